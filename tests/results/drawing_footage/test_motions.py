"""Motions: possible for a person, smooth, on the floor."""

import numpy as np
import pytest

from studio.body.person import PersonMotion, joint_points, marker_motion
from studio.foundations.errors import StudioError
from studio.results.drawing_footage.motions import MOTIONS, make_motion
from studio.results.drawing_footage.person import skeleton_of_height

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
FPS = 60.0


def made(name: str, frames: int = 150) -> PersonMotion:
    return make_motion(name, BONES, frames, FPS, {})


def knee_angles(motion: PersonMotion, side: str) -> np.ndarray:
    """Flexion in radians: how far the shin is turned backwards about the thigh's y."""
    relative = np.swapaxes(motion.turns[f"{side}_thigh"], 1, 2) @ motion.turns[f"{side}_shin"]
    return np.arctan2(relative[:, 0, 2], relative[:, 2, 2])


@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_every_segment_is_a_rotation_and_knees_and_elbows_bend_one_way(name: str) -> None:
    motion = made(name)
    for turns in motion.turns.values():
        np.testing.assert_allclose(
            np.swapaxes(turns, 1, 2) @ turns, np.tile(np.eye(3), (150, 1, 1)), atol=1e-9
        )
        np.testing.assert_allclose(np.linalg.det(turns), 1.0)
    for side in ("left", "right"):
        angles = knee_angles(motion, side)
        assert angles.min() > 0.0
        assert angles.max() < 2.6
        elbow = np.swapaxes(motion.turns[f"{side}_upper_arm"], 1, 2) @ motion.turns[f"{side}_forearm"]
        assert np.arctan2(elbow[:, 0, 2], elbow[:, 2, 2]).max() <= 0.0


@pytest.mark.parametrize("name", sorted(MOTIONS))
def test_nothing_goes_through_the_floor(name: str) -> None:
    points = joint_points(made(name))
    for joint, place in points.items():
        assert place[:, 2].min() > (-25.0 if "toes" in joint else 20.0), joint


@pytest.mark.parametrize(
    ("name", "fastest", "sharpest"), [("walk", 4.5, 6.0), ("run", 8.0, 12.0), ("handstand", 5.0, 4.0)]
)
def test_speeds_and_accelerations_are_a_persons(name: str, fastest: float, sharpest: float) -> None:
    """fastest : m/s, sharpest : multiples of gravity, of any marker."""
    positions = marker_motion(made(name)).positions
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=2) * FPS / 1000.0
    acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=2) * FPS**2 / 9810.0
    assert speed.max() < fastest
    assert acceleration.max() < sharpest
    hips = speed[:, marker_motion(made(name)).names.index("Hip")]
    assert np.ptp(hips) < 0.35 * fastest


def test_the_walk_turns_and_its_standing_feet_do_not_slide() -> None:
    motion = made("walk")
    heading = np.unwrap(np.arctan2(motion.turns["pelvis"][:, 1, 0], motion.turns["pelvis"][:, 0, 0]))
    assert np.degrees(heading[-1] - heading[0]) > 90.0
    for side in ("left", "right"):
        ankle = joint_points(motion)[f"{side}_foot"]
        flat = np.abs(ankle[:, 2] - BONES.ankle_height) < 0.5
        pairs = flat[1:] & flat[:-1]
        assert pairs.sum() > 30
        assert np.linalg.norm(np.diff(ankle, axis=0), axis=1)[pairs].max() < 1.0


def test_arms_swing_against_the_legs() -> None:
    motion = made("walk")
    points = joint_points(motion)
    forward = motion.turns["pelvis"][:, :, 0]
    hand = np.sum((points["left_hand"] - points["left_upper_arm"]) * forward, axis=1)
    foot = np.sum((points["left_foot"] - points["left_thigh"]) * forward, axis=1)
    assert np.corrcoef(hand, foot)[0, 1] < -0.8


def test_a_runner_flies_and_a_walker_does_not() -> None:
    for name, flies in (("run", True), ("walk", False)):
        motion = made(name)
        points = joint_points(motion)
        heel = np.array([-0.2 * BONES.foot, 0.0, -BONES.ankle_height])
        heels = [
            (points[f"{side}_foot"] + motion.turns[f"{side}_foot"] @ heel)[:, 2] for side in ("left", "right")
        ]
        lowest = np.min([points["left_toes"][:, 2], points["right_toes"][:, 2], *heels], axis=0)
        assert bool(np.count_nonzero(lowest > 3.0) >= 12) is flies, name


def test_the_box_is_stepped_over() -> None:
    motion = made("box", 180)
    points = joint_points(motion)
    for side in ("left", "right"):
        for part in ("foot", "toes"):
            place = points[f"{side}_{part}"]
            sole = place[:, 2] - (BONES.ankle_height if part == "foot" else 0.0)
            over = np.abs(place[:, 0]) < 60.0
            assert over.any()
            assert sole[over].min() > 125.0
    assert motion.root[0, 0] < -800.0
    assert motion.root[-1, 0] > 800.0


def test_hands_carry_the_handstand() -> None:
    motion = made("handstand")
    points = joint_points(motion)
    middle = 0.5 * (points["left_hand"] + points["right_hand"])
    np.testing.assert_allclose(middle, np.tile(middle[0], (150, 1)), atol=1e-9)
    assert points["left_foot"][90, 2] > 1900.0
    assert points["head_top"][90, 2] < points["pelvis"][90, 2]
    assert min(points["left_toes"][0, 2], points["right_toes"][0, 2]) < 60.0


def test_an_unknown_motion_is_named_with_the_known_ones() -> None:
    with pytest.raises(StudioError, match="fly") as refusal:
        make_motion("fly", BONES, 10, FPS, {})
    assert "handstand" in refusal.value.hint
