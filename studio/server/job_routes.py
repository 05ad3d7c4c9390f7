"""The state of work in the background is read, and the work stopped, at the same two addresses for every kind of it."""

from fastapi import APIRouter

from studio.jobs.job_runner import JobKind, SessionJob, State
from studio.server.app_state import App


def add_job_routes(router: APIRouter, path: str, kind: JobKind[State]) -> None:
    """Addresses of the state of a kind of jobs, and to stop one. path : with `{identifier}`."""

    @router.get(path, response_model=kind.states, summary=f"How a {kind.noun} stands")
    def job_state(identifier: str, app: App) -> SessionJob:
        """How it stands, and what came of it."""
        return app.jobs.state(kind, identifier)

    @router.delete(path, response_model=kind.states, status_code=202, summary=f"Stop a {kind.noun}")
    def cancel_job(identifier: str, app: App) -> SessionJob:
        """Stop it; nothing of it is kept but what is done frame by frame."""
        app.jobs.cancel(kind, identifier)
        return app.jobs.state(kind, identifier)
