"""Experiments whose trials are tracked footage: contenders, their outcomes by group, curves and tables.

Trials of the same attempt are the same trial whichever experiment asks for it, so figures that look at one set of
runs from several sides share them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.comparison.findings import Chart, Number, Series, Table
from studio.comparison.statistics import number, ratio_interval, sign_test
from studio.comparison.tracked import Attempt, Tracked
from studio.comparison.tracking_trials import group_of, measure_tracking, tracking_trial
from studio.comparison.trials import Outcome, Trial
from studio.reproduction.drawing import seeds_and_mean
from studio.reproduction.experiment import Experiment, concluding
from studio.tracking.catalogue import knobs_for_evaluations

Array = NDArray[np.float64]
T = TypeVar("T")
Groups = Mapping[str, Sequence[Tracked]]
Claim = Callable[[Groups], Number | None]


@dataclass(frozen=True, slots=True)
class Contender:
    """A tracker with settings, as a line of a chart. changes : knobs by flat name."""

    name: str
    tracker: str
    weighting: str
    changes: Mapping[str, Any] = field(default_factory=dict)

    def attempt(self, footage: str, seed: int, evaluations: int, **wanted: Any) -> Attempt:  # noqa: ANN401
        """A run of so many evaluations a frame, 0 where the knobs say it. wanted : other fields of `Attempt`."""
        knobs = knobs_for_evaluations(self.tracker, evaluations) if evaluations else {}
        return Attempt(footage, self.tracker, self.weighting, seed, {**knobs, **self.changes}, **wanted)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of an experiment's table of settings: what is tracked with every seed.

    evaluations : a frame, 0 where the contender's knobs say it. wanted : other fields of `Attempt`.
    """

    name: str
    contender: Contender
    footage: str
    evaluations: int = 0
    wanted: Mapping[str, Any] = field(default_factory=dict)

    def trial(self, seed: int) -> Trial:
        """The trial of a seed."""
        attempt = self.contender.attempt(self.footage, seed, self.evaluations, **self.wanted)
        return tracking_trial(self.name, attempt)


def tracked_experiment(
    name: str,
    title: str,
    source: str,
    claim: str,
    *,
    lines: Callable[[bool], Iterable[Line]],
    claims: Iterable[Claim],
    words: Callable[[Groups, Sequence[Number]], str],
    tables: Iterable[Callable[[Groups], Table]],
    charts: Iterable[Callable[[Groups], Chart]],
    settings: Mapping[str, Any] | Callable[[Sequence[Outcome]], Mapping[str, Any]],
    judged: Callable[[Number], bool] = lambda number: True,
) -> Experiment:
    """An experiment that is a table of settings and one of claims.

    lines : the settings, for a quick look or in full. claims and the rest : of `concluding`, from the runs by line.
    """
    return Experiment(
        name,
        title,
        source,
        claim,
        lambda scale: tuple(line.trial(seed) for line in lines(scale.quick) for seed in scale.seeds),
        measure_tracking,
        concluding(
            by_group,
            claims=claims,
            words=words,
            tables=tables,
            charts=charts,
            settings=settings,
            judged=judged,
        ),
        tuple(dict.fromkeys(line.footage for line in lines(False))),
    )


def mean_of(name: str, group: str, paper: float | None = None) -> Claim:
    """The mean over seeds of a line's mean error, beside the paper's."""
    return lambda groups: mean_number(name, groups[group], paper)


def worst_of(name: str, group: str, paper: float | None = None) -> Claim:
    """The mean over seeds of a line's worst frame, beside the paper's."""
    return lambda groups: mean_number(name, groups[group], paper, of=lambda run: run.worst_mm)


def ratio_of(name: str, ours: str, theirs: str, claim: str) -> Claim:
    """The ratio of two lines' mean errors; claim : "equal" or "lower"."""
    return lambda groups: error_ratio(name, groups[ours], groups[theirs], claim)


def summary(title: str) -> Callable[[Groups], Table]:
    """`summary_table` of all lines."""
    return lambda groups: summary_table(title, groups)


def curves_of(title: str, names: Mapping[str, str], fps: float = 60.0) -> Callable[[Groups], Chart]:
    """`curves` of some lines. names : in the chart, to the lines'."""
    return lambda groups: curves(title, {name: groups[line] for name, line in names.items()}, fps)


def mean_errors(runs: Sequence[Tracked]) -> list[float]:
    """The mean error of every seed, mm."""
    return [run.mean_mm for run in runs]


