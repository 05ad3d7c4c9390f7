"""Poses rewritten within the limits: the same body in space, on any branch of the angles."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from studio.body.branches import within_limits
from studio.body.catalogue import list_bodies, load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import joint_frames, limb_ends, marker_points
from studio.body.model import BodyModel
from studio.body.reader import parse_body

HALF_TURN = math.pi
# A pose of the walk's kind, degrees, by parameter; the others are neutral.
STRIDE = {
    **{"left_hip_rx": 5.0, "left_hip_ry": 30.0, "left_hip_rz": -12.0, "left_knee_ry": -40.0},
    **{"right_hip_rx": -4.0, "right_hip_ry": -15.0, "right_hip_rz": 8.0, "right_knee_ry": -20.0},
    **{"left_shoulder_ry": -120.0, "left_elbow_ry": -50.0, "left_shoulder_rz": 20.0},
    **{"right_shoulder_ry": 60.0, "right_elbow_ry": -35.0, "head_rz": 30.0},
}


def _places(body: BodyModel, *names: str) -> list[int]:
    order = [entry.name for entry in body.parameters]
    return [order.index(name) for name in names]


def _stride(body: BodyModel) -> np.ndarray:
    pose = body.neutral
    for name, value in STRIDE.items():
        pose[_places(body, name)] = math.radians(value)
    return pose


def _on_branch(
    body: BodyModel, pose: np.ndarray, ball: str, hinge: str, over: bool, turned: bool
) -> np.ndarray:
    """The pose with one ball joint (and the hinge after it) written in another way."""
    first, second, third = _places(body, f"{ball}_ry", f"{ball}_rx", f"{ball}_rz")
    other = pose.copy()
    if over:
        other[first] += HALF_TURN
        other[second] = HALF_TURN - other[second]
        other[third] += HALF_TURN
    if turned:
        other[third] += HALF_TURN
        other[_places(body, hinge)] *= -1.0
    return other


CHAINS = [
    ("left_hip", "left_knee_ry"),
    ("right_hip", "right_knee_ry"),
    ("left_shoulder", "left_elbow_ry"),
    ("right_shoulder", "right_elbow_ry"),
]


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    spellings=st.lists(st.tuples(st.booleans(), st.booleans()), min_size=4, max_size=4),
    turns=st.lists(st.integers(-2, 2), min_size=31, max_size=31),
)
def test_every_branch_of_a_stride_comes_back_within_the_limits(
    spellings: list[tuple[bool, bool]], turns: list[int]
) -> None:
    body = load_body("human31")
    pose = _stride(body)
    rewritten = pose.copy()
    for (ball, hinge), (over, turned) in zip(CHAINS, spellings, strict=True):
        rewritten = _on_branch(body, rewritten, ball, hinge, over, turned)
    bounded = np.array([entry.kind == "angle" and np.isfinite(entry.upper) for entry in body.parameters])
    rewritten += 2.0 * HALF_TURN * np.array(turns) * bounded
    np.testing.assert_allclose(limb_ends(body, rewritten), limb_ends(body, pose), atol=1e-9)
    found = within_limits(body, rewritten)
    np.testing.assert_allclose(found, pose, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(("over", "turned"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize(("ball", "hinge"), [*CHAINS, ("all", "")])
def test_one_joint_or_all_written_otherwise_come_back(
    ball: str, hinge: str, over: bool, turned: bool
) -> None:
    """With whole turns beside it."""
    body = load_body("human31")
    pose = _stride(body)
    rewritten = pose.copy()
    for one, bend in CHAINS if ball == "all" else [(ball, hinge)]:
        rewritten = _on_branch(body, rewritten, one, bend, over, turned)
        rewritten[_places(body, bend)] -= 4.0 * HALF_TURN
        rewritten[_places(body, f"{one}_rx")] += 2.0 * HALF_TURN
    np.testing.assert_allclose(within_limits(body, rewritten), pose, rtol=0.0, atol=1e-11)


def test_lengths_and_angles_without_limits_are_not_wound() -> None:
    body = load_body("human31")
    pose = _stride(body)
    free = ~body.bounded_angles
    pose[free] += 4.0 * HALF_TURN
    np.testing.assert_array_equal(within_limits(body, pose), pose)


SWING = """
title = "A ball with a rod on a hinge"
parameters = [
    { name = "d", kind = "angle", limb = "x", max_step = 1, lower = 0, upper = 140 },
    { name = "a", kind = "angle", limb = "x", max_step = 1, lower = -80, upper = 80 },
    { name = "b", kind = "angle", limb = "x", max_step = 1, lower = -80, upper = 80 },
    { name = "c", kind = "angle", limb = "x", max_step = 1, lower = -80, upper = 80 },
]
joints = [
    { name = "stand", parent = "world", type = "fixed", sequence = [{ move = "x", by = 7 }] },
    { name = "ball", parent = "stand", type = "ball", sequence = [
        { move = "z", by = 5 }, { turn = "x", by = "a" }, { turn = "y", by = "b" }, { turn = "z", by = "c" },
    ] },
    { name = "aside", parent = "ball", type = "fixed", sequence = [{ move = "z", by = -90 }] },
    { name = "rod", parent = "ball", type = "hinge", sequence = [{ move = "z", by = -80 }, { turn = "y", by = "d" }] },
]
limbs = [{ name = "upper", joint = "ball", length = -80, radius_start = 9, radius_end = 9 },
         { name = "rod", joint = "rod", length = -60, radius_start = 9, radius_end = 9 }]
