"""A stored run and its frames, as the views read them: layers with their normalised weights, estimate, settings."""

import math
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import DamagedError, NotFoundError, SettingsError, StudioError
from studio.foundations.package import software_version
from studio.foundations.words import enumerated
from studio.results.inspection.tables import Row, Selection
from studio.results.inspection.wanted import stop_if_left
from studio.runs.tracks import pose_in_track
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.settings import RunSettings, SettingsHistory, settings_from_values, values
from studio.search.trackers.annealing import normalised
from studio.search.trackers.catalogue import TRACKERS, size_in_words
from studio.search.trackers.tracker import FrameResult, LayerRecord
from studio.sessions.results_reader import ResultsReader
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")


@dataclass(frozen=True, slots=True, eq=False)
class TriedFrame:
    """A frame that was annealed again with other settings and is not stored. name : made of the settings, which with
    the run's seed give the same search again.
    """

    name: str
    number: int
    settings: RunSettings
    layers: tuple[LayerRecord, ...]
    result: FrameResult


class InspectedRun:
    """A run of a session with what all frames share. tried : stands in the place of the stored frame of its number."""

    def __init__(self, session: Session, run: StoredRun, tried: TriedFrame | None = None) -> None:
        self.session, self.run, self.tried = session, run, tried
        self._read: dict[int, RunSettings] = {}

    def tried_at(self, frame: int) -> TriedFrame | None:
        """What was tried in a frame and is looked at in its place."""
        return self.tried if self.tried is not None and self.tried.number == frame else None

    @cached_property
    def body(self) -> BodyModel:
        return self.run.body()

    @cached_property
    def history(self) -> SettingsHistory:
        with self.run.results() as results:
            return SettingsHistory(tuple(results.settings_history()))

    @cached_property
    def priors(self) -> HardPriors:
        """Which poses the body can take."""
        return HardPriors(self.body)

    @property
    def names(self) -> tuple[str, ...]:
        """(D,) names of the parameters."""
        return self.run.record.parameters

    @cached_property
    def units(self) -> tuple[str, ...]:
        """(D,) "mm" or "rad"."""
        return tuple("mm" if entry.kind == "length" else "rad" for entry in self.body.parameters)

    @cached_property
    def limbs(self) -> tuple[str, ...]:
        """(D,) limb of each parameter."""
        return tuple(entry.limb for entry in self.body.parameters)

    @property
    def labels(self) -> list[Row]:
        """D beginnings of rows: parameter, limb, unit."""
        return list(zip(self.names, self.limbs, self.units, strict=True))

    def parameter(self, name: str) -> int:
        """The place of a parameter. Raises NotFoundError."""
        if name not in self.names:
            raise NotFoundError(
                f"Run '{self.run.name}' has no parameter '{name[:40]}'.", f"It has: {', '.join(self.names)}."
            )
        return self.names.index(name)

    def settings(self, frame: int, layer: int = 0) -> RunSettings:
        """The settings in use in a layer of a frame; each version is read once."""
        if tried := self.tried_at(frame):
            return tried.settings
        record = self.run.record
        entry = self.history.in_use(frame, layer)
        version = entry.version if entry else 0
        if version not in self._read:
            values = entry.values if entry else record.settings
            self._read[version] = settings_from_values(record.tracker, record.weighting, values)
        return self._read[version]

    def frames(self) -> list[int]:
        with self.run.results() as results:
            return results.frames()

    def frame(self, frame: int, results: ResultsReader | None = None) -> "InspectedFrame":
        """A frame with its layers, finished or not. results : a reader. Raises NotFoundError, DamagedError."""
        stop_if_left()
        if tried := self.tried_at(frame):
            return InspectedFrame(self, frame, tried.layers, tried.result)
        if results is None:
            with self.run.results() as opened:
                return self.frame(frame, opened)
        layers = results.layers(frame)
        try:
            result = results.result(frame)
        except DamagedError:
            raise
        except NotFoundError:
            result = None
        return InspectedFrame(self, frame, tuple(layers), result)

    def caption(self, frame: int | None = None) -> str:
        """One sentence: session, run, frame, what it was tracked with, and versions."""
        record = self.run.record
        entry = self.history.in_use(frame, 10**6) if frame is not None else None
        tried = None if frame is None else self.tried_at(frame)
        used = values(tried.settings) if tried else entry.values if entry else record.settings
        size = size_in_words(record.tracker, used)
        named = [f"{key} {used[key]:g}" for key in ("survival", "diffusion_scale") if key in used]
        place = f", frame {frame}{' tried again, not stored' if tried else ''}" if frame is not None else ""
        made = record.software or "an older studio"
        return (
            f"Session {self.session.name}, run {self.run.name}{place}: "
            + ", ".join([f"{record.tracker} {size}".strip(), record.weighting, *named, f"seed {record.seed}"])
            + f"; tracked with {made}, drawn with {software_version()}."
        )


