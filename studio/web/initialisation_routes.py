"""Finding a start pose, in the background, with progress as `initialise` events; the scene shows what is found."""

import asyncio
from contextlib import suppress

from fastapi import APIRouter

from studio.errors import StudioError
from studio.runs.initialising import WEIGHTING, InitialPose, initialise, keep_pose
from studio.runs.new_run import checked_frames
from studio.web.doors import Door
from studio.web.initialisation_schemas import InitialisationRequest, InitialisationState
from studio.web.job_kinds import START_POSE
from studio.web.job_routes import add_job_routes
from studio.web.session_routes import OpenSession
from studio.web.windows import Window
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.jobs import Job

router = APIRouter(prefix="/api", tags=["start poses"])


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession, wish: InitialisationRequest, doors: Door, window: Window = ""
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    checked_frames(session, wish.frame, wish.frame + 1)
    body = await asyncio.to_thread(session.body, wish.body or None)
    weighting = WEIGHTINGS[wish.weighting or WEIGHTING].name

    def work(job: Job) -> dict[str, object]:
        found = initialise(
            session,
            wish.frame,
            body=body,
            behaviour=wish.behaviour or "",
            weighting=weighting,
            seed=wish.seed,
            progress=job.report,
            cancelled=job.cancelled,
        )
        place = keep_pose(session, found, wish.replace)
        with suppress(StudioError):  # without room for a scene the pose is found all the same
            scene = doors.scenes.scene(window)
            scene.poses.propose(session.name, found.pose.tolist(), found.source, found.frame)
        return {"file": place.name, **_answer(found)}

    state = InitialisationState(session=session.name, frame=wish.frame)
    return doors.jobs.begin(START_POSE, state, work)


add_job_routes(router, "/initialisations/{identifier}", START_POSE)


def _answer(found: InitialPose) -> dict[str, object]:
    return {
        "body": found.body,
        "parameters": list(found.names),
        "pose": found.pose.tolist(),
        "confidence": found.confidence,
        "margin": found.margin,
        "overlap": found.overlap,
        "source": found.source,
        "note": found.note,
    }
