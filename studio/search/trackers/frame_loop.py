"""The search of one frame, a layer at a time: it can be stopped between layers, saved and resumed.

A frame is searched `repeats` times over (more than once only where a run starts): each search begins with
what the one before ended with. Layers are numbered through: layer i of search r is record r M + i. Random
numbers are counted from seed, frame and that number, so a frame replays bit for bit from the same particles and
settings, wherever it was interrupted.
"""

import dataclasses
import importlib
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
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


@dataclass(frozen=True, slots=True, eq=False)
class NextLayer:
    """What a layer is done with.

    version : of the settings. held : the settings when the search began. in_use : those of the layer. count : layers of
    a search. repeat, layer : numbers of search and layer, from 0. numbers : the layer's random numbers.
    """

    version: int
    held: Any
    in_use: Any
    count: int
    repeat: int
    layer: int
    numbers: RandomNumbers


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
        self.on_device: SearchOnDevice | None = None
        """On the card, with its particles, those of all searches that are stepped together."""
        self._place = 0
        """Its number among these."""
        self._beside = 1
        """How many these are."""
        self._prepared: tuple[FrameLikelihood, int, FrameLikelihood] | None = None

    @property
    def state(self) -> SearchState:
        """All that is needed to go on elsewhere; particles that are on a card are copied now."""
        if self.is_only_there:
            assert self.on_device is not None
            there = self.on_device.particles()[self._place]
            self._state = dataclasses.replace(self._state, particles=there)
        return self._state

    @property
    def is_only_there(self) -> bool:
        """Whether its particles are on a card and nowhere else."""
        return self.on_device is not None and self._state.particles is None

    @property
    def problem(self) -> FrameLikelihood | None:
        """Likelihood of the last layer done here, given the expected poses; None before the first."""
        return None if self._prepared is None else self._prepared[2]

    @property
    def layers_done(self) -> int:
        """Layers done, of all repeats."""
        return self._state.layers_done

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
        return step_together((self,), problem, ((version, settings),))[0]

    def next_layer(self, version: int, settings: Any) -> NextLayer:  # noqa: ANN401
        """What the next layer is done with. Raises RunError where none is left."""
        if self.finished:
            raise RunError(f"Frame {self.frame} has no layer left.", "Continue with the next frame.")
        state = self._state
        held = state.settings if state.layers_done else settings
        in_use = held_over(settings, held)
        count = self.tracker.layer_count(in_use)
        repeat, layer = divmod(state.layers_done, count)
        numbers = RandomNumbers(self.seed, self.frame, state.layers_done, repeat)
        return NextLayer(version, held, in_use, count, repeat, layer, numbers)

    def step_here(self, problem: FrameLikelihood, at: NextLayer) -> LayerRecord:
        """Do the next layer by the processor, which goes on from what a card has done."""
        began = time.perf_counter()
        state = self.state
        self.on_device = None
        particles, expected = state.particles, state.expected
        if at.layer == 0:
            particles = self.beginning(at)
            expected = self._expected(particles, at.in_use)
        assert particles is not None
        informed = problem if expected is None else self._with_expectations(problem, at.repeat, expected)
        try:
            following, record = self.tracker.step_layer(
                at.numbers, particles, at.layer, informed, self.space, at.in_use
            )
        except WeightError as error:
            raise WeightError(
                f"Frame {self.frame}, layer {state.layers_done + 1}: {error.message}", error.hint
            ) from None
        is_last = state.layers_done + 1 == self.repeats * at.count
        memory: Mapping[str, Array] = self._remembered(informed, following, at.in_use) if is_last else {}
        return self._done(at, record, len(record.poses), began, 1, following, expected, memory)

    def stepped_there(
        self, problem: FrameLikelihood, at: NextLayer, record: LayerRecord, began: float, place: int, of: int
    ) -> LayerRecord:
        """The record of a layer that a card has done since `began`, of the search with number `place` of so many."""
        assert self.on_device is not None
        self._place, self._beside, self._prepared = place, of, (problem, at.repeat, problem)
        is_last = self._state.layers_done + 1 == self.repeats * at.count
        memory: Mapping[str, Array] = self.previous.memory if is_last else {}
        evaluated = self.on_device.evaluated
        return self._done(at, record, evaluated, began, of, None, self._state.expected, memory)

    def _done(
        self,
        at: NextLayer,
        record: LayerRecord,
        evaluated: int,
        began: float,
        of: int,
        particles: ParticleSet | None,
        expected: Array | None,
        memory: Mapping[str, Array],
    ) -> LayerRecord:
        """The record, with the state brought up to date. of : how many searches share the time since it began."""
        state, milliseconds = self._state, 1000.0 * (time.perf_counter() - began) / of
        self._state = SearchState(
            layers_done=state.layers_done + 1,
            layer_count=at.count,
            particles=particles,
            settings=at.held,
            settings_version=at.version,
            evaluations=state.evaluations + evaluated,
            milliseconds=state.milliseconds + milliseconds,
            expected=expected,
            memory=memory,
        )
        return dataclasses.replace(
            record,
            frame=self.frame,
            layer=state.layers_done,
            settings_version=at.version,
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

    def in_common(self, version: int, settings: Any) -> Hashable:  # noqa: ANN401
        """What searches of one frame's likelihood have in common whose next layers may be done together."""
        at, given = self.next_layer(version, settings), self.previous.particles
        begins_with = -1 if given is None else len(given.poses)
        shared = tuple(self.tracker.shared_knobs(at.in_use).items())
        return self.tracker.name, self.layers_done, self.fits_device(at), begins_with, shared

    def is_on(self, device: SearchOnDevice | None, searches: int) -> bool:
        """Whether its particles are there, among those of so many searches."""
        return device is not None and self.on_device is device and self._beside == searches

    def fits_device(self, at: NextLayer) -> bool:
        """Whether a card can do the next layer."""
        extra = self._state.particles.extra if self._state.particles is not None else {}
        fits = self.tracker.fits_device(at.layer, self.space, at.in_use, extra)
        return fits and len(self.space.names) <= WIDEST

    def start(self, at: NextLayer) -> FilterState:
        """What the search starts from: what the last frame left, or the search before."""
        return self.previous if at.repeat == 0 else FilterState(self.state.particles)

    def beginning(self, at: NextLayer) -> ParticleSet:
        """The unweighted set of the search's first layer."""
        return self.tracker.begin_frame(at.numbers.beginning, self.start(at), self.space, at.in_use)

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
    return search_together((search,), problem, settings_source, on_layer)[0]


def search_together(
    searches: Sequence[FrameSearch],
    problem: FrameLikelihood,
    settings_source: SettingsSource,
    on_layer: Callable[[LayerRecord], None] | None = None,
) -> list[FrameResult]:
    """Search a frame to its end, a layer of all searches at a time (`step_together`). on_layer : gets each search's
    record of a layer, in their order.
    """
    settings = None
    while not searches[0].finished:
        version, settings = settings_source()
        for record in step_together(searches, problem, ((version, settings),) * len(searches)):
            if on_layer is not None:
                on_layer(record)
    return [search.result(settings) for search in searches]


def step_together(
    searches: Sequence[FrameSearch],
    problem: FrameLikelihood,
    given: Sequence[tuple[int, Any]],
) -> list[LayerRecord]:
    """Do one layer of each of a frame's searches: side by side where a card does it, else one after the other. Each has
    the result that it has alone.

    given : version and settings of each; of these all searches have the same `in_common`.
    """
    began = time.perf_counter()
    at = [search.next_layer(*one) for search, one in zip(searches, given, strict=True)]
    records = _step_on_device(searches, problem, at)
    if records is None:
        return [search.step_here(problem, one) for search, one in zip(searches, at, strict=True)]
    return [
        search.stepped_there(problem, one, record, began, place, len(searches))
        for place, (search, one, record) in enumerate(zip(searches, at, records, strict=True))
    ]


def _step_on_device(
    searches: Sequence[FrameSearch], problem: FrameLikelihood, at: Sequence[NextLayer]
) -> list[LayerRecord] | None:
    """A layer by a card, on which the particles stay; None where the processor is to do it.

    Raises StudioError where a card that was asked for fails.
    """
    there = problem.on_device() if isinstance(problem, WeighedOnDevice) else None
    fit = all(search.fits_device(one) for search, one in zip(searches, at, strict=True))
    if there is None or not fit:
        return None
    first, layer = searches[0], at[0].layer
    try:
        on_device = first.on_device
        held = all(search.is_on(on_device, len(searches)) for search in searches)
        if on_device is None or not held or layer == 0:
            on_device = _begun_on_device(searches, there, at)
        records = on_device.step(layer, [one.numbers for one in at], [one.in_use for one in at])
    except StudioError:
        raise
    except Exception as error:
        assert isinstance(problem, WeighedOnDevice)
        problem.give_up_device(error)
        if layer > 0 and any(search.is_only_there for search in searches):
            raise RunError(
                f"The card failed in layer {layer + 1} of frame {first.frame}: {error}.",
                "Track the frame again; the processor searches it.",
            ) from None
        return None
    for search in searches:
        search.on_device = on_device
    return records


def _begun_on_device(
    searches: Sequence[FrameSearch], there: "ProblemOnDevice", at: Sequence[NextLayer]
) -> SearchOnDevice:
    """Searches on a card, with the sets that a layer weighs."""
    tracker, settings = searches[0].tracker, [one.in_use for one in at]
    module = importlib.import_module(tracker.device_module)
    spaces = [search.space for search in searches]
    on_device: SearchOnDevice = module.DeviceSearch(tracker, there, spaces, settings)
    if at[0].layer > 0:
        sets = [search.state.particles for search in searches]
        on_device.take([one for one in sets if one is not None])
        return on_device
    starts = [search.start(one) for search, one in zip(searches, at, strict=True)]
    if starts[0].particles is None:
        on_device.take([search.beginning(one) for search, one in zip(searches, at, strict=True)])
    else:
        on_device.begin(starts, [one.numbers.beginning for one in at], settings)
    return on_device


def held_over(settings: Any, held: Any) -> Any:  # noqa: ANN401
    """`settings`, except that knobs which do not take effect with the next layer keep their values in `held`."""
    if settings == held:
        return settings
    slow = [entry.name for entry in knobs_of(settings) if entry.takes_effect != "next layer"]
    return dataclasses.replace(settings, **{name: getattr(held, name) for name in slow})
