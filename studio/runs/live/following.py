"""Consecutive frames searched one after the other in memory: a run without store, events and recovery."""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array
from studio.runs.run_behaviour import learner_of
from studio.search.behaviour.model import BehaviourModel
from studio.search.settings import RunSettings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.frame_loop import FrameSearch, search_together
from studio.search.trackers.frame_refinement import FrameRefiner, space_after
from studio.search.trackers.limbs_elsewhere import changes_by_camera
from studio.search.trackers.tracker import FilterState, FrameLikelihood, FrameResult, LayerRecord, SearchSpace


@dataclass(eq=False)
class Following:
    """Tracks consecutive frames given to `step`. carried : state for the next frame. refiner : None: no refinement.
    overlap_of : a frame's number and a pose (D,) to their silhouettes' overlap, for online learning; None: not known.

    poses, log_weights, memories, overlaps : results and the search's memory so far, one each frame.
    """

    settings: RunSettings
    space: SearchSpace
    carried: FilterState
    seed: int
    refiner: FrameRefiner | None = None
    on_layer: Callable[[LayerRecord], None] | None = None
    overlap_of: Callable[[int, Array], float] | None = None
    poses: list[Array] = field(default_factory=list[Array])
    log_weights: list[float] = field(default_factory=list[float])
    memories: list[Mapping[str, Array]] = field(default_factory=list[Mapping[str, Array]])
    overlaps: list[float] = field(default_factory=list[float])

    def __post_init__(self) -> None:
        self._learner = learner_of(self.space.behaviour, self.settings, self.seed)

    @property
    def model(self) -> BehaviourModel | None:
        if self._learner is None:
            return self.space.behaviour
        return self._learner.model_in(len(self.poses), self._poses_so_far)

    def step(self, frame: int, problem: FrameLikelihood, seen: FrameEvidence | None = None) -> FrameResult:
        """Search a frame. seen : its masks, if it is to be refined."""
        return step_together((self,), frame, problem, seen)[0]

    def search_of(self, frame: int) -> FrameSearch:
        """The search of the next frame, from what the last one left."""
        settings, number, space = self.settings, len(self.poses), self.space
        if self._learner is not None:
            space = dataclasses.replace(space, behaviour=self.model)
            self.carried = self._learner.carried_into(number, self.carried, self._poses_so_far)
        if self.refiner is not None:
            space = space_after(space, self.carried, settings.refinement)
        return FrameSearch(
            TRACKERS[settings.tracker_name],
            self.carried,
            space,
            seed=self.seed,
            frame=frame,
            repeats=1 if number else settings.tracker.start_repeats,
        )

    def conclude(
        self, result: FrameResult, problem: FrameLikelihood, seen: FrameEvidence | None = None
    ) -> FrameResult:
        """The result of a frame's search, refined, and kept for the next frame."""
        settings, frame = self.settings, result.frame
        if self.refiner is not None and seen is not None:
            silhouettes = partial(silhouettes_by_camera, seen)
            changes = partial(changes_by_camera, seen)
            result = self.refiner.refined(result, silhouettes, problem, settings.refinement, changes)
        self.carried = result.carried
        self.poses.append(result.estimate.pose)
        self.log_weights.append(result.estimate.log_weight)
        self.memories.append(result.carried.memory)
        known = None if self._learner is None else self.overlap_of
        self.overlaps.append(float("nan") if known is None else known(frame, result.estimate.pose))
        return result

    def _poses_so_far(self, count: int) -> tuple[Array, Array, Array]:
        poses, log_weights, overlaps = (
            np.array(known[:count]) for known in (self.poses, self.log_weights, self.overlaps)
        )
        return poses, log_weights, overlaps


def step_together(
    runs: Sequence[Following], frame: int, problem: FrameLikelihood, seen: FrameEvidence | None = None
) -> list[FrameResult]:
    """Search a frame for runs of the same settings, side by side where a card does it; each has the result that it has
    alone. seen : as in `Following.step`.
    """
    settings, turn = runs[0].settings.tracker, itertools.cycle(runs)

    def on_layer(record: LayerRecord) -> None:
        tell = next(turn).on_layer
        if tell is not None:
            tell(record)

    results = search_together(
        [run.search_of(frame) for run in runs], problem, lambda: (1, settings), on_layer
    )
    return [run.conclude(result, problem, seen) for run, result in zip(runs, results, strict=True)]
