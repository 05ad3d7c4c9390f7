"""A sweep: every combination of some knobs' values, tracked with several seeds, each as a run of the session.

A sweep is a comparison whose candidates are the points of a grid (`Plan.vary`). Its trials are runs that are kept with
their frames, so that any of them can be opened; a session needs no truth for it: without one the silhouettes are the
measure.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from studio.body.motion_files.trc import read_trc
from studio.foundations.csv_text import as_csv
from studio.foundations.errors import RunError, SettingsError, TruthError
from studio.foundations.knobs import Knob, Value, checked
from studio.foundations.progress import duration_in_words
from studio.foundations.words import counted
from studio.results.comparison.candidates import Candidate
from studio.results.comparison.kept_trials import measured_by
from studio.results.comparison.plan import Plan, check_seeds, plan_of, tracking_trial_of
from studio.results.comparison.statistics import bootstrap_interval
from studio.results.comparison.trials import ALLOW_INCONSISTENT, Outcome, Trial
from studio.results.evaluation.errors import evaluate
from studio.runs.behaviour_models import chosen_model, needs_model
from studio.runs.pace import stored_pace
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.silhouette_faults import accepted_faults
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, all_knobs, changed_settings, values
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.tracker import LIMB_LOST, LOST
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

MOST_RUNS, MOST_KNOBS = 1000, 6


@dataclass(frozen=True, slots=True)
class Measure:
    """A number of a run. key, label, unit : name and words. more_is_better : None where neither is."""

    key: str
    label: str
    unit: str = ""
    more_is_better: bool | None = False


MEASURES = (
    Measure("error", "Mean error", "mm"),
    Measure("worst", "Error of the worst frame", "mm"),
    Measure("limb_lost", "Frames with a limb lost (truth)"),
    Measure("overlap", "Share of the body in the masks", "", True),
    Measure("search_lost", "Frames that the search reported lost"),
    Measure("evaluations", "Evaluations a frame", "", None),
    Measure("milliseconds", "Time a frame, among others at once", "ms"),
)
"""What is known of runs; the first that all runs of a sweep have ranks its points."""


@dataclass(frozen=True, slots=True)
class Swept:
    """A measured run of a sweep. Numbers that the session has no measure for are None.

    run : its name.
    worst_frame : with the largest error; without a truth the one that fits the masks least, else the one of the least
        log weight.
    per_frame : by frame its error, mm, or without a truth its share in the masks.
    """

    run: str
    worst_frame: int
    error: float | None
    worst: float | None
    limb_lost: int | None
    overlap: float | None
    search_lost: int
    evaluations: int
    milliseconds: float
    frames: list[int]
    per_frame: list[float | None]


@dataclass(frozen=True, slots=True)
class Sweep:
    """The result of a sweep.

    runs : in the order of `sweep_trials`.
    knobs : declarations of those that were varied.
    """

    plan: Plan
    runs: tuple[Swept, ...]
    knobs: tuple[Knob, ...]

    @property
    def measures(self) -> tuple[Measure, ...]:
        return tuple(one for one in MEASURES if any(getattr(run, one.key) is not None for run in self.runs))

    @property
    def chief(self) -> Measure:
        """The measure that ranks the points: the first that every run has."""
        return next(one for one in MEASURES if all(getattr(run, one.key) is not None for run in self.runs))

    def of_point(self, place: int) -> tuple[Swept, ...]:
        """The runs of a point of the grid, one a seed."""
        return self.runs[place :: len(self.plan.candidates)]


@dataclass(frozen=True, slots=True)
class SweepExpected:
    """What a sweep will take. evaluations : of all runs. seconds : None where no stored run of the session tells.
    judged_by : the run that does.
    """

    runs: int
    frames: int
    evaluations: int
    seconds: float | None
    judged_by: str

    @property
    def in_words(self) -> str:
        count = f"{counted(self.runs, 'run')} of {self.frames} frames"
        words = f"{count}, {self.evaluations:,} evaluations"
        if self.seconds is None:
            return f"{words}; how long that takes is known once the first one is done."
        return f"{words}: {duration_in_words(self.seconds)}, judged by run '{self.judged_by}'."


def plan_sweep(
    session: Session,
    vary: Mapping[str, Sequence[object]],
    seeds: Sequence[int],
    *,
    tracker: str = "",
    weighting: str = "",
    knobs: Mapping[str, object] | None = None,
    body: str = "",
    behaviour: str = "",
    first: int | None = None,
    last: int | None = None,
    fit_shape: bool = True,
    allow_inconsistent: bool = False,
) -> Plan:
    """A checked plan. vary : values by knob. knobs : of all runs.

    Raises SettingsError for an unknown knob, a value out of its range or too many of them; CalibrationError where the
    footage contradicts it, unless `allow_inconsistent`; RunError, BodyError, BehaviourError for what cannot be tracked.
    """
    accepted_faults(session, allow_inconsistent)
    _check_size(vary, knobs or {}, seeds)
    tracker = tracker or session.manifest.tracker or DEFAULT_TRACKER
    weighting = weighting or session.manifest.weighting or DEFAULT_WEIGHTING
    settings = session_settings(session, tracker, weighting, knobs)
    declared = {entry.name: entry for entry in all_knobs(settings)}
    grid = {name: _values(declared, name, wanted) for name, wanted in vary.items()}
    fixed = {name: values(settings)[name] for name in (knobs or {})}
    points: list[Candidate] = []
    for chosen in product(*grid.values()):
        point = dict(zip(grid, chosen, strict=True))
        own = changed_settings(settings, point)
        evaluations = TRACKERS[tracker].evaluations(own.tracker)
        points.append(Candidate(point_name(point), tracker, weighting, evaluations, {**fixed, **point}))
    model = session.body(body or None)
    first = session.start_pose_frame(model.name) if first is None else first
    begin, end = session.checked_frames(first, last)
    guided = next((one.settings() for one in points if needs_model(tracker, one.settings().tracker)), None)
    chosen = chosen_model(session, model, guided, behaviour) if guided else None
    evaluations = max(one.evaluations for one in points)
    plan = plan_of(session, tuple(points), evaluations, seeds, (begin, end), body, chosen)
    return replace(plan, vary=grid, fit_shape=fit_shape, allow_inconsistent=allow_inconsistent)


def point_name(point: Mapping[str, Value]) -> str:
    return ", ".join(f"{name} {value}" for name, value in point.items())


def sweep_trials(plan: Plan) -> tuple[Trial, ...]:
    """One a point and seed; every point's first seed first, so that an early look shows the whole grid."""
    return tuple(
        Trial(
            f"{candidate.name}, seed {seed}",
            {
                **tracking_trial_of(plan, candidate, seed).plain(),
                "fit_shape": plan.fit_shape,
                ALLOW_INCONSISTENT: plan.allow_inconsistent,
            },
        )
        for seed in plan.seeds
        for candidate in plan.candidates
    )


