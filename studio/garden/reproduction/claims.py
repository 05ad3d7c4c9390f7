"""Numbers over seeds compared with a paper's claims.

Three kinds of claim. A value that the paper prints: `results.comparison.statistics.number`. That something holds, of
which the paper shows one run: `share`. That one thing is smaller than another, no worse, or equal to it, or beyond a
bound: `ratio`, `saved`, `beyond`. An experiment's verdict is that of its hardest claim; a number that no claim of the
paper rests on (a setting of ours, a time on another machine) is shown without a verdict.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import binomtest

from studio.results.comparison.findings import Number, Plain, Table
from studio.results.comparison.statistics import (
    LEVEL,
    ONE_SIDED,
    equal_to,
    number,
    ratio_number,
    refuted_where,
    sign_test,
    verdict_of,
)

EQUAL, NO_WORSE, LOWER, HIGHER = "equal", "no worse", "lower", "higher"
FEWEST_SEEDS = 5
"""With fewer, nothing is found equal or no worse, however little they scatter."""
HALF = 0.5
ONE_SIDED_P = 0.05


def share(name: str, held: Iterable[bool], paper: float | None = 1.0) -> Number:
    """Share of the seeds in which something holds, with its exact (Clopper & Pearson) 95 % interval.

    paper : 1 where the paper shows that it holds, 0 where it shows that it does not, None without a claim. Reproduced
    where significantly more than half of the seeds are as the paper's (exact binomial test, one-sided at 5 %), not
    reproduced where significantly fewer, else undecided; five seeds that agree suffice, of ten it takes nine.
    """
    seen = [bool(value) for value in held]
    holds, count = sum(seen), len(seen)
    if not count:
        return number(name, [], "of 1", paper=paper)
    interval = binomtest(holds, count).proportion_ci(method="exact")
    verdict = "answered"
    if paper is not None:
        agreeing = holds if paper > HALF else count - holds
        more, fewer = (
            binomtest(agreeing, count, HALF, alternative=side).pvalue for side in ("greater", "less")
        )
        verdict = "not reproduced" if fewer <= ONE_SIDED_P else "undecided"
        verdict = "reproduced" if more <= ONE_SIDED_P else verdict
    low, high = float(interval.low), float(interval.high)
    side = "fewer" if paper is None or paper > HALF else "more"
    refuted = "" if paper is None else f"so in significantly {side} than half of the seeds"
    return Number(name, holds / count, low, high, "of 1", paper, "", count, verdict, refuted)


def percent(name: str, held: Iterable[bool], least: float | None = None) -> Number:
    """Per cent of some cases in which something holds, with its exact (Clopper & Pearson) 95 % interval, which is not
    empty where all or none do. least : claimed, per cent; better where the whole interval lies above.
    """
    seen = [bool(value) for value in held]
    holds, count = sum(seen), len(seen)
    if not count:
        return number(name, [], "%", paper=least, better="higher")
    test = binomtest(holds, count)
    outer, inner = (test.proportion_ci(level, method="exact") for level in (LEVEL, ONE_SIDED))
    low, high = 100.0 * float(outer.low), 100.0 * float(outer.high)
    tested = 100.0 * float(inner.low), 100.0 * float(inner.high)
    verdict, refuted = verdict_of((low, high), tested, least, "higher"), refuted_where(least, "higher")
    return Number(name, 100.0 * holds / count, low, high, "%", least, "higher", count, verdict, refuted)


def ratio(name: str, ours: Sequence[float], theirs: Sequence[float], claim: str = "") -> Number:
    """The ratio of two settings' errors, paired by seed.

    claim : EQUAL (within the margin of equality on both sides, so that *better* refutes it as *worse* does), NO_WORSE
    (no larger than 1 by that margin), LOWER (`beyond` 1), or none.
    """
    paper = 1.0 if claim in (EQUAL, NO_WORSE) else None
    number = ratio_number(name, ours, theirs, "×", paper=paper, better="" if claim == EQUAL else "lower")
    return beyond(number, 1.0, LOWER) if claim == LOWER else of_enough_seeds(number)


def saved(name: str, ratios: Iterable[float], claimed: float | None) -> Number:
    """The geometric mean over seeds of how many times less is needed; ratios that are not finite do not count.

    claimed : the paper's value, of which more is better; 1 where nothing is said to be saved, so that a saving refutes
    it as a loss does; None without a claim.
    """
    better = "" if claimed == 1.0 else "higher"
    return of_enough_seeds(number(name, ratios, "×", claimed, better, geometric_mean))


def of_enough_seeds(number: Number) -> Number:
    """The number; undecided where fewer than FEWEST_SEEDS seeds found it equal to the paper's, or no worse."""
    few = number.paper is not None and number.seeds < FEWEST_SEEDS
    return replace(number, verdict="undecided") if few and number.verdict == "reproduced" else number


def beyond(number: Number, bound: float, side: str) -> Number:
    """The number with the verdict on the claim that it is lower (or higher) than a bound: reproduced where the whole
    interval is, by FEWEST_SEEDS seeds or more, not reproduced where none of it is by more than the margin of equality,
    else undecided.
    """
    lower_end, upper_end = equal_to(bound)
    end = f"above {lower_end:.3g}" if side == LOWER else f"below {upper_end:.3g}"
    refuted = f"the whole interval lies {end}"
    if not (math.isfinite(number.low) and math.isfinite(number.high)):
        return replace(number, better=side, verdict="not reproduced", refuted=refuted)
    shown = number.high < bound if side == LOWER else number.low > bound
    denied = number.low >= lower_end if side == LOWER else number.high <= upper_end
    enough = number.seeds >= FEWEST_SEEDS
    verdict = "reproduced" if shown and enough else "not reproduced" if denied else "undecided"
    return replace(number, better=side, verdict=verdict, refuted=refuted)


def beside(number: Number) -> Number:
    """The number beside the paper's, without a verdict: no claim rests on it."""
    return replace(number, verdict="answered", refuted="")


def geometric_mean(values: Any, axis: int = -1) -> Any:  # noqa: ANN401 - what NumPy's own mean takes and gives
    """exp of the mean log: for ratios, and for numbers of particles tried in equal ratios."""
    return np.exp(np.mean(np.log(values), axis=axis))


def sign_tests(
    of: Callable[[str], tuple[Sequence[float], Sequence[float]]], pairs: Iterable[tuple[str, str]]
) -> Table:
    """Sign tests of pairs of settings over seeds and frames, a line a pair. of : a setting's errors of seeds, and of
    all their frames. Frames of one run are correlated, so that their p is too small.
    """
    rows: list[tuple[Plain, ...]] = []
    for first, second in pairs:
        tests = [sign_test(ours, theirs) for ours, theirs in zip(of(first), of(second), strict=True)]
        counts = [
            cell for test in tests for cell in (f"{test.better} : {test.worse}", float(f"{test.p:.2g}"))
        ]
        rows.append((f"{first} against {second}", *counts))
    columns = (
        "pair",
        "nearer in seeds",
        "p over seeds",
        "nearer in frames",
        "p over frames, which are not independent",
    )
    return Table("Sign tests", columns, tuple(rows))
