"""Whether a cloud is a posterior: ranks of the truth, their band, and the measurement on the bundled walk."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from studio.garden.reproduction.open_questions import posterior
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import plain
from studio.results.comparison.trials import Outcome, Scale

SAMPLES = Path(__file__).parents[3] / "sample_sessions"


def test_ranks_of_a_truth_that_is_drawn_like_the_cloud_are_uniform() -> None:
    rng = np.random.default_rng(1)
    ranks = np.array(
        [
            [posterior.rank(rng.normal(size=200), np.full(200, 0.005), float(rng.normal(scale=scale)))]
            for scale in [1.0] * 300
        ]
    )
    assert stats.kstest(ranks[:, 0], "uniform").pvalue > 0.01
    assert posterior.inside(ranks)
    narrow = np.array(
        [
            [posterior.rank(0.3 * rng.normal(size=200), np.full(200, 0.005), float(rng.normal()))]
            for _ in range(300)
        ]
    )
    assert not posterior.inside(narrow)


def test_a_rank_is_weighted_and_halves_what_is_equal() -> None:
    values, weights = np.array([1.0, 2.0, 3.0]), np.array([0.5, 0.3, 0.2])
    assert posterior.rank(values, weights, 2.5) == pytest.approx(0.8)
    assert posterior.rank(values, weights, 2.0) == pytest.approx(0.65)
    assert posterior.rank(values, 10.0 * weights, 9.0) == pytest.approx(1.0)


def test_the_band_has_its_level() -> None:
    """Uniform ranks leave it in at most 5 % of the cases."""
    rng = np.random.default_rng(2)
    left = [not posterior.inside(rng.random((60, 1))) for _ in range(2000)]
    assert 0.01 < np.mean(left) < 0.06


def test_a_factor_makes_spreads_right_in_95_of_100_cases() -> None:
    errors = np.random.default_rng(3).normal(scale=4.0, size=(4000, 2))
    times = posterior.factor(errors**2)
    assert times == pytest.approx(4.0, rel=0.05)
    assert np.mean(errors**2 > times**2 * posterior.NORMAL_95) == pytest.approx(0.05, abs=0.002)


@pytest.mark.slow
@pytest.mark.parametrize("tracker", [0, 2, 3])
def test_a_tracker_is_measured_layer_by_layer(tracker: int) -> None:
    cache = FootageCache(SAMPLES)
    one = posterior.CANDIDATES[tracker]
    trial = next(
        trial
        for trial in posterior.trials(Scale((0,), quick=True))
        if trial.label.startswith(f"{one.name} on")
    )
    arguments = json.loads(json.dumps(trial.arguments))
    arguments |= {"last": 11, "changes": {**one.attempt("walk", 0, 200).changes}}
    found = json.loads(json.dumps(plain(posterior.measure(arguments, cache))))
    names = list(found["layers"])
    assert posterior.LAST in names
    assert (posterior.AT_ONE in names) == (tracker != 3)
    if tracker == 0:
        assert len(names) == 11
        first, last = found["layers"]["layer 1"], found["layers"][posterior.LAST]
        # A cloud that draws together leaves the truth in its tails.
        assert np.median(last["squares"]) > np.median(first["squares"])
    for layer in found["layers"].values():
        assert np.shape(layer["ranks"]) == (2, len(found["parameters"]))
        assert 0.0 <= np.min(layer["ranks"]) <= np.max(layer["ranks"]) <= 1.0
        assert layer["particles"] >= 1.0
    parts = list(posterior.shown([Outcome(trial, found)]))
    assert len(parts) > 5
    cache.close()
