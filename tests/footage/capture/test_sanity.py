"""Upright display, and where cameras look."""

import dataclasses

import numpy as np
import pytest
from toy_footage import looking_at, rig

from studio.footage.capture.sanity import common_target, quarter_turns
from studio.foundations.geometry.projection import project


@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize("lean", [-0.6, 0.0, 0.6])
def test_the_shown_picture_has_up_upwards(quarters: int, lean: float) -> None:
    camera = looking_at("c", (3000.0, 500.0, 2500.0), (0.0, 0.0, 900.0), roll=quarters * np.pi / 2 + lean)
    feet_and_head = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1800.0]])
    (foot, head), _ = project(camera, feet_and_head)
    marked = np.zeros((camera.height, camera.width), int)
    for value, pixel in ((1, foot), (2, head)):
        across, down = np.clip(np.round(pixel).astype(int), 0, [camera.width - 1, camera.height - 1])
        marked[down, across] = value
    # numpy turns counter-clockwise for positive k; quarter_turns are clockwise.
    shown = np.rot90(marked, -quarter_turns(camera))
    (foot_row, foot_column), (head_row, head_column) = np.argwhere(shown == 1)[0], np.argwhere(shown == 2)[0]
    assert foot_row - head_row > abs(foot_column - head_column)


def test_a_camera_that_looks_straight_down_is_not_turned() -> None:
    camera = dataclasses.replace(rig(1)[0], rotation=np.diag([1.0, -1.0, -1.0]))
    assert quarter_turns(camera) == 0


def test_a_good_rig_looks_at_its_target() -> None:
    target = common_target(rig(4))
    assert target is not None
    np.testing.assert_allclose(target, [0.0, 0.0, 1000.0], atol=1e-6)
