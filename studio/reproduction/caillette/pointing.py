"""A simple sequence to learn clusters from: somebody stands and points with one arm, here and there.

The paper's clustering found 5 clusters in "a simpler arms pointing sequence" of which it says no more (section 7.1).
Ours: the right arm goes from hanging to one of two places and back, each way as an arm reaches (minimum jerk), with a
rest at both ends.
"""

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel

Array = NDArray[np.float64]

POINTING = "pointing"
TARGETS: tuple[dict[str, float], ...] = (
    {"right_shoulder_swing": 85.0, "right_shoulder_spread": 10.0, "right_elbow": 5.0},
    {"right_shoulder_swing": 20.0, "right_shoulder_spread": 85.0, "right_elbow": 5.0},
)
"""Degrees."""
ROUNDS = 4
MOVE_S, REST_S = 0.8, 0.7


def pointing_poses(body: BodyModel, fps: float) -> Array:
    """(F, D) the body pointing at each target in turn, ROUNDS times over."""
    names = [entry.name for entry in body.parameters]
    resting = body.neutral
    found = [resting[None]]
    for _ in range(ROUNDS):
        for target in TARGETS:
            pointed = resting.copy()
            for name, degrees in target.items():
                pointed[names.index(name)] = np.radians(degrees)
            found += [_reach(resting, pointed, fps), _held(pointed, fps)]
            found += [_reach(pointed, resting, fps), _held(resting, fps)]
    return np.concatenate(found)


def _reach(start: Array, end: Array, fps: float) -> Array:
    """A movement of minimum jerk (Flash & Hogan 1985)."""
    share = (np.arange(round(MOVE_S * fps)) + 1.0)[:, None] / round(MOVE_S * fps)
    return start + (end - start) * (10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5)


def _held(pose: Array, fps: float) -> Array:
    return np.repeat(pose[None], round(REST_S * fps), axis=0)
