"""The arms of Figs. 11 and 15 in motion: 40 pictures of a moving arm, tracked from the true first pose.

"Tracker efficiency was measured by the minimum number of particles needed to successfully track the articulated arm
over 40 frames" (caption of Fig. 13). The paper prints neither the motion nor what a success is. Here every joint
swings as in the studio's footage of arms, up to 90° a second; σ0 is half of the largest movement from one picture
to the next (3.1); tracking is successful while no joint or tip is ever more than LOST_MM off, a quarter of a link.

Section 6.1, adaptive diffusion: measured are two speeds of the arm, and the survival rate of section 3.1 beside the one
that anneals as much in six layers as that does in ten, for the paper prints neither of this test.

Section 6.2, crossover: 6.2.1 makes every particle from two, so the share is 100 %. What it saves depends on what it is
added to and on how fast the filter anneals, neither of which the paper says of this test: measured are the filter with
the diffusion of section 6.1 ("noise is then added … as detailed in Section 6.1") and the one of Eq. 13, each with both
survival rates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.comparison.findings import Findings
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.arms import TemplateArm, template_arm
from studio.reproduction.deutscher_reid.fewest_particles import (
    censored_in_words,
    concluded,
    fewest,
    found_by_group,
    saving,
    sizes,
    times,
)
from studio.reproduction.deutscher_reid.setting import ADAPTIVE, EQ18_WORDS, PLAIN, SOURCE, annealing_as_ten
from studio.reproduction.experiment import Experiment
from studio.runs.search_space import default_sigma, search_space
from studio.synthesis.arm_footage import arm_motion
from studio.tracking.catalogue import TRACKERS
from studio.tracking.frame_loop import search_frame
from studio.tracking.settings import AnnealedSettings
from studio.tracking.tracker import FrameProblem, SearchSpace, start_of

Array = NDArray[np.float64]

LOST_MM = 62.5
FRAMES, LAYERS, RUNS = 40, 6, 3
FEWEST, MOST = 8, 2048
QUICK_MOST = 512
# Pictures a second. At 10 a joint turns up to 9° between two pictures and one joint hides the next one's turn; at 20
# the search is easy, and what is saved is less.
RATE, SLOW_RATE = 10.0, 20.0
CHAIN, BRANCHED = "planar_arm4", "branched_arms6"
BODY_WORDS = {CHAIN: "chain", BRANCHED: "branched arms"}
# Section 3.1's for ten layers, and the one with which LAYERS anneal as much.
SURVIVALS = (0.5, round(annealing_as_ten(LAYERS), 3))
SETTINGS: Mapping[str, Any] = {
    "layers": LAYERS,
    "pictures": FRAMES,
    "lost where off by more than (mm)": LOST_MM,
    "runs a size": RUNS,
    "sizes tried": f"{FEWEST} to {MOST}, two a doubling",
    "weighting": "template, SSD",
}


@dataclass(frozen=True, slots=True, eq=False)
class ArmSequence:
    """poses : (K + 1, D), the first is where tracking starts. problems : of the K pictures after it."""

    arm: TemplateArm
    space: SearchSpace
    poses: Array
    problems: tuple[FrameProblem, ...]


def arm_sequence(body_name: str, rate: float, frames: int, seed: int) -> ArmSequence:
    """An arm in motion. seed : of the motion. Raises BodyError for an unknown body."""
    arm = template_arm(body_name)
    poses = arm_motion(arm.body, frames + 1, rate, np.random.default_rng((seed, 2)))
    space = search_space(arm.body, default_sigma(arm.body, rate))
    return ArmSequence(arm, space, poses, tuple(arm.observed(pose) for pose in poses[1:]))


def is_tracked(sequence: ArmSequence, settings: AnnealedSettings, seed: int) -> bool:
    """Whether the annealed filter keeps the arm to the last picture; it gives up where it is lost."""
    tracker, body = TRACKERS["annealed"], sequence.arm.body
    carried = start_of(tuple(sequence.poses[0]))
    truth = marker_points(body, sequence.poses)
    for frame, problem in enumerate(sequence.problems, start=1):
        result = search_frame(
            tracker,
            problem,
            carried,
            sequence.space,
            seed=seed,
            frame=frame,
            settings_source=lambda: (1, settings),
        )
        carried = result.carried
        found = marker_points(body, result.estimate.pose[None])[0]
        if np.linalg.norm(found - truth[frame], axis=1).max() > LOST_MM:
            return False
    return True


def trials(
    scale: Scale, filters: Mapping[str, Mapping[str, Any]], body: str, rate: float
) -> tuple[Trial, ...]:
    """One bisection a filter and seed. filters : knobs by the filter's name."""
    grid = sizes(FEWEST, QUICK_MOST if scale.quick else MOST, 1 if scale.quick else 2)
    return tuple(
        Trial(
            f"{group(name, body, rate)}, seed {seed}",
            {
                "body": body,
                "rate": rate,
                "knobs": {"layers": LAYERS, **knobs},
                "seed": seed,
                "frames": FRAMES,
                "sizes": list(grid),
                "runs": 1 if scale.quick else RUNS,
            },
        )
        for name, knobs in filters.items()
        for seed in scale.seeds
    )


