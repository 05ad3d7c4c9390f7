"""Events as JSON: small values only.

Each message has `type` (state, acknowledged, layer, frame, settings, log; the web's own: sessions, notes, scene,
dropped, and the kinds of jobs), `session` and `run`; `event_messages` describes them for the API's document. NaN and
infinities become null. A layer's particles are not in it: they are fetched from
`/api/sessions/{session}/runs/{run}/frames/{frame}/layers/{layer}/particles`, or drawn by the scene.
"""

import dataclasses
from typing import Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    LogLine,
    SettingsApplied,
    StateChanged,
)
from studio.results.inspection.verdict import limbs_off, verdict_on
from studio.search.trackers.tracker import FrameResult, LayerRecord

TYPES: dict[type[Event], str] = {
    StateChanged: "state",
    Acknowledged: "acknowledged",
    LayerFinished: "layer",
    FrameFinished: "frame",
    SettingsApplied: "settings",
    LogLine: "log",
}
QUANTILES = (0.0, 0.25, 0.5, 0.75, 1.0)


def as_json(message: dict[str, object]) -> str:
    """A message as text; arrays become lists, NaN becomes null."""
    return msgspec.json.encode(message, enc_hook=_plain).decode()


def plain(message: dict[str, object]) -> dict[str, object]:
    """A message as JSON's own types, NaN as None."""
    return msgspec.json.decode(as_json(message))


def message_of(event: Event) -> dict[str, object]:
    """An event as a flat dictionary."""
    head: dict[str, object] = {"type": TYPES[type(event)], "session": event.session, "run": event.run}
    if isinstance(event, LayerFinished):
        more = {
            "reannealed": event.reannealed,
            "waited_milliseconds": 1000.0 * (event.left_at - event.requested_at),
            "search_layers": event.search_layers,
            "searches": event.searches,
            "outline": None,
        }
        return head | more | layer_summary(event.record)
    if isinstance(event, FrameFinished):
        return head | {"reannealed": event.reannealed} | frame_summary(event.result)
    return head | {entry.name: getattr(event, entry.name) for entry in dataclasses.fields(event)[2:]}


def layer_summary(record: LayerRecord) -> dict[str, object]:
    """What the charts need of a layer: all but the particles.

    log_weight_quantiles : minimum, quartiles and maximum of the raw log-weights. effective_share :
    effective sample size over N at the layer's β.
    """
    return {
        "frame": record.frame,
        "layer": record.layer,
        "settings_version": record.settings_version,
        "beta": record.beta,
        "alpha_wanted": record.alpha_wanted,
        "alpha_reached": record.alpha_reached,
        "model_free_share": record.model_free_share,
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


def frame_summary(result: FrameResult) -> dict[str, object]:
    """What the timeline needs of a frame."""
    return {
        "frame": result.frame,
        "pose": result.estimate.pose,
        "log_weight": result.estimate.log_weight,
        "layers": result.layers,
        "evaluations": result.evaluations,
        "settings_version": result.settings_version,
        "milliseconds": result.milliseconds,
        "tracking": verdict_on(result).tracking,
        "limbs_off": limbs_off(result),
    }


def effective_share(log_weights: np.ndarray, beta: float) -> float:
    """(Σ w^β)² ÷ (N Σ w^2β): 1 for equal weights, 1/N when one particle has everything; NaN without
    particles.
    """
    if not log_weights.size or not np.isfinite(beta):
        return float("nan")
    scaled = np.exp(beta * (log_weights - log_weights.max()))
    return float(scaled.sum() ** 2 / (scaled.size * np.square(scaled).sum()))


def key_of(message: dict[str, object]) -> tuple[object, ...] | None:
    """Messages of one key replace each other where a watcher is slow; None: keep each."""
    kind = message["type"]
    if kind in ("state", "settings", "sessions", "scene"):
        return (kind,)
    if "step" in message:
        # How a job stands.
        return (kind, *(message.get(name) for name in ("session", "identifier", "name")))
    if kind == "layer":
        return (kind, message["frame"], message["layer"], message["reannealed"])
    if kind == "frame":
        return (kind, message["frame"], message["reannealed"])
    return None


def _quantiles(values: np.ndarray) -> list[float]:
    return np.quantile(values, QUANTILES).tolist() if values.size else []


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return cast("NDArray[Any] | np.generic[Any]", value).tolist()
    if isinstance(value, type):
        return value.__name__
    return str(value)
