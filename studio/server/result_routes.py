"""Results: the timeline, any stored frame with all its layers, the particles of a layer, CSV, the error.

Everything is read from the store, also while it is being written.
"""

import csv
import io
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Query, Response

from studio.errors import NotFoundError, SettingsError, StudioError
from studio.evaluation.errors import Evaluation
from studio.geometry.reach import within_reach
from studio.inspection.reading import InspectedRun
from studio.inspection.reference import body_points, by_limb, true_points
from studio.runs.live_summary import summary_of
from studio.runs.tracks import RAW
from studio.server.event_encoding import layer_summary
from studio.server.result_schemas import (
    EvaluationView,
    FrameDetail,
    FrameLine,
    FramesSummary,
    LayerView,
    LiveView,
    Outcome,
    ParticlesView,
    PoseError,
    PoseGiven,
)
from studio.server.run_errors import evaluation_of
from studio.server.run_routes import RUN, Checked, OpenRun
from studio.server.session_routes import OpenSession
from studio.server.session_views import describe, parameter_views
from studio.server.setting_views import changes_of, history_of
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.trackers.catalogue import TRACKERS
from studio.trackers.tracker import LayerRecord, Tracker

router = APIRouter(prefix="/api", tags=["results"])

MOMENTS = (
    ("weighed", "variance_weighed"),
    ("before_diffusion", "variance_resampled"),
    ("after_diffusion", "variance_diffused"),
)


@router.get(RUN + "/frames")
def frames(
    session: OpenSession,
    run: OpenRun,
    track: Annotated[str, Query(max_length=64, description="Whose poses the errors are of.")] = RAW,
    check: Checked = True,
) -> FramesSummary:
    """Weight, time and (with truth) error of every finished frame, where settings changed, what was corrected."""
    record = run.record
    with run.results() as results:
        damaged, timeline = results.damaged(blobs=check), results.timeline(blobs=check)
        partial, checked = results.partial(), check or results.is_checked()
    measured, problem = _measured(session, run, track, check)
    errors = dict(zip(measured.frames, measured.per_frame_mm, strict=True)) if measured else {}
    lost = dict(zip(measured.frames, measured.lost_by_frame, strict=True)) if measured else {}
    lines = [
        FrameLine(
            frame=frame,
            log_weight=float(timeline.log_weights[at]),
            milliseconds=float(timeline.milliseconds[at]),
            evaluations=int(timeline.evaluations[at]),
            layers=int(timeline.layers[at]),
            settings_version=int(timeline.settings_versions[at]),
            error_mm=errors.get(frame),
            lost=bool(lost.get(frame)),
            lost_limbs=list(lost.get(frame, ())),
            tracking=timeline.tracking[at],
        )
        for at, frame in enumerate(timeline.frames.tolist())
    ]
    times = timeline.milliseconds
    return FramesSummary.of(
        record,
        describe=describe(record),
        score=TRACKERS.get(record.tracker, Tracker).score,
        frames=lines,
        settings_changes=changes_of(history_of(run)),
        damaged=damaged,
        checked=checked,
        partial=partial.frame if partial else None,
        mean_milliseconds=float(times.mean()) if len(times) else None,
        made_from=record.made_from or None,
        track=track,
        truth_problem=problem,
        mean_mm=measured.mean_mm if measured else None,
        worst_mm=measured.worst_mm if measured else None,
    )


@router.get(RUN + "/live")
def live_figures(run: OpenRun) -> LiveView:
    """How a live run kept up, so far. Refused (404) for others."""
    found = summary_of(run)
    return LiveView.of(
        found,
        tracked=len(found.tracked),
        latency_median_ms=found.latency(0.5),
        latency_p95_ms=found.latency(0.95),
        latency_worst_ms=found.latency(1.0),
        latencies_ms=found.latencies.tolist(),
    )


@router.get(RUN + "/frames/{frame}")
def frame_detail(run: OpenRun, frame: int) -> FrameDetail:
    """A frame with all its layers; of the frame in progress those that are done."""
    with run.results() as results:
        layers = results.layers(frame)
        finished = results.is_whole(frame)
        result = results.result(frame) if finished else None
    entry = history_of(run).in_use(frame, layers[-1].layer)
    estimate = result.estimate if result else None
    return FrameDetail(
        frame=frame,
        finished=finished,
        parameters=parameter_views(run.body()),
        layers=[LayerView.model_validate(layer_summary(layer)) for layer in layers],
        pose=estimate.pose.tolist() if estimate else None,
        mean=estimate.mean.tolist() if estimate else None,
        mode=estimate.mode.tolist() if estimate else None,
        log_weight=estimate.log_weight if estimate else None,
        evaluations=result.evaluations if result else sum(len(layer.poses) for layer in layers),
        milliseconds=result.milliseconds if result else sum(layer.milliseconds for layer in layers),
        settings_version=layers[-1].settings_version,
        tracking=result.tracking if result else None,
        searched=estimate.searched.tolist() if estimate and estimate.searched is not None else None,
        disagreement=dict(result.disagreement) if result else {},
        limbs_lost=list(result.limbs_lost) if result else [],
        notes=list(result.notes) if result else [],
        settings=dict(entry.values if entry else run.record.settings),
    )


