"""Figure 16 of Deutscher & Reid (2005): what crossover gains on an arm without branches and on one with two.

The match is the paper's SSD: the mean squared difference between the template of the reported pose and the
silhouette, which is minus the log of the template weighting.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binomtest

from studio.experiments.arms import ArmScene, localise

SHARES = (0.0, 0.5, 1.0)
# Eight layers as in Fig. 18.
SETTINGS = {"layers": 8, "particles": 100, "survival": 0.3}
SIGNIFICANT = 0.05
NO_HARM = 1.05


@dataclass(frozen=True, slots=True)
class CrossoverReport:
    """The SSD after the last layer for each share of crossover.

    ssd : per share, one value a seed. mean_ssd : per share. ratio : mean SSD at 100 % over that at 0 %.
    better, worse : seeds in which 100 % has the smaller, the larger SSD. p_value : of the two-sided sign test
    on these. gains : better in most seeds with p < 0.05. harmless : ratio at most 1.05. verdict : in words.
    """

    body: str
    by: str
    settings: dict[str, Any]
    shares: tuple[float, ...]
    ssd: list[list[float]]
    mean_ssd: list[float]
    ratio: float
    better: int
    worse: int
    p_value: float
    gains: bool
    harmless: bool
    verdict: str


def crossover_report(
    scene: ArmScene,
    by: str,
    seeds: Sequence[int] = range(100),
    **changes: Any,  # noqa: ANN401
) -> CrossoverReport:
    """Search one picture a seed with each share. by : "limbs" or "parameters". changes : knobs beside
    SETTINGS.
    """
    settings = SETTINGS | {"crossover_by": by} | changes
    ssd = np.array(
        [[_final_ssd(scene, seed, settings | {"crossover": share}) for seed in seeds] for share in SHARES]
    )
    better, worse = int((ssd[-1] < ssd[0]).sum()), int((ssd[-1] > ssd[0]).sum())
    p_value = float(binomtest(better, better + worse).pvalue) if better + worse else 1.0
    ratio = float(ssd[-1].mean() / ssd[0].mean())
    verdict = (
        f"{scene.name}, cut by {by}: the mean SSD is {ratio:.2f} times as large with crossover as without; "
    )
    verdict += (
        f"smaller in {better} and larger in {worse} of {len(seeds)} seeds (sign test p = {p_value:.3f})."
    )
    return CrossoverReport(
        scene.name,
        by,
        settings,
        SHARES,
        ssd.tolist(),
        ssd.mean(axis=1).tolist(),
        ratio,
        better,
        worse,
        p_value,
        better > worse and p_value < SIGNIFICANT,
        ratio <= NO_HARM,
        verdict,
    )


def _final_ssd(scene: ArmScene, seed: int, settings: dict[str, Any]) -> float:
    """SSD of the reported pose."""
    result, _, truth = localise(scene, seed, **settings)
    return float(-scene.observed(truth).weigh(result.estimate.pose[None])[0])
