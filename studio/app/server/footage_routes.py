"""A session's footage: offsets and turns by hand, and their estimate in the background (`synchrony` events).

An estimate is only shown; `PATCH …/footage` with its offsets applies it.
"""

import asyncio
import tempfile
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.app_state import App, release
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer
from studio.app.server.session_routes import OpenSession
from studio.footage.capture.timestamps import TIMESTAMP_NAMES
from studio.operations.footage import synchronise
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.results.footage_pictures import bare_picture
from studio.runs.drawing.overlay_drawing import encode_jpeg
from studio.sessions.footage_changes import change_footage, recorded_offsets, stale_runs, synchrony_of
from studio.sessions.session import Session

router = APIRouter(prefix="/api", tags=["footage"])


MOST_OFFSET = 1_000_000


class FootageCamera(Answer):
    """One camera's footage. offset: the file's frame that is frame 0 of the session. turned: degrees clockwise."""

    name: str
    kind: str
    offset: int
    turned: int
    width: int
    height: int
    frame_count: int
    has_masks: bool
    has_background: bool


class FootageState(Answer):
    """How a session's cameras are put together. frame_count: frames that all have. stale_runs: those made before the
    footage was last changed. notes: what the change that was just made means.
    """

    session: str
    layout: str
    fps: float
    frame_count: int
    cameras: list[FootageCamera]
    stale_runs: list[str]
    notes: list[str] = Field(default_factory=list)


class TimedAnswer(Answer):
    """Offsets by a recorder's times; nothing of it is applied. apart: frames that they are apart at most after it."""

    offsets: dict[str, int]
    apart: float
    notes: list[str]


class PairView(Answer):
    """Two cameras by themselves: lag in frames, correlation there, peak over the next best, frames nearly as good."""

    first: str
    second: str
    lag: int
    peak: float
    ratio: float
    within: int
    sure: bool


class SynchronyState(SessionJob):
    """How an estimate of the offsets stands, and what it found; nothing of it is applied. confidence: peak over second
    peak; spread: frames that it may be off.
    """

    offsets: dict[str, int] = Field(default_factory=dict)
    confidence: dict[str, float] = Field(default_factory=dict)
    spread: dict[str, int] = Field(default_factory=dict)
    sure: bool = False
    notes: list[str] = Field(default_factory=list)
    pairs: list[PairView] = Field(default_factory=list[PairView])


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
    return _state(session, [])


@router.patch("/sessions/{session}/footage")
def change(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(synchronise, "FootageRequest", only=("offsets", "rotations"))],
    app: App,
) -> FootageState:
    """Change offsets and turns; says what that makes stale. Refused while a run of the session is being tracked."""
    release(app, session.name)
    changed = change_footage(session, **arguments)
    app.events.session_changed(session.name)
    return _state(changed.session, list(changed.notes))


@router.get("/sessions/{session}/footage/{camera}/{frame}.jpg", response_class=Response)
def footage_picture(
    session: OpenSession,
    camera: str,
    frame: int,
    height: Annotated[int | None, Query(ge=16, le=4320, description="Empty: as stored.")] = None,
) -> Response:
    """A camera's picture with its offset and turn, as it is before any calibration (JPEG)."""
    picture = bare_picture(session, camera, frame, height)
    return files.picture(encode_jpeg(picture))


@router.post("/sessions/{session}/footage/times")
async def times(session: OpenSession, request: Request) -> TimedAnswer:
    """Offsets by a recorder's times, the raw body of a `timestamps.csv`; nothing is changed."""
    content = await request.body()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / TIMESTAMP_NAMES[0]
        path.write_bytes(content)
        found = await asyncio.to_thread(recorded_offsets, session, path)
    return TimedAnswer(offsets=found.offsets, apart=found.apart, notes=list(found.notes))


@router.post("/sessions/{session}/synchrony", status_code=202)
async def begin_synchrony(
    session: OpenSession,
    app: App,
    arguments: Annotated[Arguments, body_of(synchronise, "SynchronyRequest", only=("within",))],
) -> SynchronyState:
    """Begin to estimate the offsets from what moves in the pictures. Ask for its state, or wait for `synchrony`
    events.
    """
    known = app.jobs.known(SYNCHRONY, session.name)
    if known is not None and known.state.is_going:
        return known

    def work(job: Job) -> dict[str, object]:
        found = synchrony_of(session, job.report_or_stop, arguments["within"])
        return SYNCHRONY.entries(found, spread=found.within)

    return app.jobs.begin(SYNCHRONY, SynchronyState(session=session.name, step="reading"), work)


@router.get("/sessions/{session}/synchrony")
def synchrony(session: OpenSession, app: App) -> SynchronyState | None:
    """How the estimate stands and what it found; null where it was not begun."""
    return app.jobs.known(SYNCHRONY, session.name)


@router.delete("/sessions/{session}/synchrony", status_code=202)
def cancel_synchrony(session: OpenSession, app: App) -> SynchronyState | None:
    """Stop an estimate."""
    app.jobs.cancel(SYNCHRONY, session.name)
    return synchrony(session, app)


def _state(session: Session, notes: list[str]) -> FootageState:
    source = session.manifest.footage
    return FootageState(
        session=session.name,
        layout=session.manifest.layout,
        fps=source.fps,
        frame_count=source.frame_count,
        cameras=[
            FootageCamera.of(
                camera,
                has_masks=bool(camera.masks),
                has_background=bool(camera.background),
            )
            for camera in source.cameras
        ],
        stale_runs=list(stale_runs(session)),
        notes=notes,
    )
