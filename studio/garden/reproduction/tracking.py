"""Experiments whose trials are tracked footage: candidates, lines of settings, and figures of their runs.

Trials of the same attempt are the same trial in every experiment, so figures on one set of runs share them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.garden.reproduction.claims import ratio, sign_tests
from studio.garden.reproduction.drawing import seeds_and_mean, table_over
from studio.garden.reproduction.experiment import Experiment, Part, grouped, listed
from studio.results.comparison.findings import FIRM_SEEDS, Chart, Number, Series, Table
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import Tracked, TrackingTrial, measure_tracking, tracking_trial
from studio.results.comparison.trials import Outcome, Scale, Trial
from studio.search.trackers.catalogue import knobs_for_evaluations

Runs = Sequence[Tracked]
Groups = Mapping[str, Runs]


@dataclass(frozen=True, slots=True)
class Candidate:
    """A tracker with settings, as a line of a chart. changes : knobs by flat name."""

    name: str
    tracker: str
    weighting: str
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def attempt(self, footage: str, seed: int, evaluations: int, **wanted: Any) -> TrackingTrial:  # noqa: ANN401
        """A run of `evaluations` evaluations a frame, 0 where the knobs give them. wanted : other fields of
        `TrackingTrial`."""
        knobs = knobs_for_evaluations(self.tracker, evaluations) if evaluations else {}
        return TrackingTrial(footage, self.tracker, self.weighting, seed, {**knobs, **self.changes}, **wanted)


@dataclass(frozen=True, slots=True)
class Line:
    """A line of an experiment's table of settings, tracked with every seed.

    evaluations : a frame, 0 where the candidate's knobs give them. wanted : other fields of `TrackingTrial`, by seed
    where it is a function. seeds : at least so many, where all ten are run.
    """

    name: str
    candidate: Candidate
    footage: str
    evaluations: int = 0
    wanted: Mapping[str, Any] | Callable[[int], Mapping[str, Any]] = field(default_factory=dict[str, Any])
    seeds: int = 0

    def trials(self, scale: Scale) -> Iterator[Trial]:
        """One a seed."""
        more = scale.seeds if scale.quick or len(scale.seeds) < FIRM_SEEDS else tuple(range(self.seeds))
        return map(self.trial, max(scale.seeds, more, key=len))

    def trial(self, seed: int) -> Trial:
        wanted = self.wanted(seed) if callable(self.wanted) else self.wanted
        attempt = self.candidate.attempt(self.footage, seed, self.evaluations, **wanted)
        return tracking_trial(self.name, attempt)


def tracked_experiment(
    name: str,
    lines: Callable[[bool], Iterable[Line]],
    shown: Callable[[dict[str, list[Tracked]]], Iterable[Part]],
) -> Experiment:
    """The experiment of tracked footage that the table lists under a name. lines : the settings, for a preview or in
    full. shown : the results of the runs by line.
    """

    def trials(scale: Scale) -> tuple[Trial, ...]:
        return tuple(trial for line in lines(scale.quick) for trial in line.trials(scale))

    footage = tuple(dict.fromkeys(line.footage for line in lines(False)))
    return listed(name, trials, measure_tracking, lambda outcomes: shown(by_group(outcomes)), footage=footage)


def by_group(outcomes: Sequence[Outcome]) -> dict[str, list[Tracked]]:
    """The tracked runs by line in the order of the trials, seeds in order."""
    return grouped(outcomes, Tracked)


def mean_errors(runs: Runs) -> list[float]:
    """The mean error of every seed, mm."""
    return [run.mean_mm for run in runs]


def lost_percent(run: Tracked) -> float:
    """Frames with a limb lost, per cent."""
    return 100.0 * run.lost_frames / len(run.frames)


def named_percent(runs: Runs, *, lost: bool) -> float:
    """Per cent of all runs' frames with a limb lost (or, not `lost`, with none) in which the tracker reported one; nan
    without such frames.
    """
    named = [
        bool(ours)
        for run in runs
        for ours, true in zip(run.named, run.lost, strict=True)
        if bool(true) == lost
    ]
    return 100.0 * float(np.mean(named)) if named else float("nan")


def mean_number(name: str, runs: Runs, paper: float | None = None) -> Number:
    """The mean over seeds of the mean error, mm, beside the paper's."""
    return number(name, mean_errors(runs), "mm", paper=paper, better="lower")


