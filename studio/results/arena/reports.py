"""Races as charts and tables: ECDF, expected running times, who came how near."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from studio.results.arena.problem import HARD, Definition
from studio.results.arena.profiles import (
    Profile,
    RunningTime,
    Trial,
    by_problem_and_racer,
    profiles,
    running_time,
)
from studio.results.comparison.findings import Chart, Plain, Series, Table

TIMES_AT = (0.5, 0.1, 0.01)
"""Shares of the way left whose expected running times are listed."""
TITLE = "Share of targets reached within so many evaluations"


def charts_of(trials: Sequence[Trial], definitions: Sequence[Definition], budget: int) -> Iterator[Chart]:
    """The ECDF over all problems, then over easy and hard ones where there are both."""
    hard = {one.name for one in definitions if one.kind == HARD}
    groups = {
        f"{TITLE} (bands: 95 % over seeds)": trials,
        f"{TITLE}, easy problems": [trial for trial in trials if trial.problem not in hard],
        f"{TITLE}, hard problems": [trial for trial in trials if trial.problem in hard],
    }
    is_mixed = all(groups.values())
    for title, own in groups.items():
        if own and (is_mixed or own is trials):
            series = tuple(map(_series, profiles(own, budget)))
            yield Chart(title, "lines", "evaluations", "share of targets", series, log_x=True)


def _series(profile: Profile) -> Series:
    return Series(
        profile.racer,
        tuple(profile.evaluations.tolist()),
        tuple(profile.share.tolist()),
        low=tuple(profile.low.tolist()),
        high=tuple(profile.high.tolist()),
        group=profile.racer,
    )


def tables_of(trials: Sequence[Trial], definitions: Sequence[Definition]) -> Iterator[Table]:
    """The problems; expected running times; how near each racer came. Each a row a problem, then a column a racer."""
    yield problem_table(definitions)
    groups = by_problem_and_racer(trials)
    names = tuple(dict.fromkeys(racer for _, racer in groups))

    def table(title: str, cell: Callable[[Sequence[Trial]], Plain]) -> Table:
        rows = ((one.name, *(cell(groups[one.name, name]) for name in names)) for one in definitions)
        return Table(title, ("problem", *names), tuple(rows))

    for share in TIMES_AT:
        yield table(
            f"Expected evaluations until {100 * share:g} % of the way are left [95 % over seeds]",
            lambda own, share=share: time_in_words(running_time(own, share)),
        )
    yield table("Way that is left in the end (%, median over seeds)", _left)


def _left(trials: Sequence[Trial]) -> Plain:
    """Of the way from the start pose to the heaviest known one."""
    return float(f"{100.0 * float(np.median([trial.share_left for trial in trials])):.3g}")


def problem_table(definitions: Sequence[Definition]) -> Table:
    """A row a problem."""
    rows: list[tuple[Plain, ...]] = []
    for one in definitions:
        best = one.best
        known = ("", "") if best is None else (float(f"{best.log_weight:.4g}"), best.evaluations)
        rows.append(
            (one.name, one.kind, len(one.free), one.about, one.maps.weighting, *known, one.microseconds)
        )
    heads = (
        "problem",
        "kind",
        "dimensions",
        "from",
        "likelihood",
        "heaviest known",
        "searched with",
        "µs an evaluation",
    )
    return Table("Problems", heads, tuple(rows))


def time_in_words(time: RunningTime) -> str:
    """ "1200 [900, 1700]"; "1200 [900, ∞] (8 of 10)" where not all seeds came so near, "–" where none did."""
    if not time.reached:
        return "–"
    ends = ", ".join(f"{end:.0f}" if np.isfinite(end) else "∞" for end in (time.low, time.high))
    some = f" ({time.reached} of {time.trials})" if time.reached < time.trials else ""
    return f"{time.expected:.0f} [{ends}]{some}"


def words_of(trials: Sequence[Trial], budget: int) -> str:
    """Who reached the largest share of targets, in a sentence, and whether a known best was beaten."""
    ranked = sorted(profiles(trials, budget), key=lambda one: -one.share[-1])
    listed = ", ".join(f"{one.racer} {100 * one.share[-1]:.0f} %" for one in ranked)
    beaten = sorted({trial.problem for trial in trials if trial.gaps and trial.gaps[-1] < 0.0})
    more = f" Heavier poses than the known ones were met on {', '.join(beaten)}." if beaten else ""
    return f"Targets reached within {budget} evaluations: {listed}.{more}"
