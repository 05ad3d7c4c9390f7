"""Sessions and runs as lists and pages show them."""

import logging
from dataclasses import dataclass, fields, replace
from typing import Annotated

from pydantic import Field

from studio.body.dimensions import follows_height
from studio.body.model import BodyModel
from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.naming import CameraMatch
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import Value
from studio.operations.comparison_folders import comparison_count
from studio.operations.run_errors import evaluation_of
from studio.operations.run_settings import history_of
from studio.runs.setup.silhouette_faults import known_faults
from studio.runs.sides import notes_of
from studio.search.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING, SettingsHistory
from studio.search.trackers.catalogue import size_in_words
from studio.sessions.run_log import LogEntry, read_log
from studio.sessions.run_record import OF_CLICKS, RunRecord
from studio.sessions.session import Session
from studio.sessions.stored_run import RunSummary, StoredRun
from studio.sessions.workspace import SessionSummary, Workspace, next_step, unusable

log = logging.getLogger(__name__)
NOTHING_CHANGED = SettingsHistory()
THUMBNAIL = "/api/sessions/{name}/thumbnail.jpg"
"""The address at which the server has a session's picture."""


@dataclass(frozen=True)
class RunLine(RunSummary):
    """A run in a list: its status, computed from its store.

    describe : tracker, layers and particles in a few words.
    mean_mm : mean marker error where the session has a truth.
    measured_frames : in how many of its frames.
    """

    describe: str = ""
    mean_mm: float | None = None
    measured_frames: int = 0


@dataclass(frozen=True, slots=True)
class RunList:
    """The runs of a session, newest first."""

    runs: tuple[RunLine, ...]


@dataclass(frozen=True, slots=True)
class SessionLine:
    """A session in a list.

    thumbnail : address of a JPEG.
    runs : newest first.
    problem : why it cannot be opened.
    """

    name: str
    title: str
    created: str
    body: str
    tracker: str
    weighting: str
    cameras: int
    camera_names: tuple[str, ...]
    frame_count: int
    fps: float
    has_truth: bool
    thumbnail: str
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    runs: tuple[RunLine, ...]
    comparisons: int = 0
    next_step: Annotated[
        str, Field(description="footage or calibration, where that is lacking; else empty.")
    ] = ""
    problem: str = ""


