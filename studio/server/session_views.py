"""Sessions, cameras and bodies as the API shows them."""

from studio.body.dimensions import follows_height
from studio.body.model import BodyModel
from studio.capture.footage_source import CameraSource
from studio.comparison.folders import comparison_count
from studio.errors import StudioError
from studio.geometry.camera import Camera
from studio.runs.silhouette_doubts import standing_doubts
from studio.server.run_errors import mean_error
from studio.server.schemas import BodyView, CameraView, ParameterView, RunLine, SessionDetail, SessionLine
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session
from studio.sessions.workspace import SessionSummary, next_step
from studio.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.trackers.catalogue import size_in_words


def session_line(summary: SessionSummary, session: Session | None) -> SessionLine:
    """A session in the list; its runs carry their mean error where `session` has a truth."""
    runs = [RunLine.model_validate(run) for run in reversed(summary.runs)]
    if session is not None:
        runs = [completed(run, session) for run in runs]
    return SessionLine.of(
        summary,
        tracker=_tracker(session),
        weighting=_weighting(session),
        cameras=len(summary.cameras),
        camera_names=list(summary.cameras),
        frame_count=summary.frames,
        thumbnail=f"/api/sessions/{summary.name}/thumbnail.jpg",
        runs=runs,
        comparisons=comparison_count(session) if session else 0,
        next_step=next_step(len(summary.cameras), bool(session and session.is_calibrated)),
    )


def completed(line: RunLine, session: Session) -> RunLine:
    """A run's line with its description and its mean error.

    Both are left out where they cannot be had; the run's own page says why.
    """
    try:
        run = session.run(line.name)
        line = line.model_copy(update={"describe": describe(run.record)})
        return line.model_copy(update={"mean_mm": mean_error(session, run, line.done)})
    except StudioError:
        return line


def describe(record: RunRecord) -> str:
    """A run in a few words: tracker, layers × particles, weighting where it is not the tracker's usual one."""
    size = size_in_words(record.tracker, record.settings)
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
        runs=[completed(RunLine.model_validate(run.summary()), session) for run in reversed(session.runs())],
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
