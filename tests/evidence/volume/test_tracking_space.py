"""The box that cameras see, and the points that they see."""

import dataclasses

import numpy as np
import pytest
from posed_cones import ring
from toy_footage import looking_at

from studio.evidence.volume.tracking_space import Box, _surroundings, box_of
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.sight import sees


def test_the_box_stands_on_the_floor_in_the_common_view() -> None:
    cameras = ring(5)
    box = box_of(cameras)
    assert box.lower[2] == 0.0
    assert box.upper[2] == 2300.0
    assert (box.lower[:2] < -500).all()
    assert (box.upper[:2] > 500).all()
    middle = np.array([0.0, 0.0, 900.0])
    assert all(sees(camera, middle) for camera in cameras)
    # Outside the box some camera does not see a whole person standing there.
    for outside in (
        [box.lower[0] - 150, 0],
        [box.upper[0] + 150, 0],
        [0, box.lower[1] - 150],
        [0, box.upper[1] + 150],
    ):
        places = np.array([[*outside, z] for z in (300.0, 1000.0, 1700.0)])
        assert not all(sees(camera, places).all() for camera in cameras)


def test_the_search_is_around_where_the_cameras_look_or_in_their_middle_where_they_look_one_way() -> None:
    places = ((3000.0, 0.0, 1500.0), (2500.0, 2000.0, 1800.0), (2800.0, -1500.0, 1200.0))
    watching = [looking_at("a", place, (-500.0, 300.0, 900.0)) for place in places]
    middle, radius = _surroundings(watching, 900.0, 1.0)
    np.testing.assert_allclose(middle, (-500.0, 300.0), atol=10.0)
    assert radius == pytest.approx(1.2 * max(np.hypot(x + 500.0, y - 300.0) for x, y, _ in places), rel=0.01)
    beside = [looking_at("a", (0.0, y, 900.0), (1000.0, y, 900.0)) for y in (-600.0, 0.0, 1200.0)]
    np.testing.assert_allclose(_surroundings(beside, 900.0, 1.0)[0], (0.0, 200.0), atol=1.0)


def test_the_cube_stands_on_the_middle_of_the_floor() -> None:
    box = Box(np.array([-1000.0, 500.0, 10.0]), np.array([1000.0, 1500.0, 2200.0]))
    assert box.edge == 2190.0
    np.testing.assert_allclose(box.corner, [-1095.0, 1000.0 - 1095.0, 10.0])


def test_a_camera_that_looks_away_does_not_empty_the_space() -> None:
    cameras = ring(4)
    odd = cameras[0]
    turned = np.diag([-1.0, 1.0, -1.0]) @ odd.rotation
    away = dataclasses.replace(odd, rotation=turned, translation=-turned @ odd.centre)
    box = box_of((away, *cameras[1:]))
    assert (box.lower[:2] < 0).all()
    assert (box.upper[:2] > 0).all()


def test_cameras_without_a_common_view_are_refused_with_a_remedy() -> None:
    one = ring(2)[0]
    turned = np.diag([-1.0, 1.0, -1.0]) @ one.rotation
    other = dataclasses.replace(one, rotation=turned, translation=-turned @ one.centre)
    with pytest.raises(CalibrationError, match="No two cameras"):
        box_of((one, other))
    with pytest.raises(CalibrationError, match="at least one camera"):
        box_of(())


def test_a_box_without_inside_is_refused() -> None:
    with pytest.raises(CalibrationError, match="empty"):
        Box(np.zeros(3), np.array([1.0, 0.0, 1.0]))


def test_points_where_the_lens_folds_back_are_not_seen() -> None:
    camera = ring(3)[0]
    # 80 degrees off the axis the polynomial with k1 = -0.32 lands back in the picture.
    far = camera.centre + camera.rotation.T @ np.array([np.tan(np.deg2rad(64.0)), 0.0, 1.0]) * 1000.0
    assert not sees(camera, far)
    assert sees(camera, camera.centre + camera.rotation[2] * 1000.0)
    assert not sees(camera, camera.centre - camera.rotation[2] * 1000.0)
