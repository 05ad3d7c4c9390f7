"""Loss detection and recovery in a run: each frame's tracking state, and the next start when the body is lost.

Everything is a function of the stored frames before, the frame's evidence, the settings and the seed, so that a resumed
run or a frame annealed again gives the same result bit for bit.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.geometry.camera import Camera
from studio.runs.setup.initialising import hull_of, seek, whole_problem
from studio.search.likelihood.catalogue import WEIGHTINGS, LossLimit
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes
from studio.search.settings import RunSettings, default_settings
from studio.search.trackers.initialisation import PER_FAMILY, QUICK
from studio.search.trackers.loss_detection import Onlooker, WeightWatch, anything_seen
from studio.search.trackers.particles import unweighted
from studio.search.trackers.recovery_settings import INITIALISE, OFF
from studio.search.trackers.start_candidates import start_candidates
from studio.search.trackers.tracker import (
    LIMB_LOST,
    LOST,
    NO_EVIDENCE,
    RECOVERED,
    TRACKED,
    FilterState,
    FrameLikelihood,
    FrameResult,
    ParticleSet,
    SearchSpace,
)
from studio.sessions.results_reader import ResultsReader

SEEKING = "edge-region-silhouette"
"""The likelihood used for recovery; recovery was measured with it."""
SHORT_GAP_S = 0.1
"""After less time without evidence the body is still about where it was."""


@runtime_checkable
class FrameSource(Protocol):
    """A source of problems and their evidence (`ProblemSource`)."""

    @property
    def body(self) -> BodyModel: ...

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """In the order of the views."""
        ...

    def problem(self, frame: int, settings: RunSettings) -> FrameLikelihood:
        """The frame as a function of poses."""
        ...

    def evidence(self, frame: int, settings: RunSettings) -> FrameEvidence:
        """The frame's evidence."""
        ...


@dataclass(slots=True)
class Standing:
    """The state before a frame.

    state : of the last frame.
    streak : number of consecutive frames with it.
    doubts : of the last frame: how many frames in a row looked lost.
    weighed : settings of likelihood and evidence that the distribution holds for.
    """

    watch: WeightWatch
    state: str = TRACKED
    streak: int = 0
    doubts: int = 0
    weighed: object = None


