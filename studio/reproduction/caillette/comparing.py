"""What runs on the dance say beside each other: ratios, losses, curves over frames, tables.

The paper's measure is the RMS joint angle error. Joints of two angles each are singular where a limb points along the
first axis (an arm held out to the side, which dancers do): the first angle then turns nothing, and is off by 50 degrees
for every tracker alike. So trackers are judged by the angle between a limb and its true direction, which no spelling of
the joints changes; joint angles stand beside it.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from studio.comparison.findings import Chart, Number, Series, Table
from studio.comparison.statistics import number, ratio_interval
from studio.comparison.trials import Outcome
from studio.reproduction.caillette.following import Followed
from studio.reproduction.caillette.setting import FPS
from studio.reproduction.drawing import places, seeds_and_mean
from studio.reproduction.tracking import claimed_verdict, grouped

Array = NDArray[np.float64]
Runs = Sequence[Followed]
Groups = Mapping[str, Runs]
Error = Callable[[Followed], float]

OFF_MM = 150.0
"""RMS over the markers: the body is no longer on the person."""


LIMB, ANGLE, POSITION = "limb direction", "joint angle", "joint position"
MEASURES: Mapping[str, tuple[str, str]] = {
    LIMB: ("limb_deg", "RMS limb direction error (°)"),
    ANGLE: ("angle_deg", "RMS joint angle error (°)"),
    POSITION: ("position_mm", "RMS joint position error (mm)"),
}
"""Words to a field of `Followed` and an axis."""


def by_contender(outcomes: Sequence[Outcome]) -> dict[str, list[Followed]]:
    """What was measured, by contender in the order of the trials, seeds in order."""
    return grouped(outcomes, Followed)


def angle(run: Followed) -> float:
    """A run's RMS joint angle error, degrees."""
    return run.angle_rms


def limb(run: Followed) -> float:
    """A run's RMS error of limbs' directions, degrees."""
    return run.limb_rms


def position(run: Followed) -> float:
    """A run's RMS joint position error, mm."""
    return run.position_rms


def beginning(run: Followed, frames: int) -> Followed:
    """The run as if it had ended after so many frames; `mean_mm` stays that of the whole."""
    parts = {
        name: getattr(run, name)[:frames] for name in ("angle_deg", "limb_deg", "position_mm", "lost", "free")
    }
    return dataclasses.replace(run, **parts)


def longest_loss(run: Followed) -> float:
    """Seconds that a run was off by more than OFF_MM at a stretch, the longest such stretch."""
    longest = now = 0
    for error in run.position_mm:
        now = now + 1 if error > OFF_MM else 0
        longest = max(longest, now)
    return longest / FPS


def loses_track(run: Followed) -> bool:
    """Whether a run is off for a second or more at a stretch."""
    return longest_loss(run) >= 1.0


def ratio(name: str, ours: Runs, theirs: Runs, claim: str, of: Error = limb) -> Number:
    """The ratio of two contenders' errors, paired by seed. claim : "equal" or "lower" (`claimed_verdict`), "" where
    there is none.
    """
    first, second = [of(run) for run in ours], [of(run) for run in theirs]
    low, high = ratio_interval(first, second)
    verdict = claimed_verdict(low, high, claim) if claim else "answered"
    value = float(np.mean(first) / np.mean(second))
    return Number(
        name, value, low, high, "×", 1.0 if claim == "equal" else None, "lower", len(first), verdict
    )


def error_number(name: str, runs: Runs, of: Error = limb, unit: str = "°") -> Number:
    """The mean over seeds of a run's error; the paper prints curves and no figures."""
    return number(name, [of(run) for run in runs], unit)


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


def summary_table(title: str, groups: Groups) -> Table:
    """A line a contender: errors, losses, time."""
    columns = (
        "contender", "seeds", "evaluations a frame", "joint angle, RMS (°)", "limb direction, RMS (°)",
        "joint position, RMS (mm)", "mean (mm)", "frames with a limb lost (%)", "longest loss (s)",
        "model-free share (%)", "search (ms a frame)",
    )  # fmt: skip
    rows = []
    for group, runs in groups.items():
        free = [value for run in runs for value in run.free]
        rows.append(
            (
                group,
                len(runs),
                runs[0].evaluations,
                round(mean_of(runs, angle), 1),
                round(mean_of(runs, limb), 1),
                round(mean_of(runs, position), 1),
                round(float(np.mean([run.mean_mm for run in runs])), 1),
                round(100.0 * float(np.mean([run.lost_share for run in runs])), 1),
                round(max(longest_loss(run) for run in runs), 1),
                round(100.0 * float(np.mean(free)), 0) if free else "",
                round(float(np.mean([run.milliseconds for run in runs])), 1),
            )
        )
    return Table(title, columns, tuple(rows))
