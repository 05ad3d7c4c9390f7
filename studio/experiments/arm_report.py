"""All findings on the arms (Deutscher & Reid 2005, Figs. 12 to 17) in one value that can be written as
JSON.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from studio.experiments.arms import ArmScene, template_arm
from studio.experiments.crossover_gain import CrossoverReport, crossover_report
from studio.experiments.variance_reduction import VarianceReport, variance_report

CHAIN, BRANCHED = "planar_arm4", "branched_arms6"


@dataclass(frozen=True, slots=True)
class ArmReport:
    """variance : Figs. 12 to 14.

    crossover : Fig. 16, both bodies, cut by limbs (the improved filter of the defaults) and by parameters
    (Eq. 19 with the plan of Eq. 13). parallel_variance : Fig. 17, per layer and parameter.

    passed : ordered with Eq. 18; crossover gains on the branched arms and does no harm to the chain, cut
    either way.
    """

    variance: VarianceReport
    crossover: tuple[CrossoverReport, ...]
    parallel_variance: list[list[float]]
    passed: bool

    def plain(self) -> dict[str, Any]:
        """Everything as dictionaries, lists and numbers."""
        return asdict(self)


def arm_report(
    seeds: Sequence[int] = range(20),
    crossover_seeds: Sequence[int] = range(100),
    scene: Callable[[str], ArmScene] = template_arm,
) -> ArmReport:
    """Run all searches (about a minute). scene : makes a body's pictures and weighting."""
    chain, branched = scene(CHAIN), scene(BRANCHED)
    variance = variance_report(chain, seeds)
    crossover = tuple(
        crossover_report(body, by, crossover_seeds, adaptive_diffusion=adaptive)
        for by, adaptive in (("limbs", True), ("parameters", False))
        for body in (chain, branched)
    )
    parallel = variance_report(branched, seeds, crossover=1.0).adaptive.shares
    harmless = all(found.harmless for found in crossover if found.body == CHAIN)
    gains = all(found.gains for found in crossover if found.body == BRANCHED)
    return ArmReport(variance, crossover, parallel, variance.ordered and harmless and gains)
