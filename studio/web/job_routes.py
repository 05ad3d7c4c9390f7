"""How work in the background is asked for and stopped: the same two addresses for every kind of it."""

from fastapi import APIRouter

from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.web.doors import Door, Doors
from studio.web.job_kinds import TRACK
from studio.web.track_schemas import TrackJobState, Verb
from studio.worker.jobs import JobKind, SessionJob, State, Work


def add_job_routes(router: APIRouter, path: str, kind: JobKind[State]) -> None:
    """Let jobs of a kind be asked for and stopped. path : with `{identifier}`."""

    @router.get(path, response_model=kind.states, summary=f"How a {kind.noun} stands")
    def job_state(identifier: str, doors: Door) -> SessionJob:
        """How it stands, and what came of it."""
        return doors.jobs.state(kind, identifier)

    @router.delete(path, response_model=kind.states, status_code=202, summary=f"Stop a {kind.noun}")
    def cancel_job(identifier: str, doors: Door) -> SessionJob:
        """Stop it; nothing of it is kept but what is done frame by frame."""
        doors.jobs.cancel(kind, identifier)
        return doors.jobs.state(kind, identifier)


def begin_job(doors: Doors, verb: Verb, session: Session, run: StoredRun | None, work: Work) -> TrackJobState:
    """Begin work on a session's poses or tracks. run : that it is about, if it is about one."""
    state = TrackJobState(verb=verb, session=session.name, run=run.name if run else "")
    return doors.jobs.begin(TRACK, state, work)
