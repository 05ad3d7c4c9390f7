"""Runs: make, look, and every command to the tracking process.

Commands are posted and answered at once with an identifier; an `acknowledged` event with it follows on the
event stream. Each names its run, which the process opens first if it is not open.
"""

from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends, Query
from pydantic import Field

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState, moving
from studio.app.server.event_encoding import message_of, plain
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Request
from studio.app.server.session_routes import NewName, OpenSession, SessionChange
from studio.foundations.declaring import LARGEST
from studio.foundations.errors import RunError
from studio.foundations.progress import no_progress
from studio.operations.jobs import commands
from studio.operations.jobs.search_pace import MOST_SECONDS, PaceView, pace_view
from studio.operations.overview import LogLines, RunDetail, RunLine, RunList, run_line, run_lines, run_log
from studio.operations.overview import run_detail as detail_of
from studio.operations.tracking import branch, new_run, set_up_branch
from studio.operations.trash import TrashEntry, trash_entry
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["runs"])


class Frame(Request):
    """A frame by its number."""

    frame: int = Field(ge=0, le=LARGEST)


class ReannealRequest(Request):
    """Which frame (-1: the selected one), and whether the answer replaces the stored one."""

    frame: int = Field(-1, ge=-1, le=LARGEST)
    keep: bool = False


@dataclass(frozen=True, slots=True)
class Posted:
    """A command handed to the tracking process; an `acknowledged` event with its identifier follows."""

    identifier: str
    command: str


class PaceRequest(Request):
    """How long each tracked layer takes at least; 0: as fast as it can."""

    seconds_a_layer: float = Field(ge=0.0, le=MOST_SECONDS, allow_inf_nan=False)


RUN = "/sessions/{session}/runs/{run}"


def run_of(session: OpenSession, run: str) -> StoredRun:
    """The run that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return session.run(run)


RunInPath = Annotated[StoredRun, Depends(run_of)]
Checked = Annotated[
    bool,
    Query(
        description="Whether everything that is stored is read and checked for damage first, once by each server;"
        " thousands of frames take seconds. False: only numbers and poses are checked, and known"
        " damage is left out."
    ),
]


@router.get("/sessions/{session}/runs")
def runs(session: OpenSession) -> RunList:
    """The session's runs, newest first."""
    return run_lines(session)


@router.post("/sessions/{session}/runs", status_code=201)
def make_run(
    session: OpenSession, arguments: Annotated[Arguments, body_of(new_run, "RunRequest")], app: App
) -> RunLine:
    """A new run, ready to be started; what is left out is the session's own or the studio's default."""
    options: dict[str, Any] = {
        **arguments,
        "start_source": arguments.get("start_source") or "set in the studio",
    }
    made = new_run(session, **options, progress=no_progress)
    app.events.session_changed(session.name, made.name)
    return run_line(made.summary(), session)


@router.post(RUN + "/branch", status_code=201)
def make_branch(
    session: OpenSession,
    run: RunInPath,
    arguments: Annotated[Arguments, body_of(branch, "BranchRequest")],
    app: App,
) -> RunLine:
    """A new run with this one's frames before a frame, ready to be started: it and all after it are tracked with other
    knobs (those that were moved in this run, where none are given). This run stays as it is.
    """
    made = set_up_branch(run, **arguments)
    app.events.session_changed(session.name, made.name)
    return run_line(made.summary(), session)


@router.get(RUN)
def run_detail(session: OpenSession, run: RunInPath, check: Checked = True) -> RunDetail:
    """What was requested of the run, how far it got, and its body's parameters."""
    return detail_of(run, session, check=check)


@router.patch(RUN)
def rename_run(session: OpenSession, run: RunInPath, change: SessionChange, app: App) -> NewName:
    """Give a run another name. Refused while it is being tracked."""
    name = run.name
    if change.name is not None and change.name != name:
        with moving(app, session.name, name):
            name = app.workspace.rename_run(session.name, name, change.name).name
    app.events.session_changed(session.name, name)
    return NewName(name=name)


@router.delete(RUN)
def delete_run(session: OpenSession, run: RunInPath, app: App) -> TrashEntry:
    """Move a run to the trash. Refused while it is being tracked."""
    with moving(app, session.name, run.name):
        place = app.workspace.trash_run(session.name, run.name)
    app.events.session_changed(session.name)
    return trash_entry(place)


