"""Runs: make, look, and everything that a person may tell the tracking process.

Commands are posted and answered at once with an identifier; an `acknowledged` event with it follows on the
event stream. A command for a run that is not the open one opens it first.
"""

import secrets
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Depends

from studio.runs.new_run import RunRequest as NewRun
from studio.runs.new_run import prepare_run
from studio.sessions.stored_run import StoredRun
from studio.web.doors import Doors, doors_of
from studio.web.event_encoding import message_of
from studio.web.schemas import (
    Frame,
    LogLines,
    NewName,
    Posted,
    RunDetail,
    RunLine,
    RunList,
    RunRequest,
    SessionChange,
    TrashEntry,
)
from studio.web.session_routes import OpenSession
from studio.web.session_views import completed, parameter_views
from studio.worker import commands

router = APIRouter(prefix="/api", tags=["runs"])

Door = Annotated[Doors, Depends(doors_of)]
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
def make_run(session: OpenSession, wish: RunRequest, doors: Door) -> RunLine:
    """A new run, ready to be started; what is left out is the session's own or the studio's default."""
    request = NewRun(
        tracker=wish.tracker or "",
        weighting=wish.weighting or "",
        body=wish.body or "",
        start_pose=None if wish.start_pose is None else np.array(wish.start_pose),
        start_source="" if wish.start_pose is None else "set in the studio",
        first=wish.first,
        last=wish.last,
        seed=wish.seed,
        changes=wish.settings,
        name=wish.name or "",
    )
    made = prepare_run(session, request)
    doors.events.publish({"type": "sessions", "session": session.name, "run": made.name})
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
        notes=list(record.notes),
    )


@router.patch(RUN)
def rename_run(session: OpenSession, run: OpenRun, change: SessionChange, doors: Door) -> NewName:
    """Give a run another name. Refused while it is being tracked."""
    name = run.name
    if change.name is not None and change.name != name:
        name = doors.workspace.rename_run(session.name, name, change.name).name
    doors.events.publish({"type": "sessions", "session": session.name, "run": name})
    return NewName(name=name)


@router.delete(RUN)
def delete_run(session: OpenSession, run: OpenRun, doors: Door) -> TrashEntry:
    """Move a run to the trash. Refused while it is being tracked."""
    place = doors.workspace.trash_run(session.name, run.name)
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})
    return TrashEntry(id=place.name, name=run.name, restorable=False)


@router.get(RUN + "/log")
def log_of(session: OpenSession, run: OpenRun, doors: Door) -> LogLines:
    """What the tracking process said of this run, oldest first."""
    return LogLines(lines=doors.events.log_of(session.name, run.name))


@router.get("/worker")
def worker_state(doors: Door) -> dict[str, object]:
    """The tracking process's state, as the `state` events carry it."""
    return message_of(doors.control.state)


@router.post("/worker/restart", status_code=202)
def restart_worker(doors: Door) -> dict[str, object]:
    """Start the tracking process again after it died."""
    doors.control.restart()
    return message_of(doors.control.state)


@router.post(RUN + "/open", status_code=202)
def open_run(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """Make the run the one that the other commands and the sliders are about."""
    return _post(doors, commands.Open(new_identifier(), str(session.path), str(run.folder)))


@router.post(RUN + "/start", status_code=202)
def start(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """Track on from the first frame that has no result; also after the process died (resume)."""
    return _post_for(doors, session.path.as_posix(), run, commands.Start(new_identifier()))


@router.post(RUN + "/pause", status_code=202)
def pause(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """Stop after the layer in progress."""
    return _post_for(doors, session.path.as_posix(), run, commands.Pause(new_identifier()))


@router.post(RUN + "/step-layer", status_code=202)
def step_layer(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """One layer, then pause inside the frame."""
    return _post_for(doors, session.path.as_posix(), run, commands.StepLayer(new_identifier()))


@router.post(RUN + "/step-frame", status_code=202)
def step_frame(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """Finish the frame at hand or do the next, then pause."""
    return _post_for(doors, session.path.as_posix(), run, commands.StepFrame(new_identifier()))


@router.post(RUN + "/seek", status_code=202)
def seek(session: OpenSession, run: OpenRun, where: Frame, doors: Door) -> Posted:
    """Choose the frame that re-annealing works on."""
    return _post_for(doors, session.path.as_posix(), run, commands.Seek(new_identifier(), where.frame))


@router.post(RUN + "/reanneal", status_code=202)
def reanneal(session: OpenSession, run: OpenRun, where: Frame, doors: Door) -> Posted:
    """Anneal a stored frame again with the knobs as they are; the stored answer stays."""
    return _post_for(doors, session.path.as_posix(), run, commands.Reanneal(new_identifier(), where.frame))


@router.post(RUN + "/cancel", status_code=202)
def cancel(session: OpenSession, run: OpenRun, doors: Door) -> Posted:
    """End the run; what was tracked stays."""
    return _post_for(doors, session.path.as_posix(), run, commands.Cancel(new_identifier()))


def new_identifier() -> str:
    """A command's identifier."""
    return secrets.token_hex(8)


def _post_for(doors: Doors, session: str, run: StoredRun, command: commands.Command) -> Posted:
    ensure_open(doors, session, run)
    return _post(doors, command)


def ensure_open(doors: Doors, session: str, run: StoredRun) -> None:
    """Open a run unless it is the open one; revive the process if it died."""
    state = doors.control.state
    if state.state == "lost":
        doors.control.restart()
    elif (state.session, state.run) == (run.record.session, run.name):
        return
    doors.control.send(commands.Open(new_identifier(), session, str(run.folder)))


def _post(doors: Doors, command: commands.Command) -> Posted:
    doors.control.send(command)
    return Posted(identifier=command.identifier, command=type(command).__name__)
