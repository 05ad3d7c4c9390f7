"""Filters whose particles stay on a CUDA device: weights, survivors, children and noise are found there.

`DeviceFilter` searches R runs side by side that have one body, one space and as many particles each; their seeds,
frames, knobs and pictures may differ. The host says what a layer is to do and, where somebody looks, reads its record:
moments of the whole set, and all particles or every k-th of many. A run's numbers depend on its own seed, frame and
layer alone (`counted_numbers`), so beside others it is searched as alone.

Not here: behaviour models, redrawn or rejected poses and limbs kept apart, which the processor's search has.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.search.likelihood.device_weighing import (
    ProblemOnDevice,
    WeighingDevice,
)
from studio.search.trackers.device_runs import RECORDED, THREADS, DeviceRuns, Moment, kernel, limits_there
from studio.search.trackers.device_search_kernels import (
    ANNEALED,
    BETA,
    CORRELATED,
    CROSSED,
    DIFFUSED,
    KEPT,
    KNOWN,
    LOG_WEIGHT,
    MOST,
    OF_SAMPLE,
    SCALE,
    SIGMA,
    SUMMING,
    SURVIVAL,
    SURVIVING,
    WANTED,
    WEIGHED,
    WEIGHTED,
)
from studio.search.trackers.layer_plan import LayerPlan, Noise
from studio.search.trackers.particle_kernels import places
from studio.search.trackers.particles import ParticleFilter
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import (
    Arrays,
    FilterState,
    LayerRecord,
    ParticleSet,
    SearchSpace,
)

CARRIED = {"weighted": 0, "resampled": 1, "mode": 2}


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSet:
    """Particles of R runs there: poses (D, R N), of `count` = N a run. cumulated : weights (R N,).
    weights : (2, R N) fitness and log-weights; None: not weighed. annealed : (R, 5).
    """

    poses: Any
    count: int
    cumulated: Any = None
    weights: Any = None
    annealed: Any = None


class DeviceFilter(DeviceRuns):
    """R runs of one body, side by side. A weighed set that it returns is valid until the next is weighed, another until
    the next but one is made.
    """

    def __init__(
        self,
        device: WeighingDevice,
        space: SearchSpace,
        runs: int = 1,
        by_limbs: bool = True,
        clamped: bool = True,
    ) -> None:
        """by_limbs : whether children take whole limbs. clamped : whether poses are set on the limits."""
        super().__init__(device, space, runs)
        size = len(space.names)
        self._limits = self._copied("limits", limits_there(space, clamped))
        self._place = self._copied("place", places(space.limb) if by_limbs else np.arange(1, size + 1))
        self._root = self._memory("root", (runs, size, size), np.float64)

    def take(self, sets: Sequence[ParticleSet]) -> DeviceSet:
        """Sets of the host, one a run and of as many particles each, there. Raises BodyError where a pose is not
        finite.
        """
        poses = sets[0].poses if len(sets) == 1 else np.concatenate([one.poses for one in sets])
        cumulated = np.concatenate([np.cumsum(np.exp(one.log_weights)) for one in sets])
        there = self._memory("last poses", poses.shape[::-1], np.float32)
        self.device.bring(np.ascontiguousarray(poses, np.float64), there)
        return DeviceSet(there, len(sets[0].poses), self._copied("last weights", cumulated))

    def begin(
        self,
        last: DeviceSet,
        moments: Sequence[Moment],
        count: int,
        sigmas: Array,
        carry: str = "weighted",
        systematic: bool = True,
        shift: Array | None = None,
    ) -> DeviceSet:
        """The set of `count` particles a run that a frame's first layer weighs: the last frame's, moved by shift (R, D)
        and spread by sigmas (R, D) (Eq. 9, 10). carry : how the last frame's are taken.
        """
        size, whole = len(self.space.names), self.runs * count
        keys, dials = self._uploaded(moments, [LayerPlan(1.0, Noise(sigma)) for sigma in sigmas])
        moved = self._copied("shift", np.zeros((self.runs, size)) if shift is None else shift)
        carried = self._memory("carried", (size, whole), np.float32)
        poses = self._next_poses(count)
        grid = -(-whole // THREADS), THREADS, self._stream
        kernel("carry_over")[grid](
            last.poses, last.count, last.cumulated, keys, CARRIED[carry], systematic, moved, count, carried
        )
        kernel("spread")[grid](carried, self._moments, self._root, dials, keys, self._limits, count, poses)
        return DeviceSet(poses, count)

    def step(
        self,
        given: DeviceSet,
        problem: ProblemOnDevice,
        moments: Sequence[Moment],
        plans: Sequence[LayerPlan],
        systematic: bool = True,
    ) -> tuple[DeviceSet, DeviceSet]:
        """Weigh a set and make the next one: the set with its weights, and what follows from it (the same where the
        plans have no noise). The problem's pictures are those of all runs, or one frame for each.
        """
        size, count, noise = len(self.space.names), given.count, plans[0].noise
        whole = self.runs * count
        keys, dials = self._uploaded(moments, plans)
        weights = self._memory("weights", (2, whole), np.float64)
        annealed = self._memory("annealed", (self.runs, ANNEALED), np.float64)
        cumulated = self._memory("cumulated", (whole,), np.float64)
        survivors = self._memory("survivors", (size, whole), np.float32)
        parents = self._memory("parents", (2, whole), np.int32)
        every = count if len(problem.frame.observed) > 1 else whole
        edges = self.device.edges_of(None)
        poses = given.poses if noise is None else self._next_poses(count)
        grid = -(-whole // THREADS), THREADS, self._stream
        blocks = (size, self.runs), SUMMING, self._stream
        found = self._moments

        def launch() -> None:
            self.device.weigh(given.poses, problem, edges, every, weights, self._stream, self._memory)
            kernel("anneal_weights")[self.runs, SUMMING, self._stream](
                weights, count, dials, annealed, cumulated
            )
            kernel("find_moments")[blocks](given.poses, count, WEIGHED, found)
            kernel("find_weighted_moments")[blocks](given.poses, cumulated, count, found)
            if noise is None:
                return
            kernel("draw_survivors")[grid](
                given.poses, cumulated, keys, count, systematic, dials, self._place, survivors, parents
            )
            kernel("find_moments")[blocks](survivors, count, SURVIVING, found)
            if noise.correlated:
                pairs = (size, size, self.runs), SUMMING, self._stream
                kernel("find_correlations")[pairs](survivors, count, found, self._root)
                kernel("find_root")[-(-self.runs // 32), 32, self._stream](self._root)
            kernel("spread")[grid](survivors, found, self._root, dials, keys, self._limits, count, poses)
            kernel("find_moments")[blocks](poses, count, DIFFUSED, found)

        correlated = noise is not None and noise.correlated
        place = id(given.poses), id(poses), problem.frame.memory, every
        self._launch((*place, problem.factors, problem.frame.scale, count, correlated, systematic), launch)
        weighed = DeviceSet(given.poses, count, cumulated, weights, annealed)
        return weighed, weighed if noise is None else DeviceSet(poses, count)

    def records(self, weighed: DeviceSet, plans: Sequence[LayerPlan], layer: int) -> list[LayerRecord]:
        """The records of all runs' layer, which `step` has just done."""
        count, is_last = weighed.count, plans[0].noise is None
        step = -(-count // RECORDED)
        poses, values, best = self._rows(weighed.poses, weighed.weights, weighed.annealed, count, step)
        annealed, moments = self._fetched(weighed.annealed), self._fetched(self._moments)
        parents = np.zeros((2, 0), dtype=np.int64)
        if not is_last:
            parents = self._fetched(self._memory("parents", (2, self.runs * count), np.int32)).astype(
                np.int64
            )
        rows = np.arange(0, count, step) if step > 1 else np.zeros(0, dtype=np.int64)
        kept = moments[WEIGHTED + 1]
        return [
            LayerRecord(
                layer=layer,
                beta=float(annealed[run, BETA]),
                alpha_wanted=plan.survival,
                alpha_reached=float(annealed[run, SURVIVAL]),
                variance_weighed=moments[WEIGHED + 1, run],
                variance_resampled=kept[run] if is_last else moments[SURVIVING + 1, run],
                variance_diffused=kept[run] if is_last else moments[DIFFUSED + 1, run],
                best=best[run],
                best_log_weight=float(annealed[run, MOST]),
                mean=moments[WEIGHTED, run],
                poses=poses[run],
                log_weights=values[LOG_WEIGHT, run],
                parents=parents if is_last else parents[:, run * count : (run + 1) * count],
                rows=rows,
            )
            for run, plan in enumerate(plans)
        ]

    def give(self, there: DeviceSet) -> list[ParticleSet]:
        """All runs' particles on the host, with their weights where they have been weighed."""
        if there.weights is None:
            equal = np.full(there.count, -math.log(there.count))
            poses = np.split(self._fetched(there.poses).T.astype(np.float64), self.runs)
            return [ParticleSet(np.ascontiguousarray(own), equal) for own in poses]
        poses, values, _ = self._rows(there.poses, there.weights, there.annealed, there.count, 1)
        given = list[ParticleSet]()
        for own, raw, (beta, _, most, total, _) in zip(
            poses, values[LOG_WEIGHT], self._fetched(there.annealed), strict=True
        ):
            given.append(ParticleSet(own, -beta * (most - raw) - math.log(total), raw))
        return given

    def means(self) -> Array:
        """(R, D) weighted means (Eq. 8) of the layer last done, where it was measured."""
        return self._fetched(self._moments)[WEIGHTED]

    def _uploaded(self, moments: Sequence[Moment], plans: Sequence[LayerPlan]) -> tuple[Any, Any]:
        size = len(self.space.names)
        keys = np.array([tuple(moment) for moment in moments], dtype=np.uint64)
        rows = np.zeros((self.runs, SIGMA + size))
        for row, one in zip(rows, plans, strict=True):
            row[WANTED], row[KNOWN], row[CROSSED] = one.survival, one.beta, one.crossed
            if one.noise is not None:
                own = one.noise.sigma is None
                row[KEPT], row[SCALE] = one.noise.kept, one.noise.scale
                row[OF_SAMPLE], row[CORRELATED] = own, one.noise.correlated
                row[SIGMA:] = 0.0 if one.noise.sigma is None else one.noise.sigma
        return self._copied("keys", keys), self._copied("dials", rows)


class DeviceSearch:
    """Searches of one frame on a device, a layer at a time, for `frame_loop`. evaluated : poses of each that the last
    layer weighed.
    """

    def __init__(
        self,
        tracker: ParticleFilter[Any],
        problem: ProblemOnDevice,
        spaces: Sequence[SearchSpace],
        settings: Any,  # noqa: ANN401
    ) -> None:
        """spaces : of the runs, which differ in σ0 alone. settings : those that the frame begins with."""
        self.evaluated = 0
        self._tracker, self._spaces = tracker, spaces
        self._problem = problem
        by_limbs = getattr(settings, "crossover_by", "limbs") == "limbs"
        clamped = settings.constraints == "clamp"
        self._filter = DeviceFilter(problem.device, spaces[0], len(spaces), by_limbs, clamped)
        self._set: DeviceSet | None = None
        self._extras = list[Arrays]()

    def begin(
        self,
        previous: Sequence[FilterState],
        numbers: Sequence[RandomNumbers],
        settings: Any,  # noqa: ANN401
    ) -> None:
        """Make the first layer's sets from what the last frame left."""
        last = [one.particles for one in previous if one.particles is not None]
        self._extras = [one.extra for one in last]
        shifts = np.zeros((len(last), len(self._spaces[0].names)))
        for shift, one in zip(shifts, previous, strict=True):
            now, before = one.estimate, one.previous_estimate
            if settings.dynamics != "none" and now is not None and before is not None:
                shift[:] = now - before
        self._set = self._filter.begin(
            self._filter.take(last),
            [Moment(*one.key) for one in numbers],
            settings.particles,
            np.array([space.sigma for space in self._spaces]) * settings.diffusion_scale,
            getattr(settings, "carry", "resampled"),
            settings.resampling == "systematic",
            shifts,
        )

    def take(self, sets: Sequence[ParticleSet]) -> None:
        """Go on from sets of the host."""
        self._set, self._extras = self._filter.take(sets), [one.extra for one in sets]

    def step(self, layer: int, numbers: Sequence[RandomNumbers], settings: Any) -> list[LayerRecord]:  # noqa: ANN401
        """Do a layer and return its records."""
        assert self._set is not None
        plans = list[LayerPlan]()
        for space, extra in zip(self._spaces, self._extras, strict=True):
            plan = self._tracker.plan_layer(layer, space, settings, extra)
            assert plan is not None
            plans.append(plan)
        moments, systematic = [Moment(*one.key) for one in numbers], settings.resampling == "systematic"
        weighed, self._set = self._filter.step(self._set, self._problem, moments, plans, systematic)
        self.evaluated = weighed.count
        records = self._filter.records(weighed, plans, layer)
        self._extras = [
            self._tracker.kept_of_layer(extra, record, settings)
            for extra, record in zip(self._extras, records, strict=True)
        ]
        return records

    def particles(self) -> list[ParticleSet]:
        """The sets that the next layer weighs, or the last layer's with their weights, on the host."""
        assert self._set is not None
        return [
            ParticleSet(there.poses, there.log_weights, there.raw_log_weights, extra)
            for there, extra in zip(self._filter.give(self._set), self._extras, strict=True)
        ]
