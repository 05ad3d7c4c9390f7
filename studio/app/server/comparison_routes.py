"""Comparing trackers and sweeping knobs: start in the background, look, cancel, continue, delete, download.

A comparison lies in its session's folder and is measured by processes of its own, or by the cluster that STUDIO_CLUSTER
names, one comparison at a time; how far it is comes as `comparison` events and in every list.
"""

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from fastapi import Depends, Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState, moving
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Request, RunName
from studio.app.server.session_routes import OpenSession
from studio.foundations.knobs import Value
from studio.operations.comparing import (
    MOST_TRACKERS,
    CompareRequest,
    SweepRequest,
    compare,
    expected_sweep,
    kept_sweep,
    sweep,
)
from studio.operations.comparison_folders import kept_comparison, new_comparison, place_of
from studio.operations.comparisons import (
    ComparisonChoices,
    ComparisonDetail,
    ComparisonLine,
    comparison_choices,
    comparison_detail,
    comparison_line,
    comparison_lines,
    discard_comparison,
    result_file,
)
from studio.operations.jobs import commands
from studio.operations.jobs.comparison_run import COMPARISON, ComparisonState, run_in_background
from studio.operations.jobs.job_runner import Job
from studio.operations.trash import TrashEntry, trash_entry
from studio.operations.trial_runs import run_of_trial
from studio.results.comparison.candidates import WEIGHTING
from studio.results.comparison.kept_comparison import FRAMES_NAME, RESULT_NAME, KeptComparison
from studio.results.comparison.plan import Plan
from studio.results.comparison.sweep import SweepExpected
from studio.sessions.session import Session

router = Router(prefix="/api/comparisons", tags=["comparisons"])


class CandidateRequest(Request):
    """A tracker of the comparison. name: a tracker, tracker:label, or a line-up; settings: its own knobs."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,64}(:[A-Za-z0-9_-]{1,40})?$")
    weighting: RunName | None = Field(None, description="Null: that of all.")
    settings: dict[str, Value] = Field(default_factory=dict)


class TrialRequest(Request):
    """A trial by its tracker's name in the comparison and its seed."""

    tracker: str = Field(max_length=110)
    seed: int = Field(ge=0, lt=2**63)


@dataclass(frozen=True, slots=True)
class ComparisonList:
    """Comparisons, newest first within their session."""

    comparisons: list[ComparisonLine]


@dataclass(frozen=True, slots=True)
class TrialRun:
    """The run of a trial. is_new: made by this request and not tracked yet."""

    session: str
    run: str
    is_new: bool


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
    return comparison_choices()


@router.get("")
def comparisons(app: App, session: str | None = None) -> ComparisonList:
    """The comparisons of a session, or of all."""
    names = [session] if session else [entry.name for entry in app.workspace.sessions() if not entry.problem]
    opened = [app.workspace.session(name) for name in names]
    return ComparisonList([line for one in opened for line in comparison_lines(one, partial(_going, app))])


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
    plan = SweepRequest(**_without_name(arguments)).plan(session)
    app.jobs.check_free(COMPARISON)
    return _start(app, session, kept_sweep(session, plan, arguments.get("name", "")))


@router.post("/sweeps/expected")
def expected_of_sweep(
    arguments: Annotated[Arguments, body_of(sweep, "ExpectedRequest", session=(RunName, ...))], app: App
) -> SweepExpected:
    """How many runs a sweep has and about how long they take; 422 for what cannot be swept."""
    session = app.workspace.session(arguments.more["session"])
    return expected_sweep(session, SweepRequest(**_without_name(arguments)))


@router.get(ONE)
def detail(session: OpenSession, kept: Kept, app: App) -> ComparisonDetail:
    """Everything about one comparison."""
    return comparison_detail(session, kept, _going(app, session, kept))


@router.post(ONE + "/trials")
def open_trial(session: OpenSession, kept: Kept, request: TrialRequest, app: App) -> TrialRun:
    """The run of a trial, to be looked into; where there is none it is made with the trial's settings and seed, and
    tracked. Its poses are the trial's.
    """
    before = {run.name for run in session.runs()}
    run = run_of_trial(session, kept, request.tracker, request.seed)
    is_new = run.name not in before
    if is_new:
        app.events.session_changed(session.name)
        app.control.request(commands.Start(**commands.about(run.folder)))
    return TrialRun(session.name, run.name, is_new)


@router.post(ONE + "/cancel", status_code=202)
def cancel(session: OpenSession, kept: Kept, app: App) -> ComparisonLine:
    """Stop it; finished trials are kept, and it can be continued."""
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
    place = discard_comparison(app.workspace, session, kept, partial(moving, app), runs=runs)
    app.events.session_changed(session.name)
    return trash_entry(place)


@router.get(ONE + "/result.json", response_class=Response)
def result_json(session: OpenSession, kept: Kept) -> Response:
    """The whole result as a file."""
    content = result_file(kept, RESULT_NAME)
    return files.download(content, f"{session.name}-{kept.name}.json", "application/json")


@router.get(ONE + "/frames.csv", response_class=Response)
def frames_as_csv(session: OpenSession, kept: Kept) -> Response:
    """A row a tracker, seed and frame: its error in mm and the limbs lost."""
    return files.download(result_file(kept, FRAMES_NAME), f"{session.name}-{kept.name}.csv", files.CSV)


def _plan(session: Session, arguments: Arguments) -> Plan:
    """The request, checked. Raises StudioError for what cannot be compared."""
    shared, candidates = arguments.more["settings"], arguments.more["trackers"]
    changes: dict[str, dict[str, Any]] = {"": shared} if shared else {}
    for candidate in candidates:
        own = dict(candidate.settings) | ({WEIGHTING: candidate.weighting} if candidate.weighting else {})
        if own:
            changes[candidate.name] = own
    names = [candidate.name for candidate in candidates]
    return CompareRequest(trackers=names, changes=changes, **_without_name(arguments)).plan(session)


def _without_name(arguments: Arguments) -> dict[str, Any]:
    return {name: value for name, value in arguments.items() if name != "name"}


def _start(app: AppState, session: Session, kept: KeptComparison) -> ComparisonLine:
    is_sweep = bool(kept.plan().vary)

    def work(job: Job) -> dict[str, object]:
        def report(step: str, done: int, total: int) -> None:
            job.report(step, done, total)
            if is_sweep:
                app.events.session_changed(session.name)

        return run_in_background(kept, session, job, report)

    app.jobs.begin(COMPARISON, ComparisonState(session=session.name, name=kept.name), work)
    app.events.session_changed(session.name)
    return _line(app, session, kept)


def _line(app: AppState, session: Session, kept: KeptComparison) -> ComparisonLine:
    return comparison_line(session, kept, _going(app, session, kept))


def _going(app: AppState, session: Session, kept: KeptComparison) -> ComparisonState | None:
    """How a comparison stands where it is being worked at."""
    state = app.jobs.known(COMPARISON, f"{session.name}/{kept.name}")
    return state if state is not None and state.state.is_going else None
