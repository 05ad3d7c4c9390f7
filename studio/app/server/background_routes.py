"""Masks of a session: how good they are, what does not count, and how they are made."""

import asyncio
from dataclasses import dataclass
from typing import Annotated

from fastapi import Query, Response
from fastapi import Request as HttpRequest
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.picture_routes import Knobs, knob_changes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Request, RunName
from studio.app.server.session_routes import OpenSession
from studio.app.server.upload_routes import forget, upload_folder
from studio.foundations.errors import FootageError, RunError, StudioError
from studio.foundations.knobs import Value
from studio.foundations.low_priority import at_low_priority
from studio.foundations.records import extended
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.masks import (
    Background,
    MaskKnobs,
    PaintedRegion,
    background_of,
    give_plates,
    keep_mask_knobs,
    mask_knobs,
    mask_quality,
    mask_settings,
    paint_region,
    region_picture,
)
from studio.operations.masks import background as set_background
from studio.operations.subjects import SubjectsInView, subjects_in_view
from studio.runs.setup.background_setup import BackgroundSource
from studio.runs.setup.best_source import SourceChoice
from studio.runs.setup.mask_quality import MaskQuality
from studio.sessions.names import place_in, relative_path
from studio.sessions.session import Session

router = Router(prefix="/api/sessions/{session}", tags=["masks"])


class BackgroundJob(SessionJob):
    """How a set-up stands."""

    source: BackgroundSource
    notes: list[str] = Field(default_factory=list)
    knobs: dict[str, Value] = Field(default_factory=dict)
    quality: Annotated[MaskQuality | None, Shown] = None
    choice: Annotated[SourceChoice | None, Shown] = None


BACKGROUND = JobKind(
    "background",
    "set-up of the background",
    BackgroundJob,
    changes_session=True,
    page="/way?session={session}&step=background",
)


@dataclass(frozen=True, slots=True)
class BackgroundAnswer(Background):
    """A session's background, and the set-up under way or the last one."""

    job: BackgroundJob | None


class PlatesRequest(Request):
    """Uploaded pictures or clips of the empty room. files: camera to a name in the upload; empty: matched by name."""

    upload: RunName
    files: dict[str, str] = Field(default_factory=dict, max_length=64)


Frames = Annotated[list[int] | None, Query(max_length=24, description="Empty: five, evenly spread.")]


@router.get("/masks/quality")
async def quality(session: OpenSession, frames: Frames = None, settings: Knobs = "") -> MaskQuality:
    """How far the views agree in the visual hull; `settings` as a preview of other knobs. Takes seconds a frame."""
    knobs = knob_changes(settings)
    looked = at_low_priority(
        mask_quality, session, tuple(frames or ()), knobs=knobs, keep=False, progress=False
    )
    return await asyncio.wrap_future(looked)


@router.post("/masks/quality")
async def measure(session: OpenSession) -> MaskQuality:
    """Measure the masks as the session makes them, and keep it for the guided set-up."""
    return await asyncio.to_thread(mask_quality, session, progress=False)


@router.get("/exclusions/{camera}", response_class=Response)
def exclusion(session: OpenSession, camera: str) -> Response:
    """The painted picture of what does not count: white on black, as stored."""
    return files.picture(region_picture(session, "exclusions", camera), "png")


@router.put("/exclusions/{camera}")
async def put_exclusion(session: OpenSession, camera: str, request: HttpRequest) -> PaintedRegion:
    """Exclude what is painted in a PNG of the footage's size; an empty body or picture excludes nothing."""
    content = await request.body()
    return await asyncio.to_thread(paint_region, session, "exclusions", camera, content)


@router.get("/in_front/{camera}", response_class=Response)
def in_front(session: OpenSession, camera: str) -> Response:
    """The picture of what stands in front of the subject's place: white on black, as stored."""
    return files.picture(region_picture(session, "in_front", camera), "png")


@router.put("/in_front/{camera}")
async def put_in_front(session: OpenSession, camera: str, request: HttpRequest) -> PaintedRegion:
    """Say where things stand in front of the subject's place: a PNG of the footage's size; an empty body: none do."""
    content = await request.body()
    return await asyncio.to_thread(paint_region, session, "in_front", camera, content)


@router.get("/evidence")
def evidence(session: OpenSession) -> MaskKnobs:
    """The session's own knobs of masks."""
    return mask_knobs(session)


@router.put("/evidence")
def put_evidence(session: OpenSession, request: dict[str, Value]) -> MaskKnobs:
    """Let new runs of the session begin with these knobs; existing runs keep theirs."""
    return keep_mask_knobs(session, request)


@router.get("/background")
def background(session: OpenSession, app: App) -> BackgroundAnswer:
    """What masks are made of and with which knobs, and the set-up under way or the last one."""
    job = app.jobs.known(BACKGROUND, session.name)
    return extended(BackgroundAnswer, background_of(session), job=job)


@router.get("/subjects")
async def subjects(session: OpenSession, frame: Annotated[int, Query(ge=0)] = 0) -> SubjectsInView:
    """Who is in view in a frame, by the masks' hull. One can be chosen: `subject_at` of `POST …/background`."""
    return await asyncio.wrap_future(at_low_priority(subjects_in_view, session, frame))


@router.post("/backgrounds")
async def take_over(session: OpenSession, request: PlatesRequest, app: App) -> BackgroundAnswer:
    """Take over uploaded pictures or clips of the empty room; files that are not named are matched by name."""
    _check_free(app, session.name)
    folder = upload_folder(app, request.upload)
    plates = {camera: place_in(folder, relative_path(name)) for camera, name in request.files.items()}
    uploaded = [path.resolve() for path in sorted(folder.rglob("*")) if path.is_file()]
    rest = [path for path in uploaded if path not in plates.values()]
    if not plates and not rest:
        raise FootageError("No file has been uploaded.", "Upload a picture or a video of the empty room.")
    changed = await asyncio.to_thread(give_plates, session, plates, rest)
    await asyncio.to_thread(forget, app, request.upload)
    return background(changed, app)


@router.post("/background", status_code=202)
async def begin_setup(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(set_background, "BackgroundRequest")],
    app: App,
) -> BackgroundJob:
    """Begin to set the background up. Ask `GET …/background` how it stands, or wait for `background` events."""
    _check_free(app, session.name)
    mask_settings(session, arguments["knobs"])

    def work(job: Job) -> dict[str, object]:
        made = set_background(session, **arguments, progress=job.report_or_stop)
        quality = _measure(Session(session.path), job)
        return {"notes": list(made.notes), "knobs": made.knobs, "quality": quality, "choice": made.choice}

    return app.jobs.begin(BACKGROUND, BackgroundJob(session=session.name, source=arguments["source"]), work)


@router.delete("/background", status_code=202)
def cancel_setup(session: OpenSession, app: App) -> BackgroundAnswer:
    """Stop the set-up; the background stays as it was."""
    app.jobs.cancel(BACKGROUND, session.name)
    return background(session, app)


def _measure(session: Session, job: Job) -> MaskQuality | None:
    """The quality of the masks that are in use now, remembered; None where views cannot be compared, or where the job
    was cancelled meanwhile.
    """
    if not session.is_comparable:
        return None
    try:
        return mask_quality(session, progress=job.report_or_stop)
    except StudioError:
        if job.cancelled():
            return None
        raise


def _check_free(app: AppState, name: str) -> None:
    if app.jobs.going(BACKGROUND, name):
        raise RunError(f"The background of '{name}' is being set up.", "Wait until it is done, or cancel it.")