def run_name(sweep: str, plan: Plan, place: int) -> str:
    """The name of the run of a trial by its place: SWEEP-pPOINT-sSEED."""
    seed, point = divmod(place, len(plan.candidates))
    digits = len(str(len(plan.candidates)))
    return f"{sweep}-p{point + 1:0{digits}}-s{plan.seeds[seed]}"


def measured_run(session: Session, run: StoredRun) -> Swept:
    """A finished run's numbers. Raises RunError for one without frames."""
    with run.results() as results:
        line, (numbers, poses) = results.timeline(), results.poses()
    if not len(numbers):
        raise RunError(f"Run '{run.name}' has no finished frame.", "Track it first.")
    overlaps = {
        int(frame): float(share)
        for frame, share in zip(line.frames, line.overlaps, strict=True)
        if math.isfinite(share)
    }
    weights = dict(zip(line.frames.tolist(), line.log_weights.tolist(), strict=True))
    evaluation = None
    if session.truth_path is not None:
        try:
            truth = read_trc(session.truth_path)
            evaluation = evaluate(poses, numbers, run.body(), truth, session.manifest.fps)
        except TruthError:
            evaluation = None
    errors = dict(zip(evaluation.frames, evaluation.per_frame_mm, strict=True)) if evaluation else {}
    if errors:
        worst_frame = max(errors, key=lambda frame: errors[frame])
    else:
        worst_frame = min(overlaps or weights, key=lambda frame: (overlaps or weights)[frame])
    shown = errors or overlaps
    return Swept(
        run=run.name,
        worst_frame=worst_frame,
        error=round(evaluation.mean_mm, 4) if evaluation else None,
        worst=round(evaluation.worst_mm, 3) if evaluation else None,
        limb_lost=evaluation.lost_frames if evaluation else None,
        overlap=round(float(np.mean(list(overlaps.values()))), 5) if overlaps else None,
        search_lost=sum(state in (LOST, LIMB_LOST) for state in line.tracking),
        evaluations=int(np.median(line.evaluations)),
        milliseconds=round(float(np.mean(line.milliseconds)), 3),
        frames=[int(frame) for frame in numbers],
        per_frame=[
            round(shown[frame], 4) if frame in shown else None for frame in map(int, numbers.tolist())
        ],
    )


