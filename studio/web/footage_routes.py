"""A session's footage: offsets and turns by hand, and their estimate in the background (`synchrony` events).

An estimate is only shown; `PATCH …/footage` with its offsets applies it.
"""

import asyncio
import tempfile
import threading
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request, Response

from studio.capture.timestamps import TIMESTAMP_NAMES
from studio.errors import SessionError, StudioError
from studio.runs.footage_pictures import bare_picture
from studio.runs.overlay_drawing import encode_jpeg
from studio.sessions.footage_changes import change_footage, recorded_offsets, stale_runs, synchrony_of
from studio.sessions.session import Session
from studio.web.doors import Doors, doors_of, let_go
from studio.web.error_responses import UnforeseenError, log
from studio.web.footage_schemas import (
    FootageCamera,
    FootageState,
    FootageWish,
    PairView,
    SynchronyState,
    SynchronyWish,
    TimedAnswer,
)
from studio.web.session_routes import OpenSession

router = APIRouter(prefix="/api", tags=["footage"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50


class _EstimateStopped(SessionError):
    code = "cancelled"


@router.get("/sessions/{session}/footage")
def footage(session: OpenSession) -> FootageState:
    """Offsets and turns of a session's cameras, and the runs that were made before they were changed."""
    return _state(session, [])


@router.patch("/sessions/{session}/footage")
def change(session: OpenSession, wish: FootageWish, doors: Door) -> FootageState:
    """Change offsets and turns; says what that makes stale. Refused while a run of the session is being tracked."""
    let_go(doors, session.name)
    changed = change_footage(session, wish.offsets, wish.rotations)
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})
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
    return Response(encode_jpeg(picture), media_type="image/jpeg", headers={"cache-control": "no-store"})


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
    session: OpenSession, doors: Door, wish: SynchronyWish | None = None
) -> SynchronyState:
    """Begin to estimate the offsets from what moves in the pictures. Ask for its state, or wait for `synchrony`
    events.
    """
    known = doors.synchronies.get(session.name)
    if known is not None and known.state == "running":
        return known
    state = SynchronyState(session=session.name, state="running", step="reading")
    doors.synchronies[session.name] = state
    doors.stops[_stop_name(session.name)] = threading.Event()
    while len(doors.synchronies) > KEPT:
        doors.synchronies.pop(next(iter(doors.synchronies)))
    within = (wish or SynchronyWish.model_validate({})).within
    job = asyncio.create_task(asyncio.to_thread(_estimate, doors, session, within))
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


@router.get("/sessions/{session}/synchrony")
def synchrony(session: OpenSession, doors: Door) -> SynchronyState:
    """How the estimate stands and what it found; state "none" where it was not begun."""
    return doors.synchronies.get(session.name) or SynchronyState(session=session.name, state="none")


@router.delete("/sessions/{session}/synchrony", status_code=202)
def cancel_synchrony(session: OpenSession, doors: Door) -> SynchronyState:
    """Stop an estimate."""
    stop = doors.stops.get(_stop_name(session.name))
    if stop is not None:
        stop.set()
    return synchrony(session, doors)


def _estimate(doors: Doors, session: Session, within: float) -> None:
    """Estimate in this thread, keeping the state up to date; never raises."""
    stop = doors.stops[_stop_name(session.name)]

    def tell(**changes: object) -> None:
        state = doors.synchronies.get(session.name)
        if state is not None:
            doors.synchronies[session.name] = state = state.model_copy(update=changes)
            message: dict[str, object] = {"type": "synchrony", "run": ""}
            doors.events.publish(message | state.model_dump())

    def report(step: str, done: int, total: int) -> None:
        if stop.is_set():
            raise _EstimateStopped("The estimate was cancelled.", "Start it again when you like.")
        tell(step=step, done=done, total=total)

    try:
        found = synchrony_of(session, report, within)
    except StudioError as error:
        tell(state="failed", code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("synchrony of '%s' failed", session.name)
        wrong = UnforeseenError(f"The estimate failed: {type(error).__name__}.", f"See '{doors.log_path}'.")
        tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(_stop_name(session.name), None)
    tell(
        state="done",
        offsets=found.offsets,
        confidence=found.confidence,
        spread=found.within,
        sure=found.sure,
        notes=list(found.notes),
        pairs=[PairView.model_validate(pair) for pair in found.pairs],
    )


def _state(session: Session, notes: list[str]) -> FootageState:
    source = session.manifest.footage
    return FootageState(
        session=session.name,
        layout=session.manifest.layout,
        fps=source.fps,
        frame_count=source.frame_count,
        cameras=[
            FootageCamera(
                name=camera.name,
                kind=camera.kind,
                offset=camera.offset,
                turned=camera.turned,
                width=camera.width,
                height=camera.height,
                frame_count=camera.frame_count,
                has_masks=bool(camera.masks),
                has_background=bool(camera.background),
            )
            for camera in source.cameras
        ],
        stale_runs=list(stale_runs(session)),
        notes=notes,
    )


def _stop_name(session: str) -> str:
    """Where the event that stops a session's estimate is kept."""
    return f"synchrony of {session}"