def group(name: str, body: str, rate: float) -> str:
    """Filter, body and rate in words."""
    return f"{name}, {BODY_WORDS[body]}, {rate:g} pictures/s"


@kept_as("deutscher_reid.arm_sequences.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """The fewest particles for one seed; the motion is the seed's, and every run has random numbers of its own."""
    del shelf
    seed = int(arguments["seed"])
    sequence = arm_sequence(arguments["body"], arguments["rate"], arguments["frames"], seed)

    def succeeds(particles: int, run: int) -> bool:
        settings = AnnealedSettings(**arguments["knobs"], particles=particles)
        return is_tracked(sequence, settings, 1000 * seed + run)

    return fewest(succeeds, arguments["sizes"], arguments["runs"]).plain()


# Section 6.1.

SAVED_BY_DIFFUSION = 2.0
DEGREES = {RATE: "9°", SLOW_RATE: "4.5°"}
# The first is the paper's, as far as it can be told; a quick look takes the first two.
CASES = tuple((rate, survival) for survival in SURVIVALS for rate in (RATE, SLOW_RATE))
QUICK_CASES = 2


def diffusion_filters(survival: float) -> dict[str, Mapping[str, Any]]:
    """Planned and adaptive."""
    return {
        f"{name}, α {survival:g}": {**knobs, "survival": survival}
        for name, knobs in (("Eq. 13", PLAIN), ("adaptive", ADAPTIVE))
    }


def _diffusion_trials(scale: Scale) -> tuple[Trial, ...]:
    return tuple(
        trial
        for rate, survival in CASES[: QUICK_CASES if scale.quick else None]
        for trial in trials(scale, diffusion_filters(survival), CHAIN, rate)
    )


def _conclude_diffusion(outcomes: Sequence[Outcome]) -> Findings:
    """The ratios of the particles needed. The verdict is on the first case."""
    groups = found_by_group(outcomes)
    savings = []
    for rate, survival in CASES:
        planned, adaptive = (group(name, CHAIN, rate) for name in diffusion_filters(survival))
        if planned in groups and adaptive in groups:
            label = f"particles saved, up to {DEGREES[rate]} between pictures, α {survival:g}"
            savings.append(saving(label, groups[planned], groups[adaptive], SAVED_BY_DIFFUSION))
    first = savings[0]
    others = "; ".join(
        f"{entry.name.removeprefix('particles saved, ')}: {times(entry)}" for entry in savings[1:]
    )
    words = (
        f"Over 40 pictures of the arm the filter with Eq. 18 needs {first.ours:.1f} times fewer particles than the one "
        f"with Eq. 13 (95 %: {first.low:.1f} to {first.high:.1f}; the paper says 2) where joints turn up to "
        f"{DEGREES[RATE]} from one picture to the next and half of the particles survive, as in section "
        "3.1; the verdict "
        f"is on this. In other cases, {others}: what is saved depends on how much has to be searched and "
        f"how fast, which the paper does not print. {censored_in_words(groups)} {EQ18_WORDS}"
    )
    title = "Particles needed to track the arm over 40 pictures"
    return concluded(groups, first.verdict, words, savings, title, SETTINGS)


DIFFUSION = Experiment(
    name="deutscher-adaptive-diffusion",
    title="What adaptive diffusion saves on the arm",
    source=f"{SOURCE}, section 6.1 and caption of Fig. 13",
    claim="With adaptive diffusion half of the particles track the articulated arm over 40 frames.",
    trials=_diffusion_trials,
    measure=measure,
    conclude=_conclude_diffusion,
)

# Section 6.2.

SAVED_BY_CROSSING = {BRANCHED: 2.0, CHAIN: 1.0}
SHARE = 1.0
# A chain is one limb: cut by limbs nothing is ever exchanged.
CUTS = {BRANCHED: ("parameters", "limbs"), CHAIN: ("parameters",)}


@dataclass(frozen=True, slots=True)
class Setting:
    """What crossover is added to: the filter's name and knobs, and α."""

    base: str
    survival: float
    filter: Mapping[str, Any]

    def name(self, cut: str = "") -> str:
        """In words, with a way to cut or without crossover."""
        words = f"{self.base}, α {self.survival:g}"
        return f"{words}, crossed by {cut}" if cut else words

    def knobs(self, cut: str = "") -> dict[str, Any]:
        """The filter's."""
        crossed = {"crossover": SHARE, "crossover_by": cut} if cut else {}
        return {**self.filter, "survival": self.survival, **crossed}


# The first is the paper's, as far as it can be told, and the only one of a quick look.
ADDED_TO = tuple(
    Setting(base, survival, knobs)
    for base, knobs in (("adaptive", ADAPTIVE), ("Eq. 13", PLAIN))
    for survival in SURVIVALS
)


def _crossover_trials(scale: Scale) -> tuple[Trial, ...]:
    found: list[Trial] = []
    for body, cuts in CUTS.items():
        filters = {
            setting.name(cut): setting.knobs(cut)
            for setting in (ADDED_TO[:1] if scale.quick else ADDED_TO)
            for cut in ("", *cuts)
        }
        found += trials(scale, filters, body, RATE)
    return tuple(found)


def _conclude_crossover(outcomes: Sequence[Outcome]) -> Findings:
    """The ratios. The verdict is on Eq. 19 as it is printed, with the first setting: branched and chain together."""
    groups = found_by_group(outcomes)
    measured = [setting for setting in ADDED_TO if group(setting.name(), CHAIN, RATE) in groups]
    numbers = {
        (setting.name(), body, cut): saving(
            f"particles saved, {BODY_WORDS[body]}: {setting.name()}, cut by {cut}",
            groups[group(setting.name(), body, RATE)],
            groups[group(setting.name(cut), body, RATE)],
            SAVED_BY_CROSSING[body],
        )
        for setting in measured
        for body, cuts in CUTS.items()
        for cut in cuts
    }
    first = ADDED_TO[0].name()
    told = " ".join(
        f"{name}: {times(numbers[name, BRANCHED, 'parameters'], 2)} on the branched arms (cut by limbs "
        f"{times(numbers[name, BRANCHED, 'limbs'], 2)}), {times(numbers[name, CHAIN, 'parameters'], 2)} on the chain."
        for name in (setting.name() for setting in measured)
    )
    words = (
        "The paper says that crossover saves 2 times on the branched arms and makes no difference on "
        f"the chain. {told} "
        f"The verdict is on Eq. 19 (cut by parameters) added to {first}. With a survival rate of "
        f"{SURVIVALS[1]:g} six layers anneal as much as the paper's ten of {SURVIVALS[0]:g}. "
        f"{censored_in_words(groups)} {EQ18_WORDS}"
    )
    return concluded(
        groups,
        overall(numbers[first, body, "parameters"].verdict for body in CUTS),
        words,
        numbers.values(),
        "Particles needed over 40 pictures, with and without crossover",
        {**SETTINGS, "crossover": SHARE, "pictures a second": RATE},
    )


CROSSOVER = Experiment(
    name="deutscher-crossover",
    title="What crossover saves on branched arms and on a chain",
    source=f"{SOURCE}, section 6.2.2",
    claim="Crossover halves the particles needed once more for branched arms, and makes no difference for an arm "
    "without branches.",
    trials=_crossover_trials,
    measure=measure,
    conclude=_conclude_crossover,
)
