"""The baseline is fair: its scale is chosen, kept, and gives the posterior of theory."""

import numpy as np
import pytest
from toy_problems import Bowl, toy_space

from studio.search.trackers.condensation import SCALES, Condensation
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.settings import CondensationSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, ParticleSet

TRACKER = Condensation()


def track(
    centres: np.ndarray, settings: CondensationSettings, width: float, count: int
) -> tuple[list[LayerRecord], list[FilterState]]:
    """Follow a bowl whose centre moves; one record a frame, and each frame's final state."""
    carried = [FilterState(ParticleSet(np.zeros((1, count)), np.zeros(1)))]
    records: list[LayerRecord] = []
    for frame, centre in enumerate(centres):
        result = search_frame(
            TRACKER,
            Bowl(centre, width),
            carried[-1],
            toy_space(count, limit=1e6),
            seed=3,
            frame=frame,
            settings_source=lambda: (1, settings),
            on_layer=records.append,
        )
        carried.append(result.carried)
    return records, carried


@pytest.mark.parametrize("width", [0.01, 1.0, 100.0])
def test_scale_lets_a_share_survive_whatever_the_weighting(width: float) -> None:
    settings = CondensationSettings(particles=500)
    records, carried = track(0.1 * np.random.default_rng(0).normal(size=(30, 8)), settings, width, 8)
    chosen, later = records[:5], records[5:]
    assert [record.alpha_reached for record in chosen] == pytest.approx([0.1] * 5)
    scale = np.exp(np.mean(np.log([record.beta for record in chosen])))
    assert [record.beta for record in later] == pytest.approx([scale] * 25)
    assert all(np.isnan(record.alpha_wanted) for record in later)
    assert np.mean([0.05 <= record.alpha_reached <= 0.2 for record in later]) >= 0.9
    last = carried[-1].particles
    assert len(last.extra[SCALES]) == 5


def test_posterior_is_the_kalman_filters() -> None:
    # Random walk of variance q a frame, likelihood exp(-β (x - z)²): Gaussian, so a Kalman filter is exact.
    measured = np.cumsum(np.random.default_rng(5).normal(size=(12, 2)) * 0.3, axis=0)
    records, _ = track(measured, CondensationSettings(particles=20000), 1.0, 2)
    mean, variance, process = np.zeros(2), 0.0, 0.09
    for record, seen in zip(records, measured, strict=True):
        predicted, noise = variance + process, 1.0 / (2.0 * record.beta)
        gain = predicted / (predicted + noise)
        mean, variance = mean + gain * (seen - mean), (1.0 - gain) * predicted
        effective = record.alpha_reached * len(record.poses)
        # Errors of earlier frames are carried on, hence six and not three standard errors.
        assert np.all(np.abs(record.mean - mean) < 6 * np.sqrt(variance / effective))
        assert np.allclose(record.variance_resampled, variance, rtol=6 * np.sqrt(2 / effective))


def test_a_frame_is_one_layer_of_all_particles() -> None:
    settings = CondensationSettings(particles=123)
    records, _ = track(np.zeros((2, 3)), settings, 1.0, 3)
    assert [len(record.poses) for record in records] == [123, 123]
    assert TRACKER.layer_count(settings) == 1
