"""A body from its film: landmarks clicked on the cameras' pictures, the body that is made of them, and the run."""

from typing import Annotated

from fastapi import Query
from pydantic import Field

from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Request
from studio.app.server.session_routes import OpenSession
from studio.foundations.declaring import LARGEST
from studio.operations.filmed_bodies import (
    ClickedLandmarks,
    body_from_film,
    carry_clicks,
    clicked_landmarks,
    keep_landmarks,
)
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.runs.setup.body_from_film import FilmedBody
from studio.sessions.landmark_clicks import MOST_CLICKS, LandmarkClick

router = Router(prefix="/api", tags=["bodies"])


class FilmState(NumberedJob):
    """How a body from its film stands. made: the body and what was measured, once it is done."""

    made: Annotated[FilmedBody | None, Shown] = None


FILM = JobKind(
    "body-from-film",
    "body from film",
    FilmState,
    changes_session=True,
    at="/api/bodies-from-film/{identifier}",
    page="/bodies?session={session}",
)


class CarriedState(NumberedJob):
    """How a run of clicks stands. run: its name, once it is done; notes: on it."""

    run: str = ""
    notes: tuple[str, ...] = ()


CARRIED = JobKind(
    "carry-clicks",
    "run of clicked landmarks",
    CarriedState,
    changes_session=True,
    at="/api/carried-clicks/{identifier}",
    page="/?session={session}&run={run}",
)


class ClickEntry(Request):
    """One click. x, y: pixels of the picture as the footage gives it."""

    frame: int = Field(ge=0, le=LARGEST)
    camera: str = Field(max_length=64)
    landmark: str = Field(max_length=64)
    x: float
    y: float


class ClicksRequest(Request):
    """All clicks of a session."""

    clicks: list[ClickEntry] = Field(max_length=MOST_CLICKS)


@router.get("/sessions/{session}/landmarks")
def landmarks(
    session: OpenSession,
    like: Annotated[str, Query(max_length=64, description="A body; default: the session's.")] = "",
) -> ClickedLandmarks:
    """The landmarks that were clicked in a session's pictures, and those that a body has."""
    return clicked_landmarks(session, like)


@router.put("/sessions/{session}/landmarks")
def put_landmarks(session: OpenSession, request: ClicksRequest) -> list[LandmarkClick]:
    """Keep these clicks in place of those that the session has."""
    return list(keep_landmarks(session, [LandmarkClick(**one.model_dump()) for one in request.clicks]))


@router.post("/sessions/{session}/body-from-film", status_code=202)
def begin_film(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(body_from_film, "BodyFromFilmRequest")],
    app: App,
) -> FilmState:
    """Begin to make a body of the session's clicks. Ask for its state, or wait for `body-from-film` events."""

    def work(job: Job) -> dict[str, object]:
        return {"made": body_from_film(session, **arguments, progress=job.report_or_stop)}

    return app.jobs.begin(FILM, FilmState(session=session.name), work)


add_job_routes(router, "/bodies-from-film/{identifier}", FILM)


@router.post("/sessions/{session}/carry-clicks", status_code=202)
def begin_carrying(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(carry_clicks, "CarryClicksRequest")],
    app: App,
) -> CarriedState:
    """Begin to make a run of the session's clicks. Ask for its state, or wait for `carry-clicks` events."""

    def work(job: Job) -> dict[str, object]:
        made = carry_clicks(session, **arguments, progress=job.report_or_stop)
        return {"run": made.run.name, "notes": made.notes}

    return app.jobs.begin(CARRIED, CarriedState(session=session.name), work)


add_job_routes(router, "/carried-clicks/{identifier}", CARRIED)
