"""human31's limits: real poses are within them, impossible ones are not."""

import math

import numpy as np
import pytest
from sample_walk import WALK

from studio.body.branches import within_limits
from studio.body.catalogue import load_body
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import read_trc
from studio.body.person import marker_motion
from studio.body.subject import Subject, fit_subject
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths, skeleton_of_height
from studio.sessions.session import Session

HEIGHT = 1760.0


def _kept(body: BodyModel, pose: np.ndarray) -> bool:
    return all(
        entry.lower <= value <= entry.upper for entry, value in zip(body.parameters, pose, strict=True)
    )


def _posed(body: BodyModel, **degrees: float) -> np.ndarray:
    pose = body.neutral
    for place, entry in enumerate(body.parameters):
        if entry.name in degrees:
            pose[place] = math.radians(degrees[entry.name])
    return pose


def test_the_walk_samples_truth_is_met_exactly_within_the_limits() -> None:
    """Inverse kinematics keeps the limits, so that a remaining distance would show where they are too tight."""
    session = Session(WALK)
    body, truth = session.body(), read_trc(WALK / "truth" / "walk.trc")
    pose = session.start_pose(body)
    assert pose is not None
    assert _kept(body, pose)
    for positions in truth.positions[::15]:
        pose, error = pose_from_markers(body, truth.names, positions, pose)
        assert error < 0.1
        assert _kept(body, pose)


@pytest.mark.parametrize("name", ["run", "box", "handstand", "stand"])
def test_other_motions_are_met_exactly_within_the_limits(name: str) -> None:
    motion = make_motion(name, skeleton_of_height(HEIGHT, np.random.default_rng(1)), 150, 60.0, {})
    body, _ = fit_subject(load_body("human31"), Subject("human31", HEIGHT, marker_lengths(motion)))
    truth, pose = marker_motion(motion), body.neutral
    for positions in truth.positions[::25]:
        pose, error = pose_from_markers(body, truth.names, positions, pose)
        assert error < 0.1
        assert _kept(body, pose)


@pytest.mark.parametrize(
    "degrees",
    [
        {"left_knee_ry": 30.0},
        {"right_knee_ry": 30.0},
        {"left_elbow_ry": 40.0},
        {"right_elbow_ry": 40.0},
        {"head_rz": 180.0},
        {"head_rx": 90.0},
        {"left_hip_rx": 90.0},
        {"right_hip_rx": -90.0},
        {"left_hip_rx": -60.0},
        {"left_hip_ry": -90.0},
        {"right_hip_ry": 175.0},
        {"left_hip_rz": 150.0},
        {"left_shoulder_rz": 170.0, "left_elbow_ry": -60.0},
        {"right_shoulder_rz": 10.0, "right_elbow_ry": -60.0},
        {"left_shoulder_ry": 20.0},
        {"right_shoulder_ry": -20.0},
        {"thorax_rz": 120.0},
        {"left_clavicle_rx": -80.0},
    ],
    ids=str,
)
def test_impossible_joint_angles_are_outside_on_every_branch(degrees: dict[str, float]) -> None:
    body, _ = fit_subject(load_body("human31"), Subject("human31", HEIGHT))
    assert _kept(body, _posed(body))
    impossible = _posed(body, **degrees)
    assert not _kept(body, impossible)
    assert not _kept(body, within_limits(body, impossible))


@pytest.mark.parametrize(
    "degrees",
    [
        {"left_hip_ry": 120.0, "left_knee_ry": -140.0},
        {"left_shoulder_ry": -270.0, "right_shoulder_ry": 270.0},
        {"left_shoulder_rx": 90.0, "right_shoulder_rx": 90.0},
        {"left_shoulder_rx": 145.0, "left_clavicle_rx": -25.0},
        {"left_elbow_ry": -145.0, "right_elbow_ry": -145.0},
        {"head_rz": 70.0, "thorax_rz": 40.0},
        {"left_hip_rx": 45.0, "right_hip_rx": -45.0},
    ],
    ids=str,
)
def test_real_joint_angles_are_inside(degrees: dict[str, float]) -> None:
    body = load_body("human31")
    assert _kept(body, _posed(body, **degrees))
