"""Tracks a run layer by layer: searches, stores, stops, resumes and anneals frames again.

Everything that a layer depends on is on disk before it runs: the final particles of the frame before (or the run's
start pose), the settings with the layer at which they were applied, and the seed. So a run resumed after a pause inside
a frame, or after its process was killed, gives the same poses bit for bit as an uninterrupted one: settings applied in
an unfinished frame are applied again at the same layers.
"""

import contextlib
import dataclasses
import time
from collections.abc import Callable, Generator, Hashable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from studio.evidence.distance_maps import silhouettes_by_camera
from studio.footage.capture.naming import listed
from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.foundations.numba_in_threads import numba
from studio.foundations.tracing import span
from studio.runs.frame_steps import FrameHistory, space_over
from studio.runs.pace import Pace, Progress
from studio.runs.run_behaviour import RunBehaviour
from studio.runs.run_watch import FrameSource, RunWatch
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.runs.storing_behind import MOST_WAITING, StoringBehind
from studio.search.likelihood.problem import BaseFrameLikelihood
from studio.search.settings import RunSettings, SettingsEntry, SettingsHistory, settings_from_values, values
from studio.search.trackers import frame_loop
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import FrameSearch, SearchState, held_over
from studio.search.trackers.frame_refinement import FrameRefiner, space_after
from studio.search.trackers.layer_record import search_notes
from studio.search.trackers.limbs_elsewhere import changes_by_camera
from studio.search.trackers.tracker import FilterState, FrameLikelihood, FrameResult, LayerRecord
from studio.sessions.results_codec import particle_arrays, particles_from
from studio.sessions.results_store import ResultsReader, ResultsWriter
from studio.sessions.stored_run import StoredRun

# The newest settings and their version; called before each layer.
SettingsSource = Callable[[], tuple[int, RunSettings]]


class Problems(Protocol):
    """A source of frames (`ProblemSource`, or a toy in tests)."""

    def problem(self, frame: int, settings: RunSettings) -> FrameLikelihood:
        """The frame as a function of poses."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Stepped:
    """The outcome of one layer. result : of the frame, if this was its last layer. applied : settings used from this
    layer on, None if unchanged. search_layers, searches : layers of one search of the frame, and how many it has.
    """

    record: LayerRecord
    result: FrameResult | None
    applied: RunSettings | None
    search_layers: int = 0
    searches: int = 1


@dataclass(frozen=True, slots=True, eq=False)
class LayerAtHand:
    """What a run's next layer is done with. is_new : whether the settings are used for the first time."""

    search: FrameSearch
    problem: FrameLikelihood
    version: int
    settings: RunSettings
    is_new: bool


