"""The search of one frame, a layer at a time: it can be stopped between layers, saved and resumed.

A frame is searched `repeats` times over (more than once only where a run starts): each search begins with
what the one before ended with. Layers are numbered through: layer i of search r is record r M + i. Random
numbers are counted from seed, frame and that number, so a frame replays bit for bit from the same particles and
settings, wherever it was interrupted.
"""

import dataclasses
import importlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from studio.foundations.errors import RunError, StudioError
from studio.foundations.knobs import knobs_of
from studio.search.likelihood.problem import FittedToPoses, WeighedOnDevice
from studio.search.trackers.layer_plan import WIDEST
from studio.search.trackers.particles import WeightError
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import (
    HIDDEN,
    MOVED,
    AnyTracker,
    Array,
    FilterState,
    FrameLikelihood,
    FrameResult,
    LayerRecord,
    ParticleSet,
    SearchOnDevice,
    SearchSpace,
)

if TYPE_CHECKING:
    from studio.search.likelihood.device_weighing import ProblemOnDevice

# The current version of the settings and the tracker's own settings.
SettingsSource = Callable[[], tuple[int, Any]]


@dataclass(frozen=True, slots=True, eq=False)
class SearchState:
    """State of an unfinished frame: all that is needed to resume it, besides what the frame started from.

    layers_done : over all repeats. layer_count : M, layers of one search (0 before the first layer).
    particles : the set that the next layer weighs (None before the first; the last search's weighted set
    where a repeat begins, or at the end). settings : read when the search began; its "next frame" knobs hold
    until the search ends. settings_version : of the settings used last. evaluations : poses weighed.
    milliseconds : time of the layers. expected : (S, D) poses that this search expected before it began (None
    before the first layer). memory : the likelihood's state after this frame, once all layers are done.
    """

    layers_done: int = 0
    layer_count: int = 0
    particles: ParticleSet | None = None
    settings: Any = None
    settings_version: int = 0
    evaluations: int = 0
    milliseconds: float = 0.0
    expected: Array | None = None
    memory: Mapping[str, Array] = field(default_factory=dict[str, Array])