@dataclass(frozen=True, eq=False)
class InspectedFrame:
    """A frame of a run. layers : in the order they ran, at least one. result : None in an unfinished frame."""

    of: InspectedRun
    number: int
    layers: tuple[LayerRecord, ...]
    result: FrameResult | None

    @cached_property
    def settings(self) -> RunSettings:
        """The settings at the frame's beginning."""
        return self.of.settings(self.number)

    def layer(self, selection: Selection) -> int:
        """The selected layer, the last one where none is. Raises NotFoundError."""
        if selection.layer is None:
            return len(self.layers) - 1
        if not 0 <= selection.layer < len(self.layers):
            raise NotFoundError(
                f"Frame {self.number} has no layer {selection.layer + 1}.",
                f"It has the layers 1 to {len(self.layers)}.",
            )
        return selection.layer

    def log_weights(self, layer: int) -> Array:
        """(N,) logs of the normalised weights π ∝ w^β (Deutscher & Reid 2005, Eq. 3 and 6) of a layer's stored
        particles, -inf for poses that the body cannot take; equal where the tracker has no β (a swarm).
        """
        if layer not in self._weights:
            self._weights[layer] = self._weighted(layer)
        return self._weights[layer]

    @cached_property
    def _weights(self) -> dict[int, Array]:
        return {}

    def _weighted(self, layer: int) -> Array:
        record = self.layers[layer]
        raw = record.log_weights
        if not math.isfinite(record.beta) or not len(raw):
            return np.full(len(raw), -np.log(max(len(raw), 1)))
        # A tracker from outside the package may have no constraints; then every pose keeps its weight.
        knobs = asdict(self.of.settings(self.number, layer).tracker)
        if knobs.get("constraints", "ignore") != "ignore":
            held = self.of.priors.hold(record.poses, limbs_apart=knobs.get("limbs_apart", False))
            raw = np.where(held, raw, -np.inf) if held.any() else raw
        return normalised(raw, record.beta)

    def weights(self, layer: int) -> Array:
        """(N,) normalised weights of a layer."""
        return np.exp(self.log_weights(layer))

    @property
    def is_weighted(self) -> bool:
        """Whether the tracker's particles have weights (a swarm's have none)."""
        return math.isfinite(self.layers[-1].beta)

    def particles(self, layer: int) -> Indices:
        """(N,) numbers of a layer's stored particles in the whole set."""
        record = self.layers[layer]
        return record.rows if len(record.rows) else np.arange(len(record.poses))

    def size(self, layer: int) -> int:
        """How many particles the layer had, stored or not."""
        record = self.layers[layer]
        drawn = self.layers[layer - 1].parents.shape[1] if layer else 0
        return max(len(record.poses), drawn, record.parents.shape[1], int(record.rows.max(initial=-1)) + 1)

    def _searches_in_words(self) -> str:
        count = self.search_layers
        spans = [
            f"layers {first + 1} to {min(first + count, len(self.layers))} are the {ordinal(number)} search"
            for number, first in enumerate(range(0, len(self.layers), count), 1)
        ]
        return enumerated(spans)

    def layer_in_words(self, layer: int) -> str:
        """A layer, counted from 1 in its search, which is named where the frame has several."""
        search, within = divmod(layer, self.search_layers)
        of = f" of the {ordinal(search + 1)} search" if len(self.layers) > self.search_layers else ""
        return f"layer {within + 1}{of}"

    def estimate(self, track: str = "") -> Array:
        """(D,) the frame's pose, in a track if one is named; in an unfinished frame the last layer's mean.

        Raises NotFoundError for a track that does not have the frame. Of a tried frame there are no tracks.
        """
        if track and track != "raw" and not self.of.tried_at(self.number):
            return pose_in_track(self.of.run, track, self.number)
        return self.layers[-1].mean if self.result is None else self.result.estimate.pose

    def searched(self) -> Array:
        """(D,) what the search reported, before any refinement."""
        if self.result is None:
            return self.layers[-1].mean
        searched = self.result.estimate.searched
        return self.result.estimate.pose if searched is None else searched

    @cached_property
    def search_layers(self) -> int:
        """Layers of one search of the frame; all of its layers where its tracker is not installed."""
        layers = len(self.layers)
        try:
            counted = TRACKERS[self.of.run.record.tracker].layer_count(self.settings.tracker)
        except (StudioError, KeyError):
            return layers
        # A frame is never searched one and a half times over: such a record is of another version's layers.
        return counted if self.result is None or layers % counted == 0 else layers

    @property
    def searches(self) -> int:
        """How many searches the frame has, those to come counted."""
        begun = -(-len(self.layers) // self.search_layers)
        if self.result is not None or self.number != self.of.run.record.first:
            return begun
        return max(begun, getattr(self.settings.tracker, "start_repeats", 1))

    def notes(self) -> tuple[str, ...]:
        """What a reader has to know of all numbers about the frame's particles."""
        notes: list[str] = []
        if len(self.layers) > self.search_layers:
            notes.append(f"The frame was searched several times over: {self._searches_in_words()}.")
        if not self.is_weighted:
            notes.append("This tracker has no β: its particles count equally here.")
        if self.result is None:
            notes.append("The frame is not finished.")
        stored, whole = len(self.layers[-1].poses), self.size(len(self.layers) - 1)
        if stored < whole:
            notes.append(
                f"Of {whole} particles a layer the {stored} heaviest are stored; weights are among these."
            )
        return tuple(notes)


def ordinal(number: int) -> str:
    """A number from 1 as a place in a row: first, second, … 13th."""
    return ORDINALS[number - 1] if number <= len(ORDINALS) else f"{number}th"


def no_value(value: float) -> float | None:
    """A number, None where it is none."""
    return value if math.isfinite(value) else None


def require(value: str, what: str, view: str) -> str:
    """A selected name. Raises SettingsError where a view needs one that is not selected."""
    if not value:
        raise SettingsError(f"View '{view}' needs a {what}.", f"Select one ({what}=NAME).")
    return value
