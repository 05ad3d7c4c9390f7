"""The arms of Figs. 11 and 15 in motion: 40 pictures of a moving arm, tracked from the true first pose.

"Tracker efficiency was measured by the minimum number of particles needed to successfully track the articulated arm
over 40 frames" (caption of Fig. 13). The paper prints neither the motion nor what a success is. Here every joint
swings as in the studio's footage of arms, up to 90° a second; σ0 is half of the largest movement from one picture
to the next (3.1); tracking is successful while no joint or tip is ever more than LOST_MM off, a quarter of a link.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.trials import Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.arms import TemplateArm, template_arm
from studio.reproduction.deutscher_reid.fewest_particles import fewest, sizes
from studio.reproduction.deutscher_reid.setting import annealing_as_ten
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
