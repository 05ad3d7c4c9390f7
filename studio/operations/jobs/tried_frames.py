"""Frames that were annealed again and are not stored, kept from the tracking process's events: a run's newest ones,
each under a name made of its settings, so that the same knobs tried twice are one.
"""

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from studio.foundations.errors import NotFoundError
from studio.foundations.knobs import Value
from studio.operations.jobs.events import Event, FrameFinished, LayerFinished, SettingsApplied
from studio.results.inspection.reading import TriedFrame
from studio.search.settings import settings_from_values
from studio.search.trackers.tracker import FrameResult, LayerRecord
from studio.sessions.stored_run import StoredRun

MOST_OF_A_RUN, MOST_BYTES = 24, 128 << 20
Place = tuple[str, str]
"""Session and run."""


@dataclass(frozen=True, slots=True, eq=False)
class _Tried:
    frame: int
    values: Mapping[str, Value]
    layers: tuple[LayerRecord, ...]
    result: FrameResult

    @property
    def size(self) -> int:
        return sum(record.poses.nbytes + record.log_weights.nbytes for record in self.layers)


class TriedFrames:
    """What was tried, by run; thread-safe. Events have to come in their order."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._settings: dict[Place, tuple[int, Mapping[str, Value]]] = {}
        self._layers: dict[Place, list[LayerRecord]] = {}
        self._kept: OrderedDict[tuple[Place, str], _Tried] = OrderedDict()

    def hear(self, event: Event) -> str:
        """Take an event in; returns the name of the frame that it ends and that is kept, else ""."""
        place = event.session, event.run
        with self._lock:
            if isinstance(event, SettingsApplied):
                self._settings[place] = event.version, event.values
            elif isinstance(event, LayerFinished) and event.reannealed:
                known = self._layers.get(place, [])
                goes_on = known and (known[-1].frame, known[-1].layer + 1) == (
                    event.record.frame,
                    event.record.layer,
                )
                self._layers[place] = [*known, event.record] if goes_on else [event.record]
            elif isinstance(event, FrameFinished) and event.reannealed:
                return self._keep(place, event.result)
            elif isinstance(event, FrameFinished):
                # What followed from the frame that is replaced now is no longer of this run.
                self._forget(lambda key, tried: key[0] == place and tried.frame >= event.result.frame)
        return ""

    def _keep(self, place: Place, result: FrameResult) -> str:
        layers, (version, values) = self._layers.pop(place, []), self._settings.get(place, (-1, {}))
        whole = len(layers) == result.layers and layers[0].layer == 0
        if not whole or {version} != {result.settings_version, *(one.settings_version for one in layers)}:
            return ""  # A watcher that is late hears of the newest only.
        key = place, name_of(result.frame, values)
        # The clouds are in the layers; what the next frame would begin with is not asked of a frame that is not kept.
        light = replace(result, carried=replace(result.carried, particles=None))
        self._kept.pop(key, None)
        self._kept[key] = _Tried(result.frame, dict(values), tuple(layers), light)
        own = [one for one in self._kept if one[0] == place]
        for old in own[:-MOST_OF_A_RUN]:
            del self._kept[old]
        while len(self._kept) > 1 and sum(one.size for one in self._kept.values()) > MOST_BYTES:
            self._kept.popitem(last=False)
        return key[1]

    def of_frame(self, run: StoredRun, session: str, frame: int) -> list[TriedFrame]:
        """What was tried of a run's frame, the oldest first."""
        with self._lock:
            place = session, run.name
            names = [key[1] for key, one in self._kept.items() if key[0] == place and one.frame == frame]
        return [self.tried(run, session, name) for name in names]

    def tried(self, run: StoredRun, session: str, name: str) -> TriedFrame:
        """What was tried under a name. Raises NotFoundError for one that is not kept (any more)."""
        with self._lock:
            kept = self._kept.get(((session, run.name), name))
        if kept is None:
            raise NotFoundError(
                f"Trial '{name[:40]}' of run '{run.name}' is not kept any more.",
                "Move the knobs there again: the same knobs give the same search.",
            )
        record = run.record
        settings = settings_from_values(record.tracker, record.weighting, kept.values)
        return TriedFrame(name, kept.frame, settings, kept.layers, kept.result)

    def forget(self, session: str, run: str = "") -> None:
        """Forget a session's runs, or one of them."""
        with self._lock:
            self._forget(lambda key, _: key[0] == (session, run) if run else key[0][0] == session)

    def _forget(self, concerns: Callable[[tuple[Place, str], _Tried], bool]) -> None:
        for key in [key for key, tried in self._kept.items() if concerns(key, tried)]:
            del self._kept[key]


def name_of(frame: int, values: Mapping[str, Value]) -> str:
    """The name of what is tried in a frame with these settings."""
    text = json.dumps(dict(values), sort_keys=True)
    return f"{frame}-{hashlib.sha256(text.encode()).hexdigest()[:10]}"
