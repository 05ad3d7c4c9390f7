"""Synthetic cameras against OpenCV's projection."""

import cv2
import numpy as np
import pytest

from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import corner_rig, pixel_rays, placed_camera

SIZE = (160, 120)


def rig() -> tuple[Camera, ...]:
    return corner_rig(SIZE, np.random.default_rng(1))


@pytest.mark.parametrize("index", range(4))
@pytest.mark.parametrize("samples", [1, 2])
def test_rays_go_through_their_pixels(index: int, samples: int) -> None:
    camera = rig()[index]
    rays = pixel_rays(camera, samples).astype(np.float64)
    assert rays.shape == (120 * samples, 160 * samples, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0, atol=1e-6)
    points = camera.centre + 3000.0 * rays.reshape(-1, 3)
    turn, _ = cv2.Rodrigues(camera.rotation)
    seen, _ = cv2.projectPoints(points, turn, camera.translation, camera.matrix, camera.distortion)
    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    columns = (np.arange(160)[:, None] + offsets).ravel()
    rows = (np.arange(120)[:, None] + offsets).ravel()
    wanted = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(seen.reshape(-1, 2), wanted, atol=2e-3)


def test_a_camera_looks_at_its_target_with_the_floor_below() -> None:
    camera = placed_camera("one", (2000.0, 1000.0, 2500.0), (0.0, 0.0, 800.0), size=SIZE, focal_px=120.0)
    np.testing.assert_allclose(camera.centre, [2000.0, 1000.0, 2500.0])
    pixels, depth = project(camera, np.array([[0.0, 0.0, 800.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(pixels[0], [79.5, 59.5], atol=1e-9)
    assert pixels[1, 1] > pixels[0, 1]
    assert np.all(depth > 0.0)
    np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.rotation) == pytest.approx(1.0)


def test_roll_turns_the_picture() -> None:
    place = ((2000.0, 0.0, 1000.0), (0.0, 0.0, 1000.0))
    level = placed_camera("a", *place, size=SIZE, focal_px=120.0)
    rolled = placed_camera("b", *place, size=SIZE, focal_px=120.0, roll=np.pi / 2)
    up = np.array([[0.0, 0.0, 1500.0]])
    assert project(level, up)[0][0, 1] < 59.5 - 20.0
    assert abs(project(rolled, up)[0][0, 1] - 59.5) < 1e-6
    assert abs(project(rolled, up)[0][0, 0] - 79.5) > 20.0


def test_a_camera_that_looks_straight_down_is_refused() -> None:
    with pytest.raises(CalibrationError, match="top"):
        placed_camera("top", (0.0, 0.0, 3000.0), (0.0, 0.0, 0.0), size=SIZE, focal_px=100.0)


def test_the_corner_rig_sees_the_middle_of_the_room() -> None:
    for camera in corner_rig((640, 480), np.random.default_rng(1)):
        ring = [
            [900.0 * np.cos(a), 900.0 * np.sin(a), z]
            for a in np.linspace(0.0, 6.0, 12)
            for z in (0.0, 1800.0)
        ]
        pixels, _ = project(camera, np.array(ring))
        assert np.all((pixels > 0.0) & (pixels < [640.0, 480.0]))