def conclude_sweep(plan: Plan, outcomes: Sequence[Outcome]) -> Sweep:
    """The sweep from the outcomes of all trials, in the order of `sweep_trials`."""
    known = {entry.name: entry for entry in all_knobs(plan.candidates[0].settings())}
    return Sweep(
        plan,
        tuple(Swept(**outcome.measured) for outcome in outcomes),
        tuple(known[name] for name in plan.vary),
    )


def sweep_document(sweep: Sweep) -> dict[str, Any]:
    """The JSON of `studio sweep --json` and what the page draws: `runs`, a row a run, and `points`, a row a point of
    the grid and measure, with the mean over its seeds and the 95 % bootstrap interval.
    """
    plan, chief = sweep.plan, sweep.chief
    means = {
        candidate.name: float(np.mean([getattr(run, chief.key) for run in sweep.of_point(place)]))
        for place, candidate in enumerate(plan.candidates)
    }
    best = (max if chief.more_is_better else min)(means, key=lambda name: means[name])
    return {
        "sweep": True,
        "session": plan.session,
        "frames": [plan.first, plan.last],
        "fps": plan.fps,
        "body": plan.body,
        "tracker": plan.candidates[0].tracker,
        "weighting": plan.candidates[0].weighting,
        "seeds": list(plan.seeds),
        "vary": {name: list(chosen) for name, chosen in plan.vary.items()},
        "knobs": [{"name": knob.name, "label": knob.label, "unit": knob.unit} for knob in sweep.knobs],
        "measures": [asdict(measure) for measure in sweep.measures],
        "best": {"point": best, "measure": chief.key, "mean": round(means[best], 4)},
        "software": measured_by(),
        "tables": [_runs_table(sweep), _points_table(sweep)],
    }


def sweep_csv(sweep: Sweep) -> str:
    """A row a run and frame: the knobs, the seed, the run, its error or its share in the masks."""
    what = "error_mm" if any(run.error is not None for run in sweep.runs) else "overlap"
    rows = [
        (*point, seed, run.run, frame, "" if value is None else value)
        for point, seed, run in _each(sweep)
        for frame, value in zip(run.frames, run.per_frame, strict=True)
    ]
    return as_csv([(*sweep.plan.vary, "seed", "run", "frame", what), *rows])


def sweep_text(sweep: Sweep) -> str:
    """The points for a terminal, the best first, by the measure that ranks them."""
    chief = sweep.chief
    shown = [one for one in sweep.measures if one.key != chief.key and one.key != "worst"]
    head = [*sweep.plan.vary, f"{chief.label} [95 %]", *(one.label for one in shown)]
    lines: list[tuple[float, list[str]]] = []
    for place, candidate in enumerate(sweep.plan.candidates):
        runs = sweep.of_point(place)
        mean, low, high = _mean([float(getattr(run, chief.key)) for run in runs])
        cells = [str(candidate.changes[name]) for name in sweep.plan.vary]
        cells.append(f"{mean:.4g} [{low:.4g}, {high:.4g}] {chief.unit}".rstrip())
        cells += [_cell([getattr(run, one.key) for run in runs]) for one in shown]
        lines.append((-mean if chief.more_is_better else mean, cells))
    table = [head, *(cells for _, cells in sorted(lines, key=lambda entry: entry[0]))]
    widths = [max(len(row[column]) for row in table) for column in range(len(head))]
    return "\n".join(
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in table
    )


