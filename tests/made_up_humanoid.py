"""Recorded motion of a made-up humanoid."""

import numpy as np
from scipy.spatial.transform import Rotation

from studio.body.motion_files.recorded_motion import RecordedMotion, moved_skeleton
from studio.foundations.geometry.rotations import axis_turn

PARTS = ("upper_arm", "lower_arm", "hand", "thigh", "shin", "foot")
NAMES = ("pelvis", "torso", "head", *(f"{side}_{part}" for side in ("right", "left") for part in PARTS))
PARENTS = (-1, 0, 1, 1, 3, 4, 0, 6, 7, 1, 9, 10, 0, 12, 13)


def humanoid(frames: int, turned: dict[str, Rotation], height: float = 900.0) -> RecordedMotion:
    """A made-up humanoid, facing x, some joints turned against their parents."""
    offsets = np.zeros((15, 3))
    offsets[1:3] = [[0, 0, 240], [0, 0, 220]]
    for first, side in ((3, -1.0), (9, 1.0)):
        offsets[first : first + 6] = [
            [0, 180 * side, 240],
            [0, 0, -270],
            [0, 0, -260],
            [0, 85 * side, 0],
            [0, 0, -420],
            [0, 0, -410],
        ]
    local = np.tile(np.eye(3), (frames, 15, 1, 1))
    for name, turn in turned.items():
        local[:, NAMES.index(name)] = turn.as_matrix()
    root = np.tile([0.0, 0.0, height], (frames, 1))
    return moved_skeleton(NAMES, PARENTS, offsets, local, root, fps=60.0, source="made up")


def turned(recorded: RecordedMotion, heading: float, fps: float, source: str) -> RecordedMotion:
    """The same movement, turned about the vertical."""
    turn = axis_turn(2, np.array(heading))
    return RecordedMotion(
        recorded.names,
        recorded.parents,
        recorded.rest,
        turn @ recorded.rotations,
        recorded.positions @ turn.T,
        fps,
        source,
    )