class RunWatch:
    """Loss detection and recovery of one run. settings_in : of a frame's first layer. restarted : frames restarted by a
    correction: the body is not searched for there, and the frames before do not count.
    """

    def __init__(
        self,
        problems: object,
        results: ResultsReader,
        settings_in: Callable[[int], RunSettings],
        *,
        seed: int,
        first: int,
        fps: float,
        restarted: Callable[[int], bool] = lambda frame: False,
    ) -> None:
        self._problems = problems if isinstance(problems, FrameSource) else None
        self._onlooker = (
            Onlooker(problems.body, problems.cameras) if isinstance(problems, FrameSource) else None
        )
        self._results, self._settings_in = results, settings_in
        self._seed, self._first, self._fps, self._restarted = seed, first, fps, restarted
        self._known: tuple[int, Standing] | None = None
        self._restart: tuple[object, ParticleSet] | None = None

    def forget(self) -> None:
        """Forget what was read, because stored frames have changed."""
        self._known = self._restart = None

    def start(self, frame: int, carried: FilterState, space: SearchSpace) -> tuple[FilterState, bool]:
        """The start of a frame's search, and whether it is a search for a lost body."""
        settings = self._settings_in(frame)
        if self._problems is None or settings.recovery.recovery == OFF or not self._is_due(frame, settings):
            return carried, False
        seeking = _seeking(settings)
        masks = self._problems.evidence(frame, seeking)
        if not anything_seen(masks):
            return carried, False
        key = (frame, settings.recovery.recovery, settings.evidence)
        if self._restart is None or self._restart[0] != key:
            self._restart = (key, self._find(frame, carried, space, settings, masks))
        return FilterState(self._restart[1], memory=carried.memory), True

    def searches_for_lost(self, frame: int) -> bool:
        """Whether `start` searches for a lost body in that frame, as far as the frames before decide it."""
        settings = self._settings_in(frame)
        if self._problems is None or settings.recovery.recovery == OFF or not self._is_due(frame, settings):
            return False
        return anything_seen(self._problems.evidence(frame, _seeking(settings)))

    def evaluate(
        self, result: FrameResult, carried: FilterState, problem: FrameLikelihood | None, for_lost: bool
    ) -> FrameResult:
        """The result with its tracking state; without evidence, the incoming pose is held.

        carried : into the frame. problem : the frame's, as it was searched. for_lost : whether the search was for a
        lost body.
        """
        settings = self._settings_in(result.frame)
        if self._problems is None or self._onlooker is None or settings.recovery.recovery == OFF:
            return result
        evidence = self._problems.evidence(result.frame, settings)
        sight = self._onlooker.sight(evidence, result.estimate.pose, problem)
        result = dataclasses.replace(result, notes=(*result.notes, *sight.notes))
        before = self._standing(result.frame)
        if self._restarted(result.frame):
            before = dataclasses.replace(before, state=TRACKED, doubts=0)
        if not sight.seen:
            return _hold(result, carried)
        watch = before.watch if before.weighed == _weighting_of(settings) else self._new_watch(settings)
        if not watch.is_lost(result.estimate.log_weight, sight):
            back = for_lost or before.state in (LOST, NO_EVIDENCE)
            state = RECOVERED if back else LIMB_LOST if result.limbs_lost else TRACKED
            return dataclasses.replace(result, tracking=state, overlap=sight.overlap)
        misses = before.doubts + 1
        lost = for_lost or before.state == LOST or misses >= settings.recovery.lost_after
        return dataclasses.replace(
            result, tracking=LOST if lost else TRACKED, overlap=sight.overlap, doubts=misses
        )

    def stored(self, result: FrameResult) -> None:
        if self._known is not None and self._known[0] == result.frame:
            standing = self._known[1]
            self._update(
                standing,
                result.frame,
                result.tracking,
                result.doubts,
                result.estimate.log_weight,
                result.overlap,
            )
            self._known = (result.frame + 1, standing)
        else:
            self._known = None

    # ------------------------------------------------------------------ the frames before

    def _standing(self, frame: int) -> Standing:
        if self._known is None or self._known[0] != frame:
            line, standing = self._results.timeline(), Standing(WeightWatch(LossLimit()))
            for at in np.flatnonzero(line.frames < frame):
                self._update(
                    standing,
                    int(line.frames[at]),
                    line.tracking[at],
                    int(line.doubts[at]),
                    float(line.log_weights[at]),
                    float(line.overlaps[at]),
                )
            self._known = (frame, standing)
        return self._known[1]

    def _update(
        self, standing: Standing, frame: int, state: str, misses: int, log_weight: float, overlap: float
    ) -> None:
        settings = self._settings_in(frame)
        if standing.weighed != _weighting_of(settings):
            standing.watch, standing.weighed = self._new_watch(settings), _weighting_of(settings)
        if state in (TRACKED, RECOVERED, LIMB_LOST) and not misses:
            standing.watch.well_tracked(log_weight, overlap)
        standing.streak = standing.streak + 1 if state == standing.state else 1
        standing.state, standing.doubts = state, misses

    def _new_watch(self, settings: RunSettings) -> WeightWatch:
        return _watch(settings, meshes=self._problems is not None and bool(self._problems.body.meshes))

    def _is_due(self, frame: int, settings: RunSettings) -> bool:
        """Whether to search for the body: at once when lost, then at intervals; and after a time without evidence."""
        if frame == self._first or self._restarted(frame):
            return False
        before = self._standing(frame)
        if before.state == NO_EVIDENCE:
            return before.streak > SHORT_GAP_S * self._fps
        return before.state == LOST and (before.streak - 1) % settings.recovery.recovery_interval == 0

    # ------------------------------------------------------------------ the search

    def _find(
        self,
        frame: int,
        carried: FilterState,
        space: SearchSpace,
        settings: RunSettings,
        masks: FrameEvidence,
    ) -> ParticleSet:
        assert self._problems is not None
        body, seeing = self._problems.body, {view.camera for view in masks.views}
        cameras = tuple(camera for camera in self._problems.cameras if camera.name in seeing)
        hull, box, _ = hull_of(body, cameras, masks)
        prototypes = None if space.behaviour is None else space.behaviour.prototypes.poses
        problem = (
            MeshSilhouettes(body, cameras, masks)
            if body.meshes
            else whole_problem(body, cameras, _seeking(settings), masks)
        )
        seed = int(np.random.SeedSequence((self._seed, frame)).generate_state(1)[0])
        if settings.recovery.recovery != INITIALISE:
            rng = np.random.default_rng(seed)
            spread = start_candidates(rng, body, hull, box, PER_FAMILY, prototypes).poses
            # The best comes first, where a swarm looks for the pose to start from.
            weights = problem.log_likelihood(spread)
            return unweighted(spread[np.argsort(-weights, kind="stable")])
        best = seek(
            problem,
            space,
            body,
            hull,
            box,
            cameras=len(cameras),
            seed=seed,
            effort=QUICK,
            prototypes=prototypes,
            known=None if carried.estimate is None else carried.estimate[None],
        )
        return ParticleSet(best.pose[None], np.zeros(1))


def _seeking(settings: RunSettings) -> RunSettings:
    """The settings of the search for a lost body: the run's evidence and the likelihood WEIGHTING."""
    return dataclasses.replace(
        default_settings(settings.tracker_name, SEEKING),
        evidence=settings.evidence,
        recovery=settings.recovery,
    )


BY_OVERLAP = LossLimit(spreads=math.inf)
"""Of a body with meshes (`loss_detection`)."""


def _watch(settings: RunSettings, *, meshes: bool) -> WeightWatch:
    return WeightWatch(BY_OVERLAP if meshes else WEIGHTINGS[settings.weighting_name].loss)


def _weighting_of(settings: RunSettings) -> tuple[object, ...]:
    return settings.weighting_name, settings.weighting, settings.evidence


def _hold(result: FrameResult, carried: FilterState) -> FrameResult:
    """The frame's result with the incoming pose and particles, at rest."""
    estimate, pose = result.estimate, carried.estimate
    if pose is None and carried.particles is not None:
        pose = np.exp(carried.particles.log_weights) @ carried.particles.poses
    if pose is None:
        return dataclasses.replace(result, tracking=NO_EVIDENCE)
    still = dataclasses.replace(estimate, pose=pose, mean=pose, mode=pose)
    handed_on = dataclasses.replace(carried, estimate=pose, previous_estimate=pose)
    return dataclasses.replace(result, estimate=still, carried=handed_on, tracking=NO_EVIDENCE)
