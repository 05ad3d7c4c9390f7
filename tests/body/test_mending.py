"""Recorded motion mended: lost feet, a knee behind its leg, hands in the floor; sound motion unchanged."""

import numpy as np
import pytest

from studio.body.mending import (
    ankle_bend,
    feet_lost,
    mended,
    smoothed,
    with_feet_on_floor,
    with_hands_above_floor,
    with_knees_forward,
)
from studio.body.person import PersonMotion, joint_points
from studio.body.retargeting import lowest_of_sole
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
WALK = make_motion("walk", BONES, 240, 120.0, {})


def changed(motion: PersonMotion, root: np.ndarray | None = None, **turns: np.ndarray) -> PersonMotion:
    """The motion with another root or other turns."""
    return PersonMotion(
        motion.skeleton, motion.fps, motion.root if root is None else root, {**motion.turns, **turns}
    )


def flipping_feet() -> PersonMotion:
    """The walk with feet that jump between two angles, as in the dancers' clips."""
    jump = np.where(np.random.default_rng(3).random(240) < 0.5, np.radians(50.0), np.radians(-60.0))
    return changed(WALK, left_foot=WALK.turns["left_shin"] @ axis_turn(1, jump))


def test_sound_motion_is_only_smoothed() -> None:
    assert not feet_lost(WALK)
    same = mended(WALK)
    before, after = joint_points(WALK), joint_points(same)
    for name in ("left_toes", "right_hand", "head_top"):
        assert np.linalg.norm(before[name] - after[name], axis=1)[12:-12].max() < 25.0, name


def test_lost_feet_stand_on_the_floor() -> None:
    broken = flipping_feet()
    assert feet_lost(broken)
    whole = mended(broken)
    bend = ankle_bend(whole, "left")
    assert np.degrees(np.abs(np.diff(bend)).max()) < 4.0
    assert np.radians(-31.0) < bend.min() < bend.max() < np.radians(66.0)
    soles = np.stack([lowest_of_sole(whole, side) for side in ("left", "right")])
    assert soles.min() > -1e-6
    assert np.quantile(soles.min(axis=0), 0.9) < 15.0


@pytest.mark.parametrize(("height", "most"), [(0.0, 3.0), (60.0, 12.0)])
def test_a_foot_on_the_floor_touches_it_and_is_flat_or_on_its_toes(height: float, most: float) -> None:
    stand = make_motion("stand", BONES, 30, 60.0, {"sway_mm": 0.0})
    flat = with_feet_on_floor(changed(stand, root=stand.root + np.array([0.0, 0.0, height])))
    toes = joint_points(flat)["left_toes"][:, 2]
    assert np.abs(toes).max() < most
    down = np.degrees(np.arcsin(-flat.turns["left_foot"][:, 2, 0]))
    reach = 0.7 * BONES.foot
    lift = joint_points(flat)["left_foot"][:, 2] - BONES.ankle_height
    np.testing.assert_allclose(down, np.degrees(np.arcsin(np.clip(lift / reach, 0.0, 1.0))), atol=3.0)


def test_a_knee_on_the_wrong_side_is_mirrored_to_the_front() -> None:
    points = joint_points(WALK)
    line = points["right_foot"] - points["right_thigh"]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    over = 2.0 * line[:, :, None] * line[:, None, :] - np.eye(3)
    wrong = np.zeros(240, dtype=bool)
    wrong[70:130] = True
    turns = {
        name: np.where(wrong[:, None, None], over @ WALK.turns[name], WALK.turns[name])
        for name in ("right_thigh", "right_shin")
    }
    broken = changed(WALK, **turns)
    assert np.linalg.norm(joint_points(broken)["right_shin"] - points["right_shin"], axis=1).max() > 20.0
    right = joint_points(with_knees_forward(broken))
    for name in ("right_shin", "right_foot", "left_shin"):
        np.testing.assert_allclose(right[name], points[name], atol=1e-6)
    assert with_knees_forward(WALK).turns["left_thigh"] is WALK.turns["left_thigh"]


def test_hands_are_lifted_out_of_the_floor_and_bones_keep_their_lengths() -> None:
    low = changed(WALK, root=WALK.root - np.array([0.0, 0.0, 720.0]))
    assert joint_points(low)["left_fingers"][:, 2].min() < 0.0
    points = joint_points(with_hands_above_floor(low))
    for side in ("left", "right"):
        assert points[f"{side}_fingers"][:, 2].min() > 35.0
        upper = np.linalg.norm(points[f"{side}_forearm"] - points[f"{side}_upper_arm"], axis=1)
        np.testing.assert_allclose(upper, BONES.upper_arm[0 if side == "left" else 1])
    same = with_hands_above_floor(WALK)
    np.testing.assert_allclose(same.turns["left_hand"], WALK.turns["left_hand"], atol=1e-12)


def test_smoothing_keeps_rotations() -> None:
    shaken = changed(
        WALK, head=WALK.turns["head"] @ axis_turn(0, np.random.default_rng(1).normal(0, 0.2, 240))
    )
    smooth = smoothed(shaken, 0.05).turns["head"]
    np.testing.assert_allclose(smooth @ np.swapaxes(smooth, 1, 2), np.tile(np.eye(3), (240, 1, 1)), atol=1e-9)
    assert np.abs(np.diff(smooth, axis=0)).max() < 0.3 * np.abs(np.diff(shaken.turns["head"], axis=0)).max()
