"""Finding a start pose, in the background, with progress as `initialise` events; the scene shows what is found."""

import asyncio
import math
import secrets
import threading
from typing import Annotated

from fastapi import APIRouter, Depends

from studio.body.model import BodyModel
from studio.errors import NotFoundError, SettingsError, StudioError
from studio.runs.initialising import WEIGHTING, InitialPose, initialise, keep_pose
from studio.runs.new_run import checked_frames
from studio.sessions.session import Session
from studio.web.doors import Doors, doors_of
from studio.web.error_responses import UnforeseenError, log
from studio.web.initialisation_schemas import InitialisationRequest, InitialisationState
from studio.web.session_routes import OpenSession
from studio.weighting.catalogue import WEIGHTINGS

router = APIRouter(prefix="/api", tags=["start poses"])

Door = Annotated[Doors, Depends(doors_of)]

KEPT = 50


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession, wish: InitialisationRequest, doors: Door
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    checked_frames(session, wish.frame, wish.frame + 1)
    body = await asyncio.to_thread(session.body, wish.body or None)
    if wish.weighting and wish.weighting not in WEIGHTINGS:
        raise SettingsError(
            f"There is no weighting '{wish.weighting}'.", f"Known: {', '.join(sorted(WEIGHTINGS))}."
        )
    state = InitialisationState(
        identifier=secrets.token_hex(8), session=session.name, frame=wish.frame, state="running"
    )
    doors.initialisations[state.identifier] = state
    doors.stops[state.identifier] = threading.Event()
    while len(doors.initialisations) > KEPT:
        doors.initialisations.pop(next(iter(doors.initialisations)))
    job = asyncio.create_task(asyncio.to_thread(_initialise, doors, state.identifier, session, body, wish))
    doors.jobs.add(job)
    job.add_done_callback(doors.jobs.discard)
    return state


@router.get("/initialisations/{identifier}")
def initialisation_state(identifier: str, doors: Door) -> InitialisationState:
    """How a search for a start pose stands, and what it found."""
    state = doors.initialisations.get(identifier)
    if state is None:
        raise NotFoundError(f"There is no search for a start pose '{identifier[:40]}'.", "Begin a new one.")
    return state


@router.delete("/initialisations/{identifier}", status_code=202)
def cancel_initialisation(identifier: str, doors: Door) -> InitialisationState:
    """Stop a search; nothing of it is kept."""
    state = initialisation_state(identifier, doors)
    if identifier in doors.stops:
        doors.stops[identifier].set()
    return state


def _initialise(
    doors: Doors, identifier: str, session: Session, body: BodyModel, wish: InitialisationRequest
) -> None:
    """Search in this thread, keeping the state up to date; never raises."""
    stop = doors.stops[identifier]

    def tell(**changes: object) -> None:
        state = doors.initialisations.get(identifier)
        if state is not None:
            doors.initialisations[identifier] = state = state.model_copy(update=changes)
            message: dict[str, object] = {"type": "initialise", "session": session.name, "run": ""}
            doors.events.publish(message | state.model_dump())

    try:
        found = initialise(
            session,
            wish.frame,
            body=body,
            behaviour=wish.behaviour or "",
            weighting=wish.weighting or WEIGHTING,
            seed=wish.seed,
            progress=lambda step, done, total: tell(step=step, done=done, total=total),
            cancelled=stop.is_set,
        )
        place = keep_pose(session, found, wish.replace)
    except StudioError as error:
        tell(state="failed", code=error.code, message=error.message, hint=error.hint)
        return
    except Exception as error:
        log.exception("initialisation of '%s' failed", session.name)
        wrong = UnforeseenError(f"The search failed: {type(error).__name__}.", f"See '{doors.log_path}'.")
        tell(state="failed", code=wrong.code, message=wrong.message, hint=wrong.hint)
        return
    finally:
        doors.stops.pop(identifier, None)
    tell(state="done", file=place.name, **_answer(found))
    doors.stage.poses.propose(session.name, found.pose.tolist(), found.source, found.frame)
    doors.events.publish({"type": "sessions", "session": session.name, "run": ""})


def _answer(found: InitialPose) -> dict[str, object]:
    return {
        "body": found.body,
        "parameters": list(found.names),
        "pose": found.pose.tolist(),
        "confidence": found.confidence,
        "margin": found.margin if math.isfinite(found.margin) else None,
        "overlap": found.overlap if math.isfinite(found.overlap) else None,
        "source": found.source,
        "note": found.note,
    }
