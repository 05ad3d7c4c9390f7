"""Numbers over seeds compared with a paper's claims."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from studio.comparison.findings import Number, Table
from studio.comparison.statistics import number, ratio_number, sign_test

EQUAL, LOWER = "equal", "lower"
HALF = 0.5


def share(name: str, held: Iterable[bool], paper: float | None = 1.0) -> Number:
    """Share of the seeds in which something holds. A minority of the seeds never counts as reproduced, even
    where the interval is wide enough to contain the paper's value.
    """
    found = number(name, [float(value) for value in held], "of 1", paper=paper)
    if found.verdict == "reproduced" and paper is not None and abs(found.ours - paper) > HALF:
        return replace(found, verdict="not reproduced")
    return found


def ratio(name: str, ours: Sequence[float], theirs: Sequence[float], claim: str = "") -> Number:
    """The ratio of two settings' errors, paired by seed.

    claim : "equal" (1 lies in the interval, or ours is better), "lower" (the whole interval lies below 1), or none.
    """
    found = ratio_number(name, ours, theirs, "×", paper=1.0 if claim == EQUAL else None, better="lower")
    if claim == LOWER:
        return replace(found, verdict="reproduced" if found.high < 1.0 else "not reproduced")
    return found


def geometric_mean(values: Any, axis: int = -1) -> Any:  # noqa: ANN401 - what NumPy's own mean takes and gives
    """exp of the mean log: for ratios, and for numbers of particles tried in equal ratios."""
    return np.exp(np.mean(np.log(values), axis=axis))


def sign_tests(
    of: Callable[[str], tuple[Sequence[float], Sequence[float]]], pairs: Iterable[tuple[str, str]]
) -> Table:
    """Sign tests of pairs of settings over seeds and frames, a line a pair. of : a setting's errors of seeds, and of
    all their frames. Frames of one run are correlated, so that their p is too small.
    """
    rows = []
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
