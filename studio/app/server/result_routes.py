"""Results: the timeline, any stored frame with all its layers, the particles of a layer, CSV, the error.

Everything is read from the store, also while it is being written.
"""

from typing import Annotated, Literal

import numpy as np
from fastapi import APIRouter, Query, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Shown
from studio.app.server.event_encoding import layer_summary
from studio.app.server.run_routes import RUN, Checked, OpenRun
from studio.app.server.schemas import Answer, Number, Numbers
from studio.app.server.session_routes import OpenSession
from studio.body.model import BodyModel
from studio.foundations.errors import NotFoundError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import Value
from studio.operations.overview import (
    ParameterView,
    SettingsChange,
    changes_of,
    describe,
    history_of,
    parameter_views,
)
from studio.operations.run_errors import evaluation_of
from studio.results.evaluation.errors import Evaluation
from studio.results.inspection.cloud_outlines import CloudOutline, outline_of
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.verdict import limbs_off, verdict_on, verdicts
from studio.runs.live.live_summary import summary_of
from studio.runs.tracks import RAW
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.tracker import LayerRecord, Tracker
from studio.sessions.named_rows import as_csv
from studio.sessions.named_rows import poses_csv as csv_of_poses
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

router = APIRouter(prefix="/api", tags=["results"])


class FrameLine(Answer):
    """A finished frame in the timeline. lost: whether a limb is off by more than 150 mm (with truth only). tracking:
    what the search says of it. fits: whether neither says that the body or a limb is lost.
    """

    frame: int
    log_weight: Number
    milliseconds: Number
    evaluations: int
    layers: int
    settings_version: int
    error_mm: Number = None
    lost: bool = False
    lost_limbs: list[str] = Field(
        default_factory=list[str], description="Limbs that are off by more than 150 mm (truth)."
    )
    tracking: str = Field("tracked", description="tracked, limb lost, lost, no evidence or recovered.")
    limbs_off: list[str] = Field(
        default_factory=list[str], description="Limbs that the silhouettes contradict."
    )
    fits: bool = True


class LiveView(Answer):
    """How a live run went. dropped: frames that came and were not tracked; incomplete: moments of a take at which not
    every camera's picture came in time. latencies_ms: from the last picture of a set
    to its pose, of the tracked frames in order.
    """

    tracked: int
    dropped: list[int]
    dropped_share: float
    incomplete: list[int] = Field(default_factory=list[int])
    frames_per_second: Number
    latency_median_ms: Number
    latency_p95_ms: Number
    latency_worst_ms: Number
    latencies_ms: Numbers


class FramesSummary(Answer):
    """A run's frames. first, last: half open. truth_problem: why the error cannot be measured though there
    is a truth.
    """

    first: int
    last: int
    fps: float
    describe: str
    score: tuple[str, str] = Field(description="What the best particle is reported by, and its unit.")
    frames: list[FrameLine]
    settings_changes: list[Annotated[SettingsChange, Shown]]
    damaged: dict[int, str] = Field(
        {}, description="Frames damaged on the disk, and what of each; resuming the run tracks them again."
    )
    checked: bool = Field(True, description="Whether all that is stored was read and checked for damage.")
    partial: int | None = Field(None, description="The frame in which the search stands, if it does.")
    mean_mm: Number = None
    worst_mm: Number = None
    mean_milliseconds: Number = None
    truth_problem: str = ""
    made_from: str | None = Field(None, description="The run that this one corrects.")
    corrected: int | None = Field(None, description="The frame whose pose was given.")
    backwards_to: int | None = Field(None, description="The last frame tracked backwards; null: onwards.")
    track: str = Field("raw", description="Whose poses the errors are of.")


class LayerView(Answer):
    """One layer without its particles; the same entries as a `layer` event."""

    frame: int
    layer: int
    settings_version: int
    beta: Number
    alpha_wanted: Number
    alpha_reached: Number
    model_free_share: Number = Field(
        None, description="Of a frame's first layer: particles moved without the behaviour model."
    )
    variance_weighed: Numbers
    variance_resampled: Numbers
    variance_diffused: Numbers
    best: Numbers
    mean: Numbers
    best_log_weight: Number
    log_weight_quantiles: Numbers
    effective_share: Number
    particles: int
    milliseconds: Number
    outline: CloudOutline | None = Field(None, description="The cloud as the first camera sees it.")


class FrameDetail(Answer):
    """A frame with all its layers. pose, mean, mode and log_weight are null in a frame that is not
    finished. search_layers, searches: layers of one search of the frame, and how many searches it has (a run's first
    frame is searched several times over).
    """

    frame: int
    finished: bool
    search_layers: int
    searches: int
    parameters: tuple[Annotated[ParameterView, Shown], ...]
    layers: list[LayerView]
    pose: Numbers | None
    mean: Numbers | None
    mode: Numbers | None
    log_weight: Number
    evaluations: int
    milliseconds: Number
    settings_version: int
    tracking: str | None = Field(None, description="As in the timeline; null in an unfinished frame.")
    searched: list[float] | None = Field(
        None, description="The pose that the search found, where `pose` was refined after it."
    )
    disagreement: dict[str, float] = Field(
        {}, description="Of each limb, the share of its area that silhouettes and pose do not agree about."
    )
    limbs_lost: list[str] = Field([], description="Limbs that are probably not where the pose has them.")
    notes: list[str] = Field(
        [],
        description="What its numbers do not say: weights that chose nothing, cameras that showed nothing.",
    )
    settings: dict[str, Value]


