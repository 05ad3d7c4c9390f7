"""Recorded motion on the synthetic skeleton: directions of limbs, hinges, floor."""

from pathlib import Path

import numpy as np
import pytest
from made_up_humanoid import humanoid
from scipy.spatial.transform import Rotation

from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import SIDES, PersonMotion, joint_points
from studio.body.retargeting import above_floor, lowest_of_sole, on_skeleton, smooth_above
from studio.foundations.errors import StudioError
from studio.results.drawing_footage.person import skeleton_of_height

BONES = skeleton_of_height(1760.0, np.random.default_rng(1))
FILES = ("05_01.amc", "05_03.amc", "CMU_01_01.bvh", "amp_humanoid_run.npz", "amp_humanoid_cartwheel.npz")


def test_a_known_pose_is_reproduced() -> None:
    turned = {
        "left_upper_arm": Rotation.from_euler("y", -90, degrees=True),
        "left_lower_arm": Rotation.from_euler("y", -30, degrees=True),
        "right_upper_arm": Rotation.from_euler("x", -90, degrees=True),
        "right_shin": Rotation.from_euler("y", 90, degrees=True),
    }
    motion = on_skeleton(humanoid(5, turned), BONES)
    points = joint_points(motion)
    arm = points["left_forearm"] - points["left_upper_arm"]
    np.testing.assert_allclose(arm, np.tile([BONES.upper_arm[0], 0.0, 0.0], (5, 1)), atol=1e-6)
    fore = (points["left_hand"] - points["left_forearm"]) / BONES.forearm[0]
    np.testing.assert_allclose(fore[0], [np.cos(np.pi / 6), 0.0, np.sin(np.pi / 6)], atol=1e-6)
    aside = points["right_forearm"] - points["right_upper_arm"]
    np.testing.assert_allclose(aside[0], [0.0, -BONES.upper_arm[1], 0.0], atol=1e-6)
    shin = points["right_foot"] - points["right_shin"]
    np.testing.assert_allclose(shin[0], [-BONES.shin[1], 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(points["head"][0] - points["pelvis"][0], [0.0, 0.0, BONES.trunk], atol=1e-6)
    assert lowest_of_sole(motion, "left") == pytest.approx(0.0, abs=1e-6)
    assert motion.root[0, 2] == pytest.approx(BONES.ankle_height + BONES.thigh[0] + BONES.shin[0])


def test_the_root_goes_as_far_as_the_legs_are_long() -> None:
    recorded = humanoid(30, {})
    recorded.positions[:, :, 0] += np.linspace(0.0, 1000.0, 30)[:, None]
    motion = on_skeleton(recorded, BONES)
    legs = (sum(BONES.thigh) + sum(BONES.shin)) / (2.0 * 830.0)
    assert motion.root[-1, 0] - motion.root[0, 0] == pytest.approx(1000.0 * legs)


def test_feet_are_raised_out_of_the_floor_smoothly_and_only_then() -> None:
    motion = on_skeleton(humanoid(200, {}), BONES)
    dip = 40.0 * np.exp(-(((np.arange(200) - 100.0) / 10.0) ** 2))
    sunk = PersonMotion(BONES, 60.0, motion.root - dip[:, None] * np.array([0.0, 0.0, 1.0]), motion.turns)
    raised = above_floor(sunk)
    lift = (raised.root - sunk.root)[:, 2]
    for side in SIDES:
        assert lowest_of_sole(raised, side).min() > -1e-9
    assert np.all(np.abs(lift[:60]) < 0.1)
    assert np.all(lift < 40.0 + 1e-9)
    assert np.abs(np.diff(lift, 2)).max() < 3.0


def test_a_curve_above_heights_rises_as_it_falls_and_holds_the_highest() -> None:
    heights = np.zeros(41)
    heights[20] = 5.0
    curve = smooth_above(heights, 6)
    np.testing.assert_allclose(curve, curve[::-1], atol=1e-12)
    assert curve[20] == pytest.approx(5.0)
    assert (curve >= heights).all()
    # Held as far as the smoothing reaches, which is as far again.
    assert np.flatnonzero(curve > 1e-12).tolist() == list(range(8, 33))


def test_a_skeleton_with_other_names_is_refused() -> None:
    recorded = humanoid(2, {})
    other = RecordedMotion(
        tuple(f"bone{number}" for number in range(15)),
        recorded.parents,
        recorded.rest,
        recorded.rotations,
        recorded.positions,
        60.0,
        "strange.bvh",
    )
    with pytest.raises(StudioError, match=r"strange\.bvh"):
        on_skeleton(other, BONES)


@pytest.mark.real_data
@pytest.mark.parametrize("name", FILES)
def test_recorded_limbs_keep_their_directions_and_hinges(real_data: Path, name: str) -> None:
    """Against the recorded places of the joints themselves."""
    recorded = read_recording(real_data / "cmu-motion" / name)
    motion = on_skeleton(recorded, BONES)
    points = joint_points(motion)
    for turn in motion.turns.values():
        unit = np.swapaxes(turn, 1, 2) @ turn
        np.testing.assert_allclose(unit, np.broadcast_to(np.eye(3), unit.shape), atol=1e-8)
        np.testing.assert_allclose(np.linalg.det(turn), 1.0, atol=1e-8)
    words = {
        "amc": ("{s}femur {s}tibia {s}foot {s}humerus {s}radius {s}wrist", ("l", "r")),
        "bvh": ("{s}UpLeg {s}Leg {s}Foot {s}Arm {s}ForeArm {s}Hand", ("Left", "Right")),
        "npz": ("{s}thigh {s}shin {s}foot {s}upper_arm {s}lower_arm {s}hand", ("left_", "right_")),
    }[name[-3:]]
    for side, prefix in zip(SIDES, words[1], strict=True):
        hip, knee, ankle, shoulder, elbow, wrist = (
            recorded.positions[:, recorded.index(word)] for word in words[0].replace("{s}", prefix).split()
        )
        for begin, end, ours in (
            (hip, knee, ("thigh", "shin")),
            (knee, ankle, ("shin", "foot")),
            (shoulder, elbow, ("upper_arm", "forearm")),
            (elbow, wrist, ("forearm", "hand")),
        ):
            made = points[f"{side}_{ours[1]}"] - points[f"{side}_{ours[0]}"]
            cosine = np.sum((end - begin) * made, axis=1)
            cosine /= np.linalg.norm(end - begin, axis=1) * np.linalg.norm(made, axis=1)
            assert cosine.min() > 1.0 - 1e-9, ours
        for upper, lower, sign in (("thigh", "shin", 1.0), ("upper_arm", "forearm", -1.0)):
            bend = np.swapaxes(motion.turns[f"{side}_{upper}"], 1, 2) @ motion.turns[f"{side}_{lower}"]
            # Turns about y alone, and only in the direction that knees and elbows bend.
            assert bend[:, 1, 1].min() > 1.0 - 1e-4
            assert (sign * np.arctan2(bend[:, 0, 2], bend[:, 2, 2])).min() > -0.06
        assert lowest_of_sole(motion, side).min() > -1e-6
