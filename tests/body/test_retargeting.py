"""Recorded motion on the synthetic skeleton: directions of limbs, hinges, floor."""

from pathlib import Path

import numpy as np
import pytest
from made_up_humanoid import humanoid
from scipy.spatial.transform import Rotation

from studio.body.motion_files.reading import read_recording
from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import SIDES, PersonMotion, joint_points
from studio.body.retargeting import above_floor, lowest_of_sole, on_floor, on_skeleton, smooth_above
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


CMU_NAMES = {
    "acclaim": "root thorax lowerneck head head_end lclavicle rclavicle {humerus} {radius} {wrist} {hand} {fingers} "
    "{femur} {tibia} {foot}",
    "biovision": "Hips Spine1 Neck Head Head_end LeftShoulder RightShoulder {Arm} {ForeArm} {Hand} {FingerBase} "
    "{UpLeg} {Leg} {Foot}",
}


def cmu_person(family: str, turned: dict[str, Rotation]) -> RecordedMotion:
    """A made-up person in CMU's T pose with the joints of one of its two formats; a joint may be turned in the world,
    with nothing that hangs on it.
    """
    prefixes = {"acclaim": ("l", "r"), "biovision": ("Left", "Right")}[family]
    sides = [word[1:-1] for word in CMU_NAMES[family].split() if word.startswith("{")]
    names = [word for word in CMU_NAMES[family].split() if not word.startswith("{")]
    rest = {
        name: np.array([0.0, 0.0, z])
        for name, z in zip(names, (900, 1200, 1400, 1500, 1750, 1380, 1380), strict=True)
    }
    across = {"humerus": 200, "Arm": 200, "radius": 480, "ForeArm": 480, "wrist": 730, "Hand": 730, "hand": 740,
              "FingerBase": 800, "fingers": 830}  # fmt: skip
    down = {"femur": 900, "UpLeg": 900, "tibia": 480, "Leg": 480, "foot": 80, "Foot": 80}
    for prefix, sign in zip(prefixes, (1.0, -1.0), strict=True):
        for part in sides:
            place = [0.0, sign * across[part], 1400.0] if part in across else [0.0, sign * 90.0, down[part]]
            rest[f"{prefix}{part}"] = np.array(place)
    every = tuple(rest)
    places = np.array(list(rest.values()))
    rotations = np.tile(np.eye(3), (4, len(every), 1, 1))
    for name, turn in turned.items():
        rotations[:, every.index(name)] = turn.as_matrix()
    return RecordedMotion(
        every, (-1,) * len(every), places, rotations, np.tile(places, (4, 1, 1)), 60.0, "cmu"
    )


@pytest.mark.parametrize(("family", "arm", "fore", "leg"), [
    ("acclaim", "{}humerus", "{}radius", "{}femur"), ("biovision", "{}Arm", "{}ForeArm", "{}UpLeg"),
])  # fmt: skip
def test_a_t_pose_has_arms_aside_whose_elbows_bend_forward_and_down(
    family: str, arm: str, fore: str, leg: str
) -> None:
    left, right = {"acclaim": ("l", "r"), "biovision": ("Left", "Right")}[family]
    bend = Rotation.from_euler("z", 25.0, degrees=True)
    motion = on_skeleton(cmu_person(family, {fore.format(left): bend, leg.format(right): bend}), BONES)
    front = np.array([0.866, 0.0, 0.5]) / np.hypot(0.866, 0.5)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for part in ("upper_arm", "forearm"):
            wanted = np.column_stack([front, np.cross([0.0, -sign, 0.0], front), [0.0, -sign, 0.0]])
            if (side, part) == ("left", "forearm"):
                wanted = bend.as_matrix() @ wanted
            np.testing.assert_allclose(motion.turns[f"{side}_{part}"][0], wanted, atol=1e-9)
        hand = np.column_stack([[1.0, 0.0, 0.0], [0.0, 0.0, sign], [0.0, -sign, 0.0]])
        np.testing.assert_allclose(motion.turns[f"{side}_hand"][0], hand, atol=1e-9)
        for part in ("thigh", "shin", "foot"):
            turn = bend.as_matrix() if (side, part) == ("right", "thigh") else np.eye(3)
            np.testing.assert_allclose(motion.turns[f"{side}_{part}"][0], turn, atol=1e-9)
    for part in ("pelvis", "thorax", "head", "left_clavicle", "right_clavicle"):
        np.testing.assert_allclose(motion.turns[part][0], np.eye(3), atol=1e-9)
    soles = [lowest_of_sole(motion, side)[0] for side in SIDES]
    assert min(soles) == pytest.approx(0.0, abs=1e-9)
    assert motion.fps == 60.0
    np.testing.assert_allclose(motion.root[0, :2], 0.0, atol=1e-9)


