"""Training material: its amount, its variation, and that it stays within the body's limits."""

import itertools

import numpy as np
import pytest
from moving_bodies import swinging

from studio.body.catalogue import load_body
from studio.foundations.errors import SettingsError
from studio.foundations.knobs import changed
from studio.runs.learning.oversampling import OversamplingSettings, oversampled, performed, smoothed_copies

BODY = load_body("human25")
POSES = swinging(BODY, 120, 30.0)
LOWER = np.array([entry.lower for entry in BODY.parameters])
UPPER = np.array([entry.upper for entry in BODY.parameters])


def test_every_performance_is_used_once_a_smoothing() -> None:
    settings = changed(OversamplingSettings(), {"performances": 3, "smoothings": 4})
    made = oversampled(BODY, POSES, 30.0, settings, np.random.default_rng(1))
    assert len(made) == 12
    np.testing.assert_array_equal(made[0], POSES)
    assert all(len(made[4 * group]) == len(made[4 * group + 1]) + 1 for group in range(3))
    total = sum(map(len, made))
    assert abs(total - 12 * 120) < 0.15 * 12 * 120
    again = oversampled(BODY, POSES, 30.0, settings, np.random.default_rng(1))
    assert all(np.array_equal(one, other) for one, other in zip(made, again, strict=True))


def test_smoothings_are_stronger_and_later_each_time() -> None:
    noisy = POSES + 0.01 * np.random.default_rng(2).standard_normal(POSES.shape)
    made = smoothed_copies(BODY, noisy, 30.0, OversamplingSettings())
    roughness = [np.abs(np.diff(poses[:, 6:], 2, axis=0)).mean() for poses in made]
    assert all(later < 0.95 * sooner for sooner, later in itertools.pairwise(roughness[1:]))
    assert roughness[-1] < 0.3 * roughness[0]
    quiet = smoothed_copies(BODY, POSES, 30.0, changed(OversamplingSettings(), {"widest_smoothing": 0.0}))
    fine = swinging(BODY, 600, 150.0)
    for number in range(1, 5):
        np.testing.assert_allclose(quiet[number][2:-2], fine[number::5][2:117], atol=0.5)
        np.testing.assert_allclose(quiet[number][2:-2, 6:], fine[number::5][2:117, 6:], atol=1e-3)


def test_another_performance_is_like_the_first_and_within_the_limits() -> None:
    rng = np.random.default_rng(5)
    made = [performed(BODY, POSES, 30.0, OversamplingSettings(), rng) for _ in range(6)]
    assert len({len(poses) for poses in made}) > 2
    for poses in made:
        assert np.all((poses >= LOWER) & (poses <= UPPER))
        first = np.degrees(poses[0, 6:] - POSES[0, 6:])
        assert 0.5 < np.sqrt(np.mean(first**2)) < 12.0
        assert np.degrees(np.abs(np.diff(poses[:, 6:], axis=0)).max()) < 8.0
        np.testing.assert_allclose(poses[:, :3].max(axis=0), POSES[:, :3].max(axis=0), atol=2.0)


def test_without_changes_a_performance_is_the_recording() -> None:
    settings = changed(OversamplingSettings(), {"tempo_change": 0.0, "angle_change": 0.0})
    made = performed(BODY, POSES, 30.0, settings, np.random.default_rng(1))
    np.testing.assert_allclose(made, POSES, atol=1e-9)


def test_invalid_settings_are_refused() -> None:
    for name, value in (("performances", 0), ("smoothings", 2.5), ("tempo_change", -0.1)):
        with pytest.raises(SettingsError, match=name):
            changed(OversamplingSettings(), {name: value})
