"""What a session's backgrounds are made of: plates and clips taken over, the set-up in the background (`background`
events), with the masks' quality at its end.
"""

import asyncio
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Query

from studio.capture.naming import match_names
from studio.capture.pictures import is_picture
from studio.errors import FootageError, RunError, StudioError
from studio.geometry.projection import project
from studio.jobs.job_runner import Job
from studio.knobs import knobs_of
from studio.operations.masks import background as set_background
from studio.runs.background_setup import HOME_OF, MODEL_OF, SOURCES, BackgroundSource
from studio.runs.best_source import SourceChoice
from studio.runs.mask_quality import MaskQuality, measure_masks
from studio.runs.overlay_pictures import forget_composers
from studio.runs.session_settings import session_settings
from studio.runs.stroke_masks import unpainted_cameras
from studio.runs.subject_masks import SeenSubject, seen_subjects
from studio.server.app_state import App, AppState
from studio.server.background_routes import quality_answer
from studio.server.background_schemas import (
    BackgroundAnswer,
    BackgroundCamera,
    BackgroundJob,
    PlatesRequest,
    SourceChoiceAnswer,
    SourceTriedLine,
    SubjectLine,
    SubjectsAnswer,
)
from studio.server.job_kinds import BACKGROUND
from studio.server.requests import Arguments, body_of
from studio.server.session_routes import OpenSession
from studio.server.setting_views import knob_view
from studio.server.upload_routes import forget, upload_folder
from studio.sessions.background_files import (
    exclusion_path,
    given_masks_of,
    home_of_masks,
    read_evidence,
    set_backgrounds,
)
from studio.sessions.made_from import origin_of
from studio.sessions.names import place_in, relative_path
from studio.sessions.session import Session
from studio.sessions.stroke_files import read_strokes
from studio.settings import values

router = APIRouter(prefix="/api/sessions/{session}", tags=["masks"])


@router.get("/background")
def background(session: OpenSession, app: App) -> BackgroundAnswer:
    """What masks are made of and with which knobs, and the set-up under way or the last one."""
    evidence = read_evidence(session)
    settings = session_settings(session)
    knobs = knobs_of(type(settings.evidence))
    now = values(settings)
    sources = session.manifest.footage.cameras
    cameras = [
        BackgroundCamera(
            name=source.name,
            given=_kind(evidence.given.get(source.name, source.background)),
            file=evidence.given.get(source.name, source.background).rpartition("/")[2],
            masks=bool(source.masks),
            excluded=exclusion_path(session, source.name) is not None,
            width=source.width,
            height=source.height,
        )
        for source in sources
    ]
    given_masks = given_masks_of(session)
    needs = {
        "plate": all(one.given == "plate" for one in cameras),
        "clip": all(one.given == "clip" for one in cameras),
        "person": session.is_calibrated,
        "strokes": not unpainted_cameras(session, read_strokes(session)),
        "masks": all(given_masks.values()),
        "best": session.is_calibrated and len(cameras) > 1,
        "subject": session.is_calibrated and len(cameras) > 1,
    }
    possible = [name for name in SOURCES if cameras and needs.get(name, True)]
    return BackgroundAnswer.model_validate(
        {
            "session": session.name,
            "source": _source(settings.evidence.background_model, bool(evidence.given), cameras, session),
            "possible": possible,
            "frame_count": session.manifest.frame_count,
            "cameras": cameras,
            "knobs": [knob_view(entry) for entry in knobs],
            "settings": {entry.name: now[entry.name] for entry in knobs},
            "own": evidence.knobs,
            "measured": known.words if (known := origin_of(session, "background")) is not None else "",
            "job": app.jobs.known(BACKGROUND, session.name),
        }
    )


@router.get("/subjects")
async def subjects(session: OpenSession, frame: Annotated[int, Query(ge=0)] = 0) -> SubjectsAnswer:
    """Who is in view in a frame, by the masks' hull. One can be chosen: `subject_at` of `POST …/background`."""
    seen = await asyncio.to_thread(seen_subjects, session, frame)
    cameras = session.cameras()

    def line(one: SeenSubject) -> SubjectLine:
        x, y = (1000.0 * value for value in one.at)
        points: dict[str, tuple[float, float]] = {}
        for camera in cameras:
            pixels, depths = project(camera, np.array([[x, y, 500.0 * one.height]]))
            u, v = (float(value) for value in pixels[0])
            if depths[0] > 0.0 and 0.0 <= u < camera.width and 0.0 <= v < camera.height:
                points[camera.name] = (u / camera.width, v / camera.height)
        return SubjectLine(at=one.at, litres=one.litres, height=one.height, points=points)

    return SubjectsAnswer(frame=frame, subjects=[line(one) for one in seen])


