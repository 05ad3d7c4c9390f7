"""Masks of a session: how good they are, what does not count, and how they are made."""

import asyncio
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from fastapi import APIRouter, Query, Response
from fastapi import Request as HttpRequest
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Shown
from studio.app.server.app_state import App, AppState
from studio.app.server.picture_routes import Knobs, knob_changes
from studio.app.server.requests import Arguments, body_of
from studio.app.server.schemas import Answer, Number, Request, RunName
from studio.app.server.session_routes import OpenSession
from studio.app.server.upload_routes import forget, upload_folder
from studio.footage.calibration.findings import Finding
from studio.footage.capture.naming import match_names
from studio.footage.capture.pictures import is_picture
from studio.foundations.errors import FootageError, NotFoundError, RunError, StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.geometry.projection import project
from studio.foundations.knobs import Knob, Value, knobs_of
from studio.operations.jobs.job_runner import Job, JobKind, SessionJob
from studio.operations.masks import background as set_background
from studio.results.overlay_pictures import forget_composers
from studio.runs.setup.background_setup import MASK_SOURCES, SOURCES, BackgroundSource
from studio.runs.setup.best_source import SourceChoice
from studio.runs.setup.contrast import ViewContrast
from studio.runs.setup.mask_quality import MaskQuality, mask_quality, measure_masks
from studio.runs.setup.session_settings import session_settings
from studio.runs.setup.stroke_masks import unpainted_cameras
from studio.runs.setup.subject_masks import SeenSubject, seen_subjects
from studio.search.settings import values
from studio.sessions.background_files import (
    exclusion_path,
    given_masks_of,
    home_of_masks,
    read_evidence,
    set_backgrounds,
    set_exclusion,
    write_evidence,
)
from studio.sessions.names import place_in, relative_path
from studio.sessions.provenance import origin_of
from studio.sessions.session import Session
from studio.sessions.stroke_files import read_strokes
from studio.sessions.work_under_way import one_at_a_time

router = APIRouter(prefix="/api/sessions/{session}", tags=["masks"])


class ViewQualityLine(Answer):
    """One camera. covered: share of the mask under the hull's silhouette; inside: share of that in the mask; agreement:
    the smaller; denied: share of the other masks that this camera alone keeps out of the hull; note: what to look for.
    """

    camera: str
    agreement: Number
    covered: Number
    inside: Number
    denied: Number
    usable: bool
    note: str


class ContrastAnswer(Answer):
    """How well subject and background can be told apart. low: too badly; words, remedy: what is alike, and what may
    help. pose: where the pose came from that says where limbs are, "" for the hull.
    """

    low: bool
    words: str
    remedy: str
    pose: str
    views: list[ViewContrast]


class MaskQualityAnswer(Answer):
    """All cameras' masks in some frames. worst: the camera to look at first, "" where all are usable. doubts: what the
    silhouettes say against the calibration. subjects: in view, 0: not counted. contrast: null where masks are not made
    by it. unconfirmed: why agreement alone does not prove them, "" where something else does.
    """

    frames: list[int]
    cameras: list[ViewQualityLine]
    usable: bool
    hull_litres: list[Number]
    worst: str = ""
    doubts: list[Finding] = Field(default_factory=list[Finding])
    subjects: int = 0
    contrast: ContrastAnswer | None = None
    unconfirmed: str = ""


class BackgroundCamera(Answer):
    """One camera. given: what the studio was given of its empty room; excluded: whether regions of it do not count."""

    name: str
    given: Literal["", "plate", "clip"]
    file: str
    masks: bool
    excluded: bool
    width: int
    height: int


class SourceTriedLine(Answer):
    """A source in the tried frames. agreements, borders (how much the pictures change along the masks' borders), scores
    (their product): by camera, 0 to 1; worst: the least score; litres: of the hull; note: why it cannot be.
    """

    source: str
    agreements: dict[str, Number]
    borders: dict[str, Number]
    scores: dict[str, Number]
    worst: Number
    litres: Number
    note: str


class SourceChoiceAnswer(Answer):
    """How "best" decided. by_camera: the source that each camera's masks come from; mixed: of these masks together."""

    tried: list[SourceTriedLine]
    by_camera: dict[str, str]
    mixed: SourceTriedLine


class BackgroundJob(SessionJob):
    """How a set-up stands."""

    source: BackgroundSource
    notes: list[str] = Field(default_factory=list)
    knobs: dict[str, Value] = Field(default_factory=dict)
    quality: MaskQualityAnswer | None = None
    choice: SourceChoiceAnswer | None = None


BACKGROUND = JobKind(
    "background",
    "set-up of the background",
    BackgroundJob,
    changes_session=True,
    page="/way?session={session}&step=background",
)


class SourceLine(Answer):
    """What a session's masks can be made of. lacking: what is to be done first, "" where it is possible now. has_knobs:
    whether knobs of the masks change what becomes of it.
    """

    name: BackgroundSource
    label: str
    help: str
    lacking: str
    has_knobs: bool


