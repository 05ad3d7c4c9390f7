"""Filters whose particles stay on a CUDA device: weights, survivors, children and noise are found there.

`DeviceFilter` searches R runs side by side that have one body, one space and as many particles each; their seeds,
frames, knobs and pictures may differ. The host says what a layer is to do and, where somebody looks, reads its record:
moments of the whole set, and all particles or every k-th of many. A run's numbers depend on its own seed, frame and
layer alone (`counted_numbers`), so beside others it is searched as alone.

Not here: behaviour models, redrawn or rejected poses and limbs kept apart, which the processor's search has.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.likelihood.device_weighing import (
    ProblemOnDevice,
    WeighingDevice,
)
from studio.search.trackers.device_runs import (
    RECORDED,
    THREADS,
    DeviceRuns,
    Launched,
    LayersAhead,
    Moment,
    kernel,
    limits_there,
    put_within,
)
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
    UTMOST,
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
    weights : (2, R N) fitness and log-weights; None: not weighed. annealed : (R, 5). turn : which of two places it has.
    """

    poses: Any
    count: int
    turn: int = 0
    cumulated: Any = None
    weights: Any = None
    annealed: Any = None


class DeviceFilter(DeviceRuns):
    """R runs of one body, side by side. A weighed set that it returns is valid until the next is weighed, another until
    one is made from a set that was made from it.
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
        return DeviceSet(there, len(sets[0].poses), cumulated=self._copied("last weights", cumulated))

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
        poses = self._poses(count, 0)
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
        correlated = any(one.noise is not None and one.noise.correlated for one in plans)
        whole = self.runs * count
        keys, dials = self._uploaded(moments, plans)
        weights = self._memory("weights", (2, whole), np.float64)
        annealed = self._memory("annealed", (self.runs, ANNEALED), np.float64)
        cumulated = self._memory("cumulated", (whole,), np.float64)
        survivors = self._memory("survivors", (size, whole), np.float32)
        parents = self._memory("parents", (2, whole), np.int32)
        every = count if len(problem.frame.observed) > 1 else whole
        edges = self.device.edges_of(None)
        turn = 1 - given.turn
        poses = given.poses if noise is None else self._poses(count, turn)
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
            if correlated:
                pairs = (size, size, self.runs), SUMMING, self._stream
                kernel("find_correlations")[pairs](survivors, count, found, self._root)
                kernel("find_root")[-(-self.runs // 32), 32, self._stream](self._root)
            kernel("spread")[grid](survivors, found, self._root, dials, keys, self._limits, count, poses)
            kernel("find_moments")[blocks](poses, count, DIFFUSED, found)

        place = id(given.poses), id(poses), problem.frame.memory, every
        self._launch((*place, problem.factors, problem.frame.scale, count, correlated, systematic), launch)
        weighed = DeviceSet(given.poses, count, given.turn, cumulated, weights, annealed)
        return weighed, weighed if noise is None else DeviceSet(poses, count, turn)

    def records(self, weighed: DeviceSet, plans: Sequence[LayerPlan], layer: int) -> list[LayerRecord]:
        """The records of all runs' layer, which `step` has just done."""
        return self.send(weighed, layer, [plan.survival for plan in plans], is_last=plans[0].noise is None)()

    def send(
        self,
        weighed: DeviceSet,
        layer: int,
        wanted: Sequence[float],
        *,
        is_last: bool,
        also: Mapping[str, Any] | None = None,
    ) -> Callable[[], list[LayerRecord]]:
        """Send the records of all runs' layer, which was launched last, to the host: what waits for them there.
        wanted : the share that was to survive, of each run. also : arrays that are sent with them.
        """
        count = weighed.count
        step = -(-count // RECORDED)
        sent = self._rows(weighed.poses, weighed.weights, weighed.annealed, count, step)
        sent |= {"annealed": weighed.annealed, "moments": self._moments}
        if not is_last:
            sent["parents"] = self._memory("parents", (2, self.runs * count), np.int32)
        on_the_way = self._send(sent | dict(also or {}))
        return lambda: self._records_of(on_the_way.arrive(), count, step, layer, wanted)

    def _records_of(
        self, sent: Mapping[str, NDArray[Any]], count: int, step: int, layer: int, wanted: Sequence[float]
    ) -> list[LayerRecord]:
        annealed, moments = sent["annealed"], sent["moments"]
        poses, values, is_last = sent["rows"], sent["values"], "parents" not in sent
        rows = np.arange(0, count, step) if step > 1 else np.zeros(0, dtype=np.int64)
        kept = moments[WEIGHTED + 1]
        drawn = [np.zeros((2, 0), dtype=np.int64)] * self.runs
        if not is_last:
            drawn = np.split(sent["parents"].astype(np.int64), self.runs, axis=1)
        return [
            LayerRecord(
                layer=layer,
                beta=float(annealed[run, BETA]),
                alpha_wanted=alpha,
                alpha_reached=float(annealed[run, SURVIVAL]),
                variance_weighed=moments[WEIGHED + 1, run],
                variance_resampled=kept[run] if is_last else moments[SURVIVING + 1, run],
                variance_diffused=kept[run] if is_last else moments[DIFFUSED + 1, run],
                best=poses[run, -1],
                best_log_weight=float(annealed[run, MOST]),
                mean=moments[WEIGHTED, run],
                poses=poses[run, :-1],
                log_weights=values[LOG_WEIGHT, run, :-1],
                parents=parents,
                rows=rows,
            )
            for run, (alpha, parents) in enumerate(zip(wanted, drawn, strict=True))
        ]

    def give(self, there: DeviceSet) -> list[ParticleSet]:
        """All runs' particles on the host, with their weights where they have been weighed."""
        if there.weights is None:
            equal = np.full(there.count, -math.log(there.count))
            return [ParticleSet(own, equal) for own in self._given(there.poses)]
        taken = self._rows(there.poses, there.weights, there.annealed, there.count, 1)
        poses, values = (
            self._fetched(taken["rows"])[:, :-1],
            self._fetched(taken["values"])[LOG_WEIGHT, :, :-1],
        )
        given = list[ParticleSet]()
        for own, raw, (beta, _, most, total, _) in zip(
            poses, values, self._fetched(there.annealed), strict=True
        ):
            log_weights = -beta * (most - raw) - math.log(total)
            given.append(ParticleSet(put_within(own, self.space), log_weights, raw))
        return given

    def _given(self, poses: Any) -> list[Array]:  # noqa: ANN401
        """Poses (D, R N) there as each run's (N, D) on the host."""
        runs = np.split(self._fetched(poses).T.astype(np.float64), self.runs)
        return [put_within(np.ascontiguousarray(own), self.space) for own in runs]

    def means(self) -> Array:
        """(R, D) weighted means (Eq. 8) of the layer last done, where it was measured."""
        return self._fetched(self._moments)[WEIGHTED]

    def _uploaded(self, moments: Sequence[Moment], plans: Sequence[LayerPlan]) -> tuple[Any, Any]:
        size = len(self.space.names)
        keys = np.array([tuple(moment) for moment in moments], dtype=np.uint64)
        rows = np.zeros((self.runs, SIGMA + size))
        for row, one in zip(rows, plans, strict=True):
            row[WANTED], row[KNOWN], row[UTMOST] = one.survival, one.beta, math.inf
            row[CROSSED] = one.crossed
            if one.noise is not None:
                own = one.noise.sigma is None
                row[KEPT], row[SCALE] = one.noise.kept, one.noise.scale
                row[OF_SAMPLE], row[CORRELATED] = own, one.noise.correlated
                row[SIGMA:] = 0.0 if one.noise.sigma is None else one.noise.sigma
        return self._copied("keys", keys), self._copied("dials", rows)


class DeviceSearch(LayersAhead[DeviceSet]):
    """Searches of one frame by a filter on a device, for `frame_loop`."""

    def __init__(
        self,
        tracker: ParticleFilter[Any],
        problem: ProblemOnDevice,
        spaces: Sequence[SearchSpace],
        settings: Sequence[Any],
    ) -> None:
        """settings : of each run, those that the frame begins with."""
        super().__init__(tracker, spaces)
        self._filter_kind, self._problem = tracker, problem
        by_limbs = getattr(settings[0], "crossover_by", "limbs") == "limbs"
        clamped = settings[0].constraints == "clamp"
        self._filter = DeviceFilter(problem.device, spaces[0], len(spaces), by_limbs, clamped)
        self._extras = list[Arrays]()

    def begin(
        self,
        previous: Sequence[FilterState],
        numbers: Sequence[RandomNumbers],
        settings: Sequence[Any],
    ) -> None:
        """Make the first layer's sets from what the last frame left."""
        last = [one.particles for one in previous if one.particles is not None]
        self._extras = [one.extra for one in last]
        shifts = np.zeros((len(last), len(self._spaces[0].names)))
        for shift, one, own in zip(shifts, previous, settings, strict=True):
            now, before = one.estimate, one.previous_estimate
            if own.dynamics != "none" and now is not None and before is not None:
                shift[:] = now - before
        self._set = self._filter.begin(
            self._filter.take(last),
            [Moment(*one.key) for one in numbers],
            settings[0].particles,
            np.array(
                [space.sigma * own.diffusion_scale for space, own in zip(self._spaces, settings, strict=True)]
            ),
            getattr(settings[0], "carry", "resampled"),
            settings[0].resampling == "systematic",
            shifts,
        )

    def take(self, sets: Sequence[ParticleSet]) -> None:
        """Go on from sets of the host."""
        self._set, self._extras = self._filter.take(sets), [one.extra for one in sets]

    def particles(self) -> list[ParticleSet]:
        """The sets that the next layer weighs, or the last layer's with their weights, on the host."""
        assert self._set is not None
        return [
            ParticleSet(there.poses, there.log_weights, there.raw_log_weights, extra)
            for there, extra in zip(self._filter.give(self._set), self._extras, strict=True)
        ]

    def _launch(
        self,
        given: DeviceSet,
        layer: int,
        moments: Sequence[Moment],
        settings: Sequence[Any],
    ) -> Launched[DeviceSet]:
        plans = list[LayerPlan]()
        for space, own, extra in zip(self._spaces, settings, self._extras, strict=True):
            plan = self._filter_kind.plan_layer(layer, space, own, extra)
            assert plan is not None
            plans.append(plan)
        systematic = settings[0].resampling == "systematic"
        weighed, following = self._filter.step(given, self._problem, moments, plans, systematic)
        wanted, is_last = [plan.survival for plan in plans], plans[0].noise is None
        sent = self._filter.send(weighed, layer, wanted, is_last=is_last)
        return Launched(following, given.count, sent)

    def _heed(self, records: Sequence[LayerRecord], settings: Sequence[Any]) -> bool:
        before, kind = self._extras, self._filter_kind
        self._extras = [
            kind.kept_of_layer(extra, record, own)
            for extra, record, own in zip(before, records, settings, strict=True)
        ]
        return any(one is not other for one, other in zip(before, self._extras, strict=True))
