"""Finding a start pose, in the background, with progress as `initialise` events; the scene shows what is found."""

import asyncio
from contextlib import suppress
from typing import Annotated

from fastapi import APIRouter

from studio.errors import StudioError
from studio.jobs.job_runner import Job
from studio.likelihood.catalogue import WEIGHTINGS
from studio.operations.person import initialise
from studio.runs.initialising import InitialPose
from studio.runs.new_run import checked_frames
from studio.server.app_state import App
from studio.server.initialisation_schemas import InitialisationState
from studio.server.job_kinds import START_POSE
from studio.server.job_routes import add_job_routes
from studio.server.requests import Arguments, body_of
from studio.server.session_routes import OpenSession
from studio.server.windows import Window

router = APIRouter(prefix="/api", tags=["start poses"])


@router.post("/sessions/{session}/initialise", status_code=202)
async def begin_initialisation(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(initialise, "InitialisationRequest", without=("keep",))],
    app: App,
    window: Window = "",
) -> InitialisationState:
    """Begin to look for the pose in a frame. Ask for its state, or wait for `initialise` events."""
    frame = arguments["frame"]
    checked_frames(session, frame, frame + 1)
    await asyncio.to_thread(session.body, arguments.get("body"))
    if "weighting" in arguments:
        WEIGHTINGS[arguments["weighting"]]

    def work(job: Job) -> dict[str, object]:
        found = initialise(session, **arguments, progress=job.report_or_stop)
        with suppress(StudioError):  # without room for a scene the pose is found all the same
            scene = app.scenes.scene(window)
            scene.poses.propose(session.name, found.pose.tolist(), found.source, found.frame)
        return {"file": found.file.name if found.file else "", **_answer(found)}

    state = InitialisationState(session=session.name, frame=frame)
    return app.jobs.begin(START_POSE, state, work)


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