@router.get(RUN + "/log")
def log_of(run: RunInPath) -> LogLines:
    """What the tracking process said of this run, oldest first."""
    return run_log(run)


# As the document describes the `state` events.
STATE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"application/json": {"schema": {"$ref": "#/components/schemas/StateChanged"}}}}
}


@router.get("/worker", response_model=None, responses=STATE)
def worker_state(app: App) -> dict[str, object]:
    """The tracking process's state, as the `state` events carry it."""
    return plain(message_of(app.control.state))


@router.post("/worker/restart", status_code=202, response_model=None, responses={202: STATE[200]})
def restart_worker(app: App) -> dict[str, object]:
    """Start the tracking process again after it died, and resume what it tracked."""
    app.control.restart()
    return plain(message_of(app.control.state))


@router.get("/worker/pace")
def pace(app: App) -> PaceView:
    """How slowly a search goes that is watched, and the choices that are offered."""
    return pace_view(app.control.state.seconds_a_layer)


@router.post("/worker/pace", status_code=202)
def set_pace(request: PaceRequest, app: App) -> Posted:
    """Let each tracked layer take at least so many seconds, until the tracking process ends; results stay the same.

    Single steps and re-annealing are not slowed.
    """
    return _post(app, commands.SetPace(seconds_a_layer=request.seconds_a_layer))


@router.post(RUN + "/open", status_code=202)
def open_run(run: RunInPath, app: App) -> Posted:
    """Make the run the one that the other commands and the sliders are about."""
    return _post(app, commands.Open(**commands.about(run.folder)))


@router.post(RUN + "/start", status_code=202)
def start(run: RunInPath, app: App) -> Posted:
    """Track on from the first frame that has no result; also after the process died (resume).

    While another run is being tracked this one waits for its turn.
    """
    return _post(app, commands.Start(**commands.about(run.folder)))


@router.post(RUN + "/dequeue", status_code=202)
def dequeue(run: RunInPath, app: App) -> Posted:
    """Take the run out of those that wait to be tracked."""
    return _post(app, commands.Dequeue(**commands.about(run.folder)))


@router.post(RUN + "/pause", status_code=202)
def pause(run: RunInPath, app: App) -> Posted:
    """Stop after the layer in progress."""
    return _post_for(app, run, commands.Pause(**commands.about(run.folder)))


@router.post(RUN + "/step-layer", status_code=202)
def step_layer(run: RunInPath, app: App) -> Posted:
    """One layer, then pause inside the frame."""
    return _post_for(app, run, commands.StepLayer(**commands.about(run.folder)))


@router.post(RUN + "/step-frame", status_code=202)
def step_frame(run: RunInPath, app: App) -> Posted:
    """Finish the frame at hand or do the next, then pause."""
    return _post_for(app, run, commands.StepFrame(**commands.about(run.folder)))


@router.post(RUN + "/seek", status_code=202)
def seek(run: RunInPath, where: Frame, app: App) -> Posted:
    """Choose the frame that re-annealing works on."""
    return _post_for(app, run, commands.Seek(frame=where.frame, **commands.about(run.folder)))


@router.post(RUN + "/reanneal", status_code=202)
def reanneal(run: RunInPath, where: ReannealRequest, app: App) -> Posted:
    """Anneal a frame again with the knobs as they are; the stored answer stays, unless `keep` replaces it: then the
    frames after it are dropped, and the run as it was goes to the trash.
    """
    return _post_for(
        app, run, commands.Reanneal(frame=where.frame, keep=where.keep, **commands.about(run.folder))
    )


@router.post(RUN + "/cancel", status_code=202)
def cancel(run: RunInPath, app: App) -> Posted:
    """End the run; what was tracked stays."""
    return _post_for(app, run, commands.Cancel(**commands.about(run.folder)))


def check_free(app: AppState, run: StoredRun) -> None:
    """Raise RunError at once where the process would refuse: another run is being tracked, as far as is known here."""
    state = app.control.state
    if state.state.searches and (state.session, state.run) != (run.session_name, run.name):
        raise RunError(
            f"Run '{state.run}' of session '{state.session}' is being tracked.", "Pause it first, or wait."
        )


def _post_for(app: AppState, run: StoredRun, command: commands.Command) -> Posted:
    check_free(app, run)
    return _post(app, command)


def _post(app: AppState, command: commands.Command) -> Posted:
    app.control.send(command)
    return Posted(identifier=command.identifier, command=type(command).__name__)
