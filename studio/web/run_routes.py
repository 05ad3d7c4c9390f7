"""Runs: make, look, and everything that a person may tell the tracking process.

Commands are posted and answered at once with an identifier; an `acknowledged` event with it follows on the
event stream. Each names its run, which the process opens first if it is not open.
"""

from typing import Annotated

from fastapi import APIRouter, Depends

from studio.errors import RunError
from studio.operations.tracking import new_run
from studio.progress import unheard
from studio.runs.sides import notes_of
from studio.sessions.run_log import read_log
from studio.sessions.stored_run import StoredRun
from studio.web.doors import Door, Doors, let_go
from studio.web.event_encoding import message_of, plain
from studio.web.log_schemas import LogEntry, LogLines
from studio.web.pace_schemas import PaceRequest, PaceView, SpeedView
from studio.web.requests import Asked, body_of
from studio.web.schemas import (
    Frame,
    NewName,
    Posted,
    ReannealRequest,
    RunDetail,
    RunLine,
    RunList,
    SessionChange,
    TrashEntry,
)
from studio.web.session_routes import OpenSession, trash_entry
from studio.web.session_views import completed, parameter_views
from studio.worker import commands
from studio.worker.search_pace import offered

router = APIRouter(prefix="/api", tags=["runs"])

SEARCHING = ("tracking", "compiling")
RUN = "/sessions/{session}/runs/{run}"


def run_of(session: OpenSession, run: str) -> StoredRun:
    """The run that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return session.run(run)


OpenRun = Annotated[StoredRun, Depends(run_of)]


@router.get("/sessions/{session}/runs")
def runs(session: OpenSession) -> RunList:
    """The session's runs, newest first."""
    lines = [RunLine.model_validate(run.summary()) for run in reversed(session.runs())]
    return RunList(runs=[completed(line, session) for line in lines])


@router.post("/sessions/{session}/runs", status_code=201)
def make_run(
    session: OpenSession, wish: Annotated[Asked, body_of(new_run, "RunRequest")], doors: Door
) -> RunLine:
    """A new run, ready to be started; what is left out is the session's own or the studio's default."""
    source = wish.get("start_source") or "set in the studio"
    made = new_run(session, **{**wish, "start_source": source}, progress=unheard)
    doors.events.session_changed(session.name, made.name)
    return completed(RunLine.model_validate(made.summary()), session)


@router.get(RUN)
def run_detail(session: OpenSession, run: OpenRun) -> RunDetail:
    """What the run was asked to do, how far it got, and its body's parameters."""
    record = run.record
    return RunDetail(
        run=completed(RunLine.model_validate(run.summary()), session),
        settings=dict(record.settings),
        parameters=parameter_views(run.body()),
        sigma=list(record.sigma),
        start_pose=None if record.start_pose is None else list(record.start_pose),
        start_source=record.start_source,
        software=record.software,
        fps=record.fps,
        notes=list(notes_of(run)),
        behaviour=record.behaviour,
        live=record.live,
    )


@router.patch(RUN)
def rename_run(session: OpenSession, run: OpenRun, change: SessionChange, doors: Door) -> NewName:
    """Give a run another name. Refused while it is being tracked."""
    name = run.name
    if change.name is not None and change.name != name:
        let_go(doors, session.name, name)
        name = doors.workspace.rename_run(session.name, name, change.name).name
    doors.events.session_changed(session.name, name)
    return NewName(name=name)


@router.delete(RUN)
def delete_run(session: OpenSession, run: OpenRun, doors: Door) -> TrashEntry:
    """Move a run to the trash. Refused while it is being tracked."""
    let_go(doors, session.name, run.name)
    place = doors.workspace.trash_run(session.name, run.name)
    doors.events.session_changed(session.name)
    return trash_entry(place)


@router.get(RUN + "/log")
def log_of(run: OpenRun) -> LogLines:
    """What the tracking process said of this run, oldest first."""
    return LogLines(lines=[LogEntry.model_validate(line) for line in read_log(run.folder)])


@router.get("/worker")
def worker_state(doors: Door) -> dict[str, object]:
    """The tracking process's state, as the `state` events carry it."""
    return plain(message_of(doors.control.state))


