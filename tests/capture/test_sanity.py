"""Upright display and doubts in words."""

import dataclasses

import numpy as np
import pytest
from toy_footage import looking_at, rig

from studio.capture.sanity import common_target, quarter_turns, sanity_notes
from studio.geometry.projection import project


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


def test_a_good_rig_raises_no_doubt_and_looks_at_its_target() -> None:
    assert sanity_notes(rig(4)) == ()
    target = common_target(rig(4))
    assert target is not None
    np.testing.assert_allclose(target, [0.0, 0.0, 1000.0], atol=1e-6)


def test_doubts_in_words() -> None:
    under = looking_at("low", (3000.0, 0.0, -500.0), (0.0, 0.0, 1000.0))
    assert "low lies under the floor" in sanity_notes((*rig(2), under))[0]
    away = looking_at("stray", (0.0, -3000.0, 1500.0), (0.0, -9000.0, 1000.0))
    assert any("stray" in note and "does not look" in note for note in sanity_notes((*rig(4), away)))
    tiny = [dataclasses.replace(c, translation=c.translation * 1e-3) for c in rig(3)]
    assert any("unit" in note for note in sanity_notes(tuple(tiny)))
