"""A stretch of a stored run tracked again with other settings or seeds, without writing anything.

It begins with the state that the run's own frame began with, so that the same settings and seed give the same poses.
What a run does beside the search of a frame and its refinement (looking for a body that was lost) is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from studio.evidence.distance_maps import silhouettes_by_camera
from studio.foundations.arrays import Array
from studio.foundations.knobs import Value, knobs_of
from studio.results.inspection.likelihoods import source_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.wanted import stop_if_left
from studio.runs.frame_steps import FrameHistory, space_over
from studio.runs.run_behaviour import RunBehaviour
from studio.runs.setup.person_witness import LimbsByNetwork
from studio.search.settings import RunSettings, changed_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.frame_refinement import FrameRefiner, space_after
from studio.search.trackers.limbs_elsewhere import changes_by_camera
from studio.search.trackers.tracker import FilterState, FrameLikelihood, FrameResult, start_of


@dataclass(frozen=True, slots=True)
class Change:
    """How a stretch is tracked differently. settings : knobs. seed : added to the run's."""

    settings: Mapping[str, Value]
    seed: int = 0


class Retracking:
    """A stretch of frames, first … last, of a run; evidence and likelihoods are made once."""

    def __init__(self, run: InspectedRun, first: int, last: int) -> None:
        self.run, self.frames = run, tuple(range(first, last + 1))
        self._source = source_of(run)
        self._problems: dict[int, FrameLikelihood] = {}
        self._settings = {frame: run.settings(frame) for frame in self.frames}
        with run.run.results() as results:
            behaviour = RunBehaviour(run.run, results)
            tracked = [frame for frame in results.frames() if frame < first]
            history = FrameHistory(results, run.run.record, tracked)
            self._space = space_over(behaviour.space_in(first), history.steps_to(first))
            self._carried = behaviour.carried_into(first, history.into(first))
            self._begins = history.is_first(first)
        self._seen = {frame: self._source.evidence(frame, self._settings[frame]) for frame in self.frames}
        for frame in self.frames:
            self._problems[frame] = self._source.problem(frame, self._settings[frame])

    def results(self, change: Change, start: Array | None = None) -> list[FrameResult]:
        """The results of all frames. start : (D,) a pose at which the first begins. Raises SettingsError, LeftError."""
        carried = self._carried if start is None else _state_at(start, self._carried)
        seed = self.run.run.record.seed + change.seed
        body, cameras = self.run.body, self._source.cameras
        source = None if self.run.run.record.live else LimbsByNetwork(body, cameras)
        refiner = FrameRefiner(body, cameras, seed, source)
        results: list[FrameResult] = []
        for frame in self.frames:
            stop_if_left()
            settings = changed_settings(self._settings[frame], change.settings)
            results.append(self._track(frame, carried, settings, seed, refiner))
            carried = results[-1].carried
        return results

    def searched(self, change: Change) -> FrameResult:
        """What the search of the first frame finds, before any refinement."""
        frame = self.frames[0]
        settings = changed_settings(self._settings[frame], change.settings)
        return self._search(frame, self._carried, settings, self.run.run.record.seed + change.seed)

    def poses(self, change: Change, start: Array | None = None) -> Array:
        """(K, D) what is reported of all frames."""
        return np.stack([result.estimate.pose for result in self.results(change, start)])

    def _search(self, frame: int, carried: FilterState, settings: RunSettings, seed: int) -> FrameResult:
        repeats = settings.tracker.start_repeats if self._begins and frame == self.frames[0] else 1
        return search_frame(
            TRACKERS[settings.tracker_name],
            self._problems[frame],
            carried,
            space_after(self._space, carried, settings.refinement),
            seed=seed,
            frame=frame,
            settings_source=lambda: (0, settings.tracker),
            repeats=repeats,
        )

    def _track(
        self, frame: int, carried: FilterState, settings: RunSettings, seed: int, refiner: FrameRefiner
    ) -> FrameResult:
        """The frame searched, and refined where the settings say so."""
        result, evidence = self._search(frame, carried, settings, seed), self._seen[frame]
        return refiner.refined(
            result,
            partial(silhouettes_by_camera, evidence),
            self._problems[frame],
            settings.refinement,
            partial(changes_by_camera, evidence),
        )


def _state_at(pose: Array, carried: FilterState) -> FilterState:
    """The state of a search that begins at a pose."""
    return replace(carried, particles=start_of(tuple(pose.tolist())).particles, estimate=pose)


def more_evaluations(settings: RunSettings, times: float) -> dict[str, Value]:
    """Knobs that search with about so many times as many particles, as far as the knobs reach."""
    tracker = TRACKERS[settings.tracker_name]
    limits = {entry.name: entry for entry in knobs_of(settings.tracker)}
    values: dict[str, Value] = {}
    for names in tracker.size_knobs:
        knob = next((name for name in names if "particles" in name), names[-1])
        high = limits[knob].high
        wanted = round(getattr(settings.tracker, knob) * times)
        values[knob] = int(min(wanted, high)) if high is not None else wanted
    return values
