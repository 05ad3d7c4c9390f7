"""Stored frames as pages show them: the timeline of a run, a frame with its layers, the particles of a layer.

Everything is read from the store, also while it is being written.
"""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import Value
from studio.operations.overview import ParameterView, describe, parameter_views
from studio.operations.run_errors import measure_or_say_why
from studio.operations.run_settings import SettingsChange, changes_of, history_of
from studio.results.inspection.cloud_outlines import CloudOutline, outline_of
from studio.results.inspection.reading import InspectedFrame, InspectedRun
from studio.results.inspection.verdict import limbs_off, verdict_on, verdicts
from studio.runs.live.live_summary import summary_of
from studio.runs.tracks import RAW
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.tracker import FrameResult, LayerRecord, Tracker
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)
MOMENTS = (
    ("weighed", "variance_weighed"),
    ("before_diffusion", "variance_resampled"),
    ("after_diffusion", "variance_diffused"),
)


@dataclass(frozen=True, slots=True)
class FrameLine:
    """A finished frame in the timeline.

    lost : whether a limb is off by more than 150 mm (with truth only).
    fits : whether neither truth nor silhouettes say that the body or a limb is lost.
    """

    frame: int
    log_weight: float
    milliseconds: float
    evaluations: int
    layers: int
    settings_version: int
    error_mm: float | None = None
    lost: bool = False
    lost_limbs: Annotated[
        tuple[str, ...], Field(description="Limbs that are off by more than 150 mm (truth).")
    ] = ()
    tracking: Annotated[str, Field(description="tracked, limb lost, lost, no evidence or recovered.")] = (
        "tracked"
    )
    limbs_off: Annotated[tuple[str, ...], Field(description="Limbs that the silhouettes contradict.")] = ()
    fits: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class LiveView:
    """How well a live run kept up.

    dropped : frames that came and were not tracked.
    incomplete : moments of a take at which not every camera's picture came in time.
    latencies_ms : from the last picture of a set to its pose, of the tracked frames in order.
    """

    tracked: int
    dropped: tuple[int, ...]
    dropped_share: float
    frames_per_second: float
    latency_median_ms: float
    latency_p95_ms: float
    latency_worst_ms: float
    latencies_ms: Array
    incomplete: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class FramesSummary:
    """A run's frames.

    first, last : half open.
    truth_problem : why the error cannot be measured though there is a truth.
    """

    first: int
    last: int
    fps: float
    describe: str
    score: Annotated[
        tuple[str, str], Field(description="What the best particle is reported by, and its unit.")
    ]
    frames: tuple[FrameLine, ...]
    settings_changes: tuple[SettingsChange, ...]
    damaged: Annotated[
        dict[int, str],
        Field(
            description="Frames damaged on the disk, and what of each; resuming the run tracks them again."
        ),
    ]
    checked: Annotated[
        bool, Field(description="Whether all that is stored was read and checked for damage.")
    ] = True
    partial: Annotated[int | None, Field(description="The frame in which the search stands, if it does.")] = (
        None
    )
    mean_mm: float | None = None
    worst_mm: float | None = None
    mean_milliseconds: float | None = None
    truth_problem: str = ""
    made_from: Annotated[str | None, Field(description="The run that this one corrects.")] = None
    corrected: Annotated[int | None, Field(description="The frame whose pose was given.")] = None
    backwards_to: Annotated[
        int | None, Field(description="The last frame tracked backwards; null: onwards.")
    ] = None
    track: Annotated[str, Field(description="Whose poses the errors are of.")] = RAW


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LayerView:
    """One layer without its particles, with the entries of a `layer` event."""

    frame: int
    layer: int
    settings_version: int
    beta: float
    alpha_wanted: float
    alpha_reached: float
    model_free_share: Annotated[
        float | None,
        Field(description="Of a frame's first layer: particles moved without the behaviour model."),
    ] = None
    temper: Annotated[
        float | None, Field(description="Exponent of the likelihood that the set is a sample with.")
    ] = None
    acceptance: Annotated[
        float | None, Field(description="Share of the proposed moves that were taken into the set.")
    ] = None
    log_evidence: Annotated[
        float | None, Field(description="Log of the evidence after the layer (nats).")
    ] = None
    variance_weighed: Array
    variance_resampled: Array
    variance_diffused: Array
    best: Array
    mean: Array
    best_log_weight: float
    log_weight_quantiles: list[float]
    effective_share: float
    particles: int
    milliseconds: float
    outline: Annotated[CloudOutline | None, Field(description="The cloud as the first camera sees it.")] = (
        None
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrameDetail:
    """A frame with all its layers.

    pose, mean, mode, log_weight : null in a frame that is not finished.
    search_layers, searches : layers of one search of the frame, and how many searches it has (a run's first frame is
    searched several times over).
    """

    frame: int
    finished: bool
    search_layers: int
    searches: int
    parameters: tuple[ParameterView, ...]
    layers: tuple[LayerView, ...]
    pose: Array | None = None
    mean: Array | None = None
    mode: Array | None = None
    log_weight: float | None = None
    evaluations: int
    milliseconds: float
    settings_version: int
    tracking: Annotated[str | None, Field(description="As in the timeline; null in an unfinished frame.")] = (
        None
    )
    searched: Annotated[
        Array | None, Field(description="The result of the search, where `pose` was refined after it.")
    ] = None
    disagreement: Annotated[
        dict[str, float],
        Field(
            description="Of each limb, the share of its area that silhouettes and pose do not agree about."
        ),
    ]
    limbs_lost: Annotated[
        tuple[str, ...], Field(description="Limbs that are probably not where the pose has them.")
    ] = ()
    notes: Annotated[
        tuple[str, ...],
        Field(
            description="What its numbers do not say: weights that chose nothing, cameras that showed nothing."
        ),
    ] = ()
    settings: dict[str, Value]


@dataclass(frozen=True, slots=True, eq=False)
class ParticlesView:
    """The weighed particles of a layer. log_weights : raw, before β."""

    frame: int
    layer: int
    beta: float
    parameters: tuple[str, ...]
    poses: list[list[float]]
    log_weights: Array


def frames_summary(
    session: Session, run: StoredRun, track: str = RAW, *, check: bool = True
) -> FramesSummary:
    """Weight, time and (with truth) error of every finished frame, where settings changed, what was corrected.

    track : whose poses the errors are of.
    check : whether all that is stored is read and checked for damage.
    """
    record = run.record
    with run.results() as results:
        damaged, timeline = results.damaged(blobs=check), results.timeline(blobs=check)
        partial, checked = results.partial(), check or results.is_checked()
    measured, problem = measure_or_say_why(session, run, track, blobs=check)
    errors = dict(zip(measured.frames, measured.per_frame_mm, strict=True)) if measured else {}
    lost = dict(zip(measured.frames, measured.lost_by_frame, strict=True)) if measured else {}
    with run.results() as results:
        verdict_of = verdicts(results, run.folder, timeline, lost, run.body())
    lines = tuple(
        FrameLine(
            frame=frame,
            log_weight=float(timeline.log_weights[at]),
            milliseconds=float(timeline.milliseconds[at]),
            evaluations=int(timeline.evaluations[at]),
            layers=int(timeline.layers[at]),
            settings_version=int(timeline.settings_versions[at]),
            error_mm=errors.get(frame),
            lost=bool(verdict_of[frame].by_truth),
            lost_limbs=verdict_of[frame].by_truth,
            tracking=verdict_of[frame].tracking,
            limbs_off=verdict_of[frame].by_silhouettes,
            fits=verdict_of[frame].fits,
        )
        for at, frame in enumerate(timeline.frames.tolist())
    )
    times, history = timeline.milliseconds, history_of(run)
    return FramesSummary(
        first=record.first,
        last=record.last,
        fps=record.fps,
        describe=describe(record, history),
        score=TRACKERS.get(record.tracker, Tracker).score,
        frames=lines,
        settings_changes=changes_of(history),
        damaged=damaged,
        checked=checked,
        partial=partial.frame if partial else None,
        mean_mm=measured.mean_mm if measured else None,
        worst_mm=measured.worst_mm if measured else None,
        mean_milliseconds=float(times.mean()) if len(times) else None,
        truth_problem=problem,
        made_from=record.made_from or None,
        corrected=record.corrected,
        backwards_to=record.backwards_to,
        track=track,
    )


def frame_detail(session: Session, run: StoredRun, frame: int) -> FrameDetail:
    """A frame with all its layers; of the frame in progress those that are done. Raises NotFoundError."""
    inspected = InspectedRun(session, run)
    with run.results() as results:
        layers = results.layers(frame)
        result = results.result(frame) if results.is_whole(frame) else None
    read = InspectedFrame(inspected, frame, tuple(layers), result)
    camera = run.cameras()[0]
    entry = inspected.history.in_use(frame, layers[-1].layer)
    estimate = result.estimate if result else None
    return FrameDetail(
        frame=frame,
        finished=result is not None,
        search_layers=read.search_layers,
        searches=read.searches,
        parameters=parameter_views(inspected.body),
        layers=tuple(layer_view(inspected.body, camera, layer) for layer in layers),
        pose=estimate and estimate.pose,
        mean=estimate and estimate.mean,
        mode=estimate and estimate.mode,
        log_weight=estimate and estimate.log_weight,
        evaluations=result.evaluations if result else sum(len(layer.poses) for layer in layers),
        milliseconds=result.milliseconds if result else sum(layer.milliseconds for layer in layers),
        settings_version=layers[-1].settings_version,
        tracking=tracking_of(result) if result else None,
        searched=estimate and estimate.searched,
        disagreement=dict(result.disagreement) if result else {},
        limbs_lost=limbs_off(result, run.body()) if result else (),
        notes=result.notes if result else (),
        settings=dict(entry.values if entry else run.record.settings),
    )


def layer_detail(run: StoredRun, frame: int, layer: int) -> LayerView:
    """One layer without its particles. Raises NotFoundError."""
    return layer_view(run.body(), run.cameras()[0], stored_layer(run, frame, layer))


def layer_view(body: BodyModel, camera: Camera, record: LayerRecord) -> LayerView:
    """A layer without its particles, but with their outline. camera : the run's first."""
    outline = outline_of(body, camera, record.poses, record.mean)
    return LayerView(**layer_summary(record), outline=outline)


def stored_layer(run: StoredRun, frame: int, layer: int) -> LayerRecord:
    """A layer as it was stored. Raises NotFoundError."""
    with run.results() as results:
        return results.layer(frame, layer)


def particles_view(run: StoredRun, frame: int, layer: int) -> ParticlesView:
    """The particles of a layer. Raises NotFoundError."""
    record = stored_layer(run, frame, layer)
    return ParticlesView(
        frame, layer, record.beta, run.record.parameters, record.poses.tolist(), record.log_weights
    )


def variance_table(run: StoredRun, frame: int) -> list[list[object]]:
    """The variances of a frame, with a head: one row a layer (from 1) and moment, one column a parameter (mm² and
    rad²). Raises NotFoundError.
    """
    with run.results() as results:
        layers = results.layers(frame)
    return [
        ["frame", "layer", "moment", *run.record.parameters],
        *(
            [frame, record.layer + 1, moment, *(f"{value:.9g}" for value in getattr(record, name))]
            for record in layers
            for moment, name in MOMENTS
        ),
    ]


def live_view(run: StoredRun) -> LiveView:
    """How well a live run has kept up so far. Raises NotFoundError for others."""
    live = summary_of(run)
    return LiveView(
        tracked=len(live.tracked),
        dropped=live.dropped,
        dropped_share=live.dropped_share,
        frames_per_second=live.frames_per_second,
        latency_median_ms=live.latency(0.5),
        latency_p95_ms=live.latency(0.95),
        latency_worst_ms=live.latency(1.0),
        latencies_ms=live.latencies,
        incomplete=live.incomplete,
    )


def layer_summary(record: LayerRecord) -> dict[str, Any]:
    """What the charts need of a layer: everything but the particles.

    log_weight_quantiles : minimum, quartiles and maximum of the raw log weights.
    effective_share : effective sample size over N at the layer's β.
    """
    return {
        "frame": record.frame,
        "layer": record.layer,
        "settings_version": record.settings_version,
        "beta": record.beta,
        "alpha_wanted": record.alpha_wanted,
        "alpha_reached": record.alpha_reached,
        "model_free_share": record.model_free_share,
        "temper": record.temper,
        "acceptance": record.acceptance,
        "log_evidence": record.log_evidence,
        "variance_weighed": record.variance_weighed,
        "variance_resampled": record.variance_resampled,
        "variance_diffused": record.variance_diffused,
        "best": record.best,
        "mean": record.mean,
        "best_log_weight": record.best_log_weight,
        "log_weight_quantiles": _quantiles(record.log_weights),
        "effective_share": effective_share(record.log_weights, record.beta),
        "particles": len(record.poses),
        "milliseconds": record.milliseconds,
    }


def frame_summary(result: FrameResult) -> dict[str, Any]:
    return {
        "frame": result.frame,
        "pose": result.estimate.pose,
        "log_weight": result.estimate.log_weight,
        "layers": result.layers,
        "evaluations": result.evaluations,
        "settings_version": result.settings_version,
        "milliseconds": result.milliseconds,
        "tracking": tracking_of(result),
        "limbs_off": limbs_off(result),
    }


def tracking_of(result: FrameResult) -> str:
    """The tracking state of a stored frame, one of TRACKING_STATES."""
    return verdict_on(result).tracking


def effective_share(log_weights: Array, beta: float) -> float:
    """(Σ w^β)² ÷ (N Σ w^2β): 1 for equal weights, 1/N when one particle has all the weight; NaN without particles."""
    if not log_weights.size or not np.isfinite(beta):
        return float("nan")
    scaled = np.exp(beta * (log_weights - log_weights.max()))
    return float(scaled.sum() ** 2 / (scaled.size * np.square(scaled).sum()))


def _quantiles(values: Array) -> list[float]:
    return np.quantile(values, QUANTILES).tolist() if values.size else []
