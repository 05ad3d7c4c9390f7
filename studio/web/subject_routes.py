"""The person in front of the cameras: by height, and fitted to the footage in the background (`subject` events)."""

import asyncio
import secrets
import threading
import time
from typing import Annotated

from fastapi import APIRouter, Depends

from studio.body.catalogue import load_body
from studio.body.subject import Subject, fit_subject, write_subject
from studio.errors import NotFoundError, StudioError
from studio.runs.overlay_pictures import forget_composers
from studio.runs.subject_fitting import FitRequest, FittedSubject, fit_session_subject, keep_subject
from studio.sessions.session import SUBJECT_NAME, Session
from studio.web.doors import Doors, doors_of
from studio.web.error_responses import UnforeseenError, log
from studio.web.session_routes import OpenSession
from studio.web.subject_schemas import (
    FitSubjectRequest,
    FitSubjectState,
    SizeLine,
    SubjectAnswer,
    SubjectRequest,
)

router = APIRouter(prefix="/api", tags=["subject"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50


@router.get("/sessions/{session}/subject")
def subject(session: OpenSession) -> SubjectAnswer:
    """The session's person: every dimension of the body as a run would have it."""
    known = session.subject()
    body, notes = session.body_with_notes()
    return SubjectAnswer(
        body=body.name,
        height_mm=known.height_mm if known else None,
        dimensions=dict(body.dimensions),
        notes=list(notes),
        source=body.definition.source if body.definition else "",
    )


@router.put("/sessions/{session}/subject")
def set_subject(session: OpenSession, wish: SubjectRequest) -> SubjectAnswer:
    """Write down a height (and measured lengths); everything else follows by published proportions."""
    wanted = Subject(
        body=wish.body or session.manifest.body, height_mm=wish.height_mm, lengths_mm=wish.lengths_mm
    )
    fit_subject(load_body(wanted.body, session.body_folders), wanted, session.body_folders)
    write_subject(wanted, session.path / SUBJECT_NAME)
    forget_composers()
    return subject(session)


@router.post("/sessions/{session}/fit-subject", status_code=202)
async def begin_fit(session: OpenSession, wish: FitSubjectRequest, doors: Door) -> FitSubjectState:
    """Begin to fit lengths and radii. Ask for its state, or wait for `subject` events."""
    await asyncio.to_thread(session.body, wish.body)
    state = FitSubjectState(identifier=secrets.token_hex(8), session=session.name, state="running")
    doors.subject_fits[state.identifier] = state
    doors.stops[state.identifier] = threading.Event()
    while len(doors.subject_fits) > KEPT:
        doors.subject_fits.pop(next(iter(doors.subject_fits)))
    job = asyncio.create_task(asyncio.to_thread(_fit, doors, state.identifier, session, wish))
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


@router.get("/subject-fits/{identifier}")
def fit_state(identifier: str, doors: Door) -> FitSubjectState:
    """How a fit stands, and what it found: each length before and after."""
    state = doors.subject_fits.get(identifier)
    if state is None:
        raise NotFoundError(f"There is no fit '{identifier[:40]}'.", "Begin a new one.")
    return state


@router.delete("/subject-fits/{identifier}", status_code=202)
def cancel_fit(identifier: str, doors: Door) -> FitSubjectState:
    """Stop a fit; nothing of it is kept."""
    state = fit_state(identifier, doors)
    if identifier in doors.stops:
        doors.stops[identifier].set()
    return state


def _fit(doors: Doors, identifier: str, session: Session, wish: FitSubjectRequest) -> None:
    """Fit in this thread, keeping the state up to date; never raises."""
    stop, begun = doors.stops[identifier], time.monotonic()
    last_step, step_begun = "", begun

    def tell(**changes: object) -> None:
        state = doors.subject_fits.get(identifier)
        if state is not None:
            doors.subject_fits[identifier] = state = state.model_copy(update=changes)
            message: dict[str, object] = {"type": "subject", "session": session.name, "run": ""}
            doors.events.publish(message | state.model_dump())

    def progress(step: str, done: int, total: int) -> None:
        nonlocal last_step, step_begun
        now = time.monotonic()
        if step != last_step:
            last_step, step_begun = step, now
        left = (now - step_begun) / done * (total - done) if done else None
        tell(step=step, done=done, total=total, seconds_left=left)

    try:
        request = FitRequest(
            frames=tuple(wish.frames),
            count=wish.count,
            symmetric=wish.symmetric,
            lengths=wish.lengths,
            radii=wish.radii,
            run=wish.run or "",
            body=wish.body or "",
            height_mm=wish.height_mm,
            seed=wish.seed,
        )
        found = fit_session_subject(session, request, progress=progress, cancelled=stop.is_set)
        place = keep_subject(session, found).name if wish.keep else ""
    except StudioError as error:
        tell(state="failed", code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("fitting the subject of '%s' failed", session.name)
        wrong = UnforeseenError(f"The fit failed: {type(error).__name__}.", f"See '{doors.log_path}'.")
        tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(identifier, None)
    forget_composers()
    tell(state="done", file=place, seconds_left=0.0, **_answer(found))
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})


def _answer(found: FittedSubject) -> dict[str, object]:
    return {
        "body": found.body.name,
        "frames": list(found.frames),
        "poses_from": found.poses_from,
        "sizes": [SizeLine.model_validate(size) for size in found.sizes],
        "overlap_before": found.overlap_before.tolist(),
        "overlap": found.overlap.tolist(),
    }
