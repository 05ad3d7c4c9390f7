"""Intervals, tests and verdicts on numbers over several seeds.

The verdict's rule, for a value that the paper prints. "better" where the bootstrap 95 % interval over the seeds lies
wholly on the better side of it. "reproduced" where two one-sided tests show equality within EQUAL_WITHIN: the 90 %
interval, whose ends are those of two tests at 5 % (Schuirmann 1987), lies between the margins; where one side is better
the test against the worse margin alone (no worse than the paper). "not reproduced" where the 95 % interval leaves the
paper's value out. Else "undecided": too few seeds for so wide a scatter. A narrow interval beside the paper's value is
thus equal to it, and a wide one around it shows nothing. A verdict is firm with FIRM_SEEDS seeds or more.
"""

import math
import warnings
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import scipy  # stats, half a second, are loaded once they are used
from numpy.typing import ArrayLike

from studio.foundations.arrays import Array
from studio.foundations.words import counted
from studio.results.comparison.findings import FIRM_SEEDS, Number

HARDEST_FIRST = ("not reproduced", "undecided", "reproduced", "better")

# Statistic of a sample; one that takes `axis`, like NumPy's, is many times as fast.
Statistic = Callable[..., Array]

RESAMPLES, LEVEL = 9999, 0.95
ONE_SIDED = 0.9
"""Level of the interval whose two ends are each a one-sided test at 5 %."""
EQUAL_WITHIN = 0.1
"""The margin of equality, of every experiment: values are equal where their ratio lies between 1 / 1.1 and 1.1."""
SEED = 20050213


class SignTest(NamedTuple):
    """better, worse, ties : pairs in which ours is smaller, larger, equal. p : two-sided, ties left out."""

    better: int
    worse: int
    ties: int
    p: float


def bootstrap_interval(
    values: Iterable[float], statistic: Statistic = np.mean, level: float = LEVEL
) -> tuple[float, float]:
    """Low and high end of a statistic's bootstrap interval (bias-corrected and accelerated; percentiles where that
    is not defined), always the same for the same values. One value, or equal ones: that value twice; none: NaN twice.
    """
    return _interval((np.array(list(values), dtype=np.float64),), statistic, level)


def ratio_interval(ours: ArrayLike, theirs: ArrayLike, level: float = LEVEL) -> tuple[float, float]:
    """The interval of mean(ours) / mean(theirs), both of the same seeds in the same order.

    Raises ValueError where they are not equally many.
    """
    return _interval(_pairs(ours, theirs), _ratio, level)


def sign_test(ours: ArrayLike, theirs: ArrayLike) -> SignTest:
    """Whether ours is smaller than theirs, pair by pair (two-sided sign test).

    Raises ValueError where they are not equally many.
    """
    first, second = _pairs(ours, theirs)
    better, worse = int((first < second).sum()), int((first > second).sum())
    p = float(scipy.stats.binomtest(better, better + worse).pvalue) if better + worse else 1.0
    return SignTest(better, worse, len(first) - better - worse, p)


def number(
    name: str,
    values: Iterable[float],
    unit: str = "",
    paper: float | None = None,
    better: str = "",
    statistic: Statistic = np.mean,
) -> Number:
    """A number over seeds with its interval and verdict. values : one a seed; only finite ones count."""
    kept = [float(value) for value in values if math.isfinite(value)]
    ours = float(np.asarray(statistic(np.array(kept)))) if kept else math.nan
    low, high = bootstrap_interval(kept, statistic)
    tested = (low, high) if paper is None else bootstrap_interval(kept, statistic, ONE_SIDED)
    verdict = verdict_of((low, high), tested, paper, better)
    return Number(
        name, ours, low, high, unit, paper, better, len(kept), verdict, refuted_where(paper, better)
    )


