"""Sessions, cameras and bodies as the API shows them."""

import math

from studio.body.model import BodyModel, Parameter
from studio.capture.footage_source import CameraSource
from studio.comparison.folders import comparison_count
from studio.errors import StudioError
from studio.geometry.camera import Camera
from studio.runs.silhouette_doubts import standing_doubts
from studio.sessions.run_record import RunRecord
from studio.sessions.session import Session
from studio.sessions.workspace import SessionSummary, next_step
from studio.settings import DEFAULT_TRACKER, DEFAULT_WEIGHTING
from studio.tracking.catalogue import size_in_words
from studio.web.run_errors import mean_error
from studio.web.schemas import BodyView, CameraView, ParameterView, RunLine, SessionDetail, SessionLine


def session_line(summary: SessionSummary, session: Session | None) -> SessionLine:
    """A session in the list; its runs carry their mean error where `session` has a truth."""
    runs = [RunLine.model_validate(run) for run in reversed(summary.runs)]
    if session is not None:
        runs = [completed(run, session) for run in runs]
    return SessionLine(
        name=summary.name,
        title=summary.title,
        created=summary.created,
        body=summary.body,
        tracker=_tracker(session),
        weighting=_weighting(session),
        cameras=len(summary.cameras),
        camera_names=list(summary.cameras),
        frame_count=summary.frames,
        fps=summary.fps,
        has_truth=summary.has_truth,
        thumbnail=f"/api/sessions/{summary.name}/thumbnail.jpg",
        notes=list(summary.notes),
        warnings=list(summary.warnings),
        runs=runs,
        comparisons=comparison_count(session) if session else 0,
        next_step=next_step(len(summary.cameras), bool(session and session.is_calibrated)),
        problem=summary.problem,
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
    """What runs of a session are tracked with unless told otherwise."""
    return (session and session.manifest.tracker) or DEFAULT_TRACKER


def _weighting(session: Session | None) -> str:
    """What runs of a session are weighed with unless told otherwise."""
    return (session and session.manifest.weighting) or DEFAULT_WEIGHTING


def session_detail(session: Session) -> SessionDetail:
    """All that is known of a session."""
    manifest = session.manifest
    body = session.body()
    subject = session.subject()
    sources = {source.name: source for source in manifest.footage.cameras}
    cameras = session.cameras() if session.has_footage and session.is_calibrated else ()
    return SessionDetail.model_validate(
        {
            "name": session.name,
            "title": manifest.title,
            "created": manifest.created,
            "fps": manifest.fps,
            "frame_count": manifest.frame_count,
            "body": body_view(body),
            "cameras": [camera_view(camera, sources[camera.name]) for camera in cameras],
            "subject": subject,
            "has_truth": session.truth_path is not None,
            "next_step": next_step(len(sources), session.is_calibrated),
            "has_start_pose": session.start_pose(body) is not None,
            "start_pose_frame": session.start_pose_frame(),
            "tracker": _tracker(session),
            "weighting": _weighting(session),
            "calibration_source": manifest.calibration_source,
            "imported_from": manifest.imported_from,
            "matching": list(manifest.matching),
            "assumptions": list(manifest.assumptions),
            "notes": list(manifest.notes),
            "warnings": list(manifest.warnings),
            "doubts": list(standing_doubts(session)),
            "runs": [
                completed(RunLine.model_validate(run.summary()), session) for run in reversed(session.runs())
            ],
        }
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
        parameters=parameter_views(body),
        limbs=[limb.name for limb in body.drawn],
        markers=[marker.name for marker in body.markers],
        dimensions=body.dimensions,
    )


def parameter_views(body: BodyModel) -> list[ParameterView]:
    """The pose vector's entries, in order."""
    return [_parameter_view(entry) for entry in body.parameters]


def _parameter_view(entry: Parameter) -> ParameterView:
    unit = "mm" if entry.kind == "length" else "rad"
    return ParameterView(
        name=entry.name,
        label=entry.label,
        unit=unit,
        lower=_or_none(entry.lower),
        upper=_or_none(entry.upper),
        max_step=_or_none(entry.max_step),
        neutral=entry.neutral,
        limb=entry.limb,
    )


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None