@dataclass(frozen=True, slots=True)
class SessionList:
    """All sessions of the workspace, by name."""

    sessions: tuple[SessionLine, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CameraView:
    """A calibrated camera and its footage."""

    name: str
    width: int
    height: int
    quarter_turns: Annotated[int, Field(description="Clockwise quarter turns that show the picture upright.")]
    matrix: list[list[float]]
    distortion: Array
    rotation: list[list[float]]
    translation: Array
    centre: Array
    picture_width: int
    picture_height: int
    frame_count: int
    has_masks: bool
    has_background: bool


@dataclass(frozen=True, slots=True)
class ParameterView:
    """One entry of the pose vector.

    unit : mm or rad.
    lower, upper, max_step : null where there are none.
    """

    name: str
    label: str
    unit: str
    lower: float
    upper: float
    max_step: float
    neutral: float
    limb: str


@dataclass(frozen=True, slots=True)
class BodyView:
    """A body as tables.

    by_height : whether its lengths follow from a person's height, unlike those of animals and machines.
    parameters : in the order of the pose vector.
    """

    name: str
    title: str
    by_height: bool
    parameters: tuple[ParameterView, ...]
    limbs: tuple[str, ...]
    markers: tuple[str, ...]
    dimensions: dict[str, float]


@dataclass(frozen=True, slots=True)
class SubjectView:
    """The person's measures, mm."""

    body: str
    height_mm: float | None
    lengths_mm: dict[str, float]


@dataclass(frozen=True, slots=True)
class SessionDetail:
    """Everything about a session but its pictures."""

    name: str
    title: str
    created: str
    fps: float
    frame_count: int
    body: BodyView
    cameras: tuple[CameraView, ...]
    subject: SubjectView | None
    has_truth: bool
    has_start_pose: bool
    tracker: str
    weighting: str
    calibration_source: str
    imported_from: str
    matching: tuple[CameraMatch, ...]
    assumptions: tuple[str, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    runs: tuple[RunLine, ...]
    next_step: str = ""
    start_pose_frame: int = 0
    doubts: Annotated[
        tuple[str, ...], Field(description="What the footage says against the calibration.")
    ] = ()


@dataclass(frozen=True, slots=True)
class RunDetail:
    """A run and its request.

    settings : at its start.
    parameters : of its pose vector, as sigma and start_pose.
    """

    run: RunLine
    settings: dict[str, Value]
    parameters: tuple[ParameterView, ...]
    sigma: tuple[float, ...]
    start_pose: tuple[float, ...] | None
    start_source: str
    software: str
    fps: float
    notes: tuple[str, ...]
    behaviour: str = ""
    live: bool = False


@dataclass(frozen=True, slots=True)
class LogLines:
    """The log of a run, oldest first."""

    lines: tuple[LogEntry, ...]


def list_lines(workspace: Workspace) -> SessionList:
    """All sessions by name with their runs, newest first; one that cannot be opened says why."""
    return SessionList(tuple(_line(workspace, entry) for entry in workspace.sessions()))


def _line(workspace: Workspace, entry: SessionSummary) -> SessionLine:
    try:
        return session_line(entry, _open(workspace, entry))
    except Exception as error:  # whatever a foreign session holds, the others are listed
        log.exception("session '%s' cannot be summed up", entry.name)
        reason = str(error) if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
        return session_line(unusable(entry.name, f"The session cannot be summed up ({reason})."), None)


def _open(workspace: Workspace, entry: SessionSummary) -> Session | None:
    try:
        return None if entry.problem else workspace.session(entry.name)
    except StudioError:
        return None


def session_line(summary: SessionSummary, session: Session | None) -> SessionLine:
    """A session in the list; its runs carry their mean error where `session` has a truth."""
    return SessionLine(
        name=summary.name,
        title=summary.title,
        created=summary.created,
        body=summary.body,
        tracker=_tracker(session),
        weighting=_weighting(session),
        cameras=len(summary.cameras),
        camera_names=summary.cameras,
        frame_count=summary.frames,
        fps=summary.fps,
        has_truth=summary.has_truth,
        thumbnail=THUMBNAIL.format(name=summary.name),
        notes=summary.notes,
        warnings=summary.warnings,
        runs=tuple(run_line(run, session) for run in reversed(summary.runs)),
        comparisons=comparison_count(session) if session else 0,
        next_step=next_step(len(summary.cameras), bool(session and session.is_calibrated)),
        problem=summary.problem,
    )


def run_lines(session: Session) -> RunList:
    """The session's runs, newest first."""
    return RunList(tuple(run_line(run.summary(), session) for run in reversed(session.runs())))


def run_line(summary: RunSummary, session: Session | None) -> RunLine:
    """A run in a list; without description and error where they cannot be read: the run's own page says why."""
    line = RunLine(**{entry.name: getattr(summary, entry.name) for entry in fields(summary)})
    if session is None:
        return line
    try:
        run = session.run(line.name)
        line = replace(line, describe=describe(run.record))
        line = replace(line, describe=describe(run.record, history_of(run)))
        errors = evaluation_of(session, run, blobs=False) if line.done else None
        return replace(line, mean_mm=errors.mean_mm, measured_frames=len(errors.frames)) if errors else line
    except StudioError:
        return line


def describe(record: RunRecord, history: SettingsHistory = NOTHING_CHANGED) -> str:
    """A run in a few words: tracker, layers × particles (with the frame from which they changed), the likelihood if it
    is not the tracker's usual one.
    """
    if record.start_source == OF_CLICKS:
        return OF_CLICKS
    size = size_in_words(record.tracker, record.settings)
    now = size
    for entry in history.entries:
        later = size_in_words(record.tracker, entry.values)
        if later != now:
            size, now = f"{size}, {later} from frame {entry.frame}", later
    unusual = "" if record.weighting == DEFAULT_WEIGHTING else f" · {record.weighting}"
    return f"{record.tracker} {size}".strip() + unusual


def _tracker(session: Session | None) -> str:
    """The default tracker of a session's runs."""
    return (session and session.manifest.tracker) or DEFAULT_TRACKER


def _weighting(session: Session | None) -> str:
    """The default likelihood of a session's runs."""
    return (session and session.manifest.weighting) or DEFAULT_WEIGHTING


def session_detail(session: Session) -> SessionDetail:
    """Cameras, body, subject, how footage and calibration were matched, warnings, runs."""
    manifest, body, subject = session.manifest, session.body(), session.subject()
    sources = {source.name: source for source in manifest.footage.cameras}
    cameras = session.cameras() if session.has_footage and session.is_calibrated else ()
    return SessionDetail(
        name=session.name,
        title=manifest.title,
        created=manifest.created,
        fps=manifest.fps,
        frame_count=manifest.frame_count,
        body=body_view(body),
        cameras=tuple(camera_view(camera, sources[camera.name]) for camera in cameras),
        subject=subject and SubjectView(subject.body, subject.height_mm, dict(subject.lengths_mm)),
        has_truth=session.truth_path is not None,
        has_start_pose=session.start_pose(body) is not None,
        tracker=_tracker(session),
        weighting=_weighting(session),
        calibration_source=manifest.calibration_source,
        imported_from=manifest.imported_from,
        matching=manifest.matching,
        assumptions=manifest.assumptions,
        notes=manifest.notes,
        warnings=manifest.warnings,
        runs=run_lines(session).runs,
        next_step=next_step(len(sources), session.is_calibrated),
        start_pose_frame=session.start_pose_frame(),
        doubts=known_faults(session),
    )


def run_detail(run: StoredRun, session: Session, *, check: bool) -> RunDetail:
    """A run's request, how far it got, and its body's parameters.

    check : whether everything that is stored is read and checked for damage.
    """
    record = run.record
    return RunDetail(
        run=run_line(run.summary(blobs=check), session),
        settings=dict(record.settings),
        parameters=parameter_views(run.body()),
        sigma=record.sigma,
        start_pose=record.start_pose,
        start_source=record.start_source,
        software=record.software,
        fps=record.fps,
        notes=notes_of(run),
        behaviour=record.behaviour,
        live=record.live,
    )


def run_log(run: StoredRun, last: int = 200) -> LogLines:
    """The last lines of a run's log, oldest first. Raises SessionError."""
    return LogLines(read_log(run.folder, last))


def camera_view(camera: Camera, source: CameraSource) -> CameraView:
    return CameraView(
        name=camera.name,
        width=camera.width,
        height=camera.height,
        quarter_turns=camera.quarter_turns,
        matrix=camera.matrix.tolist(),
        distortion=camera.distortion,
        rotation=camera.rotation.tolist(),
        translation=camera.translation,
        centre=camera.centre,
        picture_width=source.width,
        picture_height=source.height,
        frame_count=source.frame_count,
        has_masks=bool(source.masks),
        has_background=bool(source.background),
    )


def body_view(body: BodyModel) -> BodyView:
    return BodyView(
        name=body.name,
        title=body.title,
        by_height=follows_height(body),
        parameters=parameter_views(body),
        limbs=tuple(limb.name for limb in body.drawn),
        markers=tuple(marker.name for marker in body.markers),
        dimensions=dict(body.dimensions),
    )


def parameter_views(body: BodyModel) -> tuple[ParameterView, ...]:
    """The pose vector's entries, in order."""
    return tuple(
        ParameterView(
            entry.name,
            entry.label,
            "mm" if entry.kind == "length" else "rad",
            entry.lower,
            entry.upper,
            entry.max_step,
            entry.neutral,
            entry.limb,
        )
        for entry in body.parameters
    )