@router.post("/backgrounds")
async def take_over(session: OpenSession, request: PlatesRequest, app: App) -> BackgroundAnswer:
    """Take over uploaded pictures or clips of the empty room; files that are not named are matched by name."""
    _check_free(app, session.name)
    folder = upload_folder(app, request.upload)
    names = [path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file()]
    files = dict(request.files)
    rest = [name for name in names if name not in files.values()]
    if rest:
        cameras = [one.name for one in session.manifest.footage.cameras if one.name not in files]
        stems = {name.rpartition("/")[2].rpartition(".")[0]: name for name in rest}
        for match in match_names(list(stems), cameras, "backgrounds", FootageError):
            files[match.camera] = stems[match.footage]
    if not files:
        raise FootageError("No file has been uploaded.", "Upload a picture or a video of the empty room.")
    places = {camera: place_in(folder, relative_path(name)) for camera, name in files.items()}
    changed = await asyncio.to_thread(set_backgrounds, session, places)
    await asyncio.to_thread(forget, app, request.upload)
    forget_composers()
    return background(changed, app)


@router.post("/background", status_code=202)
async def begin_setup(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(set_background, "BackgroundRequest")],
    app: App,
) -> BackgroundJob:
    """Begin to set the background up. Ask `GET …/background` how it stands, or wait for `background` events."""
    _check_free(app, session.name)
    session_settings(session, changes=arguments["knobs"])

    def work(job: Job) -> dict[str, object]:
        try:
            made = set_background(session, **arguments, progress=job.report_or_stop)
            quality = _measured(Session(session.path), job)
        finally:
            forget_composers()
        answer = quality_answer(quality) if quality is not None else None
        choice = None if made.choice is None else _choice_answer(made.choice)
        return {"notes": list(made.notes), "knobs": made.knobs, "quality": answer, "choice": choice}

    return app.jobs.begin(BACKGROUND, BackgroundJob(session=session.name, source=arguments["source"]), work)


@router.delete("/background", status_code=202)
def cancel_setup(session: OpenSession, app: App) -> BackgroundAnswer:
    """Stop the set-up; the background stays as it was."""
    app.jobs.cancel(BACKGROUND, session.name)
    return background(session, app)


def _measured(session: Session, job: Job) -> MaskQuality | None:
    """The quality of the masks that are in use now, remembered; None where views cannot be compared, or no one waits
    for it any more.
    """
    if len(session.manifest.footage.cameras) < 2 or not session.is_calibrated:
        return None
    try:
        return measure_masks(session, progress=job.report_or_stop)
    except StudioError:
        if job.cancelled():
            return None
        raise


def _check_free(app: AppState, name: str) -> None:
    if app.jobs.going(BACKGROUND, name):
        raise RunError(f"The background of '{name}' is being set up.", "Wait until it is done, or cancel it.")


def _choice_answer(choice: SourceChoice) -> SourceChoiceAnswer:
    tried = [SourceTriedLine.of(one) for one in choice.tried]
    return SourceChoiceAnswer(tried=tried, by_camera=choice.by_camera, mixed=SourceTriedLine.of(choice.mixed))


def _kind(path: str) -> Literal["", "plate", "clip"]:
    return "" if not path else "plate" if is_picture(Path(path)) else "clip"


def _source(model: str, cleaned: bool, cameras: list[BackgroundCamera], session: Session) -> BackgroundSource:
    """What masks are made of."""
    if model == "mask" or (model == "auto" and cameras and all(one.masks for one in cameras)):
        homes = {home_of_masks(source) for source in session.manifest.footage.cameras}
        made: list[BackgroundSource] = [source for source, home in HOME_OF.items() if homes == {home}]
        return made[0] if made else "masks"
    if model == MODEL_OF["threshold"]:
        return "threshold"
    if cleaned or model == MODEL_OF["combined"]:
        return "combined"
    if model == MODEL_OF["median"] or not cameras or not all(one.given for one in cameras):
        return "median"
    return "clip" if cameras[0].given == "clip" else "plate"
