"""Comparisons and sweeps that a session keeps, and the trackers that can be compared."""

import logging
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat

from studio.foundations.errors import NotFoundError, RunError, StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.knobs import Value
from studio.operations.comparison_folders import kept_comparisons, runs_of, throw_away
from studio.operations.jobs.comparison_run import ComparisonState, done_before
from studio.operations.trial_runs import TrialLine, trial_lines
from studio.results.comparison.candidates import LINEUPS, VARIANTS
from studio.results.comparison.kept_comparison import RESULT_NAME, KeptComparison
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

log = logging.getLogger("studio.operations.comparisons")

Moving = Callable[[str, str], AbstractContextManager[None]]
"""moving(session, run): inside, a run may be deleted."""
Going = Callable[[Session, KeptComparison], ComparisonState | None]
"""going(session, kept): how it stands where it is being worked at, else None."""


@dataclass(frozen=True, slots=True)
class ComparisonLine:
    """A comparison in a list.

    done, total : trials.
    best : the tracker with the smallest mean error, once it is done.
    """

    session: str
    name: str
    created: str
    status: Literal["queued", "running", "cancelling", "done", "interrupted", "cancelled", "failed"]
    trackers: list[str]
    evaluations: int
    seeds: int
    first: int
    last: int
    done: int
    total: int
    tracker: Annotated[str, Field(description="Of a sweep.")] = ""
    step: str = ""
    seconds_left: FiniteFloat | None = None
    problem: str = ""
    best: str = ""
    best_mm: FiniteFloat | None = None
    vary: Annotated[
        dict[str, list[Value]],
        Field(description="Of a sweep the values of each knob, else empty; trackers are then its points."),
    ] = field(default_factory=dict[str, list[Value]])


@dataclass(frozen=True, slots=True)
class ComparisonDetail:
    """A comparison.

    settings : by tracker its weighting and knobs.
    result : null until it is done, else the numbers as `studio compare --json` (of a sweep `studio sweep --json`)
        prints them, every frame's error and the findings.
    trials : of a finished comparison.
    """

    comparison: ComparisonLine
    body: str
    behaviour: str
    fit_shape: Annotated[bool, Field(description="Of a sweep: whether each run fits the body's shape.")]
    fps: FiniteFloat
    split_frames: Annotated[
        int, Field(description="Of each trial, in how many it is measured whose fault errors are.")
    ]
    settings: dict[str, dict[str, Value]]
    result: dict[str, Any] | None
    trials: list[TrialLine]


@dataclass(frozen=True, slots=True)
class CandidateChoice:
    """A tracker, or a label of one.

    changes : its knobs.
    sized_by : knobs that follow from the evaluations.
    """

    name: str
    tracker: str
    help: str
    sized_by: list[str]
    changes: dict[str, Value]


@dataclass(frozen=True, slots=True)
class LineupChoice:
    """A name that stands for several trackers."""

    name: str
    trackers: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ComparisonChoices:
    """The trackers that can be compared."""

    candidates: list[CandidateChoice]
    lineups: list[LineupChoice]
    weightings: list[str]


def comparison_choices() -> ComparisonChoices:
    """The trackers that can be compared: by name, by labels that bring knobs, by names of several."""
    candidates = [
        CandidateChoice(
            name=name,
            tracker=tracker.name,
            help=entry.help if entry else tracker.label,
            sized_by=[knob for names in tracker.size_knobs for knob in names],
            changes=dict(entry.changes) if entry else {},
        )
        for name, entry in {**dict.fromkeys(TRACKERS), **VARIANTS}.items()
        for tracker in (TRACKERS[name.partition(":")[0]],)
    ]
    lineups = [LineupChoice(name, tuple(members)) for name, members in LINEUPS.items()]
    return ComparisonChoices(candidates, lineups, list(WEIGHTINGS))


def comparison_lines(session: Session, going: Going) -> Iterator[ComparisonLine]:
    """A session's comparisons, newest first; without folders that cannot be read, whose own address says why."""
    for kept in kept_comparisons(session):
        try:
            yield comparison_line(session, kept, going(session, kept))
        except StudioError as error:
            log.warning("comparison '%s' is left out of the list: %s", kept.folder, error)


def comparison_line(session: Session, kept: KeptComparison, job: ComparisonState | None) -> ComparisonLine:
    """A comparison in a list. job : the work on it, None if there is none."""
    record, plan = kept.record(), kept.plan(session)
    status: Any = job.state.value if job else kept.status()
    total = len(plan.seeds) * len(plan.candidates)
    if status == "done":
        done = total
    else:
        done = job.done if job and job.total else done_before(kept, plan)
    line = ComparisonLine(
        session=session.name,
        name=kept.name,
        created=record.created,
        status=status,
        trackers=[candidate.name for candidate in plan.candidates],
        tracker=plan.candidates[0].tracker if plan.vary else "",
        evaluations=plan.evaluations,
        seeds=len(plan.seeds),
        first=plan.first,
        last=plan.last,
        done=done,
        total=total,
        problem=record.problem,
        vary={name: list(chosen) for name, chosen in plan.vary.items()},
    )
    if job:
        return replace(line, step=job.step, seconds_left=job.seconds_left)
    if status != "done":
        return line
    best, best_mm = _best_of(kept, (kept.folder / RESULT_NAME).stat().st_mtime_ns)
    return replace(line, best=best, best_mm=best_mm)


@lru_cache(maxsize=512)
def _best_of(kept: KeptComparison, _written: int) -> tuple[str, float | None]:
    """The tracker (or a sweep's point) with the smallest mean error of a result that was written at a moment."""
    result = kept.result() or {}
    if swept := result.get("best"):
        return swept["point"], swept["mean"] if swept["measure"] == "error" else None
    trackers = result.get("trackers", [])
    best = min(trackers, key=lambda entry: entry["mean_mm"], default=None)
    return ("", None) if best is None else (best["tracker"], best["mean_mm"])


def comparison_detail(
    session: Session, kept: KeptComparison, job: ComparisonState | None
) -> ComparisonDetail:
    """Everything about one comparison. job : the work on it, None if there is none."""
    plan = kept.plan(session)
    return ComparisonDetail(
        comparison=comparison_line(session, kept, job),
        body=plan.body,
        behaviour=plan.behaviour,
        fit_shape=plan.fit_shape,
        split_frames=plan.split_frames,
        fps=plan.fps,
        settings={one.name: one.chosen for one in plan.candidates},
        result=kept.result(),
        trials=trial_lines(session, kept),
    )


def result_file(kept: KeptComparison, name: str) -> bytes:
    """A file of a finished comparison. Raises NotFoundError."""
    path = kept.folder / name
    if not path.is_file():
        raise NotFoundError(f"Comparison '{kept.name}' is not finished.", "Wait for it, or continue it.")
    return read_file(path)


def discard_comparison(
    workspace: Workspace, session: Session, kept: KeptComparison, moving: Moving, *, runs: bool
) -> Path:
    """Move a comparison to the trash; returns where it lies then. runs : a sweep's runs, too.

    Raises RunError while work on it continues, or one of these runs is being tracked.
    """
    own = [*runs_of(session, kept).values()] if runs and kept.plan().vary else []
    if tracked := [run.name for run in own if run.being_tracked()]:
        raise RunError(f"Run '{tracked[0]}' of the sweep is being tracked.", "Cancel it first.")
    place = throw_away(workspace, session, kept)
    for run in own:
        with moving(session.name, run.name):
            workspace.trash_run(session.name, run.name)
    return place