@router.post("/worker/restart", status_code=202)
def restart_worker(doors: Door) -> dict[str, object]:
    """Start the tracking process again after it died, and resume what it tracked."""
    doors.control.restart()
    return plain(message_of(doors.control.state))


@router.get("/worker/pace")
def pace(doors: Door) -> PaceView:
    """How slowly a search goes that is watched, and the choices that are offered."""
    seconds = doors.control.state.seconds_a_layer
    choices = [SpeedView.model_validate(choice) for choice in offered(seconds)]
    return PaceView(seconds_a_layer=seconds, choices=choices)


@router.post("/worker/pace", status_code=202)
def set_pace(wish: PaceRequest, doors: Door) -> Posted:
    """Let each tracked layer take at least so many seconds, until the tracking process ends; results stay the same.

    Single steps and re-annealing are not slowed.
    """
    return _post(doors, commands.SetPace(seconds_a_layer=wish.seconds_a_layer))


@router.post(RUN + "/open", status_code=202)
def open_run(run: OpenRun, doors: Door) -> Posted:
    """Make the run the one that the other commands and the sliders are about."""
    return _post(doors, commands.Open(**commands.about(run.folder)))


@router.post(RUN + "/start", status_code=202)
def start(run: OpenRun, doors: Door) -> Posted:
    """Track on from the first frame that has no result; also after the process died (resume).

    While another run is being tracked this one waits for its turn.
    """
    return _post(doors, commands.Start(**commands.about(run.folder)))


@router.post(RUN + "/dequeue", status_code=202)
def dequeue(run: OpenRun, doors: Door) -> Posted:
    """Take the run out of those that wait to be tracked."""
    return _post(doors, commands.Dequeue(**commands.about(run.folder)))


@router.post(RUN + "/pause", status_code=202)
def pause(run: OpenRun, doors: Door) -> Posted:
    """Stop after the layer in progress."""
    return _post_for(doors, run, commands.Pause(**commands.about(run.folder)))


@router.post(RUN + "/step-layer", status_code=202)
def step_layer(run: OpenRun, doors: Door) -> Posted:
    """One layer, then pause inside the frame."""
    return _post_for(doors, run, commands.StepLayer(**commands.about(run.folder)))


@router.post(RUN + "/step-frame", status_code=202)
def step_frame(run: OpenRun, doors: Door) -> Posted:
    """Finish the frame at hand or do the next, then pause."""
    return _post_for(doors, run, commands.StepFrame(**commands.about(run.folder)))


@router.post(RUN + "/seek", status_code=202)
def seek(run: OpenRun, where: Frame, doors: Door) -> Posted:
    """Choose the frame that re-annealing works on."""
    return _post_for(doors, run, commands.Seek(frame=where.frame, **commands.about(run.folder)))


@router.post(RUN + "/reanneal", status_code=202)
def reanneal(run: OpenRun, where: ReannealRequest, doors: Door) -> Posted:
    """Anneal a frame again with the knobs as they are; the stored answer stays, unless `keep` replaces it."""
    return _post_for(
        doors, run, commands.Reanneal(frame=where.frame, keep=where.keep, **commands.about(run.folder))
    )


@router.post(RUN + "/cancel", status_code=202)
def cancel(run: OpenRun, doors: Door) -> Posted:
    """End the run; what was tracked stays."""
    return _post_for(doors, run, commands.Cancel(**commands.about(run.folder)))


def check_free(doors: Doors, run: StoredRun) -> None:
    """Raise RunError at once where the process would refuse: another run is being tracked, as far as is known here."""
    state = doors.control.state
    if state.state in SEARCHING and (state.session, state.run) != (session_name(run), run.name):
        raise RunError(
            f"Run '{state.run}' of session '{state.session}' is being tracked.", "Pause it first, or wait."
        )


def session_name(run: StoredRun) -> str:
    """The name of the session that a run lies in, as events carry it."""
    return run.folder.parent.parent.name


def _post_for(doors: Doors, run: StoredRun, command: commands.Command) -> Posted:
    check_free(doors, run)
    return _post(doors, command)


def _post(doors: Doors, command: commands.Command) -> Posted:
    doors.control.send(command)
    return Posted(identifier=command.identifier, command=type(command).__name__)
