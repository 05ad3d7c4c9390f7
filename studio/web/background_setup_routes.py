"""What a session's backgrounds are made of: plates and clips taken over, the set-up in the background (`background`
events), with the masks' quality at its end.
"""

import asyncio
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter

from studio.capture.naming import match_names
from studio.capture.pictures import is_picture
from studio.errors import FootageError, RunError, StudioError
from studio.knobs import knobs_of
from studio.operations.masks import background as set_background
from studio.runs.background_setup import MODEL_OF, SOURCES
from studio.runs.mask_quality import MaskQuality, measure_masks
from studio.runs.overlay_pictures import forget_composers
from studio.runs.session_settings import session_settings
from studio.sessions.background_files import exclusion_path, read_evidence, set_backgrounds
from studio.sessions.made_from import origin_of
from studio.sessions.names import place_in, relative_path
from studio.sessions.session import Session
from studio.settings import values
from studio.web.background_routes import quality_answer
from studio.web.background_schemas import (
    BackgroundAnswer,
    BackgroundCamera,
    BackgroundJob,
    PlatesWish,
)
from studio.web.doors import Door, Doors
from studio.web.job_kinds import BACKGROUND
from studio.web.requests import Asked, body_of
from studio.web.session_routes import OpenSession
from studio.web.setting_views import knob_view
from studio.web.upload_routes import forget, upload_folder
from studio.worker.jobs import Job

router = APIRouter(prefix="/api/sessions/{session}", tags=["masks"])


@router.get("/background")
def background(session: OpenSession, doors: Door) -> BackgroundAnswer:
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
    possible = [
        name for name in SOURCES if name not in ("plate", "clip") or all(one.given == name for one in cameras)
    ]
    return BackgroundAnswer.model_validate(
        {
            "session": session.name,
            "source": _source(settings.evidence.background_model, bool(evidence.given), cameras),
            "possible": possible,
            "frame_count": session.manifest.frame_count,
            "cameras": cameras,
            "knobs": [knob_view(entry) for entry in knobs],
            "settings": {entry.name: now[entry.name] for entry in knobs},
            "own": evidence.knobs,
            "measured": known.words if (known := origin_of(session, "background")) is not None else "",
            "job": doors.jobs.known(BACKGROUND, session.name),
        }
    )


@router.post("/backgrounds")
async def take_over(session: OpenSession, wish: PlatesWish, doors: Door) -> BackgroundAnswer:
    """Take over uploaded pictures or clips of the empty room; files that are not named are matched by name."""
    _check_free(doors, session.name)
    folder = upload_folder(doors, wish.upload)
    names = [path.relative_to(folder).as_posix() for path in sorted(folder.rglob("*")) if path.is_file()]
    files = dict(wish.files)
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
    await asyncio.to_thread(forget, doors, wish.upload)
    forget_composers()
    return background(changed, doors)


@router.post("/background", status_code=202)
async def begin_setup(
    session: OpenSession, asked: Annotated[Asked, body_of(set_background, "BackgroundWish")], doors: Door
) -> BackgroundJob:
    """Begin to set the background up. Ask `GET …/background` how it stands, or wait for `background` events."""
    _check_free(doors, session.name)
    session_settings(session, changes=asked["knobs"])

    def work(job: Job) -> dict[str, object]:
        try:
            made = set_background(session, **asked, progress=job.report_or_stop)
            quality = _measured(Session(session.path), job)
        finally:
            forget_composers()
        answer = quality_answer(quality) if quality is not None else None
        return {"notes": list(made.notes), "knobs": made.knobs, "quality": answer}

    return doors.jobs.begin(BACKGROUND, BackgroundJob(session=session.name, source=asked["source"]), work)


@router.delete("/background", status_code=202)
def cancel_setup(session: OpenSession, doors: Door) -> BackgroundAnswer:
    """Stop the set-up; the background stays as it was."""
    doors.jobs.cancel(BACKGROUND, session.name)
    return background(session, doors)


def _measured(session: Session, job: Job) -> MaskQuality | None:
    """The quality of the masks that are in use now, remembered; None where views cannot be compared, or nobody waits
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


def _check_free(doors: Doors, name: str) -> None:
    if doors.jobs.going(BACKGROUND, name):
        raise RunError(f"The background of '{name}' is being set up.", "Wait until it is done, or cancel it.")


def _kind(path: str) -> Literal["", "plate", "clip"]:
    return "" if not path else "plate" if is_picture(Path(path)) else "clip"


def _source(model: str, cleaned: bool, cameras: list[BackgroundCamera]) -> str:
    """What masks are made of, as `SOURCES` has it; "masks" where they are given."""
    if model == "mask" or (model == "auto" and cameras and all(one.masks for one in cameras)):
        return "masks"
    if cleaned or model == MODEL_OF["combined"]:
        return "combined"
    if model == MODEL_OF["median"] or not cameras or not all(one.given for one in cameras):
        return "median"
    return "clip" if cameras[0].given == "clip" else "plate"
