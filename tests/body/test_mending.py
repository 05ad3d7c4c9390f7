"""Recorded motion mended: lost feet, a knee behind its leg, hands in the floor; sound motion unchanged."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.body.mending import (
    ankle_bend,
    feet_lost,
    mended,
    smoothed,
    with_feet_on_floor,
    with_hands_above_floor,
    with_knees_forward,
)
from studio.body.person import SIDES, PersonMotion, joint_points
from studio.body.retargeting import lowest_of_sole, smooth_above
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


EVEN = replace(BONES, thigh=(430.0, 430.0), shin=(410.0, 410.0))
UPRIGHT = make_motion("stand", EVEN, 60, 50.0, {"sway_mm": 0.0})
REACH = 0.7 * BONES.foot


def standing(height: np.ndarray | float = 0.0, lean: float = 0.0, tilt: float = 0.0) -> PersonMotion:
    """Upright with straight legs, both ankles above where they stand by shares of the toes' reach. lean, tilt : radians
    by which the shins, feet with them, are turned about y and x.
    """
    count = UPRIGHT.frame_count
    turn = axis_turn(0, np.full(count, tilt)) @ axis_turn(1, np.full(count, lean))
    turns = {name: np.tile(np.eye(3), (count, 1, 1)) for name in UPRIGHT.turns}
    turns |= {f"{side}_{part}": turn for side in SIDES for part in ("shin", "foot")}
    motion = PersonMotion(EVEN, 50.0, np.zeros((count, 3)), turns)
    level = BONES.ankle_height + REACH * height - joint_points(motion)["left_foot"][:, 2]
    return changed(motion, root=level[:, None] * np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("degrees", "share", "is_lost"),
    [
        (-41, 0.1, True),
        (76, 0.1, True),
        (-39, 1.0, False),
        (74, 1.0, False),
        (-60, 0.06, True),
        (-60, 0.04, False),
    ],
)
def test_feet_are_lost_whose_ankles_bend_too_far_too_often(
    degrees: float, share: float, is_lost: bool
) -> None:
    motion = standing()
    bent = np.arange(60) < 2 * share * 60
    feet = motion.turns["left_shin"] @ axis_turn(1, np.where(bent, np.radians(degrees), 0.1))
    assert feet_lost(changed(motion, left_foot=feet)) is is_lost
    assert feet_lost(changed(motion, right_foot=feet)) is is_lost


def test_an_ankles_bend_is_the_angle_that_it_was_turned_by() -> None:
    bend = np.linspace(-1.5, 1.5, 60)
    leaning = standing(lean=0.4, tilt=0.3)
    motion = changed(leaning, right_foot=leaning.turns["right_shin"] @ axis_turn(1, bend))
    np.testing.assert_allclose(ankle_bend(motion, "right"), bend)
    np.testing.assert_allclose(ankle_bend(motion, "left"), 0.0, atol=1e-12)


@pytest.mark.parametrize("height", [-0.3, 0.0, 0.3, 0.79, 0.86, 0.95, 1.1, 1.3, 1.45, 3.0])
def test_a_foot_goes_down_to_the_floor_and_is_stretched_in_the_air(height: float) -> None:
    motion = standing(height)
    down = min(np.arcsin(np.clip(height, 0.0, 1.0)), np.radians(70.0))
    share = np.clip((height - 0.8) / 0.6, 0.0, 1.0)
    share = 3.0 * share**2 - 2.0 * share**3
    wanted = min(down + share * (np.radians(35.0) - down), np.radians(65.0))
    for side in SIDES:
        np.testing.assert_allclose(ankle_bend(with_feet_on_floor(motion), side), wanted, atol=1e-9)


@pytest.mark.parametrize(("lean", "tilt"), [(0.3, 0.0), (-0.25, 0.0), (0.2, 0.4), (0.0, -0.6)])
def test_a_foot_below_a_leaning_shin_goes_down_as_far(lean: float, tilt: float) -> None:
    motion = with_feet_on_floor(standing(0.3, lean, tilt))
    for side in SIDES:
        height = (joint_points(motion)[f"{side}_foot"][:, 2] - BONES.ankle_height) / REACH
        np.testing.assert_allclose(-motion.turns[f"{side}_foot"][:, 2, 0], height, atol=1e-9)


@pytest.mark.parametrize(("lean", "degrees"), [(1.0, -30.0), (-1.5, 65.0)])
def test_an_ankle_bends_no_further_than_ankles_do(lean: float, degrees: float) -> None:
    motion = with_feet_on_floor(standing(0.2, lean))
    np.testing.assert_allclose(np.degrees(ankle_bend(motion, "left")), degrees)


def gaussian(values: np.ndarray, width: float) -> np.ndarray:
    """Smoothed by plain sums, the first and the last value held."""
    far = int(4.0 * width + 0.5)
    kernel = np.exp(-0.5 * (np.arange(-far, far + 1) / width) ** 2)
    held = np.concatenate([np.full(far, values[0]), values, np.full(far, values[-1])])
    return np.convolve(held, kernel / kernel.sum(), mode="valid")


def test_a_foot_that_leaves_the_floor_is_stretched_smoothly() -> None:
    height = np.where(np.arange(60) < 30, 0.0, 0.5)
    bend = ankle_bend(with_feet_on_floor(standing(height)), "left")
    np.testing.assert_allclose(bend, gaussian(np.arcsin(height), 0.04 * 50.0), atol=1e-9)


def test_lost_feet_are_set_down_where_they_stand_most() -> None:
    """Most frames 300 mm below the floor, the last ones lower still."""
    motion = standing(np.where(np.arange(60) < 57, 0.0, -0.2) - 300.0 / REACH)
    jump = np.where(np.arange(60) % 2, np.radians(50.0), np.radians(-60.0))
    whole = mended(changed(motion, left_foot=motion.turns["left_shin"] @ axis_turn(1, jump)))
    ankles, before = (joint_points(one)["left_foot"][:, 2] for one in (whole, smoothed(motion, 0.04)))
    level = BONES.ankle_height - np.quantile(before, 0.1)
    np.testing.assert_allclose(ankles[:40], before[:40] + level, atol=1e-6)
    assert lowest_of_sole(whole, "left").min() > -1e-6


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


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    "stretches", [[(0, 60)], [(200, 240)], [(30, 60), (100, 170)], [(0, 30), (170, 239)]]
)
def test_every_stretch_of_a_knee_on_the_wrong_side_is_mirrored(
    side: str, stretches: list[tuple[int, int]]
) -> None:
    points = joint_points(WALK)
    line = points[f"{side}_foot"] - points[f"{side}_thigh"]
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    over = Rotation.from_rotvec(np.pi * line).as_matrix()
    wrong = np.zeros(240, dtype=bool)
    for begin, end in stretches:
        wrong[begin:end] = True
    turns = {
        f"{side}_{part}": np.where(
            wrong[:, None, None], over @ WALK.turns[f"{side}_{part}"], WALK.turns[f"{side}_{part}"]
        )
        for part in ("thigh", "shin")
    }
    again = with_knees_forward(changed(WALK, **turns))
    for name, turn in WALK.turns.items():
        np.testing.assert_allclose(again.turns[name], turn, atol=1e-9, err_msg=name)


@pytest.mark.parametrize(("degrees", "is_over"), [(80.0, False), (100.0, True)])
def test_a_thigh_turns_over_by_more_than_a_quarter(degrees: float, is_over: bool) -> None:
    motion = standing()
    twist = axis_turn(2, np.where(np.arange(60) < 20, np.radians(degrees), 0.0))
    again = with_knees_forward(changed(motion, left_thigh=twist))
    assert np.allclose(again.turns["left_thigh"][:20], twist[:20]) is not is_over
    np.testing.assert_allclose(again.turns["left_thigh"][20:], twist[20:])


def test_hands_in_the_floor_are_lifted_just_out_of_it() -> None:
    """Arms that hang, and one that points ahead and down: fingers come to 40 mm, ahead of where they were."""
    motion = standing()
    fingers = joint_points(motion)["left_fingers"][0, 2]
    low = changed(motion, root=motion.root - np.array([0.0, 0.0, fingers + 60.0]))
    turn = np.tile(Rotation.from_euler("ZY", [40.0, -50.0], degrees=True).as_matrix(), (60, 1, 1))
    low = changed(low, **{f"right_{part}": turn for part in ("upper_arm", "forearm", "hand")})
    low = changed(low, root=low.root - np.array([0.0, 0.0, 500.0]))
    lifted = with_hands_above_floor(low)
    before, after = joint_points(low), joint_points(lifted)
    for side in SIDES:
        np.testing.assert_allclose(after[f"{side}_fingers"][:, 2], 40.0, atol=1e-6)
        np.testing.assert_array_equal(after[f"{side}_upper_arm"], before[f"{side}_upper_arm"])
    ways = [(points["right_fingers"] - points["right_upper_arm"])[0] for points in (before, after)]
    headings = [np.arctan2(way[1], way[0]) for way in ways]
    assert headings[0] == pytest.approx(headings[1], abs=1e-3)
    way = (after["left_fingers"] - after["left_upper_arm"])[0]
    assert way[0] > 100.0
    assert way[1] == pytest.approx(0.0, abs=1e-6)


def test_a_hand_rises_before_it_would_be_in_the_floor() -> None:
    """By a fifth of a second, and as much again; frames are moved from there on."""
    motion = standing()
    fingers = joint_points(motion)["left_fingers"][0, 2]
    dip = np.where(np.arange(60) == 30, 20.0, 0.0)
    low = changed(motion, root=motion.root - (dip + fingers - 41.0)[:, None] * np.array([0.0, 0.0, 1.0]))
    lift = (joint_points(with_hands_above_floor(low))["left_fingers"] - joint_points(low)["left_fingers"])[
        :, 2
    ]
    np.testing.assert_allclose(lift, smooth_above(np.where(dip > 0.0, 19.0, 0.0), 10), atol=1e-6)


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


@pytest.mark.parametrize(("frames", "seconds"), [(3, 0.01), (60, 0.1)])
def test_smoothing_leaves_steady_movement_as_it_is_to_both_ends(frames: int, seconds: float) -> None:
    motion = standing()
    root = np.arange(float(frames))[:, None] * np.array([3.0, -2.0, 1.0]) + 100.0
    turns = {name: turn[:frames] for name, turn in motion.turns.items()}
    same = smoothed(PersonMotion(BONES, 50.0, root, turns), seconds)
    np.testing.assert_allclose(same.root, root, atol=1e-9)
    assert same.fps == 50.0


def test_smoothing_spreads_a_jerk_by_a_gaussian_of_so_many_seconds() -> None:
    root = np.zeros((60, 3))
    root[30, 1] = 10.0
    smooth = smoothed(PersonMotion(BONES, 50.0, root, standing().turns), 0.06)
    np.testing.assert_allclose(smooth.root[:, 1], gaussian(root[:, 1], 3.0), atol=1e-9)


def test_smoothing_keeps_rotations() -> None:
    shaken = changed(
        WALK, head=WALK.turns["head"] @ axis_turn(0, np.random.default_rng(1).normal(0, 0.2, 240))
    )
    smooth = smoothed(shaken, 0.05).turns["head"]
    np.testing.assert_allclose(smooth @ np.swapaxes(smooth, 1, 2), np.tile(np.eye(3), (240, 1, 1)), atol=1e-9)
    assert np.abs(np.diff(smooth, axis=0)).max() < 0.3 * np.abs(np.diff(shaken.turns["head"], axis=0)).max()
