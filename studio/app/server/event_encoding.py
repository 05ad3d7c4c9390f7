"""Events as JSON: small values only.

Each message has `type` (state, acknowledged, layer, frame, settings, log; the web's own: sessions, notes, scene,
dropped, and the kinds of jobs), `session` and `run`; `event_messages` describes them for the API's document. NaN and
infinities become null. A layer's particles are not in it: they are fetched from
`/api/sessions/{session}/runs/{run}/frames/{frame}/layers/{layer}/particles`, or drawn by the scene.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    LogLine,
    SettingsApplied,
    StateChanged,
)
from studio.operations.stored_frames import LayerView, frame_summary, layer_summary


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LayerMessage(LayerView):
    """A layer without its particles.

    waited_milliseconds : from the slider that it answers, null where it answers none.
    search_layers, searches : layers of one search of the frame, and how many searches the frame has.
    """

    session: str
    run: str
    reannealed: bool
    waited_milliseconds: float
    search_layers: int
    searches: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrameMessage:
    """A frame's result. trial : the name under which a frame that was annealed again is kept, "" where it is not."""

    session: str
    run: str
    reannealed: bool
    frame: int
    pose: Array
    log_weight: float
    layers: int
    evaluations: int
    settings_version: int
    milliseconds: float
    tracking: str
    limbs_off: tuple[str, ...]
    trial: str = ""


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
    """A message of the tracking process: its type, and the entries of its record."""
    record = _record_of(event)
    entries = {entry.name: getattr(record, entry.name) for entry in dataclasses.fields(record)}
    return {"type": TYPES[type(event)], **entries}


def _record_of(event: Event) -> Event | LayerMessage | FrameMessage:
    if isinstance(event, LayerFinished):
        return LayerMessage(
            session=event.session,
            run=event.run,
            reannealed=event.reannealed,
            waited_milliseconds=1000.0 * (event.left_at - event.requested_at),
            search_layers=event.search_layers,
            searches=event.searches,
            **layer_summary(event.record),
        )
    if isinstance(event, FrameFinished):
        return FrameMessage(
            session=event.session,
            run=event.run,
            reannealed=event.reannealed,
            **frame_summary(event.result),
        )
    return event


def key_of(message: dict[str, object]) -> tuple[object, ...] | None:
    """Messages of one key replace each other where a watcher is slow; None: keep each."""
    kind = message["type"]
    if kind in ("state", "settings", "sessions", "scene"):
        return (kind,)
    if "key" in message:
        # How a job stands.
        return (kind, message["key"])
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
