"""Comparing trackers and sweeping knobs: start in the background, look, cancel, go on, throw away, download.

A comparison lies in its session's folder and is measured by processes of its own, or by the cluster that STUDIO_CLUSTER
names, one comparison at a time; how far it is comes as `comparison` events and in every list.
"""

from functools import lru_cache
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.app_state import App, AppState, moving
from studio.app.server.error_responses import log
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer, Request, RunName
from studio.app.server.session_routes import OpenSession, TrashEntry, trash_entry
from studio.foundations.errors import NotFoundError, RunError, StudioError, WorkCancelledError
from studio.foundations.foreign_files import read_file
from studio.foundations.knobs import Value
from studio.operations.comparing import MOST_TRACKERS, compare, kept_sweep, planned, sweep
from studio.operations.jobs import commands
from studio.operations.jobs.cluster import chosen_executor
from studio.operations.jobs.comparison_run import done_before, run_comparison
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.jobs.process_executor import cores
from studio.results.comparison.candidates import LINEUPS, VARIANTS, WEIGHTING
from studio.results.comparison.folders import (
    kept_comparison,
    kept_comparisons,
    new_comparison,
    place_of,
    runs_of,
    throw_away,
)
from studio.results.comparison.kept_comparison import FRAMES_NAME, RESULT_NAME, KeptComparison
from studio.results.comparison.plan import Plan, conclude
from studio.results.comparison.sweep import SweepExpected, conclude_sweep, expected, plan_sweep
from studio.results.comparison.trial_runs import TrialLine, run_of_trial, trial_lines
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.session import Session

router = APIRouter(prefix="/api/comparisons", tags=["comparisons"])


class CandidateRequest(Request):
    """A tracker that takes part. name: a tracker, tracker:label, or a line-up; settings: its own knobs."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}(:[A-Za-z0-9_-]{1,40})?$")
    weighting: RunName | None = Field(None, description="Null: that of all.")
    settings: dict[str, Value] = Field(default_factory=dict)


class ComparisonState(SessionJob):
    """How a comparison stands that is being worked at. step: the trial that was done last; done, total: trials."""

    name: str

    @property
    def key(self) -> str:
        """The name that it is requested by."""
        return f"{self.session}/{self.name}"


COMPARISON = JobKind(
    "comparison",
    "comparison",
    ComparisonState,
    busy="Comparison '{name}' of '{session}' is running; one runs at a time.",
    keeps_session=True,
    page="/comparisons?session={session}&name={name}",
)


class ComparisonLine(Answer):
    """A comparison in a list. done, total: trials. best: the tracker with the smallest mean error, once it is done."""

    session: str
    name: str
    created: str
    status: Literal["queued", "running", "cancelling", "done", "interrupted", "cancelled", "failed"]
    trackers: list[str]
    tracker: str = Field("", description="Of a sweep.")
    evaluations: int
    seeds: int
    first: int
    last: int
    done: int
    total: int
    step: str = ""
    seconds_left: float | None = None
    problem: str = ""
    best: str = ""
    best_mm: float | None = None
    vary: dict[str, list[Value]] = Field(
        default_factory=dict[str, list[Value]],
        description="Of a sweep the values of each knob, else empty; trackers are then its points.",
    )


class ComparisonList(Answer):
    """Comparisons, newest first within their session."""

    comparisons: list[ComparisonLine]


class TrialRequest(Request):
    """A trial by its tracker's name in the comparison and its seed."""

    tracker: str = Field(max_length=110)
    seed: int = Field(ge=0, lt=2**63)


class TrialRun(Answer):
    """The run of a trial. is_new: made by this request and not tracked yet."""

    session: str
    run: str
    is_new: bool


class ComparisonDetail(Answer):
    """A comparison. settings: by tracker its weighting and knobs; result: null until it is done, else the numbers
    as `studio compare --json` prints them, every frame's error and the findings; of a sweep as `studio sweep --json`.
    trials: of a finished comparison.
    """

    comparison: ComparisonLine
    body: str
    behaviour: str = ""
    fit_shape: bool = Field(False, description="Of a sweep: whether each run fits the body's shape.")
    fps: float
    settings: dict[str, dict[str, Value]]
    result: dict[str, Any] | None
    trials: list[TrialLine]


class CandidateChoice(Answer):
    """A name that can take part. changes: the knobs that it brings along. sized_by: those that follow from the
    evaluations.
    """

    name: str
    tracker: str
    help: str
    sized_by: list[str]
    changes: dict[str, Value] = Field(default_factory=dict)


class LineupChoice(Answer):
    """A name that stands for several."""

    name: str
    trackers: list[str]


class ComparisonChoices(Answer):
    """Who can take part."""

    candidates: list[CandidateChoice]
    lineups: list[LineupChoice]
    weightings: list[str]


WHO: dict[str, Any] = {
    "session": (RunName, ...),
    "trackers": (Annotated[list[CandidateRequest], Field(min_length=1, max_length=MOST_TRACKERS)], ...),
    "settings": (
        dict[str, Value],
        Field(dict[str, Value](), description="Knobs of all trackers that have them."),
    ),
}
ONE = "/{session}/{comparison}"