@router.post(RUN + "/frames/{frame}/outcome")
def outcome(session: OpenSession, run: OpenRun, frame: int, given: PoseGiven) -> Outcome:
    """What another pose would change in a frame: its error and that of the stored pose, in all and by limb."""
    inspected = InspectedRun(session, run)
    if len(given.pose) != len(inspected.names) or not within_reach(given.pose):
        raise SettingsError("The pose is not one of the run's body.", "Give its parameters in order.")
    with run.results() as results:
        result = results.result(frame)
    truth = true_points(inspected, frame)
    poses = np.stack([result.estimate.pose, np.array(given.pose)])
    away = None if truth is None else np.linalg.norm(body_points(inspected.body, poses) - truth, axis=2)

    def error_of(at: int) -> PoseError | None:
        if away is None:
            return None
        limbs: dict[str, float | None] = {
            limb: float(mm) for limb, mm in by_limb(inspected.body, away[at]).items()
        }
        return PoseError(error_mm=float(np.nanmean(np.asarray(away[at]))), limbs=limbs)

    return Outcome(
        frame=frame,
        log_weight=result.estimate.log_weight,
        evaluations=result.evaluations,
        milliseconds=result.milliseconds,
        before=error_of(0),
        after=error_of(1),
    )


@router.get(RUN + "/frames/{frame}/layers/{layer}")
def layer_detail(run: OpenRun, frame: int, layer: int) -> LayerView:
    """One layer without its particles."""
    with run.results() as results:
        return LayerView.model_validate(layer_summary(results.layer(frame, layer)))


@router.get(
    RUN + "/frames/{frame}/layers/{layer}/particles",
    response_model=ParticlesView,
    responses={200: {"content": {"application/octet-stream": {}}}},
)
def particles(
    run: OpenRun,
    frame: int,
    layer: int,
    form: Annotated[Literal["json", "float32"], Query(alias="format")] = "json",
) -> Response | ParticlesView:
    """The particles of a layer as they were weighed.

    format=float32: little-endian numbers, N rows of D pose entries and the raw log-weight; headers
    X-Studio-Rows and X-Studio-Columns give N and D + 1.
    """
    with run.results() as results:
        record = results.layer(frame, layer)
    if form == "float32":
        return _binary(record)
    return ParticlesView(
        frame=frame,
        layer=layer,
        beta=record.beta,
        parameters=list(run.record.parameters),
        poses=record.poses.tolist(),
        log_weights=record.log_weights.tolist(),
    )


@router.get(RUN + "/frames/{frame}/variance.csv", response_class=Response)
def variance_csv(run: OpenRun, frame: int) -> Response:
    """The variances of a frame: one row a layer (from 1) and moment, one column a parameter (mm² and rad²)."""
    with run.results() as results:
        layers = results.layers(frame)
    rows = [
        [frame, record.layer + 1, moment, *(f"{value:.9g}" for value in getattr(record, name))]
        for record in layers
        for moment, name in MOMENTS
    ]
    return _csv(
        ["frame", "layer", "moment", *run.record.parameters], rows, f"{run.name}-frame{frame}-variance.csv"
    )


@router.get(RUN + "/poses.csv", response_class=Response)
def poses_csv(session: OpenSession, run: OpenRun) -> Response:
    """All poses: frame, then one column per parameter in the body's order (radians and mm)."""
    with run.results() as results:
        numbers, poses = results.poses()
    rows = [
        [int(number), *(repr(float(value)) for value in pose)]
        for number, pose in zip(numbers, poses, strict=True)
    ]
    return _csv(["frame", *run.record.parameters], rows, f"{session.name}-{run.name}-poses.csv")


@router.get(RUN + "/evaluation")
def evaluation(session: OpenSession, run: OpenRun) -> EvaluationView:
    """The error of all finished frames. 404 without a truth or before the first frame."""
    measured = evaluation_of(session, run)
    if measured is None:
        raise NotFoundError(
            f"There is nothing to measure run '{run.name}' against, or no frame yet.",
            "Import the session with a truth/*.trc, and track it.",
        )
    return EvaluationView.model_validate(measured)


def _measured(session: Session, run: StoredRun, track: str, check: bool) -> tuple[Evaluation | None, str]:
    """The track's errors, None without a truth; and why that cannot be used, which is named, not fatal."""
    try:
        return evaluation_of(session, run, track, blobs=check), ""
    except NotFoundError:
        raise
    except StudioError as error:
        return None, str(error)


def _binary(record: LayerRecord) -> Response:
    table = np.column_stack([record.poses, record.log_weights]).astype("<f4")
    headers = {"x-studio-rows": str(table.shape[0]), "x-studio-columns": str(table.shape[1])}
    return Response(table.tobytes(), media_type="application/octet-stream", headers=headers)


def _csv(head: list[str], rows: Sequence[Sequence[object]], name: str) -> Response:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(text.getvalue(), media_type="text/csv; charset=utf-8", headers=headers)
