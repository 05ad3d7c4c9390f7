"""Finding a start pose, in the background, with progress as `initialise` events; the scene shows what is found."""

import asyncio
from contextlib import suppress
from typing import Annotated

from fastapi import APIRouter

from studio.errors import StudioError
from studio.operations.person import initialise
from studio.runs.initialising import InitialPose
from studio.runs.new_run import checked_frames
from studio.web.doors import Door
from studio.web.initialisation_schemas import InitialisationState
from studio.web.job_kinds import START_POSE
from studio.web.job_routes import add_job_routes
from studio.web.requests import Asked, body_of
from studio.web.session_routes import OpenSession
from studio.web.windows import Window
from studio.weighting.catalogue import WEIGHTINGS
from studio.worker.jobs import Job

router = APIRouter(prefix="/api", tags=["start poses"])


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession,
    asked: Annotated[Asked, body_of(initialise, "InitialisationRequest", without=("keep",))],
    doors: Door,
    window: Window = "",
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    frame = asked["frame"]
    checked_frames(session, frame, frame + 1)
    await asyncio.to_thread(session.body, asked.get("body"))
    if "weighting" in asked:
        WEIGHTINGS[asked["weighting"]]

    def work(job: Job) -> dict[str, object]:
        found = initialise(session, **asked, progress=job.report_or_stop)
        with suppress(StudioError):  # without room for a scene the pose is found all the same
            scene = doors.scenes.scene(window)
            scene.poses.propose(session.name, found.pose.tolist(), found.source, found.frame)
        return {"file": found.file.name if found.file else "", **_answer(found)}

    state = InitialisationState(session=session.name, frame=frame)
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