class ParticlesView(Answer):
    """The particles of a layer as they were weighed. log_weights: raw, before β."""

    frame: int
    layer: int
    beta: Number
    parameters: list[str]
    poses: list[Numbers]
    log_weights: Numbers


class EvaluationView(Answer):
    """A run against the session's truth, in mm, without alignment unless said.

    lost_frames: how many frames have a limb that is off by more than 150 mm; lost_frame_numbers: which.
    without_offsets_mm: with each marker's constant offset removed; common_offset_mm: the mean of these offsets.
    """

    frames: list[int]
    mean_mm: Number
    std_mm: Number
    worst_mm: Number
    lost_frames: int
    lost_frame_numbers: list[int]
    lost_limbs: list[str]
    per_marker_mm: dict[str, Number]
    per_frame_mm: Numbers
    root_aligned_mm: Number
    procrustes_mm: Number
    without_offsets_mm: Number
    common_offset_mm: Number
    unmatched_markers: list[str]


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
    with run.results() as results:
        said = verdicts(results, run.folder, timeline, lost, run.body())
    lines = [
        FrameLine(
            frame=frame,
            log_weight=float(timeline.log_weights[at]),
            milliseconds=float(timeline.milliseconds[at]),
            evaluations=int(timeline.evaluations[at]),
            layers=int(timeline.layers[at]),
            settings_version=int(timeline.settings_versions[at]),
            error_mm=errors.get(frame),
            lost=bool(said[frame].by_truth),
            lost_limbs=list(said[frame].by_truth),
            tracking=said[frame].tracking,
            limbs_off=list(said[frame].by_silhouettes),
            fits=said[frame].fits,
        )
        for at, frame in enumerate(timeline.frames.tolist())
    ]
    times, history = timeline.milliseconds, history_of(run)
    return FramesSummary.of(
        record,
        describe=describe(record, history),
        score=TRACKERS.get(record.tracker, Tracker).score,
        frames=lines,
        settings_changes=list(changes_of(history)),
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
def frame_detail(session: OpenSession, run: OpenRun, frame: int) -> FrameDetail:
    """A frame with all its layers; of the frame in progress those that are done."""
    inspected = InspectedRun(session, run)
    with run.results() as results:
        layers = results.layers(frame)
        finished = results.is_whole(frame)
        result = results.result(frame) if finished else None
    read = InspectedFrame(inspected, frame, tuple(layers), result)
    camera = run.cameras()[0]
    entry = inspected.history.in_use(frame, layers[-1].layer)
    estimate = result.estimate if result else None
    return FrameDetail(
        frame=frame,
        finished=finished,
        search_layers=read.search_layers,
        searches=read.searches,
        parameters=parameter_views(inspected.body),
        layers=[layer_view(inspected.body, camera, layer) for layer in layers],
        pose=estimate.pose.tolist() if estimate else None,
        mean=estimate.mean.tolist() if estimate else None,
        mode=estimate.mode.tolist() if estimate else None,
        log_weight=estimate.log_weight if estimate else None,
        evaluations=result.evaluations if result else sum(len(layer.poses) for layer in layers),
        milliseconds=result.milliseconds if result else sum(layer.milliseconds for layer in layers),
        settings_version=layers[-1].settings_version,
        tracking=verdict_on(result).tracking if result else None,
        searched=estimate.searched.tolist() if estimate and estimate.searched is not None else None,
        disagreement=dict(result.disagreement) if result else {},
        limbs_lost=list(limbs_off(result, run.body())) if result else [],
        notes=list(result.notes) if result else [],
        settings=dict(entry.values if entry else run.record.settings),
    )


@router.get(RUN + "/frames/{frame}/layers/{layer}")
def layer_detail(run: OpenRun, frame: int, layer: int) -> LayerView:
    """One layer without its particles."""
    with run.results() as results:
        return layer_view(run.body(), run.cameras()[0], results.layer(frame, layer))


def layer_view(body: BodyModel, camera: Camera, record: LayerRecord) -> LayerView:
    """A layer without its particles, but with their outline. camera : the run's first."""
    outline = outline_of(body, camera, record.poses, record.mean)
    return LayerView.model_validate(layer_summary(record) | {"outline": outline})


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
    heads = ["frame", "layer", "moment", *run.record.parameters]
    return files.download(as_csv([heads, *rows]), f"{run.name}-frame{frame}-variance.csv", files.CSV)


@router.get(RUN + "/poses.csv", response_class=Response)
def poses_csv(session: OpenSession, run: OpenRun) -> Response:
    """All poses: frame, then one column per parameter in the body's order (radians and mm)."""
    with run.results() as results:
        numbers, poses = results.poses()
    name = f"{session.name}-{run.name}-poses.csv"
    return files.download(csv_of_poses(run.record.parameters, numbers, poses), name, files.CSV)


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