def comparison_of(session: OpenSession, comparison: str) -> KeptComparison:
    """The comparison that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return kept_comparison(session, comparison)


Kept = Annotated[KeptComparison, Depends(comparison_of)]


@router.get("/choices")
def choices() -> ComparisonChoices:
    """Who can be compared: trackers, labels that bring their knobs, line-ups of several."""
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
    return ComparisonChoices(
        candidates=candidates,
        lineups=[LineupChoice(name=name, trackers=list(members)) for name, members in LINEUPS.items()],
        weightings=list(WEIGHTINGS),
    )


@router.get("")
def comparisons(app: App, session: str | None = None) -> ComparisonList:
    """The comparisons of a session, or of all."""
    names = [session] if session else [entry.name for entry in app.workspace.sessions() if not entry.problem]
    found: list[ComparisonLine] = []
    for name in names:
        opened = app.workspace.session(name)
        found += [line for kept in kept_comparisons(opened) if (line := _line_or_none(app, opened, kept))]
    return ComparisonList(comparisons=found)


@router.post("", status_code=202)
def begin(
    arguments: Annotated[Arguments, body_of(compare, "ComparisonRequest", **WHO)], app: App
) -> ComparisonLine:
    """Begin a comparison. 409 while another one runs; 422 for a session without a truth or for wrong knobs."""
    session = app.workspace.session(arguments.more["session"])
    plan = _plan(session, arguments)
    app.jobs.check_free(COMPARISON)
    kept = new_comparison(place_of(session, arguments.get("name", "")), plan, session)
    return _start(app, session, kept)


@router.post("/sweeps", status_code=202)
def begin_sweep(
    arguments: Annotated[Arguments, body_of(sweep, "SweepRequest", session=(RunName, ...))], app: App
) -> ComparisonLine:
    """Begin a sweep: runs of the session for every combination of some knobs' values. 409 while a comparison runs."""
    session = app.workspace.session(arguments.more["session"])
    plan = _sweep_plan(session, arguments)
    app.jobs.check_free(COMPARISON)
    return _start(app, session, kept_sweep(session, plan, arguments.get("name", "")))


@router.post("/sweeps/expected")
def expected_of_sweep(
    arguments: Annotated[Arguments, body_of(sweep, "ExpectedRequest", session=(RunName, ...))], app: App
) -> SweepExpected:
    """How many runs a sweep has and about how long they take; 422 for what cannot be swept."""
    session = app.workspace.session(arguments.more["session"])
    return expected(session, _sweep_plan(session, arguments), _processes(), cores())


@router.get(ONE)
def detail(session: OpenSession, kept: Kept, app: App) -> ComparisonDetail:
    """Everything about one comparison."""
    plan = kept.plan(session)
    return ComparisonDetail(
        comparison=_line(app, session, kept),
        body=plan.body,
        behaviour=plan.behaviour,
        fps=plan.fps,
        settings={
            candidate.name: {WEIGHTING: candidate.weighting, **candidate.changes}
            for candidate in plan.candidates
        },
        fit_shape=plan.fit_shape,
        result=kept.result(),
        trials=trial_lines(session, kept),
    )


@router.post(ONE + "/trials")
def open_trial(session: OpenSession, kept: Kept, request: TrialRequest, app: App) -> TrialRun:
    """The run of a trial, to be looked into; where there is none it is made with the trial's settings and seed, and
    tracked. Its poses are the trial's.
    """
    before = {run.name for run in session.runs()}
    run = run_of_trial(session, kept, request.tracker, request.seed)
    if run.name not in before:
        app.events.session_changed(session.name)
        app.control.request(commands.Start(**commands.about(run.folder)))
    return TrialRun(session=session.name, run=run.name, is_new=run.name not in before)


@router.post(ONE + "/cancel", status_code=202)
def cancel(session: OpenSession, kept: Kept, app: App) -> ComparisonLine:
    """Stop it; what is measured stays, and it can go on."""
    app.jobs.cancel(COMPARISON, f"{session.name}/{kept.name}")
    return _line(app, session, kept)


@router.post(ONE + "/resume", status_code=202)
def resume(session: OpenSession, kept: Kept, app: App) -> ComparisonLine:
    """Go on with what is not finished. 409 while any comparison runs."""
    if kept.status() == "done":
        return _line(app, session, kept)
    return _start(app, session, kept)


@router.delete(ONE)
def delete(
    session: OpenSession,
    kept: Kept,
    app: App,
    runs: Annotated[bool, Query(description="Of a sweep: its runs, too.")] = False,
) -> TrashEntry:
    """Move it to the trash. 409 while it runs, or one of the runs that shall go is being tracked."""
    own = [*runs_of(session, kept).values()] if runs and kept.plan().vary else []
    if tracked := [run.name for run in own if run.being_tracked()]:
        raise RunError(f"Run '{tracked[0]}' of the sweep is being tracked.", "Cancel it first.")
    place = throw_away(app.workspace, session, kept)
    for run in own:
        with moving(app, session.name, run.name):
            app.workspace.trash_run(session.name, run.name)
    app.events.session_changed(session.name)
    return trash_entry(place)


