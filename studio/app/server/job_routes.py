"""Work in the background: the list of all of it, and of every kind the addresses of its state and to stop it."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field, FiniteFloat

from studio.app.server.answers import Router
from studio.app.server.app_state import App
from studio.foundations.records import extended
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob, State, entries_of

router = Router(prefix="/api", tags=["jobs"])


@dataclass(frozen=True, slots=True)
class JobLine:
    """A job that is under way, or over since the studio was started. kind : type of its events. noun : what it is
    called. at : the address of its whole state, "" where the page has it. page : where what came of it is shown.
    """

    kind: str
    key: Annotated[str, Field(description="By which it is stopped.")]
    noun: str
    session: str
    name: Annotated[str, Field(description="Of what it makes, where that has one.")]
    run: str
    verb: str
    began: FiniteFloat
    state: str
    step: str
    done: int
    total: int
    seconds_left: float | None
    message: str
    hint: str
    at: str
    page: str


@dataclass(frozen=True, slots=True)
class JobList:
    """All work in the background, the oldest first."""

    jobs: list[JobLine]


@router.get("/jobs")
def jobs(
    app: App,
    session: Annotated[str | None, Query(max_length=64, description="Of this session only.")] = None,
    kind: Annotated[str, Query(max_length=64, description="Of this kind only.")] = "",
) -> JobList:
    """Jobs under way, and those that ended since the studio started: so a page that is loaded again finds its own."""
    return JobList([_line(job) for job in app.jobs.jobs(session, kind)])


@router.delete("/jobs/{kind}/{key:path}", status_code=202)
def stop_job(kind: str, key: str, app: App) -> JobLine:
    """Stop a job; nothing of it is kept but what is done frame by frame or trial by trial."""
    return _line(app.jobs.stop(kind, key))


def _line(job: Job) -> JobLine:
    state, kind, entries = job.state, job.kind, entries_of(job.state)
    return extended(
        JobLine,
        state,
        kind=kind.event,
        noun=kind.noun,
        key=state.key,
        **{name: str(entries.get(name) or "") for name in ("name", "run", "verb")},
        began=job.began,
        at=kind.address(state),
        page=kind.page_of(state),
    )


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
