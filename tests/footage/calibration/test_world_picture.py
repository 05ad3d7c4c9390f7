"""The world drawn over a picture: a pole of the subject's size, beside which the grid can be read."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from studio.body.catalogue import load_body
from studio.footage.calibration.world_picture import GREY, RED, WHITE, grid_step, world_picture
from studio.foundations.geometry.camera import Camera
from studio.operations.calibration_views import pole_of
from studio.results.drawing_footage.cameras import placed_camera


def camera_before(pole: float) -> Camera:
    """A camera from which a pole of so many mm is half as high as the picture."""
    place = (2.0 * pole, -1.0 * pole, 1.0 * pole)
    return placed_camera("cam1", place, (0.0, 0.0, 0.4 * pole), size=(640, 480), focal_px=600.0)


@pytest.mark.parametrize(
    ("pole", "step"), [(1800.0, 500.0), (150.0, 20.0), (180.0, 50.0), (90.0, 20.0), (5.0, 1.0)]
)
def test_the_grid_has_round_steps(pole: float, step: float) -> None:
    assert grid_step(pole) == pytest.approx(step)


def test_a_small_world_looks_as_a_large_one_does() -> None:
    """Lengths, places and the nearest that is drawn shrink together: only the pole's words differ."""
    empty = np.zeros((480, 640, 3), np.uint8)
    large = world_picture(empty, camera_before(1800.0), height=480)
    small = world_picture(empty, camera_before(18.0), height=480, pole=18.0)
    for colour in (GREY, RED, WHITE):
        assert np.all(large == colour, axis=2).any()
    differs = np.any(large != small, axis=2)
    assert 0 < differs.sum() < 0.005 * differs.size


@pytest.mark.parametrize(("name", "pole"), [("human35", 1800.0), ("dog", 1800.0)])
def test_bodies_of_a_persons_size_have_a_persons_pole(name: str, pole: float) -> None:
    assert pole_of(cast(Any, SimpleNamespace(body=lambda: load_body(name)))) == pole


def test_a_mouse_has_a_mouses_pole() -> None:
    assert 50.0 <= pole_of(cast(Any, SimpleNamespace(body=lambda: load_body("mouse31")))) <= 200.0
