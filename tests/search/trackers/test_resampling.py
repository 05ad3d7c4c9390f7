"""Draws have the right expectation, the right spread, and never take a particle without weight."""

import numpy as np
import pytest
from scipy import stats

from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.resampling import draw, draw_others, equal_draw

WEIGHTS = np.array([0.02, 0.0, 0.33, 0.15, 0.4, 0.1])


@pytest.mark.parametrize("seed", range(5))
def test_multinomial_counts_fit_the_weights(seed: int) -> None:
    drawn = draw(RandomNumbers(seed, 0, 0), WEIGHTS, 20000, "multinomial")
    counts = np.bincount(drawn, minlength=len(WEIGHTS))
    heavy = WEIGHTS > 0
    assert counts[~heavy].sum() == 0
    assert stats.chisquare(counts[heavy], 20000 * WEIGHTS[heavy]).pvalue > 1e-3


@pytest.mark.parametrize("count", [7, 100, 999])
def test_systematic_counts_are_the_expectation_rounded(count: int) -> None:
    for seed in range(20):
        drawn = draw(RandomNumbers(seed, 0, 0), WEIGHTS, count, "systematic")
        counts = np.bincount(drawn, minlength=len(WEIGHTS))
        assert np.all(counts >= np.floor(count * WEIGHTS - 1e-9))
        assert np.all(counts <= np.ceil(count * WEIGHTS + 1e-9))


def test_systematic_draw_is_unbiased() -> None:
    count, repeats = 10, 4000
    total = np.zeros(len(WEIGHTS))
    for seed in range(repeats):
        drawn = draw(RandomNumbers(seed, 0, 0), WEIGHTS, count, "systematic")
        total += np.bincount(drawn, minlength=len(WEIGHTS))
    # One draw's count varies by less than 1/2, so the mean's standard error is below 0.5 / sqrt(repeats).
    assert np.allclose(total / repeats, count * WEIGHTS, atol=4 * 0.5 / np.sqrt(repeats))


def test_systematic_draw_keeps_more_distinct_survivors() -> None:
    weights = np.random.default_rng(1).exponential(size=200)
    weights /= weights.sum()
    distinct = {
        scheme: np.mean(
            [len(np.unique(draw(RandomNumbers(seed, 0, 0), weights, 200, scheme))) for seed in range(50)]
        )
        for scheme in ("systematic", "multinomial")
    }
    assert distinct["systematic"] > distinct["multinomial"] + 5


@pytest.mark.parametrize("scheme", ["systematic", "multinomial"])
def test_particles_without_weight_are_never_drawn(scheme: str) -> None:
    weights = np.array([0.0, 1.0, 0.0])
    for seed in range(50):
        assert np.all(draw(RandomNumbers(seed, 0, 0), weights, 33, scheme) == 1)
    # Ten tenths sum to less than one: the rounding left over belongs to the last weight that is not zero.
    tenths = np.append(np.full(10, 0.1), 0.0)
    assert draw(RandomNumbers(0, 0, 0), tenths, 5000, scheme).max() == 9


def test_second_parents_are_drawn_one_by_one_and_independent_of_the_first() -> None:
    numbers, count = RandomNumbers(3, 0, 0), 20000
    for scheme in ("systematic", "multinomial"):
        first, second = draw(numbers, WEIGHTS, count, scheme), draw_others(numbers, WEIGHTS, count)
        both = np.histogram2d(first, second, bins=[np.arange(len(WEIGHTS) + 1)] * 2)[0]
        heavy = WEIGHTS > 0
        expected = count * np.outer(WEIGHTS[heavy], WEIGHTS[heavy])
        assert stats.chisquare(both[np.ix_(heavy, heavy)].ravel(), expected.ravel()).pvalue > 1e-3
        assert both.sum() == both[np.ix_(heavy, heavy)].sum()


def test_equal_draw_takes_each_as_often() -> None:
    assert np.array_equal(equal_draw(5, 5), np.arange(5))
    assert np.array_equal(np.bincount(equal_draw(4, 12)), [3, 3, 3, 3])
    assert np.bincount(equal_draw(7, 3), minlength=7).max() == 1
    assert set(np.bincount(equal_draw(3, 10))) == {3, 4}
