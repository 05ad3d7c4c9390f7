"""Footage of nearly the calibrated size."""

import dataclasses

import cv2
import numpy as np
import pytest
from toy_footage import rig

from studio.footage.capture.footage_fit import black_margins, fit_camera
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.projection import project

CAMERA = dataclasses.replace(
    rig(1)[0],
    width=1088,
    height=1920,
    matrix=np.array([[1681.0, 0.0, 533.0], [0.0, 1681.0, 948.0], [0.0, 0.0, 1.0]]),
)
POINT = np.array([[100.0, 50.0, 700.0]])


def spot(pixel: np.ndarray, width: int = 1088, height: int = 1920) -> np.ndarray:
    """A grey picture with a soft bright spot at a pixel."""
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    light = 150.0 * np.exp(-((x - pixel[0]) ** 2 + (y - pixel[1]) ** 2) / (2.0 * 6.0**2))
    return np.repeat((100.0 + light)[:, :, None], 3, axis=2).round().astype(np.uint8)


def centre_of(picture: np.ndarray) -> np.ndarray:
    """Where the spot is: the centre of gravity of the light above 120."""
    light = np.maximum(picture[:, :, 0].astype(float) - 120.0, 0.0)
    y, x = np.indices(light.shape)
    return np.array([(x * light).sum(), (y * light).sum()]) / light.sum()


def test_the_calibrated_size_changes_nothing() -> None:
    camera, crop = fit_camera(CAMERA, 1088, 1920)
    assert camera is CAMERA
    assert crop is None


def test_a_centred_crop_moves_the_principal_point() -> None:
    (pixel,), _ = project(CAMERA, POINT)
    cropped = spot(pixel)[:, 4:-4]
    camera, crop = fit_camera(CAMERA, 1080, 1920, black_margins(lambda _: cropped, 1))
    (moved,), _ = project(camera, POINT)
    np.testing.assert_allclose(moved, centre_of(cropped), atol=0.05)
    assert (crop.left, crop.right, crop.top, crop.scale) == (4.0, 4.0, 0.0, 1.0)
    assert camera.matrix[0, 2] == CAMERA.matrix[0, 2] - 4.0
    assert "4 px at the left" in crop.words("c")


def test_a_picture_shrunk_between_bars_is_scaled() -> None:
    (pixel,), _ = project(CAMERA, POINT)
    shrunk = cv2.resize(spot(pixel), (1080, 1906), interpolation=cv2.INTER_AREA)
    footage = cv2.copyMakeBorder(shrunk, 7, 7, 0, 0, cv2.BORDER_CONSTANT)
    bars = black_margins(lambda _: footage, 1)
    assert bars == (0, 7, 0, 7)
    camera, crop = fit_camera(CAMERA, 1080, 1920, bars)
    (moved,), _ = project(camera, POINT)
    np.testing.assert_allclose(moved, centre_of(footage), atol=0.1)
    assert crop.scale == pytest.approx(1080 / 1088)


def test_a_dark_scene_is_no_bar() -> None:
    dark = np.full((200, 100, 3), 12, np.uint8)
    dark[90:110, 40:60] = 200
    assert black_margins(lambda _: dark, 1) == (0, 0, 0, 0)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        ((1060, 1920), "2.6%"),
        ((1088, 1870), "2.6%"),
        ((1920, 1088), "lies on its side"),
        ((544, 960), "50.0%"),
    ],
)
def test_another_size_is_refused(size: tuple[int, int], message: str) -> None:
    with pytest.raises(CalibrationError) as caught:
        fit_camera(CAMERA, *size)
    assert message in caught.value.message
    assert "1088x1920" in caught.value.message
