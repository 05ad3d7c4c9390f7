"""Points of one calibration's world, carried into that of another one by where they are seen."""

import dataclasses

import numpy as np
import pytest

from studio.footage.calibration.carried_points import carried
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rigid import rigid, transform
from studio.foundations.geometry.rotations import axis_turn
from tests.drawn_people import ring_of_cameras

CAMERAS = ring_of_cameras(4)
MOTION = rigid(axis_turn(2, np.array(0.7)) @ axis_turn(0, np.array(1.9)), np.array([300.0, -2000.0, 4000.0]))


def moved(camera: Camera) -> Camera:
    """A camera of the same picture in the world new = MOTION old."""
    rotation = camera.rotation @ MOTION[:, :3].T
    return dataclasses.replace(
        camera, rotation=rotation, translation=camera.translation - rotation @ MOTION[:, 3]
    )


def points() -> np.ndarray:
    found = np.random.default_rng(0).uniform([-300, -300, 0], [300, 300, 1700], (5, 7, 3))
    found[2, 3] = np.nan
    return found


def test_points_arrive_where_the_same_pictures_show_them() -> None:
    own, others = CAMERAS, tuple(map(moved, CAMERAS))
    found, missed = carried(points(), own, others)
    np.testing.assert_allclose(found, transform(MOTION, points()), atol=1e-3)
    assert np.isnan(found[2, 3]).all()
    assert missed < 1e-3
    # The order of the cameras does not matter, nor cameras that only one of both has.
    again, _ = carried(points(), own[:3], others[::-1])
    np.testing.assert_allclose(again, found, atol=1e-3)


def test_a_point_that_one_camera_sees_is_missing() -> None:
    seen = points()
    seen[0, 0] = CAMERAS[0].centre + 200.0 * CAMERAS[0].rotation[2]
    found, _ = carried(seen, CAMERAS[:2], CAMERAS)
    assert np.isnan(found[0, 0]).all()
    np.testing.assert_allclose(found[1], seen[1], atol=1e-3)


def test_what_does_not_fit_is_refused() -> None:
    strangers = tuple(dataclasses.replace(camera, name=f"other-{camera.name}") for camera in CAMERAS)
    with pytest.raises(CalibrationError, match="0 cameras in common"):
        carried(points(), strangers, CAMERAS)
    with pytest.raises(CalibrationError, match="seen by two cameras"):
        carried(1000.0 * points(), CAMERAS, CAMERAS)
    one, other, *rest = CAMERAS
    exchanged = (dataclasses.replace(one, name=other.name), dataclasses.replace(other, name=one.name), *rest)
    with pytest.raises(CalibrationError, match="pixels apart"):
        carried(points() + 150.0, exchanged, CAMERAS)