@router.get(ONE + "/result.json", response_class=Response)
def result_json(session: OpenSession, kept: Kept) -> Response:
    """The whole result as a file."""
    return _file(session, kept, RESULT_NAME, "application/json", "json")


@router.get(ONE + "/frames.csv", response_class=Response)
def frames_as_csv(session: OpenSession, kept: Kept) -> Response:
    """A row a tracker, seed and frame: its error in mm and the limbs lost."""
    return _file(session, kept, FRAMES_NAME, files.CSV, "csv")


def _plan(session: Session, arguments: Arguments) -> Plan:
    """The request, checked. Raises StudioError for what cannot be compared."""
    shared, candidates = arguments.more["settings"], arguments.more["trackers"]
    changes: dict[str, dict[str, Any]] = {"": shared} if shared else {}
    for candidate in candidates:
        own = dict(candidate.settings) | ({WEIGHTING: candidate.weighting} if candidate.weighting else {})
        if own:
            changes[candidate.name] = own
    return planned(session, [candidate.name for candidate in candidates], changes=changes, **arguments)


def _sweep_plan(session: Session, arguments: Arguments) -> Plan:
    """The request, checked. Raises StudioError for what cannot be swept."""
    given = {name: value for name, value in arguments.items() if name not in ("name", "seeds")}
    return plan_sweep(session, seeds=range(arguments["seeds"]), **given)


def _processes() -> int:
    """One core stays free for the studio itself, which is being looked at meanwhile."""
    return max(1, cores() - 1)


def _start(app: AppState, session: Session, kept: KeptComparison) -> ComparisonLine:
    is_sweep = bool(kept.plan().vary)

    def work(job: Job) -> dict[str, object]:
        def report(step: str, done: int, total: int) -> None:
            job.report(step, done, total)
            if is_sweep:
                app.events.session_changed(session.name)

        try:
            with chosen_executor("", session.path) as executor:
                run_comparison(
                    kept,
                    session,
                    report,
                    conclude_sweep if is_sweep else conclude,
                    processes=_processes(),
                    executor=executor,
                    checkpoint=job.check,
                )
        except WorkCancelledError:
            if not job.closing:
                kept.end("cancelled")
            raise
        except Exception as error:
            words = str(error) if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
            kept.end("failed", words)
            raise
        return {}

    app.jobs.begin(COMPARISON, ComparisonState(session=session.name, name=kept.name), work)
    app.events.session_changed(session.name)
    return _line(app, session, kept)


def _line_or_none(app: AppState, session: Session, kept: KeptComparison) -> ComparisonLine | None:
    """A line; None for a folder that cannot be read, which its own address reports."""
    try:
        return _line(app, session, kept)
    except StudioError as error:
        log.warning("comparison '%s' is left out of the list: %s", kept.folder, error)
        return None


def _line(app: AppState, session: Session, kept: KeptComparison) -> ComparisonLine:
    record, plan = kept.record(), kept.plan(session)
    job = app.jobs.known(COMPARISON, f"{session.name}/{kept.name}")
    going = job if job is not None and job.state.is_going else None
    status = going.state.value if going else kept.status()
    total = len(plan.seeds) * len(plan.candidates)
    if status == "done":
        done = total
    else:
        done = going.done if going and going.total else done_before(kept, plan)
    line = ComparisonLine(
        session=session.name,
        name=kept.name,
        created=record.created,
        status=status,  # pyright: ignore[reportArgumentType]
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
    if going:
        return line.model_copy(update={"step": going.step, "seconds_left": going.seconds_left})
    return _with_best(line, kept) if status == "done" else line


def _with_best(line: ComparisonLine, kept: KeptComparison) -> ComparisonLine:
    path = kept.folder / RESULT_NAME
    tracker, mean_mm = _best_of(kept, path.stat().st_mtime_ns)
    return line.model_copy(update={"best": tracker, "best_mm": mean_mm})


@lru_cache(maxsize=512)
def _best_of(kept: KeptComparison, _written: int) -> tuple[str, float | None]:
    """The tracker (or a sweep's point) with the smallest mean error of a result that was written at a moment."""
    result = kept.result() or {}
    if swept := result.get("best"):
        return swept["point"], swept["mean"] if swept["measure"] == "error" else None
    trackers = result.get("trackers", [])
    best = min(trackers, key=lambda entry: entry["mean_mm"], default=None)
    return ("", None) if best is None else (best["tracker"], best["mean_mm"])


def _file(session: Session, kept: KeptComparison, name: str, kind: str, ending: str) -> Response:
    path = kept.folder / name
    if not path.is_file():
        raise NotFoundError(f"Comparison '{kept.name}' is not finished.", "Wait for it, or let it go on.")
    return files.download(read_file(path), f"{session.name}-{kept.name}.{ending}", kind)
