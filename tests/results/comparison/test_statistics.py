"""Intervals and verdicts, against closed forms and scipy."""

import math

import numpy as np
import pytest
from scipy import stats

from studio.results.comparison.statistics import (
    EQUAL_WITHIN,
    ONE_SIDED,
    bootstrap_interval,
    equal_to,
    firmness,
    number,
    overall,
    ratio_interval,
    ratio_number,
    sign_test,
    verdict_of,
)


def test_the_interval_of_a_mean_is_close_to_students_and_repeatable() -> None:
    values = np.random.default_rng(1).normal(50.0, 4.0, 40).tolist()
    low, high = bootstrap_interval(values)
    exact = stats.t.interval(0.95, 39, np.mean(values), stats.sem(values))
    assert (low, high) == pytest.approx(exact, abs=0.25)
    assert (low, high) == bootstrap_interval(values)


def test_the_interval_has_its_nominal_coverage() -> None:
    rng = np.random.default_rng(7)
    covered = sum(
        low <= 1.0 <= high for low, high in (bootstrap_interval(rng.exponential(1.0, 20)) for _ in range(150))
    )
    assert 0.86 * 150 <= covered <= 0.99 * 150


@pytest.mark.parametrize(
    ("values", "expected"), [([3.0], (3.0, 3.0)), ([2.0] * 5, (2.0, 2.0)), ([], (math.nan, math.nan))]
)
def test_degenerate_samples(values: list[float], expected: tuple[float, float]) -> None:
    assert bootstrap_interval(values) == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize("statistic", [np.median, np.max, lambda sample: float(np.ptp(sample))])
def test_any_statistic_has_an_interval(statistic) -> None:
    low, high = bootstrap_interval([1.0, 1.0, 1.0, 1.0, 9.0], statistic)
    assert math.isfinite(low)
    assert low <= high


def test_a_ratio_is_paired() -> None:
    theirs = np.random.default_rng(3).uniform(1.0, 100.0, 12)
    low, high = ratio_interval((2.0 * theirs).tolist(), theirs.tolist())
    assert low == pytest.approx(2.0)
    assert high == pytest.approx(2.0)
    shuffled = ratio_interval((2.0 * theirs[::-1]).tolist(), theirs.tolist())
    assert shuffled[0] < 1.9 < 2.1 < shuffled[1]
    with pytest.raises(ValueError, match="paired"):
        ratio_interval([1.0, 2.0], [1.0])


def test_the_sign_test_is_scipys_without_ties() -> None:
    ours, theirs = [1, 2, 3, 4, 9, 5, 1], [2, 3, 4, 5, 1, 5, 2]
    assert sign_test(ours, theirs) == (5, 1, 1, pytest.approx(stats.binomtest(5, 6).pvalue))
    assert sign_test([1.0], [1.0]) == (0, 0, 1, 1.0)


def test_the_verdict_follows_the_interval() -> None:
    wide, tested = (1.0, 2.0), (1.1, 1.9)
    assert verdict_of(wide, tested, None) == "answered"
    assert verdict_of(wide, tested, 3.0, "lower") == "better"
    assert verdict_of(wide, tested, 3.0, "higher") == "not reproduced"
    assert verdict_of(wide, tested, 0.5, "higher") == "better"
    assert verdict_of(wide, tested, 0.5) == "not reproduced"
    nothing = (math.nan, math.nan)
    assert verdict_of(nothing, nothing, 0.5, "lower") == "not reproduced"
    with pytest.raises(ValueError, match="smaller"):
        verdict_of(wide, tested, 0.5, "smaller")


def test_equality_is_shown_within_a_margin_and_not_by_scatter() -> None:
    """A wide interval around the paper's value shows nothing; a narrow one beside it is equal to it."""
    assert EQUAL_WITHIN == 0.1
    assert verdict_of((0.5, 1.6), (0.6, 1.5), 1.0) == "undecided"
    assert verdict_of((1.02, 1.06), (1.03, 1.05), 1.0) == "reproduced"
    assert verdict_of((1.02, 1.2), (1.03, 1.15), 1.0) == "not reproduced"
    # The margin is a ratio, the same on both sides, and the 90 % interval is tested against it.
    assert verdict_of((0.90, 1.12), (0.92, 1.09), 1.0) == "reproduced"
    assert verdict_of((0.90, 1.12), (0.90, 1.09), 1.0) == "undecided"
    # Where less is better only the worse margin counts.
    assert verdict_of((0.5, 1.1), (0.6, 1.05), 1.0, "lower") == "reproduced"
    assert verdict_of((0.5, 1.3), (0.6, 1.2), 1.0, "lower") == "undecided"
    assert verdict_of((0.85, 1.6), (0.95, 1.5), 1.0, "higher") == "reproduced"
    assert equal_to(-2.0) == (-2.2, pytest.approx(-2.0 / 1.1))


def test_the_tested_interval_is_that_of_two_one_sided_tests() -> None:
    values = np.random.default_rng(3).normal(1.0, 0.1, 30)
    low, high = bootstrap_interval(values, level=ONE_SIDED)
    t = stats.t.ppf(0.95, 29) * values.std(ddof=1) / np.sqrt(30)
    assert low == pytest.approx(values.mean() - t, abs=0.01)
    assert high == pytest.approx(values.mean() + t, abs=0.01)
    margin = equal_to(1.0)
    shown = (
        stats.ttest_1samp(values, margin[0], alternative="greater").pvalue < 0.05
        and stats.ttest_1samp(values, margin[1], alternative="less").pvalue < 0.05
    )
    assert number("n", values, paper=1.0).verdict == ("reproduced" if shown else "undecided")
    assert number("n", values[:3], paper=1.0).verdict == "undecided"


def test_a_number_counts_the_seeds_that_gave_one() -> None:
    found = number("mean error", [30.0, 40.0, 50.0, math.inf], "mm", paper=38.0, better="lower")
    assert (found.ours, found.seeds, found.verdict) == (40.0, 3, "undecided")
    assert found.low < 38.0 < found.high
    assert number("none", [math.nan], paper=1.0).verdict == "not reproduced"
    assert number("worst", [1.0, 5.0], statistic=np.max).ours == 5.0
    ratio = ratio_number("saving", [4.0, 8.0, math.nan], [2.0, 4.0, 1.0], paper=2.0)
    assert (ratio.ours, ratio.seeds, ratio.verdict) == (2.0, 2, "reproduced")


def test_the_whole_is_as_good_as_its_worst() -> None:
    assert overall([]) == "answered"
    assert overall(["answered", "better"]) == "better"
    assert overall(["reproduced", "better"]) == "reproduced"
    assert overall(["reproduced", "undecided", "better"]) == "undecided"
    assert overall(["reproduced", "not reproduced", "undecided"]) == "not reproduced"


def test_few_seeds_are_reported() -> None:
    assert firmness(10) == ""
    assert firmness(3) == "not firm: 3 seeds of at least 10"