class TrackingRun:
    """Tracks a stored run. A second one for the same run raises RunError. Close it when done.

    storing : an executor of one thread, which stores each frame while the next one is searched; None: at once.
    waiting : how many frames may wait for it.
    """

    def __init__(
        self,
        run: StoredRun,
        problems: Problems,
        storing: Executor | None = None,
        waiting: int = MOST_WAITING,
    ) -> None:
        self.run, self.record, self.problems = run, run.record, problems
        self.tracker = TRACKERS[self.record.tracker]
        self._behind, self._astray = StoringBehind(storing, waiting), False
        self._reader = ResultsReader(run.folder, self._wait_for_disk)
        self._behaviour = RunBehaviour(run, self._reader)
        self._watch = RunWatch(
            problems,
            self._reader,
            lambda frame: self._settings_at(frame)[1],
            seed=self.record.seed,
            first=self.record.first,
            fps=self.record.fps,
            restarted=self.record.is_restarted,
        )
        self._seen = problems if isinstance(problems, FrameSource) else None
        self._check_cameras()
        self._refiner = (
            None
            if self._seen is None
            else FrameRefiner(
                self._seen.body,
                self._seen.cameras,
                self.record.seed,
                None if self.record.live else LimbsByNetwork(self._seen.body, self._seen.cameras),
            )
        )
        self._writer = ResultsWriter(run.folder)
        self._pace = Pace()
        self._seconds, self._frames = 0.0, 0
        """Spent on so many frames since it was last stored how long they took."""
        try:
            self._load()
        except BaseException:
            self._free()
            raise

    def _check_cameras(self) -> None:
        """Raise RunError where a camera of the stored frames has no footage any more: others would follow of less."""
        if self._seen is None or not self._reader.done():
            return
        filmed = {camera.name for camera in self._seen.cameras}
        gone = sorted(camera.name for camera in self.run.cameras() if camera.name not in filmed)
        if gone:
            raise RunError(
                f"Run '{self.run.name}' was tracked with {listed(gone)}, of which the session has no footage any more.",
                "Track a new run; this one can still be shown, exported and shared.",
            )

    def close(self) -> None:
        """Save an unfinished frame, and release the run even if saving fails."""
        try:
            self.save()
            self.keep_time()
        finally:
            self._free()

    def _free(self) -> None:
        self._writer.close()
        self._reader.close()

    def _load(self) -> None:
        """Load the run's state from its store."""
        self._astray = False
        """Whether a finished frame is not stored yet, so that the state in memory must not be continued."""
        self.history = SettingsHistory(tuple(self._reader.settings_history()))
        self.settings_source: SettingsSource = self.latest_settings
        self._settings: dict[int, RunSettings] = {}
        if not self.history.entries:
            recorded = settings_from_values(self.record.tracker, self.record.weighting, self.record.settings)
            self._apply(1, recorded, self.record.first, 0)
        self._go_to_next()
        self._search: FrameSearch | None = None
        self._layers: list[LayerRecord] = []
        self._spent: list[float] = []
        self._saved = True
        self._take_up_partial()
        if self.next_frame >= self.record.last:
            self._behaviour.keep_missing()

    def _go_to_next(self) -> None:
        """Go to the next frame: damaged ones first, those tracked backwards from the last one down. Frames of a live
        run came on a clock and are not tracked again.
        """
        frames = self._reader.frames()
        damaged = {} if self.record.live else self._reader.damaged()
        backwards = [frame for frame in damaged if self.record.is_restarted(frame)]
        self.damaged = len(damaged)
        """Number of damaged frames to track again before any other."""
        end = max([*frames, *damaged], default=self.record.first - 1) + 1
        self.next_frame = max(backwards, default=min(damaged, default=end))
        self.done = len(frames)
        self._handed = FrameHistory(self._reader, self.record, [at for at in frames if at < self.next_frame])

    def _take_up_partial(self) -> None:
        partial = self._reader.partial()
        if partial is None or partial.frame != self.next_frame:
            return
        numbers = partial.state["search_numbers"]
        held = self._settings_at(partial.frame)[1].tracker
        particles = particles_from(partial.state)
        # Older versions stored too little to resume the search of a whole frame.
        state = SearchState(
            layers_done=partial.next_layer,
            layer_count=int(numbers[0]),
            particles=particles,
            settings=held,
            settings_version=int(numbers[1]),
            evaluations=int(numbers[2]),
            milliseconds=float(numbers[3]),
            expected=partial.state.get("search_expected"),
        )
        search = self._new_search(partial.frame, state)
        if not search.finished:
            self._search, self._layers = search, self._reader.layers(partial.frame)

    def _load_again(self) -> None:
        """Discard everything not in the store, except the source of the settings."""
        self._wait_for_disk()
        source = self.settings_source
        self._behaviour.forget()
        self._watch.forget()
        self._load()
        self.settings_source = source

    @property
    def finished(self) -> bool:
        """Whether every frame has a result."""
        return not self._astray and self.next_frame >= self.record.last

    def when_stored(self, action: Callable[[], None]) -> None:
        """Call `action` once all finished frames are stored: in the storing thread, or at once after the run's end."""
        with self._astray_where_it_fails():
            self._behind.do(action)
        if self.finished:
            self._wait_for_disk()

    def _wait_for_disk(self) -> None:
        """Wait until all is stored. Raises SessionError if a frame, and so all after it, could not be."""
        with self._astray_where_it_fails():
            self._behind.wait()

    @contextlib.contextmanager
    def _astray_where_it_fails(self) -> Generator[None]:
        try:
            yield
        except BaseException:
            self._astray = True
            raise

    @property
    def layers_done(self) -> int:
        """Layers done of the frame at hand; 0 between frames."""
        return self._search.layers_done if self._search else 0

    def step_layer(self) -> Stepped:
        """Do one layer of the next frame; after its last layer the frame is stored. Raises RunError when finished,
        SessionError if this frame or one before could not be stored: then the run continues from the stored frames.
        """
        return step_together((self,))[0]

    def layer_at_hand(self) -> LayerAtHand:
        """The next layer, which is to be done and given to `take_layer`."""
        if self._astray:
            self._load_again()
        if self.finished:
            raise RunError(f"Run '{self.run.name}' has no frame left.", "Start a new run.")
        frame = self.next_frame
        version, settings, is_new = self._settings_for(frame, self.layers_done)
        search = self._search or self._new_search(frame)
        with span("wait for the frame", frame):
            problem = self.problems.problem(frame, self._held_in(frame, settings))
        return LayerAtHand(search, problem, version, settings, is_new)

    def take_layer(self, done: LayerAtHand, record: LayerRecord, seconds: float) -> Stepped:
        """Go on after a layer. seconds : that it took."""
        began, search, settings = time.perf_counter() - seconds, done.search, done.settings
        self._search, self._saved, self._astray = search, False, search.finished
        self._layers.append(record)
        result = self.result_of(search, settings, self._layers) if search.finished else None
        if result is not None:
            self._store(result, settings)
            self._astray = False
            self._next(result)
        self._spent.append(time.perf_counter() - began)
        if result is not None:
            self._pace.add(self._spent)
            self._seconds, self._frames = self._seconds + sum(self._spent), self._frames + 1
            self._spent = []
        return Stepped(record, result, settings if done.is_new else None, search.layer_count, search.repeats)

    def result_of(
        self, search: FrameSearch, settings: RunSettings, layers: Sequence[LayerRecord]
    ) -> FrameResult:
        """The result of a finished search of a frame, with its tracking state. layers : its records."""
        held = self._held_in(search.frame, settings)
        problem = search.problem or self.problems.problem(search.frame, held)
        notes = (*search_notes(layers), *(problem.notes if isinstance(problem, BaseFrameLikelihood) else ()))
        result = dataclasses.replace(search.result(settings.tracker), notes=notes)
        if self._refiner is not None and self._seen is not None and settings.refinement.refine_frames:
            evidence = self._seen.evidence(search.frame, held)
            with span("refine", search.frame):
                result = self._refiner.refined(
                    result,
                    partial(silhouettes_by_camera, evidence),
                    problem,
                    settings.refinement,
                    partial(changes_by_camera, evidence),
                )
        carried, for_lost = self.carried_into(search.frame), self._watch.searches_for_lost(search.frame)
        with span("conclude", search.frame):
            return self._watch.evaluate(result, carried, problem, for_lost)

    def _store(
        self, result: FrameResult, settings: RunSettings, came: tuple[float, float] | None = None
    ) -> None:
        layers, kept = tuple(self._layers), settings.recording.record_particles

        def store() -> None:
            with span("store", result.frame):
                self._writer.write_frame(result, layers, kept, came=came)

        self._behind.do(store)

    def _next(self, result: FrameResult) -> None:
        self._handed.stored(result)
        self._watch.stored(result)
        self._search, self._layers, self._saved = None, [], True
        if self.damaged:
            self._go_to_next()
        else:
            self.next_frame += 1
            self.done += 1
        if self.finished:
            self._wait_for_disk()
            self._behaviour.keep()

    def save(self) -> None:
        """Store the state of an unfinished frame, so that another process can continue it.

        A finished frame that could not be stored is not saved; it is searched again.
        """
        self._wait_for_disk()
        if self._astray or self._search is None or self._saved or self._search.state.particles is None:
            return
        state = self._search.state
        assert state.particles is not None
        numbers = [state.layer_count, state.settings_version, state.evaluations, state.milliseconds]
        arrays = particle_arrays(state.particles) | {"search_numbers": np.array(numbers, dtype=np.float64)}
        if state.expected is not None:
            arrays["search_expected"] = state.expected
        self._writer.write_partial(self.next_frame, state.layers_done, arrays, self._layers)
        self._saved = True

    def keep_time(self, seconds: float = 0.0) -> None:
        """Store how long the frames took since the last time. seconds : that were spent on the run as a whole, too."""
        if self._frames and not self.record.live:
            # A disk that refuses it is no reason to refuse the run.
            with contextlib.suppress(SessionError):
                threads = int(numba.get_num_threads())
                self._writer.add_time(self._seconds + seconds, self._frames, threads)
        self._seconds, self._frames = 0.0, 0

    def mark_cancelled(self) -> None:
        """Note in the store that the user cancelled the run."""
        self.save()
        self._writer.mark_ended("cancelled")

    def mark_going_on(self) -> None:
        """Note that a run is resumed that was cancelled or whose disk was full."""
        # A frame that could not be stored meanwhile is tracked again.
        with contextlib.suppress(SessionError):
            self._wait_for_disk()
        if self._astray:
            self._load_again()
        if self._reader.ended():
            self._writer.mark_ended("")

    @property
    def ended(self) -> str:
        """ "cancelled" if the user cancelled the run, else ""."""
        return self._reader.ended()

    def progress(self, least: float = 0.0) -> Progress:
        """The run's progress and time left. least : seconds that a layer is slowed down to."""
        return self._pace.progress(self.done, self.record.frame_count, least)

    def latest_settings(self) -> tuple[int, RunSettings]:
        entry = self.history.entries[-1]
        return entry.version, self._read_settings(entry)

    def _settings_for(self, frame: int, layer: int) -> tuple[int, RunSettings, bool]:
        """The settings of a layer: new ones if there are any, else those of the history."""
        # A damaged frame is tracked again with its old settings.
        version, settings = self.latest_settings() if self.damaged else self.settings_source()
        if version > self.history.entries[-1].version:
            self._apply(version, settings, frame, layer)
            return version, settings, True
        return *self._settings_at(frame, layer), False

    def _settings_at(self, frame: int, layer: int = 0) -> tuple[int, RunSettings]:
        entry = self.history.in_use(frame, layer) or self.history.entries[0]
        return entry.version, self._read_settings(entry)

    def _held_in(self, frame: int, settings: RunSettings) -> RunSettings:
        """The settings, with those that cannot change inside a frame as at its first layer."""
        held = self._settings_at(frame)[1]
        if held is settings:
            return settings
        return dataclasses.replace(
            settings,
            weighting=held_over(settings.weighting, held.weighting),
            evidence=held_over(settings.evidence, held.evidence),
        )

    def _apply(self, version: int, settings: RunSettings, frame: int, layer: int) -> None:
        history = self.history.with_applied(version, frame, layer, settings)
        self._writer.write_settings(version, frame, layer, history.entries[-1].values)
        self.history = history

    def _read_settings(self, entry: SettingsEntry) -> RunSettings:
        """The settings of a history entry; those in use are read once."""
        if entry.version not in self._settings:
            recorded = settings_from_values(self.record.tracker, self.record.weighting, entry.values)
            self._settings[entry.version] = recorded
        return self._settings[entry.version]

    def _new_search(self, frame: int, state: SearchState | None = None) -> FrameSearch:
        space = space_over(self._behaviour.space_in(frame), self._handed.steps_to(frame))
        carried = self._behaviour.carried_into(frame, self.carried_into(frame))
        if state is None:
            carried, for_lost = self._watch.start(frame, carried, space)
        elif for_lost := self._watch.searches_for_lost(frame):
            # The state already has its result.
            carried = FilterState(None, memory=carried.memory)
        repeats = 1
        if self._handed.is_first(frame) or for_lost:
            repeats = self._settings_at(frame)[1].tracker.start_repeats
        space = space_after(space, carried, self._settings_at(frame)[1].refinement)
        return FrameSearch(
            self.tracker, carried, space, seed=self.record.seed, frame=frame, repeats=repeats, state=state
        )

    def carried_into(self, frame: int) -> FilterState:
        """The state that a frame starts from (`frame_steps.FrameHistory.into`)."""
        return self._handed.into(frame)

    def search_again(self, frame: int) -> FrameSearch:
        """A new search of a frame with the same start and random keys; nothing is stored.

        Raises NotFoundError for a frame outside the run, or one whose predecessor has no result.
        """
        if not self.record.first <= frame < min(self.next_frame + 1, self.record.last):
            raise NotFoundError(
                f"Frame {frame} of run '{self.run.name}' cannot be annealed yet.",
                f"Choose a frame from {self.record.first} to {min(self.next_frame, self.record.last - 1)}.",
            )
        return self._new_search(frame)

    def keep(
        self,
        result: FrameResult,
        layers: list[LayerRecord],
        version: int,
        settings: RunSettings,
        *,
        alone: bool = False,
    ) -> None:
        """Replace a frame by one annealed again; later frames, which followed from the old one, are dropped.

        alone : keep the later frames, which do not depend on it.
        """
        self._wait_for_disk()
        if alone:
            self._writer.write_frame(result, layers, settings.recording.record_particles)
            self._watch.forget()
            return
        with self._writer.together():
            self._writer.forget_from(result.frame)
            self._writer.write_settings(version, result.frame, 0, values(settings))
            self._writer.write_frame(result, layers, settings.recording.record_particles)
        self._load_again()


def step_together(runs: Sequence[TrackingRun]) -> list[Stepped]:
    """Do the next layer of each of some runs as `TrackingRun.step_layer`; those of one frame's likelihood side by side
    where a card can do it. Each has the results that it has alone.
    """
    began = time.perf_counter()
    at_hand = [run.layer_at_hand() for run in runs]
    seconds = (time.perf_counter() - began) / len(runs)
    alike = dict[Hashable, list[int]]()
    for place, one in enumerate(at_hand):
        key = id(one.problem), one.search.in_common(one.version, one.settings.tracker)
        alike.setdefault(key, []).append(place)
    stepped = dict[int, Stepped]()
    for places in alike.values():
        together, began = [at_hand[place] for place in places], time.perf_counter()
        with span("search", together[0].search.frame):
            records = frame_loop.step_together(
                [one.search for one in together],
                together[0].problem,
                [(one.version, one.settings.tracker) for one in together],
            )
        share = seconds + (time.perf_counter() - began) / len(places)
        for place, one, record in zip(places, together, records, strict=True):
            stepped[place] = runs[place].take_layer(one, record, share)
    return [stepped[place] for place in range(len(runs))]
