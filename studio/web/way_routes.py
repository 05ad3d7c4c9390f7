"""The guided way: its page, a session that begins empty, and how far a session is."""

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import Response

from studio.export.kept_exports import exported_files
from studio.operations.footage import new_session
from studio.runs.way import Way, way_of
from studio.runs.way_results import newest_run
from studio.sessions.session import Session
from studio.tracking.catalogue import knobs_for_evaluations
from studio.web.doors import Door, Doors
from studio.web.job_kinds import BACKGROUND, EXPORT, START_POSE, SUBJECT, TRACK
from studio.web.pages import NAME, PLACES, html_page
from studio.web.requests import Asked, body_of
from studio.web.schemas import NewName, RunName
from studio.web.session_routes import OpenSession
from studio.web.way_schemas import WayAnswer

router = APIRouter(tags=["way"])


@router.get("/way", include_in_schema=False)
def page() -> Response:
    """The page of the guided set-up."""
    return html_page("setup.html", "/way", {"title": f"{PLACES['/way']} · {NAME}"})


@router.post("/api/sessions", status_code=201)
def begin(
    asked: Annotated[Asked, body_of(new_session, "NewSession", name=(RunName, ...))], doors: Door
) -> NewName:
    """Make an empty session: footage and calibration are added later."""
    session = new_session(doors.workspace.place_for(asked.more["name"]), **asked)
    doors.events.session_changed(session.name)
    return NewName(name=session.name)


@router.get("/api/evaluations")
def evaluations(tracker: str, evaluations: Annotated[int, Query(ge=1, le=1_000_000)]) -> dict[str, int]:
    """Knobs with which a tracker weighs about so many poses a frame."""
    return knobs_for_evaluations(tracker, evaluations)


@router.get("/api/sessions/{session}/way")
async def way(session: OpenSession, doors: Door) -> WayAnswer:
    """Every step of the guided way: done, ready, blocked, stale (and why) or running."""
    found = await asyncio.to_thread(_way, session, running_steps(doors, session))
    return WayAnswer.model_validate(found)


def running_steps(doors: Doors, session: Session) -> dict[str, str]:
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
        for state in doors.jobs.going(kind, session.name)
    }


def _way(session: Session, running: dict[str, str]) -> Way:
    run = newest_run(session)
    return way_of(session, running, exported_files(run) if run else ())
