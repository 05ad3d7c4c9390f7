"""From where a body is looked at: always all of it or a way back."""

import numpy as np
import pytest
from swaying_session import swaying_pose

from studio.app.scene.viewpoint import (
    FILLED,
    WIDEST,
    Preset,
    between,
    direction,
    facing,
    framed,
    is_in_sight,
    is_well_framed,
    on_screen,
    zoomed,
)
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel

FOV, ASPECT = 0.85, 2.0


@pytest.fixture(scope="module")
def ends(human: BodyModel) -> np.ndarray:
    return limb_ends(human, swaying_pose(human, 2))[0] / 1000.0


@pytest.mark.parametrize("toward", [(1.0, 0.2, 0.3), (-1.0, -2.0, 0.0), (0.1, 0.0, 1.5)])
@pytest.mark.parametrize("aspect", [2.0, 0.6])
def test_a_framed_body_is_seen_whole_and_large(
    ends: np.ndarray, toward: tuple[float, float, float], aspect: float
) -> None:
    points = ends.reshape(-1, 3)
    eye = framed(points, np.array(toward), FOV, aspect)
    seen = on_screen(points, eye, FOV, aspect)
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    np.testing.assert_allclose((low + high) / 2.0, 0.5, atol=0.06)
    filled = max((high[1] - low[1]) / FILLED, (high[0] - low[0]) / WIDEST)
    assert filled == pytest.approx(1.0, abs=0.01) if toward[2] < 1.0 else 0.1 < filled <= 1.01
    assert seen[:, 2].min() > 0.3, "from above the head is not in the eye"
    assert is_in_sight(points, eye, FOV, aspect)
    assert is_well_framed(points, eye, FOV, aspect) == (high[1] - low[1] >= 0.6)


def test_presets_see_a_person_from_front_left_and_above(human: BodyModel, ends: np.ndarray) -> None:
    forward = facing(human, ends)
    sides = [
        np.mean([ends[at] for at, limb in enumerate(human.drawn) if limb.side == side], axis=(0, 1))
        for side in ("left", "right")
    ]
    ways: dict[Preset, np.ndarray] = {name: direction(name, human, ends) for name in ("front", "side", "top")}
    assert ways["front"] @ forward > 0.9
    assert abs(ways["side"] @ forward) < 1e-9
    assert ways["top"][2] > 0.99
    seen = on_screen(np.stack(sides), framed(ends.reshape(-1, 3), ways["front"], FOV, ASPECT), FOV, ASPECT)
    assert seen[0, 0] > seen[1, 0], "whoever faces us has the left hand on our right"


def test_an_eased_way_begins_and_ends_where_it_should_and_keeps_its_distance() -> None:
    one, other = (3.0, 0.0, 1.0, 0.0, 0.0, 1.0), (-0.1, 3.0, 1.0, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(between(one, other, 0.0), one, atol=1e-9)
    np.testing.assert_allclose(between(one, other, 1.0), other, atol=1e-9)
    middle = np.array(between(one, other, 0.5))
    assert np.linalg.norm(middle[:3] - middle[3:]) == pytest.approx(3.0, abs=0.02), "about what is looked at"


def test_a_zoom_goes_to_what_is_under_the_pointer_and_never_loses_the_body(ends: np.ndarray) -> None:
    points = ends.reshape(-1, 3)
    eye = framed(points, np.array([1.0, 0.4, 0.3]), FOV, ASPECT)
    hand = points[np.argmax(on_screen(points, eye, FOV, ASPECT)[:, 1])]
    across, down, _ = map(float, on_screen(hand[None], eye, FOV, ASPECT)[0])
    nearer = zoomed(eye, 0.6, (across, down), FOV, ASPECT, points)
    np.testing.assert_allclose(on_screen(hand[None], nearer, FOV, ASPECT)[0, :2], [across, down], atol=0.06)
    for at in ((0.02, 0.02), (0.98, 0.5), (0.5, 0.98)):
        lost = eye
        for _ in range(60):
            lost = zoomed(lost, 0.8, at, FOV, ASPECT, points)
        for _ in range(80):
            lost = zoomed(lost, 1.25, at, FOV, ASPECT, points)
        assert is_in_sight(points, lost, FOV, ASPECT), f"at {at}"
        distance = np.linalg.norm(np.array(lost[:3]) - np.array(lost[3:]))
        assert distance < 12.0 * np.ptp(points, axis=0).max()
