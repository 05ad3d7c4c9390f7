import cv2
import numpy as np
import pytest

from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import rotation_from_vector


def _camera(seed: int, skew: float = 0.0) -> Camera:
    rng = np.random.default_rng(seed)
    rotation = rotation_from_vector(rng.uniform(-2.0, 2.0, 3))
    return Camera(
        name=f"camera {seed}",
        width=640,
        height=480,
        matrix=np.array(
            [[rng.uniform(500, 900), skew, 310.0], [0.0, rng.uniform(500, 900), 250.0], [0.0, 0.0, 1.0]]
        ),
        distortion=np.array([-0.32, 0.15, 2e-3, -1e-3, 0.02]) * rng.uniform(0.2, 1.0, 5),
        rotation=rotation,
        translation=rng.uniform(-500.0, 500.0, 3),
    )


def _seen_points(camera: Camera, seed: int, count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(1000.0, 6000.0, count)
    seen = np.stack(
        [rng.uniform(-0.5, 0.5, count) * depth, rng.uniform(-0.4, 0.4, count) * depth, depth], axis=1
    )
    return (seen - camera.translation) @ camera.rotation


@pytest.mark.parametrize("seed", range(6))
def test_projection_is_that_of_opencv(seed: int) -> None:
    camera = _camera(seed)
    points = _seen_points(camera, 100 + seed)
    pixels, depth = project(camera, points)
    vector = cv2.Rodrigues(camera.rotation)[0]
    expected = cv2.projectPoints(points, vector, camera.translation, camera.matrix, camera.distortion)[0][
        :, 0
    ]
    np.testing.assert_allclose(pixels, expected, atol=1e-8)
    np.testing.assert_allclose(depth, (camera.rotation @ points.T).T[:, 2] + camera.translation[2])


def test_skew_shifts_along_the_row_by_the_distorted_height() -> None:
    plain, skewed = _camera(3), _camera(3, skew=25.0)
    points = _seen_points(plain, 7)
    before, _ = project(plain, points)
    after, _ = project(skewed, points)
    height = (before[:, 1] - plain.matrix[1, 2]) / plain.matrix[1, 1]
    np.testing.assert_allclose(after[:, 0] - before[:, 0], 25.0 * height, atol=1e-9)
    np.testing.assert_allclose(after[:, 1], before[:, 1])


def test_points_behind_have_no_pixels_and_shapes_are_kept() -> None:
    camera = _camera(1)
    points = _seen_points(camera, 2, 6).reshape(2, 3, 3)
    points[1, 2] = camera.centre - 500.0 * camera.rotation[2]
    pixels, depth = project(camera, points)
    assert pixels.shape == (2, 3, 2)
    assert depth.shape == (2, 3)
    assert depth[1, 2] == pytest.approx(-500.0)
    assert np.isnan(pixels[1, 2]).all()
    assert np.isfinite(pixels.reshape(-1, 2)[:5]).all()
