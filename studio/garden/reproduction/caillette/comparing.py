"""Comparison of runs on the dance: ratios, losses, curves over frames, tables.

The paper's measure is the RMS joint angle error. Joints of two angles each are singular where a limb points along the
first axis (an arm held out to the side, which dancers do): the first angle then turns nothing, and is off by 50 degrees
for every tracker alike. So the angle between a limb and its true direction stands beside it, which does not depend on
the angles' branch, but on the root's orientation. What the paper says of its curves is judged by joint angles; where it
prints no measure, by limbs' directions.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any

import numpy as np

from studio.garden.reproduction import claims
from studio.garden.reproduction.caillette.following import Followed
from studio.garden.reproduction.caillette.setting import FPS
from studio.garden.reproduction.drawing import places, seeds_and_mean, table_over
from studio.garden.reproduction.experiment import grouped
from studio.results.comparison.findings import Chart, Number, Series, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome

Runs = Sequence[Followed]
Groups = Mapping[str, Runs]
Error = Callable[[Followed], float]

OFF_MM = 150.0
"""RMS over the markers, mm, above which the body is lost."""

angle: Error = attrgetter("angle_rms")
limb: Error = attrgetter("limb_rms")
position: Error = attrgetter("position_rms")
"""A run's RMS error of joint angles and of limbs' directions (degrees), and of joint positions (mm)."""
centre: Error = attrgetter("centre_rms")
shape: Error = attrgetter("shape_rms")
"""The two parts of a position error (mm), whose squares add up: of the body's middle, and about it."""

LIMB, ANGLE, POSITION = "limb direction", "joint angle", "joint position"
MEASURES: Mapping[str, tuple[str, str]] = {
    LIMB: ("limb_deg", "RMS limb direction error (°)"),
    ANGLE: ("angle_deg", "RMS joint angle error (°)"),
    POSITION: ("position_mm", "RMS joint position error (mm)"),
}
"""Names to a field of `Followed` and an axis."""


def by_candidate(outcomes: Iterable[Outcome]) -> dict[str, list[Followed]]:
    """The measurements by candidate in the order of the trials, seeds in order."""
    return grouped(outcomes, Followed)


def longest_loss(run: Followed) -> float:
    """Longest uninterrupted time that a run was off by more than OFF_MM, s."""
    longest = now = 0
    for error in run.position_mm:
        now = now + 1 if error > OFF_MM else 0
        longest = max(longest, now)
    return longest / FPS


def loses_track(run: Followed) -> bool:
    """Whether a run is off for a second or more at a stretch."""
    return longest_loss(run) >= 1.0


def ratio(name: str, ours: Runs, theirs: Runs, claim: str = "", of: Error = limb) -> Number:
    """The ratio of two candidates' errors, paired by seed. claim : of `claims.ratio`."""
    return claims.ratio(name, [of(run) for run in ours], [of(run) for run in theirs], claim)


def errors(what: str, groups: Groups, of: Error = limb, unit: str = "°") -> Iterable[Number]:
    """The mean over seeds of each candidate's error; the paper has curves but no figures."""
    return (number(f"{what}: {name}", map(of, runs), unit) for name, runs in groups.items())


def mean_of(runs: Runs, of: Error = limb) -> float:
    """The mean over seeds."""
    return float(np.mean([of(run) for run in runs]))


def curves(title: str, groups: Groups, measure: str = LIMB) -> Chart:
    """Error over frames by one of MEASURES: every seed thin, the RMS over seeds thick."""
    field, axis = MEASURES[measure]
    series: list[Series] = []
    for group, runs in groups.items():
        rows = np.array([getattr(run, field) for run in runs])
        series += seeds_and_mean(group, places(rows.shape[1]), rows, np.sqrt((rows**2).mean(axis=0)))
    return Chart(title, "lines", f"frame (at {FPS} Hz)", axis, tuple(series))


SIDE_BY_SIDE = "Verdicts: the tracker as printed, and ours"
TWO_TRACKERS = (
    "The claims are judged by the paper's tracker as printed; ours ('guided') has five additions, is shown beside it, "
    "and no claim of the paper rests on it."
)


def side_by_side(rows: Iterable[tuple[str, Number, Number]]) -> Table:
    """A line a claim: the number and the verdict with the printed tracker, and with ours."""

    def cells(number: Number) -> tuple[str, str]:
        return f"{number.ours:.3g} {number.unit} [{number.low:.3g}, {number.high:.3g}]", number.verdict

    heads = ("claim", "as printed", "verdict", "ours", "verdict of ours")
    return Table(SIDE_BY_SIDE, heads, tuple((name, *cells(one), *cells(other)) for name, one, other in rows))


def summary_table(title: str, groups: Groups) -> Table:
    """A line a candidate: errors, losses, time."""
    return table_over(title, "candidate", COLUMNS, groups)


def _model_free(runs: Runs) -> Any:  # noqa: ANN401 - a cell
    free = [value for run in runs for value in run.free]
    return round(100.0 * float(np.mean(free)), 0) if free else ""


COLUMNS: Mapping[str, Callable[[Runs], Any]] = {
    "seeds": len,
    "evaluations a frame": lambda runs: runs[0].evaluations,
    "joint angle, RMS (°)": lambda runs: mean_of(runs, angle),
    "limb direction, RMS (°)": lambda runs: mean_of(runs, limb),
    "joint position, RMS (mm)": lambda runs: mean_of(runs, position),
    "of the body's middle (mm)": lambda runs: mean_of(runs, centre),
    "about its middle (mm)": lambda runs: mean_of(runs, shape),
    "mean (mm)": lambda runs: mean_of(runs, lambda run: run.mean_mm),
    "frames with a limb lost (%)": lambda runs: 100.0 * mean_of(runs, lambda run: run.lost_share),
    "longest loss (s)": lambda runs: max(map(longest_loss, runs)),
    "model-free share (%)": _model_free,
    "search (ms a frame)": lambda runs: mean_of(runs, lambda run: run.milliseconds),
}
