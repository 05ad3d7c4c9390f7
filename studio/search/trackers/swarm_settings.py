"""The knobs of the swarm (Fleischmann, Austvoll & Kwolek 2012, sections 2.3 and 2.4; defaults of Table 1)."""

from dataclasses import dataclass

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import knob, next_frame_knob, with_default
from studio.search.trackers.paper_presets import FLEISCHMANN
from studio.search.trackers.settings import GUIDED
from studio.search.trackers.shared_knobs import GuidedSettings, dynamics, prediction
from studio.search.trackers.tracker import Variant

PARTITIONS = ("soft", "soft-three", "hard-two", "hard-twelve", "global-local", "global")
# Eq. 2 divides by N - 2.
FEWEST_ITERATIONS = 3
# Eq. 3 needs φ = c1 + c2 > 4.
SMALLEST_C = 2.0
TWELVE, KINDS_OF_LIMBS = 12, 2


@dataclass(frozen=True, slots=True)
class SwarmSettings(GuidedSettings):
    """Knobs of the soft-partitioning particle swarm."""

    title = "Particle swarm"

    stage1_particles: int = next_frame_knob(
        10, 2, 2000, 1, label="particles, stage 1",
        help="Particles of the first stage, which searches for the root: position and orientation of the body.",
    )  # fmt: skip
    stage1_iterations: int = next_frame_knob(
        20, FEWEST_ITERATIONS, 400, 1, label="iterations, stage 1",
        help="N of the first stage; the first iteration weighs the swarm as it was sampled.",
    )  # fmt: skip
    stage2_particles: int = next_frame_knob(
        20, 2, 2000, 1, label="particles, stage 2",
        help="Particles of the stages after the first, which search for the whole pose.",
    )  # fmt: skip
    stage2_iterations: int = next_frame_knob(
        40, FEWEST_ITERATIONS, 400, 1, label="iterations, stage 2",
        help="N of the stages after the first, together.",
    )  # fmt: skip
    c_first: float = knob(
        2.05, 2.01, 4.0, 0.01, label="c at first",
        help="c1 = c2 of a stage's second iteration (Eq. 2); above 2, and larger settles sooner.",
    )  # fmt: skip
    c_last: float = knob(
        2.15, 2.01, 4.0, 0.01, label="c at last",
        help="c1 = c2 of a stage's last iteration (Eq. 2); the constriction follows (Eq. 3).",
    )  # fmt: skip
    partition: str = next_frame_knob(
        "soft", choices=PARTITIONS,
        help="Which parameters are searched first, and whether they move later; every choice weighs as many poses.",
    )  # fmt: skip
    start_velocity: str = next_frame_knob(
        "uniform", choices=("uniform", "zero"), label="start velocity",
        help="Velocities at a stage's start: drawn from -σ to σ as in the paper, or zero.",
    )  # fmt: skip
    position_divisor: float = next_frame_knob(
        10.0, 1.0, 100.0, 0.5, label="position divisor",
        help="Divisor of the root position's σ in the soft stages after the first (2.4).",
    )  # fmt: skip
    dynamics: str = dynamics()
    prediction: str = prediction()
    estimate: str = knob(
        "mode", choices=("mode", "mean"),
        help="The pose that is reported: the best the swarm has found, or the mean of its particles' bests.",
    )  # fmt: skip
    constraints: str = with_default(GuidedSettings, "constraints", "redraw")
    limbs_apart: bool = with_default(GuidedSettings, "limbs_apart", True)

    def __post_init__(self) -> None:
        """Raise SettingsError for N <= 2 in any stage and for φ <= 4."""
        for name in ("stage1_iterations", "stage2_iterations"):
            _check_iterations(name, getattr(self, name), self._stages_sharing(name))
        for name in ("c_first", "c_last"):
            value = getattr(self, name)
            if not value > SMALLEST_C:
                raise SettingsError(
                    f"Setting '{name}' cannot be {value:g}: Eq. 3 needs c1 + c2 above 4.",
                    f"Give a number above {SMALLEST_C:g}.",
                )
        if self.partition == "hard-twelve":
            _check_iterations("stage2_iterations", self.wanted_evaluations // self.stage1_particles, TWELVE)

    @property
    def wanted_evaluations(self) -> int:
        """Poses weighed in a frame, but for the rounding of single partitions (`partitions.evaluations`)."""
        return self.stage1_particles * self.stage1_iterations + self.stage2_particles * self.stage2_iterations

    def _stages_sharing(self, name: str) -> int:
        """Number of stages that share the iterations."""
        shared = {
            ("soft-three", "stage2_iterations"): 2,
            ("global-local", "stage1_iterations"): KINDS_OF_LIMBS,
        }
        return shared.get((self.partition, name), 1)


def _check_iterations(name: str, iterations: int, stages: int) -> None:
    """Raise SettingsError if one of `stages` that share the iterations has fewer than Eq. 2 needs."""
    if iterations // stages < FEWEST_ITERATIONS:
        over = f" over {stages} stages" if stages > 1 else ""
        raise SettingsError(
            f"Setting '{name}' leaves {iterations} iterations{over}: Eq. 2 needs more than 2 in each.",
            f"Give {FEWEST_ITERATIONS * stages} iterations or more.",
        )


PRESETS = (FLEISCHMANN,)

_PARTITION_WORDS = {
    "soft-three": "three soft stages: root, trunk and head, all",
    "hard-two": "two hard stages: the root stays fixed in the second (Fig. 2a)",
    "hard-twelve": "twelve hard stages along the hierarchy (John, Trucco & Ivekovic)",
    "global-local": "the whole pose, then legs and arms apart (GLPSO)",
    "global": "the whole pose at once, no partition",
}
VARIANTS = {"guided": GUIDED} | {
    partition: Variant(words, {"partition": partition}) for partition, words in _PARTITION_WORDS.items()
}