def test_a_trunk_that_leans_and_a_head_that_nods_are_followed() -> None:
    """Of the AMP humanoid, whose head has no joint above it: its own rotation counts."""
    lean, nod = (
        Rotation.from_euler("y", 30.0, degrees=True),
        Rotation.from_euler("xy", [20.0, 10.0], degrees=True),
    )
    turn = Rotation.from_euler("z", 40.0, degrees=True)
    motion = on_skeleton(humanoid(3, {"pelvis": turn, "torso": lean, "head": nod}), BONES)
    np.testing.assert_allclose(motion.turns["pelvis"][0], turn.as_matrix(), atol=1e-9)
    torso = turn * lean
    points = humanoid(3, {"pelvis": turn, "torso": lean, "head": nod}).positions[0]
    up = points[[3, 9]].mean(axis=0) - points[[6, 12]].mean(axis=0)
    thorax = motion.turns["thorax"][0]
    np.testing.assert_allclose(thorax[:, 2], up / np.linalg.norm(up), atol=1e-9)
    assert thorax[:, 1] @ torso.as_matrix()[:, 1] > 0.99
    np.testing.assert_allclose(motion.turns["head"][0], (torso * nod).as_matrix(), atol=1e-9)
    for side in SIDES:
        np.testing.assert_allclose(motion.turns[f"{side}_clavicle"], motion.turns["thorax"], atol=1e-9)


def test_the_lowest_of_a_sole_is_its_heel_or_its_toes() -> None:
    """A fifth of a foot behind the ankle and seven tenths before it."""
    motion = on_skeleton(humanoid(4, {}), BONES)
    for pitch, ahead in ((20.0, 0.7), (-20.0, -0.2)):
        turn = np.tile(Rotation.from_euler("y", pitch, degrees=True).as_matrix(), (4, 1, 1))
        other = PersonMotion(BONES, 60.0, motion.root, {**motion.turns, "left_foot": turn})
        ankle = joint_points(other)["left_foot"][:, 2]
        down = ahead * BONES.foot * np.sin(np.radians(pitch)) + BONES.ankle_height * np.cos(np.radians(pitch))
        np.testing.assert_allclose(lowest_of_sole(other, "left"), ankle - down, atol=1e-9)


def test_a_motion_stands_where_its_lower_foot_mostly_is() -> None:
    """A tenth of the frames are lower and are raised, smoothly within a tenth of a second."""
    motion = on_skeleton(humanoid(100, {}), BONES)
    heights = 100.0 + np.arange(100.0)
    raised = on_floor(
        PersonMotion(BONES, 60.0, motion.root + heights[:, None] * [0.0, 0.0, 1.0], motion.turns)
    )
    level = np.quantile(heights, 0.1)
    below = np.maximum(level - heights, 0.0)
    wanted = motion.root[:, 2] + heights - level + smooth_above(below, 6)
    np.testing.assert_allclose(raised.root[:, 2], wanted, atol=1e-6)
    slow = PersonMotion(BONES, 2.0, motion.root - [0.0, 0.0, 5.0], motion.turns)
    np.testing.assert_allclose(above_floor(slow).root, motion.root, atol=1e-6)


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
    kernel = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    held = np.where(np.abs(np.arange(41) - 20) <= 6, 5.0, 0.0)
    np.testing.assert_allclose(curve, np.convolve(held, kernel / kernel.sum(), mode="same"), atol=1e-12)
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