class BackgroundAnswer(Answer):
    """A session's background. source: what it is made of, "masks" where masks came with the footage. possible: what it
    can be made of now; sources: all of them. settings: all knobs of masks with their values in use; own: those the
    session has said. measured: how far the views agreed when that was last measured, in words.
    """

    session: str
    source: BackgroundSource
    possible: list[BackgroundSource]
    sources: list[SourceLine]
    frame_count: int
    cameras: list[BackgroundCamera]
    knobs: list[Annotated[Knob, Shown]]
    settings: dict[str, Value]
    own: dict[str, Value]
    measured: str = ""
    job: BackgroundJob | None


class PlatesRequest(Request):
    """Uploaded pictures or clips of the empty room. files: camera to a name in the upload; empty: matched by name."""

    upload: RunName
    files: dict[str, str] = Field(default_factory=dict, max_length=64)


class SubjectLine(Answer):
    """A subject in view. at: x and y on the floor, metres; height: metres to its top; points: where its middle is seen,
    by camera, as shares of the picture's width and height.
    """

    at: tuple[float, float]
    litres: Number
    height: Number
    points: dict[str, tuple[float, float]]


class SubjectsAnswer(Answer):
    """Who is in view in a frame, the largest first."""

    frame: int
    subjects: list[SubjectLine]


Frames = Annotated[list[int] | None, Query(max_length=24, description="Empty: five, evenly spread.")]


class ExclusionAnswer(Answer):
    """What does not count of a camera."""

    camera: str
    pixels: int


class EvidenceAnswer(Answer):
    """Knobs of the masks that the session's new runs begin with, by flat name."""

    knobs: dict[str, Value] = Field(default_factory=dict)


@router.get("/masks/quality")
async def quality(session: OpenSession, frames: Frames = None, settings: Knobs = "") -> MaskQualityAnswer:
    """How far the views agree in the visual hull; `settings` as a preview of other knobs. Takes seconds a frame."""
    wanted = session_settings(session, changes=knob_changes(settings)).evidence
    return quality_answer(await asyncio.to_thread(mask_quality, session, wanted, tuple(frames or ())))


@router.post("/masks/quality")
async def measure(session: OpenSession) -> MaskQualityAnswer:
    """Measure the masks as the session makes them, and keep it for the guided set-up."""
    return quality_answer(await asyncio.to_thread(measure_masks, session))


@router.get("/exclusions/{camera}", response_class=Response)
def exclusion(session: OpenSession, camera: str) -> Response:
    """The painted picture of what does not count: white on black, as stored."""
    path = exclusion_path(session, camera)
    if path is None:
        raise NotFoundError(f"Nothing of camera '{camera[:64]}' is excluded.", "Paint something.")
    return files.picture(read_file(path), "png")


@router.put("/exclusions/{camera}")
async def put_exclusion(session: OpenSession, camera: str, request: HttpRequest) -> ExclusionAnswer:
    """Exclude what is painted in a PNG of the footage's size; an empty body or picture excludes nothing."""
    content = await request.body()
    pixels = await asyncio.to_thread(set_exclusion, session, camera, content)
    forget_composers()
    return ExclusionAnswer(camera=camera, pixels=pixels)


@router.get("/evidence")
def evidence(session: OpenSession) -> EvidenceAnswer:
    """The session's own knobs of masks."""
    return EvidenceAnswer(knobs=read_evidence(session).knobs)


@router.put("/evidence")
def put_evidence(session: OpenSession, request: dict[str, Value]) -> EvidenceAnswer:
    """Let new runs of the session begin with these knobs; runs that are there keep theirs."""
    session_settings(session, changes=request)
    with one_at_a_time(session.path):
        stored = read_evidence(session)
        write_evidence(session, msgspec.structs.replace(stored, knobs=dict(request)))
    return EvidenceAnswer(knobs=dict(request))


def quality_answer(found: MaskQuality) -> MaskQualityAnswer:
    """A quality as the API shows it."""
    lines = [ViewQualityLine.of(view, note=view.in_words()) for view in found.views]
    contrast = found.contrast and ContrastAnswer.of(
        found.contrast, words=found.contrast.in_words(), remedy=found.contrast.remedy()
    )
    return MaskQualityAnswer.of(
        found, cameras=lines, contrast=contrast, unconfirmed=found.why_not_confirmed()
    )


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
            "sources": [
                SourceLine.of(one, name=name, lacking="" if name in possible else one.lacking)
                for name, one in MASK_SOURCES.items()
            ],
            "frame_count": session.manifest.frame_count,
            "cameras": cameras,
            "knobs": list(knobs),
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
        made: list[BackgroundSource] = [
            name for name, one in MASK_SOURCES.items() if one.home and homes == {one.home}
        ]
        return made[0] if made else "masks"
    if model == MASK_SOURCES["threshold"].model:
        return "threshold"
    if cleaned or model == MASK_SOURCES["combined"].model:
        return "combined"
    if model == MASK_SOURCES["median"].model or not cameras or not all(one.given for one in cameras):
        return "median"
    return "clip" if cameras[0].given == "clip" else "plate"
