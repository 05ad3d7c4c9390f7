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
from studio.operations.stored_frames import frame_summary, layer_summary

TYPES: dict[type[Event], str] = {
    StateChanged: "state",
    Acknowledged: "acknowledged",
    LayerFinished: "layer",
    FrameFinished: "frame",
    SettingsApplied: "settings",
    LogLine: "log",
}


def as_json(message: dict[str, object]) -> str:
    """A message as text; arrays become lists, NaN becomes null."""
    return msgspec.json.encode(message, enc_hook=_plain).decode()


def plain(message: dict[str, object]) -> dict[str, object]:
    """A message as JSON's own types, NaN as None."""
    return msgspec.json.decode(as_json(message))


def message_of(event: Event) -> dict[str, object]:
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


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return cast("NDArray[Any] | np.generic[Any]", value).tolist()
    if isinstance(value, type):
        return value.__name__
    return str(value)
