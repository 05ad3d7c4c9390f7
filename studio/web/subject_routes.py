"""The person in front of the cameras: by height, and fitted to the footage in the background (`subject` events)."""

import asyncio
import secrets
import threading
import time
from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.subject import Subject
from studio.errors import NotFoundError, StudioError
from studio.runs.overlay_drawing import encode_jpeg
from studio.runs.overlay_pictures import compose_view, forget_composers
from studio.runs.subject_choice import body_of_choice, choose_subject, keep_fitted
from studio.runs.subject_fitting import FitRequest, FittedSubject, fit_session_subject
from studio.sessions.made_from import origin_of
from studio.sessions.session import SUBJECT_NAME, Session
from studio.web.doors import Doors, doors_of
from studio.web.error_responses import UnforeseenError, log
from studio.web.picture_routes import Height
from studio.web.session_routes import OpenSession
from studio.web.subject_schemas import (
    FitSubjectRequest,
    FitSubjectState,
    LimbDrawing,
    SizeLine,
    SubjectAnswer,
    SubjectRequest,
)

router = APIRouter(prefix="/api", tags=["subject"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50


@router.get("/sessions/{session}/subject")
def subject(
    session: OpenSession,
    height_mm: Annotated[float | None, Query(description="As if the person were so tall.")] = None,
    body: Annotated[str, Query(max_length=64, description="As if it were this kinematic tree.")] = "",
) -> SubjectAnswer:
    """The session's person: every dimension of the body as a run would have it, and its limbs as it stands upright;
    with a height or body as a preview, nothing is written.
    """
    known = session.subject()
    if height_mm is None and not body:
        tree, notes = session.body_with_notes()
    else:
        known = Subject(body=body or session.manifest.body, height_mm=height_mm)
        tree, notes = body_of_choice(session, known)
    return SubjectAnswer(
        body=tree.name,
        height_mm=known.height_mm if known else None,
        dimensions=dict(tree.dimensions),
        notes=list(notes),
        source=tree.definition.source if tree.definition else "",
        limbs=limb_drawings(tree),
        saved=(session.path / SUBJECT_NAME).exists(),
        fitted=origin_of(session, "subject") is not None,
    )


@router.put("/sessions/{session}/subject")
def set_subject(session: OpenSession, wish: SubjectRequest, doors: Door) -> SubjectAnswer:
    """Write down a height (and measured lengths); everything else follows by published proportions. A body that is
    named becomes the session's.
    """
    wanted = Subject(
        body=wish.body or session.manifest.body, height_mm=wish.height_mm, lengths_mm=wish.lengths_mm
    )
    changed = choose_subject(session, wanted)
    forget_composers()
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})
    return subject(changed)


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


@router.post("/subject-fits/{identifier}/keep")
def keep_fit(identifier: str, doors: Door) -> FitSubjectState:
    """Keep what a fit found as the session's subject; the old one stays beside it."""
    found = _found(identifier, doors)
    state = doors.subject_fits[identifier]
    place = keep_fitted(doors.workspace.session(state.session), found)
    forget_composers()
    doors.subject_fits[identifier] = state = state.model_copy(update={"file": place.name})
    doors.events.publish({"type": "sessions", "session": state.session, "run": ""})
    return state


@router.get("/subject-fits/{identifier}/frames/{frame}/views/{camera}.jpg", response_class=Response)
def fitted_picture(identifier: str, frame: int, camera: str, doors: Door, height: Height = None) -> Response:
    """The found body over what a camera saw, in a frame that was looked at."""
    found = _found(identifier, doors)
    if frame not in found.frames:
        listed = ", ".join(map(str, found.frames))
        raise NotFoundError(f"Frame {frame} was not looked at in this fit.", f"These were: {listed}.")
    session = doors.workspace.session(doors.subject_fits[identifier].session)
    pose = found.poses[found.frames.index(frame)]
    picture = compose_view(
        session, None, frame, camera, ("outline", "mask"), pose, height=height, body=found.body
    )
    return Response(encode_jpeg(picture), media_type="image/jpeg", headers={"cache-control": "no-store"})


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
        place = keep_fitted(session, found).name if wish.keep else ""
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
    doors.fitted_subjects[identifier] = found
    while len(doors.fitted_subjects) > KEPT:
        doors.fitted_subjects.pop(next(iter(doors.fitted_subjects)))
    forget_composers()
    tell(state="done", file=place, seconds_left=0.0, **_answer(found))
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})


def _found(identifier: str, doors: Doors) -> FittedSubject:
    """What a fit found. Raises NotFoundError."""
    state = fit_state(identifier, doors)
    if identifier not in doors.fitted_subjects:
        raise NotFoundError(f"This fit found no subject: it is {state.state}.", "Begin a new one.")
    return doors.fitted_subjects[identifier]


def limb_drawings(body: BodyModel) -> list[LimbDrawing]:
    """The drawn limbs of a body as it stands upright."""
    entries = {limb.name: limb for limb in body.definition.limbs} if body.definition else {}
    ends = limb_ends(body, body.neutral)[0]
    found = []
    for limb, (start, end) in zip(body.drawn, ends, strict=True):
        length = entries[limb.name].length if limb.name in entries else ""
        found.append(
            LimbDrawing(
                name=limb.name,
                side=limb.side,
                start=start.tolist(),
                end=end.tolist(),
                radii=(limb.radius_start, limb.radius_end),
                dimension=length.lstrip("-") if isinstance(length, str) else "",
            )
        )
    return found


def _answer(found: FittedSubject) -> dict[str, object]:
    return {
        "body": found.body.name,
        "frames": list(found.frames),
        "poses_from": found.poses_from,
        "sizes": [SizeLine.model_validate(size) for size in found.sizes],
        "overlap_before": found.overlap_before.tolist(),
        "overlap": found.overlap.tolist(),
        "limbs": limb_drawings(found.body),
    }
