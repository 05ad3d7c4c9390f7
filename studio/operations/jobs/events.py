"""What the tracking process says. Newest wins where a watcher is slow; small values only, arrays go through
the store except a layer's own cloud, which travels with `LayerFinished` so that it can be drawn at once."""

import math
from collections.abc import Hashable
from dataclasses import dataclass, field
from enum import StrEnum

from studio.foundations.knobs import Value
from studio.runs.live.live_summary import LiveStanding
from studio.search.trackers.tracker import FrameResult, LayerRecord


class RunState(StrEnum):
    """What the tracking process does with the run that is open. LOST: the process died."""

    IDLE = "idle"
    COMPILING = "compiling"
    TRACKING = "tracking"
    PAUSED = "paused"
    REANNEALING = "reannealing"
    FINISHED = "finished"
    CANCELLED = "cancelled"
    FAILED = "failed"
    LOST = "lost"

    @property
    def searches(self) -> bool:
        """Whether frames are tracked, or will be once kernels are compiled."""
        return self in (RunState.COMPILING, RunState.TRACKING)


@dataclass(frozen=True, slots=True)
class Event:
    """session, run : names; empty where no run is open."""

    session: str
    run: str

    @property
    def key(self) -> Hashable:
        """Events of one key replace each other where a watcher is slow; None: each is kept."""
        return type(self)


@dataclass(frozen=True, slots=True)
class StateChanged(Event):
    """frame, layer : where the search stands. first, last : frames of the run, half open. done : frames
    finished. frames_per_second and seconds_left : measured, NaN while unknown. message, hint : for failed and
    lost. waiting : (session, run) names of the runs that are tracked after this one. selected : the frame
    that re-anneal works on, -1 for none. seconds_a_layer : what each tracked layer takes at least, 0 as fast as
    it can (`commands.SetPace`); both estimates hold for this pace. live : how a live run keeps up, None for others.
    """

    state: RunState
    frame: int = 0
    layer: int = 0
    first: int = 0
    last: int = 0
    done: int = 0
    frames_per_second: float = math.nan
    seconds_left: float = math.nan
    message: str = ""
    hint: str = ""
    waiting: tuple[tuple[str, str], ...] = ()
    selected: int = -1
    seconds_a_layer: float = 0.0
    live: LiveStanding | None = None


@dataclass(frozen=True, slots=True)
class Acknowledged(Event):
    """A command was taken (ok) or refused (message, hint, and `code` of the StudioError)."""

    identifier: str
    command: str
    ok: bool
    message: str = ""
    hint: str = ""
    code: str = ""

    @property
    def key(self) -> Hashable:
        """Each is kept."""
        return None


@dataclass(frozen=True, slots=True)
class LayerFinished(Event):
    """reannealed : true for a what-if layer that is not stored.

    requested_at : `time.monotonic()` when the person's command (a slider's event) came that this layer answers,
    NaN where it answers none. left_at : when it left the process. The difference is the time that a person
    waits. search_layers, searches : layers of one search of the frame, and how many searches the frame has.
    """

    record: LayerRecord
    reannealed: bool = False
    requested_at: float = math.nan
    left_at: float = math.nan
    search_layers: int = 0
    searches: int = 1

    @property
    def key(self) -> Hashable:
        """One a layer."""
        return LayerFinished, self.record.layer, self.reannealed


@dataclass(frozen=True, slots=True)
class FrameFinished(Event):
    """A frame's result (stored unless reannealed); of a live run without particles and memory.

    latency_ms : from the last picture's arrival to the pose, NaN where the run is not live.
    """

    result: FrameResult
    reannealed: bool = False
    latency_ms: float = math.nan

    @property
    def key(self) -> Hashable:
        """The newest, and the newest answer."""
        return FrameFinished, self.reannealed


@dataclass(frozen=True, slots=True)
class SettingsApplied(Event):
    """The settings in use since (frame, layer). values : every knob by name. changed : the names that moved."""

    version: int
    frame: int
    layer: int
    values: dict[str, Value] = field(default_factory=dict[str, Value])
    changed: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LogLine(Event):
    """level : info, warning or error. time : seconds since the epoch."""

    level: str
    time: float
    text: str

    @property
    def key(self) -> Hashable:
        """Each is kept."""
        return None


def nothing_open(seconds_a_layer: float = 0.0) -> StateChanged:
    """The state of a process with no run open."""
    return StateChanged("", "", RunState.IDLE, seconds_a_layer=seconds_a_layer)
