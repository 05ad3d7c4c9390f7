"""A tree of joints moving over time: forward kinematics beside scipy's rotations, and the words of text files."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.motion_files.recorded_motion import UP_FROM_Y_UP, followed, moved_skeleton, numbers
from studio.foundations.errors import StudioError

PARENTS = (-1, 0, 1, 0)
NAMES = ("root", "arm", "hand", "tail")
RNG = np.random.default_rng(3)
OFFSETS = RNG.normal(size=(4, 3))
LOCAL = Rotation.random(8, rng=RNG)
ROOT = RNG.normal(size=(2, 3))


def placed() -> tuple[np.ndarray, list[list[Rotation]]]:
    """Places (F, J, 3) and turns of the joints, one by one."""
    places, turns = np.zeros((2, 4, 3)), []
    for frame in range(2):
        own = [LOCAL[4 * frame + joint] for joint in range(4)]
        world = [own[0], own[0] * own[1], own[0] * own[1] * own[2], own[0] * own[3]]
        places[frame, 0] = ROOT[frame]
        for joint in (1, 2, 3):
            parent = PARENTS[joint]
            places[frame, joint] = places[frame, parent] + world[parent].apply(OFFSETS[joint])
        turns.append(world)
    return places, turns


@pytest.mark.parametrize(("axes", "scale"), [(None, 1.0), (UP_FROM_Y_UP, 25.0)])
def test_a_skeleton_moves_as_its_joints_turn_one_after_the_other(
    axes: np.ndarray | None, scale: float
) -> None:
    local = LOCAL.as_matrix().reshape(2, 4, 3, 3)
    more = {} if axes is None else {"axes": axes, "scale": scale}
    motion = moved_skeleton(NAMES, PARENTS, OFFSETS, local, ROOT, fps=50.0, source="made", **more)
    turn = np.eye(3) if axes is None else axes
    places, turns = placed()
    np.testing.assert_allclose(motion.positions, scale * places @ turn.T, atol=1e-9)
    for frame in range(2):
        for joint in range(4):
            wanted = turn @ turns[frame][joint].as_matrix() @ turn.T
            np.testing.assert_allclose(motion.rotations[frame, joint], wanted, atol=1e-9)
    rest = np.array([np.zeros(3), OFFSETS[1], OFFSETS[1] + OFFSETS[2], OFFSETS[3]])
    np.testing.assert_allclose(motion.rest, scale * rest @ turn.T, atol=1e-9)
    assert (motion.names, motion.parents, motion.fps, motion.source, motion.seconds) == (
        NAMES, PARENTS, 50.0, "made", 0.02,
    )  # fmt: skip
    assert motion.index("hand") == 2
    with pytest.raises(StudioError, match="'made' has no joint 'wing'"):
        motion.index("wing")


def test_joints_that_move_and_turn_are_followed() -> None:
    moves = np.tile(OFFSETS, (2, 1, 1))
    moves[:, 0] = ROOT
    places, turned = followed(PARENTS, moves, LOCAL.as_matrix().reshape(2, 4, 3, 3))
    wanted, turns = placed()
    np.testing.assert_allclose(places, wanted, atol=1e-9)
    np.testing.assert_allclose(turned, [[one.as_matrix() for one in frame] for frame in turns], atol=1e-9)


def test_words_are_numbers_with_a_point_or_a_comma() -> None:
    path = Path("a.bvh")
    assert numbers(path, 3, ["1", "-2.5", "3,5", "1e-3"]) == [1.0, -2.5, 3.5, 0.001]
    for word in ("x", "nan", "inf", "1,000.5"):
        with pytest.raises(StudioError, match=rf"'a\.bvh', line 3: '{word}' is not a number"):
            numbers(path, 3, ["1", word])
