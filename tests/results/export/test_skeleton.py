"""The skeleton of any body: rigid, in a T-pose at rest, and where forward kinematics says."""

import dataclasses

import numpy as np
import pytest
from export_runs import moving_poses

from studio.body.catalogue import list_bodies, load_body
from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import MOVE, TURN, Joint, Step
from studio.body.motion_files.recorded_motion import followed
from studio.results.export.skeleton import joint_tree, skeleton_of


@pytest.mark.parametrize("name", list_bodies())
@pytest.mark.parametrize("rest", ["tpose", "neutral"])
def test_every_marker_rides_on_its_joint(name: str, rest: str) -> None:
    """Markers at rest, carried along by the joints' places and turns alone, are where the body's own kinematics puts
    them."""
    body = load_body(name)
    skeleton = skeleton_of(body, rest)
    poses = moving_poses(body, 40)
    places, turns = followed(skeleton.tree.parents, *skeleton.animated(poses))
    frames, wanted = joint_frames(body, poses), marker_points(body, poses)
    for at, marker in enumerate(body.markers):
        joint = skeleton.tree.whole[marker.joint]
        np.testing.assert_allclose(
            turns[:, joint] @ skeleton.turns[joint], frames[:, marker.joint, :, :3], atol=1e-12
        )
        local = (turns[:, joint].transpose(0, 2, 1) @ (wanted[:, at] - places[:, joint])[..., None])[..., 0]
        # The same vector from the joint to the marker in every frame: the joint's pivot is rigid on what carries it.
        np.testing.assert_allclose(local, np.broadcast_to(local[0], local.shape), atol=1e-9)


@pytest.mark.parametrize("name", ["human25", "human29", "human31", "human34", "human35"])
def test_people_rest_in_a_t_pose(name: str) -> None:
    body = load_body(name)
    skeleton = skeleton_of(body)
    assert skeleton.kind == "T-pose"
    places = dict(zip(skeleton.names, skeleton.rest_pivots, strict=True))
    arm = places["left_forearm"] - places["left_upper_arm"]
    np.testing.assert_allclose(arm / np.linalg.norm(arm), [0.0, 1.0, 0.0], atol=1e-9)
    other = places["right_hand"] - places["right_forearm"]
    np.testing.assert_allclose(other / np.linalg.norm(other), [0.0, -1.0, 0.0], atol=1e-9)
    leg = places["left_shin"] - places["left_thigh"]
    np.testing.assert_allclose(leg / np.linalg.norm(leg), [0.0, 0.0, -1.0], atol=1e-9)
    assert skeleton_of(body, "neutral").kind == "neutral pose"


@pytest.mark.parametrize("name", ["dog", "planar_arm4"])
def test_other_bodies_rest_as_they_stand(name: str) -> None:
    body = load_body(name)
    skeleton = skeleton_of(body)
    assert skeleton.kind == "neutral pose"
    places = skeleton.rest_pivots + joint_frames(body, body.neutral)[0, 0, :, 3]
    np.testing.assert_allclose(places, skeleton.tree.placed(body.neutral[None])[0][0], atol=1e-9)


def test_two_roots_hang_on_one_base() -> None:
    tree = joint_tree(load_body("branched_arms6"))
    assert tree.names[0] == "base"
    assert [parent for parent in tree.parents if parent < 0] == [-1]


def test_a_joint_that_turns_moves_and_turns_again_is_cut() -> None:
    """Turn, 100 mm on, turn again: two pivots; a length that varies after a turn makes a joint that moves."""
    body = load_body("planar_arm4")
    steps = (Step(TURN, 1, 1, 1.0), Step(MOVE, 2, -1, 100.0), Step(TURN, 0, 2, 1.0), Step(MOVE, 2, 3, 1.0))
    joints = (body.joints[0], Joint("odd", 0, steps))
    odd = dataclasses.replace(body, joints=joints, limbs=(), markers=())
    tree = joint_tree(odd)
    assert tree.names == ("link_1", "odd_1", "odd_2", "odd")
    assert tree.moving == (True, False, False, True)
    poses = np.random.default_rng(3).normal(size=(20, 4)) * [1.0, 1.0, 1.0, 50.0]
    skeleton = skeleton_of(odd)
    places, turns = followed(skeleton.tree.parents, *skeleton.animated(poses))
    wanted = joint_frames(odd, poses)[:, 1]
    np.testing.assert_allclose(places[:, 3], wanted[..., 3], atol=1e-9)
    np.testing.assert_allclose(turns[:, 3] @ skeleton.turns[3], wanted[..., :3], atol=1e-12)


def test_a_stiff_foot_hangs_at_the_ankle() -> None:
    skeleton = skeleton_of(load_body("human31"))
    places = dict(zip(skeleton.names, skeleton.rest_pivots, strict=True))
    across = places["left_foot"] - places["left_shin"]
    assert abs(across[0]) < 1.0
    assert across[2] < -400.0
