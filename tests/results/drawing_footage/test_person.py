"""The synthetic skeleton: lengths that stay, and markers that a tracker's body can meet."""

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.person import MARKERS, joint_points, marker_motion
from studio.body.subject import Subject, fit_subject
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths, skeleton_of_height


def test_marker_names_are_those_of_the_tracker_bodies() -> None:
    for name in ("human31", "human29", "human34", "human25"):
        assert set(MARKERS) == {marker.name for marker in load_body(name).markers}


@pytest.mark.parametrize("name", ["walk", "run", "box", "handstand", "stand"])
def test_limb_lengths_never_change(name: str) -> None:
    motion = make_motion(name, skeleton_of_height(1700.0, np.random.default_rng(3)), 40, 60.0, {})
    markers = marker_motion(motion)
    at = {marker: index for index, marker in enumerate(markers.names)}
    for pair, length in marker_lengths(motion).items():
        one, other = pair.split("_")
        distances = np.linalg.norm(markers.positions[:, at[one]] - markers.positions[:, at[other]], axis=1)
        np.testing.assert_allclose(distances, length, atol=1e-6)
    assert markers.times[0] == 0.0
    np.testing.assert_allclose(np.diff(markers.times), 1.0 / 60.0)


def test_standing_height_is_the_height() -> None:
    for height in (1550.0, 1760.0, 1900.0):
        bones = skeleton_of_height(height, np.random.default_rng(1))
        points = joint_points(make_motion("stand", bones, 2, 60.0, {}))
        soles = points["left_foot"][0, 2] - bones.ankle_height
        assert points["head_top"][0, 2] - soles == pytest.approx(height, rel=0.025)
        assert bones.thigh[0] == pytest.approx(bones.thigh[1], rel=0.03)


def test_left_is_on_the_left() -> None:
    motion = make_motion(
        "stand", skeleton_of_height(1760.0, np.random.default_rng(1)), 2, 60.0, {"heading_degrees": 0.0}
    )
    points = joint_points(motion)
    assert points["left_hand"][0, 1] > 150.0
    assert points["right_hand"][0, 1] < -150.0
    assert points["left_toes"][0, 0] > points["left_foot"][0, 0] + 100.0


@pytest.mark.parametrize("name", ["walk", "run", "box", "handstand"])
def test_human31_of_the_measured_lengths_meets_all_markers(name: str) -> None:
    motion = make_motion(name, skeleton_of_height(1760.0, np.random.default_rng(1)), 90, 60.0, {})
    subject = Subject(height_mm=1760.0, lengths_mm=marker_lengths(motion))
    body, notes = fit_subject(load_body("human31"), subject)
    assert notes == ()
    markers = marker_motion(motion)
    for frame in (0, 45, 89):
        _, error = pose_from_markers(body, markers.names, markers.positions[frame], body.neutral)
        assert error < 5.0, f"frame {frame}"
