"""Consecutive frames searched one after the other in memory: a run without its store, events and "
"recovery."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from studio.behaviour.model import BehaviourModel
from studio.evidence.distance_maps import silhouettes_by_camera
from studio.evidence.frame_evidence import FrameEvidence
from studio.runs.run_behaviour import learner_of
from studio.settings import RunSettings
from studio.tracking.catalogue import TRACKERS
from studio.tracking.frame_loop import search_frame
from studio.tracking.frame_refinement import FrameRefiner, space_after
from studio.tracking.tracker import Carried, FrameProblem, FrameResult, LayerRecord, SearchSpace

Array = NDArray[np.float64]


@dataclass(eq=False)
class Following:
    """Tracks consecutive frames given to `step`. carried : state for the next frame. refiner : None: no refinement.

    poses, log_weights, memories : results and the search's memory so far, one each frame.
    """

    settings: RunSettings
    space: SearchSpace
    carried: Carried
    seed: int
    refiner: FrameRefiner | None = None
    on_layer: Callable[[LayerRecord], None] | None = None
    poses: list[Array] = field(default_factory=list)
    log_weights: list[float] = field(default_factory=list)
    memories: list[Mapping[str, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._learner = learner_of(self.space.behaviour, self.settings, self.seed)

    @property
    def model(self) -> BehaviourModel | None:
        """The behaviour model of the next frame."""
        if self._learner is None:
            return self.space.behaviour
        return self._learner.model_in(len(self.poses), self._tracked)

    def step(self, frame: int, problem: FrameProblem, seen: FrameEvidence | None = None) -> FrameResult:
        """Search a frame. seen : its masks, if it is to be refined."""
        settings, number, space = self.settings, len(self.poses), self.space
        if self._learner is not None:
            space = dataclasses.replace(space, behaviour=self.model)
            self.carried = self._learner.carried_into(number, self.carried, self._tracked)
        if self.refiner is not None:
            space = space_after(space, self.carried, settings.refinement)
        result = search_frame(
            TRACKERS[settings.tracker_name],
            problem,
            self.carried,
            space,
            seed=self.seed,
            frame=frame,
            settings_source=lambda: (1, settings.tracker),
            repeats=1 if number else settings.tracker.start_repeats,
            on_layer=self.on_layer,
        )
        if self.refiner is not None and seen is not None:
            silhouettes = partial(silhouettes_by_camera, seen)
            result = self.refiner.refined(result, silhouettes, problem, settings.refinement)
        self.carried = result.carried
        self.poses.append(result.estimate.pose)
        self.log_weights.append(result.estimate.log_weight)
        self.memories.append(result.carried.memory)
        return result

    def _tracked(self, count: int) -> tuple[Array, Array]:
        return np.array(self.poses[:count]), np.array(self.log_weights[:count])
