"""Cameras in the scene against OpenCV's own projection: every pixel hangs on its own ray."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.app.scene.camera_placement import clockwise_turn, picture_plane, straight_picture
from studio.app.scene.camera_views import frustum_mesh
from studio.foundations.geometry.camera import Camera
from studio.runs.drawing.overlay_drawing import upright


def with_turns(camera: Camera, turns: int) -> Camera:
    return Camera(
        camera.name,
        camera.width,
        camera.height,
        camera.matrix,
        camera.distortion,
        camera.rotation,
        camera.translation,
        turns,
    )


def seen_on_plane(camera: Camera, point: np.ndarray) -> np.ndarray:
    """Where the ray to a world point (mm) meets the upright picture, as shares of its width and height."""
    plane = picture_plane(camera)
    turn = Rotation.from_quat(plane.wxyz, scalar_first=True)
    local = turn.inv().apply(point / 1000.0 - plane.position)
    x, y = local[:2] / local[2]
    return np.array([(x - plane.left) / plane.size[0], (y - plane.top) / plane.size[1]])


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_points_lie_where_opencv_projects_them(cameras: tuple[Camera, ...], turns: int) -> None:
    rng = np.random.default_rng(turns)
    for camera in cameras:
        camera = with_turns(camera, turns)
        for point in rng.uniform([-600, -600, 200], [600, 600, 1800], (10, 3)):
            vector, _ = cv2.Rodrigues(camera.rotation)
            pixel, _ = cv2.projectPoints(point[None], vector, camera.translation, camera.matrix, np.zeros(5))
            u, v = (pixel.ravel() + 0.5) / (camera.width, camera.height)
            expected = [(u, v), (1 - v, u), (1 - u, 1 - v), (v, 1 - u)][turns]
            np.testing.assert_allclose(seen_on_plane(camera, point), expected, atol=1e-9)


def test_the_turned_picture_is_upright_for_a_camera_lying_on_its_side(cameras: tuple[Camera, ...]) -> None:
    plane = picture_plane(cameras[3])
    assert cameras[3].quarter_turns == 1
    assert plane.up[2] > 0.8
    assert plane.size[0] < plane.size[1], "a picture on its side stands when it is turned"


def test_a_quarter_turn_moves_pixels_as_turning_the_picture_does() -> None:
    picture = np.zeros((3, 5, 3), dtype=np.uint8)
    picture[0, 4] = 255
    hung = upright(picture, 1)
    assert hung.shape == (5, 3, 3)
    assert hung[4, 2].all(), "the right end of the top row becomes the lower end of the right column"
    np.testing.assert_array_equal(clockwise_turn(1) @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    np.testing.assert_array_equal(clockwise_turn(5), clockwise_turn(1))


def test_the_lens_is_taken_out_of_the_picture(cameras: tuple[Camera, ...]) -> None:
    camera = cameras[0]
    point = np.array([700.0, -1300.0, 1700.0])
    vector, _ = cv2.Rodrigues(camera.rotation)
    bent, _ = cv2.projectPoints(point[None], vector, camera.translation, camera.matrix, camera.distortion)
    straight, _ = cv2.projectPoints(point[None], vector, camera.translation, camera.matrix, np.zeros(5))
    picture = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
    u, v = bent.ravel()
    cv2.circle(picture, (round(u), round(v)), 5, (255, 255, 255), -1)
    result = straight_picture(camera, camera.width, camera.width)(picture)
    rows, columns = np.nonzero(result[:, :, 0] > 127)
    found = np.array([columns.mean(), rows.mean()])
    # The dot's centre was rounded to a pixel, and the map is sampled at pixels: one pixel in all.
    assert np.linalg.norm(found - straight.ravel()) < 1.0
    assert np.linalg.norm(bent - straight) > 1.5, "a lens that bends nothing would test nothing"


def test_pictures_arrive_small(cameras: tuple[Camera, ...]) -> None:
    small = straight_picture(cameras[3], 320, 160)(np.full((240, 320, 3), 200, dtype=np.uint8))
    assert small.shape == (160, 120, 3)


def test_a_viewer_sees_the_whole_picture_whatever_the_window(cameras: tuple[Camera, ...]) -> None:
    plane = picture_plane(cameras[0])
    for aspect in (0.5, 1.0, 2.5):
        half = np.tan(plane.field_of_view(aspect) / 2.0)
        assert half >= max(abs(plane.top), abs(plane.bottom))
        assert half * aspect >= max(abs(plane.left), abs(plane.right))


def test_the_frustum_reaches_from_the_centre_to_the_corners(cameras: tuple[Camera, ...]) -> None:
    plane = picture_plane(cameras[1])
    mesh = frustum_mesh(plane, depth=1.0, bar=1e-4)
    for corner in (np.zeros(3), *plane.corners):
        assert np.linalg.norm(mesh.vertices - corner, axis=1).min() < 1e-4