def expected(session: Session, plan: Plan, processes: int, cores: int) -> SweepExpected:
    """How many runs a plan has and about how long they take, so many at a time on so many cores."""
    frames = plan.frame_count
    evaluations = sum(one.evaluations for one in plan.candidates) * len(plan.seeds) * frames
    runs = len(plan.candidates) * len(plan.seeds)
    first = plan.candidates[0]
    pace = stored_pace(session, first.tracker, first.weighting, evaluations / runs / frames)
    if pace is None:
        return SweepExpected(runs, frames, evaluations, None, "")
    # A run that is tracked alone has all cores, one of a sweep has one.
    share = (pace.threads or cores) / min(processes, runs)
    return SweepExpected(
        runs, frames, evaluations, pace.seconds(evaluations, runs * frames) * share, pace.run
    )


def _each(sweep: Sweep) -> list[tuple[tuple[Value, ...], int, Swept]]:
    """Every run with its point's values and its seed."""
    plan = sweep.plan
    return [
        (
            tuple(candidate.changes[name] for name in plan.vary),
            seed,
            sweep.runs[at * len(plan.candidates) + place],
        )
        for place, candidate in enumerate(plan.candidates)
        for at, seed in enumerate(plan.seeds)
    ]


def _runs_table(sweep: Sweep) -> dict[str, Any]:
    columns = [
        *_knob_columns(sweep),
        {"key": "seed", "label": "Seed", "unit": ""},
        {"key": "run", "label": "Run", "unit": ""},
        *({"key": one.key, "label": one.label, "unit": one.unit} for one in sweep.measures),
        {"key": "worst_frame", "label": "Worst frame", "unit": ""},
    ]
    rows = [
        [*point, seed, run.run, *(getattr(run, one.key) for one in sweep.measures), run.worst_frame]
        for point, seed, run in _each(sweep)
    ]
    return {"name": "runs", "title": "Every run", "columns": columns, "rows": rows}


def _points_table(sweep: Sweep) -> dict[str, Any]:
    columns = [
        *_knob_columns(sweep),
        *(
            {"key": key, "label": label, "unit": ""}
            for key, label in (
                ("measure", "Measure"), ("mean", "Mean over seeds"), ("low", "Low end, 95 %"),
                ("high", "High end, 95 %"),
            )
        ),
    ]  # fmt: skip
    rows: list[list[object]] = []
    for place, candidate in enumerate(sweep.plan.candidates):
        point = [candidate.changes[name] for name in sweep.plan.vary]
        for one in sweep.measures:
            values = [getattr(run, one.key) for run in sweep.of_point(place)]
            known = [float(value) for value in values if value is not None]
            rows.append([*point, one.key, *(_mean(known) if known else (None, None, None))])
    return {"name": "points", "title": "Points of the grid", "columns": columns, "rows": rows}


def _knob_columns(sweep: Sweep) -> list[dict[str, str]]:
    return [{"key": knob.name, "label": knob.label, "unit": knob.unit} for knob in sweep.knobs]


def _mean(numbers: list[float]) -> tuple[float, float, float]:
    low, high = bootstrap_interval(numbers)
    return round(float(np.mean(numbers)), 6), round(low, 6), round(high, 6)


def _cell(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.4g}" if known else ""


def _values(declared: Mapping[str, Knob], name: str, wanted: Sequence[object]) -> tuple[Value, ...]:
    """A knob's values as its own type. Raises SettingsError for an unknown knob, and one out of range or twice."""
    if name not in declared:
        raise SettingsError(f"There is no setting '{name}'.", f"Known: {', '.join(sorted(declared))}.")
    values = tuple(checked(declared[name], value) for value in wanted)
    if not values:
        raise SettingsError(f"Knob '{name}' has no values.", "Give it two or more.")
    for value in values:
        if values.count(value) > 1:
            raise SettingsError(f"Knob '{name}' has the value {value} twice.", "Give each value once.")
    return values


def _check_size(
    grid: Mapping[str, Sequence[object]], fixed: Mapping[str, object], seeds: Sequence[int]
) -> None:
    if not 0 < len(grid) <= MOST_KNOBS:
        raise SettingsError(
            f"{len(grid)} knobs cannot be varied at once.", f"Vary 1 to {MOST_KNOBS} of them."
        )
    for name in grid:
        if name in fixed:
            raise SettingsError(f"Knob '{name}' is both varied and set.", "Leave one of the two out.")
    check_seeds(seeds)
    runs = math.prod(len(chosen) for chosen in grid.values()) * len(seeds)
    if runs > MOST_RUNS:
        raise SettingsError(
            f"{runs} runs are too many for one sweep.", f"Give fewer values or seeds: up to {MOST_RUNS} runs."
        )
