"""Intervals, tests and verdicts on numbers over several seeds.

The verdict's rule: the bootstrap 95 % interval over the seeds contains the paper's value (reproduced), lies
wholly on the better side of it (better), or does not (not reproduced). It is firm with FIRM_SEEDS seeds or more.
"""

import math
import warnings
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from studio.comparison.findings import FIRM_SEEDS, Number

Array = NDArray[np.float64]
# Statistic of a sample; one that takes `axis`, like NumPy's, is many times as fast.
Statistic = Callable[..., ArrayLike]

RESAMPLES, LEVEL = 9999, 0.95
SEED = 20050213


class SignTest(NamedTuple):
    """better, worse, ties : pairs in which ours is smaller, larger, equal. p : two-sided, ties left out."""

    better: int
    worse: int
    ties: int
    p: float


def bootstrap_interval(values: Iterable[float], statistic: Statistic = np.mean) -> tuple[float, float]:
    """Low and high end of a statistic's bootstrap 95 % interval (bias-corrected and accelerated; percentiles where that
    is not defined), always the same for the same values. One value, or equal ones: that value twice; none: NaN twice.
    """
    return _interval((np.array(list(values), dtype=np.float64),), statistic)


def ratio_interval(ours: ArrayLike, theirs: ArrayLike) -> tuple[float, float]:
    """The interval of mean(ours) / mean(theirs), both of the same seeds in the same order.

    Raises ValueError where they are not equally many.
    """
    return _interval(_pairs(ours, theirs), _ratio)


def sign_test(ours: ArrayLike, theirs: ArrayLike) -> SignTest:
    """Whether ours is smaller than theirs, pair by pair (two-sided sign test).

    Raises ValueError where they are not equally many.
    """
    first, second = _pairs(ours, theirs)
    better, worse = int((first < second).sum()), int((first > second).sum())
    p = float(stats.binomtest(better, better + worse).pvalue) if better + worse else 1.0
    return SignTest(better, worse, len(first) - better - worse, p)


def number(
    name: str,
    values: Iterable[float],
    unit: str = "",
    paper: float | None = None,
    better: str = "",
    statistic: Statistic = np.mean,
) -> Number:
    """A number over seeds with its interval and verdict; values : one a seed, those that are not finite are left
    out (and not counted).
    """
    kept = [float(value) for value in values if math.isfinite(value)]
    ours = float(np.asarray(statistic(np.array(kept)))) if kept else math.nan
    low, high = bootstrap_interval(kept, statistic)
    verdict = verdict_of(low, high, paper, better)
    return Number(name, ours, low, high, unit, paper, better, len(kept), verdict)


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
    return Number(
        name, value, low, high, unit, paper, better, len(first), verdict_of(low, high, paper, better)
    )


def verdict_of(low: float, high: float, paper: float | None, better: str = "") -> str:
    """The verdict on an interval: "answered" without a paper's value, else by the rule above."""
    if better not in ("", "lower", "higher"):
        raise ValueError(f"better is '{better}', not 'lower', 'higher' or ''.")
    if paper is None:
        return "answered"
    if low <= paper <= high:
        return "reproduced"
    on_better_side = (better == "lower" and high < paper) or (better == "higher" and low > paper)
    return "better" if on_better_side else "not reproduced"


def overall(verdicts: Iterable[str]) -> str:
    """The overall verdict: "not reproduced" as soon as one is, "better" only where all comparable ones are,
    "answered" where none is comparable.
    """
    compared = [verdict for verdict in verdicts if verdict != "answered"]
    if not compared:
        return "answered"
    if "not reproduced" in compared:
        return "not reproduced"
    return "reproduced" if "reproduced" in compared else "better"


def firmness(seeds: int) -> str:
    """Text to add to a verdict: empty with enough seeds, else that it is not firm."""
    if seeds >= FIRM_SEEDS:
        return ""
    return f"not firm: {seeds} {'seed' if seeds == 1 else 'seeds'} of at least {FIRM_SEEDS}"


def _interval(samples: tuple[Array, ...], statistic: Statistic) -> tuple[float, float]:
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
            found = stats.bootstrap(
                samples,
                statistic,
                n_resamples=RESAMPLES,
                confidence_level=LEVEL,
                method=method,
                paired=len(samples) > 1,
                rng=np.random.default_rng(SEED),
            ).confidence_interval
        if math.isfinite(found.low) and math.isfinite(found.high):
            return float(found.low), float(found.high)
    return math.nan, math.nan


def _ratio(first: Array, second: Array, axis: int = -1) -> Array:
    return np.mean(first, axis=axis) / np.mean(second, axis=axis)


def _pairs(ours: ArrayLike, theirs: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
    if first.shape != second.shape:
        raise ValueError(f"{len(first)} values cannot be paired with {len(second)}.")
    return first, second