def worst_number(name: str, runs: Runs, paper: float | None = None) -> Number:
    """The mean over seeds of the worst frame, mm, beside the paper's."""
    return number(name, [run.worst_mm for run in runs], "mm", paper=paper, better="lower")


def error_ratio(name: str, ours: Runs, theirs: Runs, claim: str) -> Number:
    """The ratio of two lines' mean errors. claim : of `ratio`."""
    return ratio(name, mean_errors(ours), mean_errors(theirs), claim)


def error_rows(runs: Runs) -> Array:
    """(S, F) mean error of every seed and frame, mm."""
    return np.array([run.per_frame_mm for run in runs])


def error_tests(groups: Groups, pairs: Iterable[tuple[str, str]]) -> Table:
    """`sign_tests` of lines' errors."""
    return sign_tests(
        lambda name: (mean_errors(groups[name]), error_rows(groups[name]).ravel().tolist()), pairs
    )


def curves(
    title: str, groups: Groups, fps: float = 60.0, bands: tuple[tuple[float, float, str], ...] = ()
) -> Chart:
    """Error over frames: every seed thin, the mean over seeds thick. Frames are those of the footage at 60 Hz when
    `fps` is the footage's own rate (a frame k at 20 Hz is drawn at 3 k).
    """
    series: list[Series] = []
    for group, runs in groups.items():
        series += seeds_and_mean(
            group, tuple(frame * 60.0 / fps for frame in runs[0].frames), error_rows(runs)
        )
    return Chart(title, "lines", "frame (at 60 Hz)", "mean error (mm)", tuple(series), bands=bands)


def summary_table(title: str, groups: Groups) -> Table:
    """A line a setting: error, worst frame, lost limbs, time."""
    return table_over(title, "setting", COLUMNS, groups)


def _mean(of: Callable[[Tracked], float]) -> Callable[[Runs], float]:
    return lambda runs: float(np.mean([of(run) for run in runs]))


COLUMNS: Mapping[str, Callable[[Runs], float]] = {
    "seeds": len,
    "evaluations a frame": lambda runs: runs[0].evaluations,
    "mean (mm)": _mean(lambda run: run.mean_mm),
    "highest seed (mm)": lambda runs: max(mean_errors(runs)),
    "mean of worst frames (mm)": _mean(lambda run: run.worst_mm),
    "largest (mm)": lambda runs: max(run.worst_mm for run in runs),
    "frames with a limb lost (%)": lambda runs: (
        100.0 * float(np.mean([run.lost_frames for run in runs])) / len(runs[0].frames)
    ),
    "runs without loss": lambda runs: sum(not run.lost_limbs for run in runs),
    "search (ms a frame)": lambda runs: (
        1000.0 * float(np.mean([run.seconds for run in runs])) / max(1, len(runs[0].frames) - 1)
    ),
}


@dataclass(frozen=True, slots=True)
class Spell:
    """A spell of a lost limb: its name, length in frames, and whether it was found again before the end."""

    limb: str
    frames: int
    found_again: bool


def spells(run: Tracked) -> Iterator[Spell]:
    """All spells in which a limb is lost (one of its markers is too far off), limb by limb."""
    for limb in sorted({limb for limbs in run.lost for limb in limbs}):
        length = 0
        for limbs in run.lost:
            if limb in limbs:
                length += 1
            elif length:
                yield Spell(limb, length, True)
                length = 0
        if length:
            yield Spell(limb, length, False)