"""


@pytest.mark.parametrize(("over", "turned"), [(True, False), (False, True), (True, True)])
def test_a_joint_is_rewritten_with_the_hinge_that_hangs_on_it(over: bool, turned: bool) -> None:
    body = parse_body(SWING, "swing", "swing.toml")
    pose = np.array([0.6, 0.3, -0.4, 0.5])
    other = pose.copy()
    if over:
        other[1:] = pose[1] + HALF_TURN, HALF_TURN - pose[2], pose[3] + HALF_TURN
    if turned:
        other[[0, 3]] = -pose[0], other[3] + HALF_TURN
    np.testing.assert_allclose(within_limits(body, other), pose, atol=1e-11)
    # So it is wherever the joint's angles stand in the pose.
    first = next(line for line in SWING.splitlines() if '"d", kind' in line)
    last = SWING.replace(f"{first}\n", "").replace("\n]\njoints", f"\n{first}\n]\njoints")
    found = within_limits(parse_body(last, "last", "last.toml"), np.roll(other, -1))
    np.testing.assert_allclose(found, np.roll(pose, -1), atol=1e-11)
    # A flat rod shows which way it was turned about itself, but half a turn.
    flat = SWING.replace("radius_end = 9 }]", "radius_end = 9, scale_x = 0.5 }]")
    np.testing.assert_allclose(within_limits(parse_body(flat, "f", "f.toml"), other), pose, atol=1e-11)


def test_two_angles_about_one_axis_are_no_ball() -> None:
    """Whatever is done, the same frames come out."""
    text = SWING.replace('turn = "z", by = "c"', 'turn = "x", by = "c"')
    body = parse_body(text, "swing", "swing.toml")
    pose = np.array([0.6, 0.3 + HALF_TURN, HALF_TURN + 0.4, 0.5 + HALF_TURN])
    found = within_limits(body, pose)
    np.testing.assert_allclose(joint_frames(body, found), joint_frames(body, pose), atol=1e-9)


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_on_a_limit_of_a_joint_that_turns_more_than_once_a_pose_stays(side: str) -> None:
    wide = SWING.replace("lower = 0, upper = 140", "lower = -200, upper = 200")
    body = parse_body(wide, "wide", "wide.toml")
    pose = np.array([getattr(body, side)[0], 0.1, 0.1, 0.1])
    np.testing.assert_array_equal(within_limits(body, pose), pose)


def test_a_ball_joints_other_angles_are_the_same_rotation() -> None:
    """The identity behind it, by another library: Ry(-b) Rx(-a) Rz(-c) on both branches."""
    a, b, c = 0.4, -1.3, 0.7
    one = Rotation.from_euler("YXZ", [-b, -a, -c]).as_matrix()
    two = Rotation.from_euler("YXZ", [-(b + HALF_TURN), -(HALF_TURN - a), -(c + HALF_TURN)]).as_matrix()
    np.testing.assert_allclose(one, two, atol=1e-15)


@pytest.mark.parametrize("name", list_bodies())
def test_a_pose_within_the_limits_is_unchanged(name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(3)
    lower = np.array([max(entry.lower, -1000.0) for entry in body.parameters])
    upper = np.array([min(entry.upper, 1000.0) for entry in body.parameters])
    for _ in range(20):
        pose = rng.uniform(lower, upper)
        np.testing.assert_array_equal(within_limits(body, pose), pose)


def test_a_drawn_foot_distinguishes_a_leg_turned_by_half() -> None:
    """Without feet a leg turned by π with its knee negated is the same leg; a foot would point backwards."""
    plain = load_body("human31")
    shod = with_dimensions(plain, {"left_foot_length": 260.0, "right_foot_length": 260.0})
    pose = _stride(plain)
    turned = _on_branch(plain, pose, "left_hip", "left_knee_ry", over=False, turned=True)
    np.testing.assert_allclose(within_limits(plain, turned), pose, atol=1e-11)
    kept = within_limits(shod, turned)
    np.testing.assert_allclose(joint_frames(shod, kept), joint_frames(shod, turned), atol=1e-9)
    assert not np.allclose(limb_ends(shod, pose), limb_ends(shod, turned), atol=1.0)


def test_a_pose_without_a_branch_within_the_limits_is_unchanged() -> None:
    body = load_body("human31")
    pose = _stride(body)
    pose[_places(body, "left_knee_ry")] = math.radians(60.0)
    pose[_places(body, "head_rz")] = math.radians(150.0)
    found = within_limits(body, pose)
    np.testing.assert_allclose(limb_ends(body, found), limb_ends(body, pose), atol=1e-9)
    np.testing.assert_allclose(marker_points(body, found), marker_points(body, pose), atol=1e-9)
    lower = np.array([entry.lower for entry in body.parameters])
    upper = np.array([entry.upper for entry in body.parameters])
    assert np.any((found < lower) | (found > upper))
