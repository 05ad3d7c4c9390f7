"""Sessions, cameras and bodies as the API shows them."""

import dataclasses
from dataclasses import dataclass

from pydantic import Field

from studio.app.server.run_errors import mean_error
from studio.app.server.schemas import Answer, Number, Numbers
from studio.body.dimensions import follows_height
from studio.body.model import BodyModel
from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.naming import CameraMatch
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.operations.comparison_folders import comparison_count
from studio.operations.run_settings import history_of
from studio.runs.setup.silhouette_doubts import standing_doubts
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, SettingsHistory
from studio.search.trackers.catalogue import size_in_words
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import RunSummary
from studio.sessions.workspace import SessionSummary, next_step

NOTHING_CHANGED = SettingsHistory()


@dataclass(frozen=True)
class RunLine(RunSummary):
    """A run in a list: its status, computed from its store. describe : tracker, layers and particles in a few words.
    mean_mm : mean marker error where the session has a truth.
    """

    describe: str = ""
    mean_mm: float | None = None


class SessionLine(Answer):
    """A session in a list; runs newest first. thumbnail: address of a JPEG. problem: why it cannot be
    opened.
    """

    name: str
    title: str
    created: str
    body: str
    tracker: str
    weighting: str
    cameras: int
    camera_names: list[str]
    frame_count: int
    fps: float
    has_truth: bool
    thumbnail: str
    notes: list[str]
    warnings: list[str]
    runs: list[RunLine]
    comparisons: int = 0
    next_step: str = Field("", description="footage or calibration, where that is lacking; else empty.")
    problem: str = ""


class CameraView(Answer):
    """A calibrated camera and its footage."""

    name: str
    width: int
    height: int
    quarter_turns: int = Field(description="Clockwise quarter turns that show the picture upright.")
    matrix: list[list[float]]
    distortion: Numbers
    rotation: list[list[float]]
    translation: Numbers
    centre: Numbers
    picture_width: int
    picture_height: int
    frame_count: int
    has_masks: bool
    has_background: bool


class ParameterView(Answer):
    """One entry of the pose vector. unit: mm or rad; limits null where there are none."""

    name: str
    label: str
    unit: str
    lower: Number
    upper: Number
    max_step: Number
    neutral: float
    limb: str


class BodyView(Answer):
    """A body as tables: parameters in the order of the pose vector. by_height: whether its lengths follow from a
    person's height, unlike those of animals and machines.
    """

    name: str
    title: str
    by_height: bool
    parameters: list[ParameterView]
    limbs: list[str]
    markers: list[str]
    dimensions: dict[str, float]


class SubjectView(Answer):
    """The person's measures, mm."""

    body: str
    height_mm: Number
    lengths_mm: dict[str, float]


class SessionDetail(Answer):
    """Everything about a session but its pictures."""

    name: str
    title: str
    created: str
    fps: float
    frame_count: int
    body: BodyView
    cameras: list[CameraView]
    subject: SubjectView | None
    has_truth: bool
    next_step: str = ""
    has_start_pose: bool
    start_pose_frame: int = 0
    tracker: str
    weighting: str
    calibration_source: str
    imported_from: str
    matching: list[CameraMatch]
    assumptions: list[str]
    notes: list[str]
    warnings: list[str]
    doubts: list[str] = Field(
        default_factory=list, description="What the footage says against the calibration."
    )
    runs: list[RunLine]


def session_line(summary: SessionSummary, session: Session | None) -> SessionLine:
    """A session in the list; its runs carry their mean error where `session` has a truth."""
    return SessionLine.of(
        summary,
        tracker=_tracker(session),
        weighting=_weighting(session),
        cameras=len(summary.cameras),
        camera_names=list(summary.cameras),
        frame_count=summary.frames,
        thumbnail=f"/api/sessions/{summary.name}/thumbnail.jpg",
        runs=[run_line(run, session) for run in reversed(summary.runs)],
        comparisons=comparison_count(session) if session else 0,
        next_step=next_step(len(summary.cameras), bool(session and session.is_calibrated)),
    )


def run_line(summary: RunSummary, session: Session | None) -> RunLine:
    """A run in a list; without description and error where they cannot be had: the run's own page says why."""
    line = RunLine(**{entry.name: getattr(summary, entry.name) for entry in dataclasses.fields(summary)})
    if session is None:
        return line
    try:
        run = session.run(line.name)
        line = dataclasses.replace(line, describe=describe(run.record))
        line = dataclasses.replace(line, describe=describe(run.record, history_of(run)))
        return dataclasses.replace(line, mean_mm=mean_error(session, run, line.done))
    except StudioError:
        return line


def describe(record: RunRecord, history: SettingsHistory = NOTHING_CHANGED) -> str:
    """A run in a few words: tracker, layers × particles and from which frame on others, weighting where it is not the
    tracker's usual one.
    """
    size = size_in_words(record.tracker, record.settings)
    now = size
    for entry in history.entries:
        later = size_in_words(record.tracker, entry.values)
        if later != now:
            size, now = f"{size}, {later} from frame {entry.frame}", later
    unusual = "" if record.weighting == DEFAULT_WEIGHTING else f" · {record.weighting}"
    return f"{record.tracker} {size}".strip() + unusual


def _tracker(session: Session | None) -> str:
    """What runs of a session are tracked with by default."""
    return (session and session.manifest.tracker) or DEFAULT_TRACKER


def _weighting(session: Session | None) -> str:
    """What runs of a session are weighted with by default."""
    return (session and session.manifest.weighting) or DEFAULT_WEIGHTING


def session_detail(session: Session) -> SessionDetail:
    """All that is known of a session."""
    manifest = session.manifest
    body = session.body()
    sources = {source.name: source for source in manifest.footage.cameras}
    cameras = session.cameras() if session.has_footage and session.is_calibrated else ()
    return SessionDetail.of(
        manifest,
        name=session.name,
        body=body_view(body),
        cameras=[camera_view(camera, sources[camera.name]) for camera in cameras],
        subject=session.subject(),
        has_truth=session.truth_path is not None,
        next_step=next_step(len(sources), session.is_calibrated),
        has_start_pose=session.start_pose(body) is not None,
        start_pose_frame=session.start_pose_frame(),
        tracker=_tracker(session),
        weighting=_weighting(session),
        doubts=list(standing_doubts(session)),
        runs=[run_line(run.summary(), session) for run in reversed(session.runs())],
    )


def camera_view(camera: Camera, source: CameraSource) -> CameraView:
    """A camera with the size of its footage."""
    return CameraView(
        name=camera.name,
        width=camera.width,
        height=camera.height,
        quarter_turns=camera.quarter_turns,
        matrix=camera.matrix.tolist(),
        distortion=camera.distortion.tolist(),
        rotation=camera.rotation.tolist(),
        translation=camera.translation.tolist(),
        centre=camera.centre.tolist(),
        picture_width=source.width,
        picture_height=source.height,
        frame_count=source.frame_count,
        has_masks=bool(source.masks),
        has_background=bool(source.background),
    )


def body_view(body: BodyModel) -> BodyView:
    """A body's tables."""
    return BodyView(
        name=body.name,
        title=body.title,
        by_height=follows_height(body),
        parameters=parameter_views(body),
        limbs=[limb.name for limb in body.drawn],
        markers=[marker.name for marker in body.markers],
        dimensions=body.dimensions,
    )


def parameter_views(body: BodyModel) -> list[ParameterView]:
    """The pose vector's entries, in order."""
    return [
        ParameterView.of(entry, unit="mm" if entry.kind == "length" else "rad") for entry in body.parameters
    ]