class FrameSearch:
    """The search of one frame. Call `step` until `finished`, then `result`.

    `state` is immutable and may be kept at any moment; a search made with a kept state goes on from there
    with the same result, bit for bit, as one that was never interrupted.
    """

    def __init__(
        self,
        tracker: AnyTracker,
        previous: FilterState,
        space: SearchSpace,
        *,
        seed: int,
        frame: int,
        repeats: int = 1,
        state: SearchState | None = None,
    ) -> None:
        self.tracker, self.previous, self.space = tracker, previous, space
        self.seed, self.frame, self.repeats = seed, frame, repeats
        self._state = state or SearchState()
        self._on_device: SearchOnDevice | None = None
        self._prepared: tuple[FrameLikelihood, int, FrameLikelihood] | None = None

    @property
    def state(self) -> SearchState:
        """All that is needed to go on elsewhere; particles that are on a card are copied now."""
        if self._on_device is not None and self._state.particles is None:
            self._state = dataclasses.replace(self._state, particles=self._on_device.particles())
        return self._state

    @property
    def problem(self) -> FrameLikelihood | None:
        """Likelihood of the last layer done here, given the expected poses; None before the first."""
        return None if self._prepared is None else self._prepared[2]

    @property
    def layer_count(self) -> int:
        """Layers of one of its searches; 0 before the first layer."""
        return self._state.layer_count

    @property
    def finished(self) -> bool:
        """Whether all layers of all repeats are done."""
        state = self._state
        return state.layer_count > 0 and state.layers_done == self.repeats * state.layer_count

    def step(self, problem: FrameLikelihood, version: int, settings: Any) -> LayerRecord:  # noqa: ANN401
        """Do one layer with these settings (of the tracker's type) and return its record.

        Knobs that take effect with the next frame keep the value they had when the search began.
        """
        if self.finished:
            raise RunError(f"Frame {self.frame} has no layer left.", "Continue with the next frame.")
        began = time.perf_counter()
        state = self._state
        held = state.settings if state.layers_done else settings
        in_use = held_over(settings, held)
        count = self.tracker.layer_count(in_use)
        repeat, layer = divmod(state.layers_done, count)
        record = self._step_on_device(problem, repeat, layer, in_use)
        particles, expected = None, state.expected
        memory: Mapping[str, Array] = self.previous.memory
        if record is None:
            particles, expected, record, memory = self._step_here(problem, repeat, layer, in_use)
        evaluated = len(record.poses) if self._on_device is None else self._on_device.evaluated
        is_last = state.layers_done + 1 == self.repeats * count
        milliseconds = 1000.0 * (time.perf_counter() - began)
        self._state = SearchState(
            layers_done=state.layers_done + 1,
            layer_count=count,
            particles=particles,
            settings=held,
            settings_version=version,
            evaluations=state.evaluations + evaluated,
            milliseconds=state.milliseconds + milliseconds,
            expected=expected,
            memory=memory if is_last else {},
        )
        return dataclasses.replace(
            record,
            frame=self.frame,
            layer=state.layers_done,
            settings_version=version,
            milliseconds=milliseconds,
        )

    def result(self, settings: Any = None) -> FrameResult:  # noqa: ANN401
        """The frame's result; settings : of the tracker's type, those held since the beginning if None.

        Raises RunError while layers remain.
        """
        state = self.state
        if not self.finished or state.particles is None:
            raise RunError(f"Frame {self.frame} is not searched to its end.", "Do the remaining layers.")
        in_use = state.settings if settings is None else held_over(settings, state.settings)
        estimate = self.tracker.end_frame(state.particles, self.space, in_use)
        return FrameResult(
            frame=self.frame,
            estimate=estimate,
            layers=state.layers_done,
            evaluations=state.evaluations,
            settings_version=state.settings_version,
            milliseconds=state.milliseconds,
            carried=FilterState(state.particles, estimate.pose, self.previous.estimate, state.memory),
        )

    def _step_here(
        self,
        problem: FrameLikelihood,
        repeat: int,
        layer: int,
        settings: Any,  # noqa: ANN401
    ) -> tuple[ParticleSet, Array | None, LayerRecord, Mapping[str, Array]]:
        """A layer by the processor: the set that follows, the poses that the search expected, the record, and the
        memory for the next frame where this is the last layer.
        """
        state = self.state
        particles, expected = state.particles, state.expected
        if layer == 0:
            particles = self._beginning(repeat, settings)
            expected = self._expected(particles, settings)
        assert particles is not None
        informed = problem if expected is None else self._with_expectations(problem, repeat, expected)
        numbers = RandomNumbers(self.seed, self.frame, state.layers_done, repeat)
        try:
            following, record = self.tracker.step_layer(
                numbers, particles, layer, informed, self.space, settings
            )
        except WeightError as error:
            raise WeightError(
                f"Frame {self.frame}, layer {state.layers_done + 1}: {error.message}", error.hint
            ) from None
        is_last = state.layers_done + 1 == self.repeats * self.tracker.layer_count(settings)
        return (
            following,
            expected,
            record,
            self._remembered(informed, following, settings) if is_last else {},
        )

    def _step_on_device(
        self,
        problem: FrameLikelihood,
        repeat: int,
        layer: int,
        settings: Any,  # noqa: ANN401
    ) -> LayerRecord | None:
        """A layer by a card, on which the particles stay; None where the processor is to do it.

        Raises StudioError where a card that was asked for fails.
        """
        state = self._state
        there = problem.on_device() if isinstance(problem, WeighedOnDevice) else None
        if there is None or not self._fits_device(layer, settings):
            # The processor goes on from what the card has done.
            self._state, self._on_device = self.state, None
            return None
        try:
            on_device = self._on_device
            if on_device is None or layer == 0:
                on_device = self._begun_on_device(there, repeat, layer, settings)
            numbers = RandomNumbers(self.seed, self.frame, state.layers_done, repeat)
            record = on_device.step(layer, numbers, settings)
            self._on_device = on_device
        except StudioError:
            raise
        except Exception as error:
            assert isinstance(problem, WeighedOnDevice)
            problem.give_up_device(error)
            if layer > 0 and state.particles is None:
                raise RunError(
                    f"The card failed in layer {layer + 1} of frame {self.frame}: {error}.",
                    "Track the frame again; the processor searches it.",
                ) from None
            self._on_device = None
            return None
        self._prepared = problem, repeat, problem
        return record

    def _begun_on_device(
        self,
        there: "ProblemOnDevice",
        repeat: int,
        layer: int,
        settings: Any,  # noqa: ANN401
    ) -> SearchOnDevice:
        """A card's search with the set that a layer weighs."""
        module = importlib.import_module(self.tracker.device_module)
        on_device: SearchOnDevice = module.DeviceSearch(self.tracker, there, self.space, settings)
        start = self.previous if repeat == 0 else FilterState(self.state.particles)
        particles = self.state.particles
        if layer > 0 and particles is not None:
            on_device.take(particles)
        elif start.particles is None:
            on_device.take(self._beginning(repeat, settings))
        else:
            on_device.begin(start, RandomNumbers.of_beginning(self.seed, self.frame, repeat), settings)
        return on_device

    def _fits_device(self, layer: int, settings: Any) -> bool:  # noqa: ANN401
        """Whether a card can do a layer."""
        extra = self._state.particles.extra if self._state.particles is not None else {}
        fits = self.tracker.fits_device(layer, self.space, settings, extra)
        return fits and len(self.space.names) <= WIDEST

    def _beginning(self, repeat: int, settings: Any) -> ParticleSet:  # noqa: ANN401
        """The unweighted set of a search's first layer."""
        numbers = RandomNumbers.of_beginning(self.seed, self.frame, repeat)
        start = self.previous if repeat == 0 else FilterState(self.state.particles)
        return self.tracker.begin_frame(numbers, start, self.space, settings)

    def _expected(self, particles: ParticleSet, settings: Any) -> Array:  # noqa: ANN401
        """(S, D) poses expected by a search that starts from these particles: the tracker's; after
        the first come the last pose moved on at constant velocity and the last reported pose, as far as they are
        known.
        """
        poses = self.tracker.expectations(particles, self.space, settings)
        last, before = self.previous.estimate, self.previous.previous_estimate
        if last is None:
            return poses
        known = last[None] if before is None else np.stack([2.0 * last - before, last])
        return np.concatenate([poses[:1], known, poses[1:]])

    def _with_expectations(self, problem: FrameLikelihood, repeat: int, expected: Array) -> FrameLikelihood:
        """The frame's likelihood given the expected poses, made once a search, if it uses them."""
        kept = self._prepared
        if kept is None or kept[0] is not problem or kept[1] != repeat:
            informed = problem
            if isinstance(problem, FittedToPoses):
                informed = problem.expecting(expected, self.previous.memory)
            kept = self._prepared = (problem, repeat, informed)
        return kept[2]

    def _remembered(
        self,
        informed: FrameLikelihood,
        particles: ParticleSet,
        settings: Any,  # noqa: ANN401
    ) -> Mapping[str, Array]:
        """Memory for the next frame: the likelihood's, updated with this frame's estimate, and the hidden areas."""
        before = self.previous.memory
        if not isinstance(informed, FittedToPoses):
            return before
        found = informed.remembered(self.tracker.end_frame(particles, self.space, settings).pose)
        return {
            **{name: values for name, values in before.items() if name.startswith((HIDDEN, MOVED))},
            **found,
        }


def search_frame(
    tracker: AnyTracker,
    problem: FrameLikelihood,
    previous: FilterState,
    space: SearchSpace,
    *,
    seed: int,
    frame: int,
    settings_source: SettingsSource,
    repeats: int = 1,
    on_layer: Callable[[LayerRecord], None] | None = None,
) -> FrameResult:
    """Search a frame to its end.

    settings_source : called before every layer, gives (version, tracker settings). on_layer : gets each record.
    """
    search = FrameSearch(tracker, previous, space, seed=seed, frame=frame, repeats=repeats)
    settings = None
    while not search.finished:
        version, settings = settings_source()
        record = search.step(problem, version, settings)
        if on_layer is not None:
            on_layer(record)
    return search.result(settings)


def held_over(settings: Any, held: Any) -> Any:  # noqa: ANN401
    """`settings`, except that knobs which do not take effect with the next layer keep their values in `held`."""
    if settings == held:
        return settings
    slow = [entry.name for entry in knobs_of(settings) if entry.takes_effect != "next layer"]
    return dataclasses.replace(settings, **{name: getattr(held, name) for name in slow})