def grouped(outcomes: Sequence[Outcome], made: Callable[..., T]) -> dict[str, list[T]]:
    """What was measured, by group in the order of the trials, seeds in order. made : from the plain fields."""
    found: dict[str, list[T]] = {}
    for outcome in outcomes:
        found.setdefault(group_of(outcome.trial), []).append(made(**outcome.measured))
    return found


def by_group(outcomes: Sequence[Outcome]) -> dict[str, list[Tracked]]:
    """What was tracked, by group in the order of the trials, seeds in order."""
    return grouped(outcomes, Tracked)


def curves(
    title: str,
    groups: Mapping[str, Sequence[Tracked]],
    fps: float = 60.0,
    bands: tuple[tuple[float, float, str], ...] = (),
) -> Chart:
    """Error over frames: every seed thin, the mean over seeds thick. Frames are those of the footage at 60 Hz when
    `fps` is the footage's own rate (a frame k at 20 Hz is drawn at 3 k).
    """
    series: list[Series] = []
    for group, runs in groups.items():
        frames = tuple(frame * 60.0 / fps for frame in runs[0].frames)
        series += seeds_and_mean(group, frames, error_rows(runs))
    return Chart(title, "lines", "frame (at 60 Hz)", "mean error (mm)", tuple(series), bands=bands)


def error_rows(runs: Sequence[Tracked]) -> Array:
    """(S, F) mean error of every seed and frame, mm."""
    return np.array([run.per_frame_mm for run in runs])


def summary_table(title: str, groups: Mapping[str, Sequence[Tracked]]) -> Table:
    """A line a group: error, worst frame, lost limbs, time."""
    columns = (
        "setting", "seeds", "evaluations a frame", "mean (mm)", "highest seed (mm)", "mean of worst frames (mm)",
        "largest (mm)", "frames with a limb lost (%)", "runs without loss", "search (ms a frame)",
    )  # fmt: skip
    rows = []
    for group, runs in groups.items():
        means = [run.mean_mm for run in runs]
        worst = [run.worst_mm for run in runs]
        count = len(runs[0].frames)
        rows.append(
            (
                group,
                len(runs),
                runs[0].evaluations,
                round(float(np.mean(means)), 1),
                round(max(means), 1),
                round(float(np.mean(worst)), 1),
                round(max(worst), 1),
                round(100.0 * float(np.mean([run.lost_frames for run in runs])) / count, 1),
                sum(not run.lost_limbs for run in runs),
                round(1000.0 * float(np.mean([run.seconds for run in runs])) / max(1, count - 1), 1),
            )
        )
    return Table(title, columns, tuple(rows))


def mean_number(
    name: str,
    runs: Sequence[Tracked],
    paper: float | None = None,
    of: Callable[[Tracked], float] | None = None,
) -> Number:
    """The mean over seeds of a run's mean error (or what `of` takes of it), mm, beside the paper's."""
    values = [of(run) if of else run.mean_mm for run in runs]
    return number(name, values, "mm", paper=paper, better="lower")


def error_ratio(name: str, ours: Sequence[Tracked], theirs: Sequence[Tracked], claim: str) -> Number:
    """The ratio of two settings' mean errors, paired by seed.

    claim : "equal" (1 lies in the interval, or ours is better) or "lower" (the whole interval lies below 1).
    """
    first, second = [run.mean_mm for run in ours], [run.mean_mm for run in theirs]
    low, high = ratio_interval(first, second)
    verdict = claimed_verdict(low, high, claim)
    ratio = float(np.mean(first) / np.mean(second))
    paper = 1.0 if claim == "equal" else None
    return Number(name, ratio, low, high, "×", paper, "lower", len(first), verdict)


def claimed_verdict(low: float, high: float, claim: str) -> str:
    """Whether an interval bears out that a ratio is "equal" to 1, or "lower"."""
    if claim == "lower":
        return "reproduced" if high < 1.0 else "not reproduced"
    return "better" if high < 1.0 else "reproduced" if low <= 1.0 else "not reproduced"


def sign_words(first: str, ours: Sequence[Tracked], second: str, theirs: Sequence[Tracked]) -> str:
    """Who has the smaller error in more seeds and in more frames, with the sign test."""
    seeds = sign_test([run.mean_mm for run in ours], [run.mean_mm for run in theirs])
    frames = sign_test(error_rows(ours).ravel().tolist(), error_rows(theirs).ravel().tolist())
    better, worse, _, p_seeds = seeds
    return (
        f"{first} is nearer than {second} in {better} of {better + worse} seeds (sign test p = "
        f"{p_seeds:.2g}) and in {100.0 * frames[0] / max(1, frames[0] + frames[1]):.0f} % of all frames (p "
        f"= {frames[3]:.1g}; frames of one run follow from each other, so that p flatters)."
    )
