"""The behaviour model that each frame of a run is searched with: the run's own, or one learnt online since."""

import dataclasses

import numpy as np

from studio.foundations.arrays import Array
from studio.runs.search_space import search_space
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import write_model
from studio.search.settings import RunSettings, settings_from_values
from studio.search.trackers.online_learning import OnlineLearner
from studio.search.trackers.tracker import RECOVERED, TRACKED, FilterState, SearchSpace
from studio.sessions.results_store import ResultsReader
from studio.sessions.stored_run import StoredRun

LEARNT_NAME = "learnt.behaviour"
"""In the run's folder: the learnt model at its end, for other runs."""


def learner_of(model: BehaviourModel | None, settings: RunSettings, seed: int) -> OnlineLearner | None:
    """The online learner of a run's model; None without a model or online learning."""
    if model is None or not getattr(settings.tracker, "online_learning", False):
        return None
    tracker = settings.tracker
    return OnlineLearner(model, tracker.learning_interval, seed, tracker.learning_overlap)


class RunBehaviour:
    """A run's search spaces, frame by frame. results : of the run, read when the model is updated."""

    def __init__(self, run: StoredRun, results: ResultsReader) -> None:
        self._run, self._results = run, results
        record = run.record
        self.space = search_space(run.body(), np.array(record.sigma), run.behaviour())
        self._settings = settings_from_values(record.tracker, record.weighting, record.settings)
        self.forget()

    def forget(self) -> None:
        """Discard what was learnt, because frames of the training data have changed."""
        self._learner = learner_of(self.space.behaviour, self._settings, self._run.record.seed)

    def space_in(self, frame: int) -> SearchSpace:
        """The search space of a frame; all frames before it have results."""
        if self._learner is None:
            return self.space
        model = self._learner.model_in(frame - self._run.record.first, self._poses_so_far)
        return dataclasses.replace(self.space, behaviour=model)

    def carried_into(self, frame: int, carried: FilterState) -> FilterState:
        """The state from the frame before, in terms of this frame's model."""
        if self._learner is None:
            return carried
        return self._learner.carried_into(frame - self._run.record.first, carried, self._poses_so_far)

    def keep_missing(self) -> None:
        """As `keep`, if that failed before."""
        if self._learner is not None and not (self._run.folder / LEARNT_NAME).exists():
            self.keep()

    def keep(self) -> None:
        """Store the learnt model beside the run's results once all frames have one. Raises BehaviourError."""
        record = self._run.record
        model = self.space_in(record.last).behaviour
        if self._learner is not None and model is not None:
            write_model(model, self._run.folder / LEARNT_NAME)

    def _poses_so_far(self, count: int) -> tuple[Array, Array, Array]:
        """Poses (K, D), log-weights (K,) and overlaps (K,) of the run's first frames; no overlap where the run itself
        says that the body, or a limb, was lost.
        """
        _, poses = self._results.poses()
        line = self._results.timeline()
        known = np.isin(np.array(line.tracking[:count]), (TRACKED, RECOVERED))
        return poses[:count], line.log_weights[:count], np.where(known, line.overlaps[:count], 0.0)
