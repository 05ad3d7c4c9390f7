"""Limbs that a start pose has in a wrong place are found on the silhouettes."""

import numpy as np
import pytest
from drawn_people import drawn_evidence, ring_of_cameras
from moving_bodies import standing

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.runs.setup.initial_limbs import limbs_put_right
from studio.search.trackers.loss_detection import Onlooker

CAMERAS = ring_of_cameras(4, 480, 360)


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_body("human31")


@pytest.fixture(scope="module")
def stretched(body: BodyModel) -> np.ndarray:
    """Standing, the right arm stretched aside."""
    return standing(body, right_shoulder_rx=1.0, left_hip_ry=0.2)


def off(body: BodyModel, pose: np.ndarray, truth: np.ndarray, marker: str) -> float:
    column = [entry.name for entry in body.markers].index(marker)
    apart = marker_points(body, np.stack([pose, truth]))[:, column]
    return float(np.linalg.norm(apart[0] - apart[1]))


@pytest.mark.parametrize("seed", [0, 1])
def test_an_arm_before_the_trunk_is_found_where_it_is(
    body: BodyModel, stretched: np.ndarray, seed: int
) -> None:
    names = [entry.name for entry in body.parameters]
    hidden = stretched.copy()
    hidden[names.index("right_shoulder_rx")] = -0.3
    hidden[names.index("right_elbow_ry")] = -1.8
    evidence = drawn_evidence(body, stretched, CAMERAS)
    assert off(body, hidden, stretched, "RWrist") > 400.0
    found = limbs_put_right(body, CAMERAS, evidence, hidden, seed).pose
    assert off(body, found, stretched, "RWrist") < 80.0
    assert off(body, found, stretched, "LWrist") < 80.0
    assert np.array_equal(found, limbs_put_right(body, CAMERAS, evidence, hidden, seed).pose)


def test_a_pose_that_fits_is_not_lost(body: BodyModel, stretched: np.ndarray) -> None:
    evidence = drawn_evidence(body, stretched, CAMERAS)
    found = limbs_put_right(body, CAMERAS, evidence, stretched, 0).pose
    onlooker = Onlooker(body, CAMERAS)
    assert onlooker.sight(evidence, found).overlap >= onlooker.sight(evidence, stretched).overlap
    for marker in ("RWrist", "LWrist", "LAnkle", "Head"):
        assert off(body, found, stretched, marker) < 40.0
