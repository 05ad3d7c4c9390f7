"""Paths that change direction."""

import numpy as np
import pytest

from studio.results.drawing_footage.gait import Journey, Stretch


def test_a_turn_on_the_spot_stays_and_turns_by_the_whole_angle() -> None:
    way = Journey((100.0, 200.0), 0.5, (Stretch(1500.0), Stretch(1200.0, turn=np.pi, onward=0.0)), ease=90.0)
    distance = np.linspace(-500.0, 4500.0, 2001)
    place, heading = way(distance)
    start, first = way(np.zeros(1))
    np.testing.assert_allclose(start[0], [100.0, 200.0], atol=0.1)
    assert first[0] == pytest.approx(0.5, abs=1e-6)
    assert heading[-1] == pytest.approx(0.5 + np.pi, abs=1e-6)
    assert np.all(np.diff(heading) >= -1e-12)
    spot = np.array([100.0, 200.0]) + 1500.0 * np.array([np.cos(0.5), np.sin(0.5)])
    turning = (distance > 1800.0) & (distance < 2400.0)
    assert np.linalg.norm(place[turning] - spot, axis=1).max() < 15.0
    assert way.pace(distance)[turning].max() < 0.01
    # Back on the same path: as far from the start as it has moved since.
    back = place[-1] - spot
    np.testing.assert_allclose(back, -1800.0 * np.array([np.cos(0.5), np.sin(0.5)]), atol=20.0)


def test_a_bend_is_an_arc_at_full_speed() -> None:
    length = 1000.0 * np.pi / 2.0
    way = Journey((0.0, 0.0), 0.0, (Stretch(length, turn=np.pi / 2.0),), ease=1.0)
    place, heading = way(np.linspace(0.0, length, 200))
    np.testing.assert_allclose(np.linalg.norm(place - [0.0, 1000.0], axis=1), 1000.0, atol=5.0)
    assert heading[-1] == pytest.approx(np.pi / 2.0, abs=0.01)
    assert way.pace(np.array([500.0]))[0] == pytest.approx(1.0)
