"""A person's skeleton: where its joints are, and its motion at other times."""

import numpy as np
import pytest
import scipy
from scipy.spatial.transform import Rotation, RotationSpline

from studio.body.person import (
    MARKERS,
    PersonMotion,
    Skeleton,
    first_frames,
    joint_points,
    marker_motion,
    sampled,
)

BONES = Skeleton(
    height=1800.0,
    trunk=500.0,
    head=250.0,
    hip_half_width=(90.0, 95.0),
    thigh=(430.0, 440.0),
    shin=(410.0, 405.0),
    shoulder=((10.0, 180.0, -20.0), (15.0, 190.0, -25.0)),
    upper_arm=(300.0, 310.0),
    forearm=(260.0, 255.0),
    hand=190.0,
    foot=250.0,
    ankle_height=80.0,
)
PLACES = {
    "pelvis": (0, 0, 0), "thorax": (0, 0, 0), "head": (0, 0, 500), "head_top": (0, 0, 750),
    "left_clavicle": (0, 0, 500), "left_upper_arm": (10, 180, 480), "left_forearm": (10, 180, 180),
    "left_hand": (10, 180, -80), "left_fingers": (10, 180, -270),
    "left_thigh": (0, 90, 0), "left_shin": (0, 90, -430), "left_foot": (0, 90, -840), "left_toes": (175, 90, -920),
    "right_clavicle": (0, 0, 500), "right_upper_arm": (15, -190, 475), "right_forearm": (15, -190, 165),
    "right_hand": (15, -190, -90), "right_fingers": (15, -190, -280),
    "right_thigh": (0, -95, 0), "right_shin": (0, -95, -440), "right_foot": (0, -95, -845),
    "right_toes": (175, -95, -925),
}  # fmt: skip
"""Of the joints of one who stands upright, from the middle of the hips."""
SEGMENTS = ("pelvis", "thorax", "head", *(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")
))  # fmt: skip


def turning(frames: int, seed: int) -> PersonMotion:
    """A motion whose segments all turn by themselves, smoothly."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames)
    turns = {
        name: Rotation.from_rotvec(
            np.sin(0.07 * times[:, None] + rng.uniform(0, 6, 3)) * rng.uniform(0.2, 0.8, 3)
        ).as_matrix()
        for name in SEGMENTS
    }
    root = 300.0 * np.sin(0.05 * times[:, None] + rng.uniform(0, 6, 3))
    return PersonMotion(BONES, 50.0, root, turns)


def test_joints_are_where_the_skeletons_lengths_put_them() -> None:
    turns = Rotation.random(3, rng=np.random.default_rng(0)).as_matrix()
    root = np.random.default_rng(1).normal(0.0, 500.0, (3, 3))
    points = joint_points(PersonMotion(BONES, 50.0, root, dict.fromkeys(SEGMENTS, turns)))
    assert set(points) == set(PLACES)
    for name, place in PLACES.items():
        np.testing.assert_allclose(
            points[name], root + turns @ np.array(place, dtype=float), atol=1e-9, err_msg=name
        )
    assert BONES.standing_hip_height == 80.0 + 840.0


def test_each_segment_is_turned_by_its_own_turn() -> None:
    ends = {
        "upper_arm": "forearm",
        "forearm": "hand",
        "hand": "fingers",
        "thigh": "shin",
        "shin": "foot",
        "foot": "toes",
    }
    motion = turning(4, 2)
    points = joint_points(motion)
    places = {name: np.array(place, dtype=float) for name, place in PLACES.items()}
    pairs = [(f"{side}_{name}", f"{side}_{end}") for side in ("left", "right") for name, end in ends.items()]
    pairs += [("thorax", "head"), ("head", "head_top")]
    pairs += [(f"{side}_clavicle", f"{side}_upper_arm") for side in ("left", "right")]
    for segment, end in pairs:
        wanted = motion.turns[segment] @ (places[end] - places[segment])
        np.testing.assert_allclose(points[end] - points[segment], wanted, atol=1e-9, err_msg=segment)


def test_markers_are_joints_in_metres_on_time() -> None:
    motion = turning(4, 3)
    points, markers = joint_points(motion), marker_motion(motion)
    joints = "pelvis head head_top right_thigh right_shin right_foot right_upper_arm right_forearm right_hand"
    for name, joint in zip(MARKERS, joints.split(), strict=False):
        np.testing.assert_array_equal(markers.positions[:, MARKERS.index(name)], points[joint])
        if name.startswith("R"):
            other = MARKERS.index(f"L{name[1:]}")
            np.testing.assert_array_equal(markers.positions[:, other], points[joint.replace("right", "left")])
    np.testing.assert_allclose(markers.times, [0.0, 0.02, 0.04, 0.06])
    assert (markers.names, markers.unit, markers.rate) == (MARKERS, "m", 50.0)


def test_a_motions_beginning() -> None:
    motion = turning(9, 4)
    short, whole = first_frames(motion, 4), first_frames(motion, None)
    assert (short.frame_count, whole.frame_count, short.fps) == (4, 9, 50.0)
    np.testing.assert_array_equal(short.root, motion.root[:4])
    np.testing.assert_array_equal(short.turns["head"], motion.turns["head"][:4])


@pytest.mark.parametrize(
    ("begin", "end"), [(0.0, 79.0), (0.0, 5.0), (30.2, 41.7), (70.0, 79.0), (40.0, 40.0)]
)
def test_a_motion_at_other_times_follows_curves_through_its_frames(begin: float, end: float) -> None:
    motion = turning(80, 5)
    at = np.linspace(begin, end, 17)
    other = sampled(motion, at / 50.0, 120.0)
    assert (other.fps, other.skeleton) == (120.0, BONES)
    frames = np.arange(80.0)
    np.testing.assert_allclose(other.root, scipy.interpolate.CubicSpline(frames, motion.root)(at), atol=1e-4)
    for name in SEGMENTS:
        curve = RotationSpline(frames, Rotation.from_matrix(motion.turns[name]))
        np.testing.assert_allclose(other.turns[name], curve(at).as_matrix(), atol=1e-6)


@pytest.mark.parametrize("frames", [2, 3, 80])
def test_times_of_frames_give_the_frames_and_others_the_nearest(frames: int) -> None:
    motion = turning(frames, 6)
    same = sampled(motion, np.arange(frames) / 50.0, 50.0)
    np.testing.assert_allclose(same.root, motion.root, atol=1e-9)
    beside = sampled(motion, np.array([-1.0, 100.0]), 50.0)
    np.testing.assert_allclose(beside.root, motion.root[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(beside.turns["head"], motion.turns["head"][[0, -1]], atol=1e-9)
