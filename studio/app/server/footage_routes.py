"""A session's footage: offsets and turns by hand, and their estimate in the background (`synchrony` events).

An estimate is only shown; `PATCH …/footage` with its offsets applies it.
"""

import asyncio
import tempfile
from pathlib import Path
from typing import Annotated

from fastapi import Query, Request, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, release
from studio.app.server.requests import Arguments, body_of
from studio.app.server.session_routes import OpenSession
from studio.footage.capture.synchrony import PairLag
from studio.footage.capture.timestamps import TIMESTAMP_NAMES, TimedOffsets
from studio.operations.footage import FootageState, footage_state, synchronise
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.pictures import View
from studio.operations.pictures import footage_picture as picture_of

router = Router(prefix="/api", tags=["footage"])


MOST_OFFSET = 1_000_000


class SynchronyState(SessionJob):
    """How an estimate of the offsets stands, and what came of it; none of it is applied. confidence: peak over second
    peak; spread: frames that it may be off.
    """

    offsets: dict[str, int] = Field(default_factory=dict)
    confidence: dict[str, float] = Field(default_factory=dict)
    spread: dict[str, int] = Field(default_factory=dict)
    sure: bool = False
    notes: list[str] = Field(default_factory=list)
    pairs: Annotated[tuple[PairLag, ...], Shown] = ()


SYNCHRONY = JobKind(
    "synchrony",
    "estimate of the offsets",
    SynchronyState,
    at="/api/sessions/{session}/synchrony",
    page="/way?session={session}&step=footage",
)


@router.get("/sessions/{session}/footage")
def footage(session: OpenSession) -> FootageState:
    """Offsets and turns of a session's cameras, and the runs that were made before they were changed."""
    return footage_state(session)


@router.patch("/sessions/{session}/footage")
def change(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(synchronise, "FootageRequest", only=("offsets", "rotations"))],
    app: App,
) -> FootageState:
    """Change offsets and turns; says what that makes stale. Refused while a run of the session is being tracked."""
    release(app, session.name)
    if not (arguments.get("offsets") or arguments.get("rotations")):
        return footage_state(session)
    changed = synchronise(session, **arguments, progress=False)
    app.events.session_changed(session.name)
    return footage_state(changed.session, changed.change.notes if changed.change else ())


@router.get("/sessions/{session}/footage/{camera}/{frame}.jpg", response_class=Response)
def footage_picture(
    session: OpenSession,
    camera: str,
    frame: int,
    height: Annotated[int | None, Query(ge=16, le=4320, description="Empty: as stored.")] = None,
) -> Response:
    """A camera's picture with its offset and turn, as it is before any calibration (JPEG)."""
    return files.picture(picture_of(session, View(frame, camera, height=height)))


@router.post("/sessions/{session}/footage/times")
async def times(session: OpenSession, request: Request) -> TimedOffsets:
    """Offsets by a recorder's times, the raw body of a `timestamps.csv`; nothing is changed."""
    content = await request.body()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / TIMESTAMP_NAMES[0]
        path.write_bytes(content)
        read = await asyncio.to_thread(synchronise, session, timestamps=path, progress=False)
    assert isinstance(read.synchrony, TimedOffsets)
    return read.synchrony


@router.post("/sessions/{session}/synchrony", status_code=202)
async def begin_synchrony(
    session: OpenSession,
    app: App,
    arguments: Annotated[Arguments, body_of(synchronise, "SynchronyRequest", only=("within",))],
) -> SynchronyState:
    """Begin to estimate the offsets from motion. Ask for its state, or wait for `synchrony` events."""
    known = app.jobs.known(SYNCHRONY, session.name)
    if known is not None and known.state.is_going:
        return known

    def work(job: Job) -> dict[str, object]:
        estimate = synchronise(session, **arguments, progress=job.report_or_stop).synchrony
        return SYNCHRONY.entries(estimate, spread=getattr(estimate, "within", {}))

    return app.jobs.begin(SYNCHRONY, SynchronyState(session=session.name, step="reading"), work)


@router.get("/sessions/{session}/synchrony")
def synchrony(session: OpenSession, app: App) -> SynchronyState | None:
    """How the estimate stands and what came of it; null where it was not begun."""
    return app.jobs.known(SYNCHRONY, session.name)


@router.delete("/sessions/{session}/synchrony", status_code=202)
def cancel_synchrony(session: OpenSession, app: App) -> SynchronyState | None:
    """Stop an estimate."""
    app.jobs.cancel(SYNCHRONY, session.name)
    return synchrony(session, app)
