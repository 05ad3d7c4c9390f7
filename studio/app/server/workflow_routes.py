"""The guided set-up: its page, a session that begins empty, and how far a session is."""

import asyncio
from typing import Annotated

from fastapi import Query
from starlette.responses import Response

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.background_routes import BACKGROUND
from studio.app.server.export_routes import EXPORT
from studio.app.server.pages import NAME, PLACES, html_page
from studio.app.server.pose_routes import START_POSE
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import RunName
from studio.app.server.session_routes import NewName, OpenSession
from studio.app.server.subject_routes import SUBJECT
from studio.app.server.track_routes import TRACK
from studio.operations.footage import new_session
from studio.operations.opening import workflow_now
from studio.runs.setup.workflow import Workflow
from studio.search.trackers.catalogue import knobs_for_evaluations
from studio.sessions.session import Session

router = Router(tags=["workflow"])


@router.get("/way", include_in_schema=False)
def page() -> Response:
    """The page of the guided set-up."""
    return html_page("setup.html", "/way", {"title": f"{PLACES['/way']} · {NAME}"})


@router.post("/api/sessions", status_code=201)
def begin(
    arguments: Annotated[Arguments, body_of(new_session, "NewSession", name=(RunName, ...))], app: App
) -> NewName:
    """Make an empty session: footage and calibration are added later."""
    session = new_session(app.workspace.place_for(arguments.more["name"]), **arguments)
    app.events.session_changed(session.name)
    return NewName(name=session.name)


@router.get("/api/evaluations")
def evaluations(tracker: str, evaluations: Annotated[int, Query(ge=1, le=1_000_000)]) -> dict[str, int]:
    """Knobs with which a tracker evaluates about so many poses a frame."""
    return knobs_for_evaluations(tracker, evaluations)


@router.get("/api/sessions/{session}/way")
async def workflow(session: OpenSession, app: App) -> Workflow:
    """Every step of the guided set-up: done, ready, blocked, stale (and why) or running."""
    return await asyncio.to_thread(workflow_now, session, running_steps(app, session))


def running_steps(app: AppState, session: Session) -> dict[str, str]:
    """Steps whose job is under way in this server, with how far it is, in words."""
    jobs = {
        "subject": SUBJECT,
        "start-pose": START_POSE,
        "background": BACKGROUND,
        "check": TRACK,
        "export": EXPORT,
    }
    return {
        step: state.step or "beginning"
        for step, kind in jobs.items()
        for state in app.jobs.going(kind, session.name)
    }