def ratio_number(
    name: str,
    ours: ArrayLike,
    theirs: ArrayLike,
    unit: str = "",
    paper: float | None = None,
    better: str = "",
) -> Number:
    """mean(ours) / mean(theirs) with its interval and verdict, paired by seed; pairs that are not finite are left out.

    Raises ValueError where they are not equally many.
    """
    first, second = _pairs(ours, theirs)
    finite = np.isfinite(first) & np.isfinite(second)
    first, second = first[finite], second[finite]
    value = float(_ratio(first, second)) if len(first) else math.nan
    low, high = ratio_interval(first, second)
    tested = (low, high) if paper is None else ratio_interval(first, second, ONE_SIDED)
    verdict = verdict_of((low, high), tested, paper, better)
    refuted = refuted_where(paper, better)
    return Number(name, value, low, high, unit, paper, better, len(first), verdict, refuted)


def equal_to(value: float) -> tuple[float, float]:
    """The values between which a ratio or a measured size counts as equal to `value`; ends in order."""
    ends = value / (1.0 + EQUAL_WITHIN), value * (1.0 + EQUAL_WITHIN)
    return min(ends), max(ends)


def verdict_of(
    interval: tuple[float, float], tested: tuple[float, float], paper: float | None, better: str = ""
) -> str:
    """The verdict by the rule above, "answered" without a paper's value.

    interval : the 95 % interval. tested : the 90 % interval, of the two one-sided tests.
    """
    if better not in ("", "lower", "higher"):
        raise ValueError(f"better is '{better}', not 'lower', 'higher' or ''.")
    if paper is None:
        return "answered"
    (low, high), (least, most) = interval, tested
    if not (math.isfinite(low) and math.isfinite(high)):
        return "not reproduced"
    if (better == "lower" and high < paper) or (better == "higher" and low > paper):
        return "better"
    lower_end, upper_end = equal_to(paper)
    if (least >= lower_end or better == "lower") and (most <= upper_end or better == "higher"):
        return "reproduced"
    return "undecided" if low <= paper <= high else "not reproduced"


def refuted_where(paper: float | None, better: str = "") -> str:
    """What of the interval makes the verdict "not reproduced", a clause; "" without a paper's value."""
    if paper is None:
        return ""
    lower_end, upper_end = equal_to(paper)
    match better:
        case "lower":
            return f"the interval lies above {paper:.4g} and reaches beyond {upper_end:.3g}"
        case "higher":
            return f"the interval lies below {paper:.4g} and reaches below {lower_end:.3g}"
        case _:
            return (
                f"the interval leaves {paper:.4g} out and reaches beyond {lower_end:.3g} or {upper_end:.3g}"
            )


def overall(verdicts: Iterable[str]) -> str:
    """The hardest verdict of several claims: the first of HARDEST_FIRST that one has; else "answered"."""
    given = set(verdicts)
    return next((verdict for verdict in HARDEST_FIRST if verdict in given), "answered")


def firmness(seeds: int) -> str:
    """Text to add to a verdict: empty with enough seeds, else that it is not firm."""
    if seeds >= FIRM_SEEDS:
        return ""
    return f"not firm: {counted(seeds, 'seed')} of at least {FIRM_SEEDS}"


def _interval(samples: tuple[Array, ...], statistic: Statistic, level: float) -> tuple[float, float]:
    count = len(samples[0])
    if count == 0:
        return math.nan, math.nan
    if count == 1 or all(np.all(sample == sample[0]) for sample in samples):
        value = float(np.asarray(statistic(*samples)))
        return value, value
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # Samples whose resamples hardly differ (a median, a maximum) have no acceleration: use percentiles.
            warnings.simplefilter("ignore")
            interval = scipy.stats.bootstrap(
                samples,
                statistic,
                n_resamples=RESAMPLES,
                confidence_level=level,
                method=method,
                paired=len(samples) > 1,
                rng=np.random.default_rng(SEED),
            ).confidence_interval
        if math.isfinite(interval.low) and math.isfinite(interval.high):
            return float(interval.low), float(interval.high)
    return math.nan, math.nan


def _ratio(first: Array, second: Array, axis: int = -1) -> Array:
    return np.mean(first, axis=axis) / np.mean(second, axis=axis)


def _pairs(ours: ArrayLike, theirs: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"{len(first)} values cannot be paired with {len(second)}.")
    return first, second
