"""Stretches of recorded motion: sampled, repeated, bent, placed, refused."""

from pathlib import Path

import numpy as np
import pytest
from made_up_humanoid import humanoid, turned

from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import PersonMotion, joint_points, sampled
from studio.body.retargeting import on_skeleton
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.recorded_clips import bent, recorded_person

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
FPS = 60.0


def straight(frames: int = 121, speed: float = 2000.0, heading: float = 0.7) -> RecordedMotion:
    """Gliding along a line, the arms swinging once a second."""
    recorded = humanoid(frames, {})
    times = np.arange(frames) / FPS
    for side, sign in (("left", 1.0), ("right", -1.0)):
        joints = [recorded.index(f"{side}_{part}") for part in ("upper_arm", "lower_arm", "hand")]
        swing = axis_turn(1, sign * 0.5 * np.sin(2.0 * np.pi * times))
        for joint in joints:
            recorded.rotations[:, joint] = swing
    recorded.positions[:, :, 0] += speed * times[:, None]
    return turned(recorded, heading, FPS, "made up")


def test_recorded_frames_are_reproduced_and_smooth_in_between() -> None:
    motion = on_skeleton(straight(), BONES)
    same = sampled(motion, np.arange(30, 60) / FPS, FPS)
    np.testing.assert_allclose(same.root, motion.root[30:60], atol=1e-9)
    for name, turn in same.turns.items():
        np.testing.assert_allclose(turn, motion.turns[name][30:60], atol=1e-9)
    half = sampled(motion, np.linspace(30.5, 59.5, 30) / FPS, FPS)
    angle = 0.5 * np.sin(2.0 * np.pi * (np.arange(30, 60) + 0.5) / FPS)
    expected = axis_turn(2, 0.7) @ axis_turn(1, angle)
    np.testing.assert_allclose(half.turns["left_upper_arm"], expected, atol=1e-4)


def test_speed_start_place_and_turn_are_the_given_ones() -> None:
    options = {"start_s": 0.5, "speed": 0.5, "turn_degrees": 30.0, "at_x_mm": 200.0, "at_y_mm": -300.0}
    motion = recorded_person(straight(), BONES, 60, FPS, options)
    middle = 0.5 * (motion.root.max(axis=0) + motion.root.min(axis=0))
    np.testing.assert_allclose(middle[:2], [200.0, -300.0], atol=1e-6)
    way = motion.root[-1] - motion.root[0]
    legs = (sum(BONES.thigh) + sum(BONES.shin)) / (2.0 * 830.0)
    assert np.hypot(*way[:2]) == pytest.approx(2000.0 * legs * 0.5 * 59 / FPS, rel=1e-6)
    assert np.arctan2(way[1], way[0]) == pytest.approx(0.7 + np.radians(30.0))


def test_a_cycle_is_repeated_without_a_jump() -> None:
    motion = recorded_person(straight(), BONES, 240, FPS, {"start_s": 0.1, "cycle_s": 0.95})
    points = joint_points(motion)
    whole = joint_points(on_skeleton(straight(), BONES))
    for name in ("left_hand", "right_hand", "head_top", "left_toes"):
        step = np.linalg.norm(np.diff(points[name], axis=0), axis=1) * FPS
        usual = np.linalg.norm(np.diff(whole[name], axis=0), axis=1) * FPS
        assert step.max() < 1.05 * usual.max() + 1.0, name
    away = points["left_hand"] - motion.root
    np.testing.assert_allclose(away[:57], away[57:114], atol=1e-6)
    assert np.hypot(*(motion.root[-1] - motion.root[0])[:2]) > 7000.0


@pytest.mark.parametrize("radius", [900.0, -1200.0])
def test_a_bent_way_is_a_circle_of_the_same_length_leaning_inwards(radius: float) -> None:
    motion = on_skeleton(straight(), BONES)
    upright = bent(motion, radius, 0.0)
    steps = np.linalg.norm(np.diff(upright.root[:, :2], axis=0), axis=1)
    np.testing.assert_allclose(steps, np.linalg.norm(np.diff(motion.root[:, :2], axis=0), axis=1), rtol=1e-3)
    leaning = bent(motion, radius, 1.0)
    assert isinstance(leaning, PersonMotion)
    heading = np.unwrap(np.arctan2(*np.gradient(upright.root[:, :2], axis=0).T[::-1]))
    assert np.ptp(heading) == pytest.approx(steps.sum() / abs(radius), rel=0.03)
    assert np.sign(heading[-1] - heading[0]) == np.sign(radius)
    up = (joint_points(leaning)["head"] - leaning.root) / BONES.trunk
    speed = steps.mean() * FPS
    demanded = np.arctan(speed**2 / (abs(radius) * 9810.0))
    np.testing.assert_allclose(np.arccos(up[:, 2]), demanded, atol=1e-3)
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
    assert np.all(np.sign(np.sum(up[5:-5, :2] * left[5:-5], axis=1)) == np.sign(radius))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"speeed": 1.0}, "no option 'speeed'"),
        ({"speed": 0.0}, "speed"),
        ({"bank": 2.0}, "bank"),
        ({"start_s": 1.5}, "lasts 2.00 s; the recipe shows it up to 2.48 s"),
        ({"cycle_s": 3.0}, "lasts 2.00 s"),
    ],
)
def test_impossible_options_are_refused(options: dict[str, float], words: str) -> None:
    with pytest.raises(StudioError) as refusal:
        recorded_person(straight(), BONES, 60, FPS, options)
    assert words in refusal.value.message
    assert refusal.value.hint


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StudioError, match=r"walk\.c3d") as refusal:
        read_recording(tmp_path / "walk.c3d")
    assert ".bvh" in refusal.value.hint
