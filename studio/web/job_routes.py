"""How work in the background is asked for and stopped: the same two addresses for every kind of it."""

from fastapi import APIRouter

from studio.web.background_jobs import JobKind, State
from studio.web.doors import Door
from studio.web.job_schemas import SessionJob


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
