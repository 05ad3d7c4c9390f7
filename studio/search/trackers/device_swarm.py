# pyright: standard
"""Swarms whose particles stay on a CUDA device: bests are found and particles moved there.

`DeviceSwarm` searches R runs side by side that have one body, one space and the same stages; their seeds, frames, knobs
and pictures may differ. A run's numbers depend on its own seed, frame and layer alone (`counted_numbers`), so beside
others it is searched as alone. Symbols and equations are those of `particle_swarm`.

Not here: behaviour models, rejected poses and limbs kept apart, which the processor's search has.
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.likelihood.device_weighing import ProblemOnDevice, WeighingDevice
from studio.search.likelihood.problem import TRUNK_FIRST
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
    DIFFUSED,
    MOST,
    SUMMING,
    SURVIVING,
    WEIGHED,
)
from studio.search.trackers.device_swarm_kernels import (
    MOVING,
    POSSIBLE,
    PULL,
    SHRINK,
    SIGMA,
    STANDING,
    VALUE,
)
from studio.search.trackers.particle_swarm import (
    BEST_POSES,
    BEST_POSSIBLE,
    BEST_VALUES,
    FREEDOM,
    LEADER,
    LEADER_POSSIBLE,
    LEADER_VALUE,
    START,
    VELOCITIES,
    ParticleSwarm,
    acceleration,
    constriction,
    predict_pose,
    seen_in,
)
from studio.search.trackers.particles import unweighted
from studio.search.trackers.partitions import moment_of, stages_of
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, ParticleSet, SearchSpace


@dataclass(frozen=True, slots=True, eq=False)
class SwarmStep:
    """A step of a run's swarm, or the sample of a new one. sigma : (D,) σ. pull : c = c1 = c2 of a step, NaN for a
    sample. moving : whether a sample has velocities.
    """

    sigma: Array
    pull: float = np.nan
    moving: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSwarmSet:
    """Particles of R runs there, `count` = N a run: places, velocities and bests (D, R N), reached (2, R N); leaders
    and starts (D, R), standing (R, 5), see `device_swarm_kernels`. weights : (2, R N) of places, of whose rows `row` is
    f; None: not weighed. turn : which of two places the particles have.
    """

    count: int
    places: Any
    velocities: Any
    bests: Any
    reached: Any
    leaders: Any
    starts: Any
    standing: Any
    weights: Any = None
    row: int = 0
    turn: int = 0


class DeviceSwarm(DeviceRuns):
    """R runs of one body, side by side. A set that it returns has the places that it had then until a set is made from
    one that was made from it; its bests and leaders are those of the last weighing.
    """

    def __init__(self, device: WeighingDevice, space: SearchSpace, runs: int = 1) -> None:
        super().__init__(device, space, runs)
        self._inner = limits_there(space, kept=True)
        self._limits = [
            self._copied(f"limits {kept}", limits_there(space, kept=kept)) for kept in (False, True)
        ]

    def take(self, sets: Sequence[ParticleSet]) -> DeviceSwarmSet:
        """Swarms of the host, one a run and of as many particles each, there."""
        there = self._following(len(sets[0].poses), 0)

        def fill(array: Any, values: Sequence[Array], *, placed: bool = True) -> None:  # noqa: ANN401
            joined = np.concatenate([np.atleast_2d(one) for one in values])
            single = self._narrowed(joined) if placed else joined.astype(np.float32)
            array.copy_to_device(np.ascontiguousarray(single.T), stream=self._stream)

        extras = [one.extra for one in sets]
        fill(there.places, [one.poses for one in sets])
        fill(there.velocities, [extra[VELOCITIES] for extra in extras], placed=False)
        fill(there.bests, [extra[BEST_POSES] for extra in extras])
        fill(there.leaders, [extra[LEADER] for extra in extras])
        fill(there.starts, [extra[START] for extra in extras])
        reached = np.empty((2, self.runs * there.count))
        reached[VALUE] = np.concatenate([extra[BEST_VALUES] for extra in extras])
        reached[POSSIBLE] = np.concatenate([extra[BEST_POSSIBLE] for extra in extras])
        standing = np.zeros((self.runs, STANDING))
        standing[:, VALUE] = np.concatenate([extra[LEADER_VALUE] for extra in extras])
        standing[:, POSSIBLE] = np.concatenate([extra[LEADER_POSSIBLE] for extra in extras])
        there.reached.copy_to_device(reached, stream=self._stream)
        there.standing.copy_to_device(standing, stream=self._stream)
        return there

    def sample(
        self,
        starts: Array,
        moments: Sequence[Moment],
        count: int,
        steps: Sequence[SwarmStep],
        constraints: str = "clamp",
    ) -> DeviceSwarmSet:
        """A stage's swarms of `count` particles a run, sampled about x̂ (R, D): x ← N(x̂, Σ), v ← U(-σ, σ) or zero."""
        keys, dials = self._uploaded(moments, steps)
        following = self._following(count, 0)
        following.leaders.copy_to_device(np.ascontiguousarray(self._narrowed(starts).T), stream=self._stream)
        self._sample(following, keys, dials, constraints)
        return following

    def step(
        self,
        given: DeviceSwarmSet,
        problem: ProblemOnDevice,
        moments: Sequence[Moment],
        steps: Sequence[SwarmStep] | None,
        *,
        constraints: str = "clamp",
        trunk_first: bool = False,
        sampled: int = 0,
    ) -> tuple[DeviceSwarmSet, DeviceSwarmSet]:
        """Weigh swarms, bring the bests up to date, and move them; or sample the next stage's, of `sampled` particles a
        run, about the leaders: the set with its weights and what follows from it (the same where there are no steps).

        constraints : what happens beyond a limit. trunk_first : whether only the trunk's edges count.
        """
        count, whole = given.count, self.runs * given.count
        keys, dials = (None, None) if steps is None else self._uploaded(moments, steps)
        edges = self.device.edges_of(problem.trunk if trunk_first else None)
        every = count if len(problem.frame.observed) > 1 else whole
        weights = self._memory("weights", (2, whole), np.float64)
        following = given if steps is None else self._following(sampled or count, 1 - given.turn)
        limits = self._limits[constraints != "ignore"]
        found, blocks = self._moments, ((len(self.space.names), self.runs), SUMMING, self._stream)

        def launch() -> None:
            self.device.weigh(given.places, problem, edges, every, weights, self._stream, self._memory)
            kernel("find_bests")[self.runs, SUMMING, self._stream](
                given.places, weights, problem.ranked, limits, count, given.bests, given.reached, given.leaders,
                given.standing,
            )  # fmt: skip
            kernel("find_moments")[blocks](given.places, count, WEIGHED, found)
            kernel("find_moments")[blocks](given.bests, count, SURVIVING, found)
            if following is given:
                return
            if sampled:
                self._sample(following, keys, dials, constraints)
            else:
                kernel("step_swarm")[self.runs, SUMMING, self._stream](
                    given.places, given.velocities, given.bests, given.leaders, dials, keys, limits, False,
                    constraints == "redraw", count, following.places, following.velocities,
                )  # fmt: skip
            kernel("find_moments")[blocks](following.places, following.count, DIFFUSED, found)

        where = id(given.places), id(following.places), id(edges), problem.frame.memory, every
        how = problem.factors, problem.frame.scale, problem.ranked, constraints, sampled, count
        self._launch(("swarm", *where, *how), launch)
        weighed = DeviceSwarmSet(
            count, given.places, given.velocities, given.bests, given.reached, given.leaders, given.starts,
            given.standing, weights, problem.ranked, given.turn,
        )  # fmt: skip
        return weighed, weighed if following is given else following

    def records(self, weighed: DeviceSwarmSet, layer: int, *, is_last: bool) -> list[LayerRecord]:
        """The records of all runs' layer, which `step` has just done."""
        return self.send(weighed, layer, is_last=is_last)()

    def send(self, weighed: DeviceSwarmSet, layer: int, *, is_last: bool) -> Callable[[], list[LayerRecord]]:
        """Send the records of all runs' layer, which was launched last, to the host: what waits for them there."""
        count = weighed.count
        every = -(-count // RECORDED)
        sent = self._rows(weighed.places, weighed.weights, weighed.standing, count, every)
        on_the_way = self._send(sent | {"moments": self._moments, "standing": weighed.standing})
        rows = np.arange(0, count, every) if every > 1 else np.zeros(0, dtype=np.int64)

        def records() -> list[LayerRecord]:
            arrived = on_the_way.arrive()
            poses, values, moments = arrived["rows"], arrived["values"], arrived["moments"]
            return [
                LayerRecord(
                    layer=layer,
                    variance_weighed=moments[WEIGHED + 1, run],
                    variance_resampled=moments[SURVIVING + 1, run],
                    variance_diffused=moments[(SURVIVING if is_last else DIFFUSED) + 1, run],
                    best=poses[run, -1],
                    best_log_weight=float(arrived["standing"][run, MOST]),
                    mean=moments[WEIGHED, run],
                    poses=poses[run, :-1],
                    log_weights=values[weighed.row, run, :-1],
                    rows=rows,
                )
                for run in range(self.runs)
            ]

        return records

    def kept(self, given: DeviceSwarmSet) -> DeviceSwarmSet:
        """A set with copies of the bests and leaders, which the next weighing changes."""
        return self._with_copies(given, "kept ")

    def put_back(self, kept: DeviceSwarmSet) -> DeviceSwarmSet:
        """The set of which `kept` was made, as it was."""
        return self._with_copies(kept, "")

    def _with_copies(self, given: DeviceSwarmSet, where: str) -> DeviceSwarmSet:
        copies = dict[str, Any]()
        for name in ("bests", "reached", "leaders", "starts", "standing"):
            there = getattr(given, name)
            copies[name] = self._memory(where + name, there.shape, there.dtype.type)
            copies[name].copy_to_device(there, stream=self._stream)
        return dataclasses.replace(given, **copies)

    def give(self, there: DeviceSwarmSet, freedom: Array) -> list[ParticleSet]:
        """All runs' swarms on the host, with their values where they have been weighed. freedom : (D,) of the stage."""
        arrays = there.places, there.velocities, there.bests, there.leaders, there.starts
        places, velocities, bests, leaders, starts = (
            np.split(self._fetched(array).T.astype(np.float64), self.runs) for array in arrays
        )
        for runs in (places, bests, leaders, starts):
            for own in runs:
                put_within(own, self.space)
        reached = np.split(self._fetched(there.reached), self.runs, axis=1)
        standing = self._fetched(there.standing)
        none = np.zeros((2, 0))
        values = none if there.weights is None else self._fetched(there.weights)
        weighed = np.split(values[there.row], self.runs)
        given = list[ParticleSet]()
        for run in range(self.runs):
            swarm = unweighted(
                np.ascontiguousarray(places[run]),
                {
                    VELOCITIES: np.ascontiguousarray(velocities[run]),
                    BEST_POSES: np.ascontiguousarray(bests[run]),
                    BEST_VALUES: np.ascontiguousarray(reached[run][VALUE]),
                    BEST_POSSIBLE: reached[run][POSSIBLE] > 0.0,
                    LEADER: leaders[run][0],
                    LEADER_VALUE: standing[run, [VALUE]],
                    LEADER_POSSIBLE: standing[run, [POSSIBLE]] > 0.0,
                    START: starts[run][0],
                    FREEDOM: freedom,
                },
            )
            given.append(ParticleSet(swarm.poses, swarm.log_weights, weighed[run], swarm.extra))
        return given

    def _sample(self, following: DeviceSwarmSet, keys: Any, dials: Any, constraints: str) -> None:  # noqa: ANN401
        """Launch the sampling of swarms about their leaders."""
        count = following.count
        whole = self.runs * count
        shape = len(self.space.names), whole
        at_start = self._memory("at start", shape, np.float32)
        drawn = self._memory("drawn velocities", shape, np.float32)
        kernel("line_up")[-(-whole // THREADS), THREADS, self._stream](
            following.leaders, dials, keys, count, at_start, drawn, following.reached, following.starts,
            following.standing,
        )  # fmt: skip
        kernel("step_swarm")[self.runs, SUMMING, self._stream](
            at_start, drawn, following.bests, following.leaders, dials, keys, self._limits[constraints != "ignore"],
            True, constraints == "redraw", count, following.places, following.velocities,
        )  # fmt: skip

    def _uploaded(self, moments: Sequence[Moment], steps: Sequence[SwarmStep]) -> tuple[Any, Any]:
        keys = np.array([tuple(moment) for moment in moments], dtype=np.uint64)
        rows = np.zeros((self.runs, SIGMA + len(self.space.names)))
        for row, one in zip(rows, steps, strict=True):
            row[PULL], row[MOVING], row[SIGMA:] = one.pull, one.moving, one.sigma
            row[SHRINK] = constriction(one.pull)
        return self._copied("keys", keys), self._copied("dials", rows)

    def _following(self, count: int, turn: int) -> DeviceSwarmSet:
        """Where a set goes: its places and velocities never where that one has them from which it is made."""
        size, whole = len(self.space.names), self.runs * count
        return DeviceSwarmSet(
            count,
            self._poses(count, turn),
            self._memory(f"velocities {turn}", (size, whole), np.float32),
            self._memory("bests", (size, whole), np.float32),
            self._memory("reached", (2, whole), np.float64),
            self._memory("leaders", (size, self.runs), np.float32),
            self._memory("starts", (size, self.runs), np.float32),
            self._memory("standing", (self.runs, STANDING), np.float64),
            turn=turn,
        )

    def _narrowed(self, poses: Array) -> NDArray[np.float32]:
        """Poses (N, D) in single precision, such that none leaves its limits by being rounded."""
        kept = (self.space.lower <= poses) & (poses <= self.space.upper)
        return np.where(kept, np.clip(poses, *self._inner), poses).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class _Staged:
    """A swarm, and the freedom (D,) of the stage that it is in."""

    swarm: DeviceSwarmSet
    freedom: Array


class DeviceSearch(LayersAhead[_Staged]):
    """Searches of one frame by a swarm on a device, for `frame_loop`: a layer is an iteration."""

    def __init__(
        self,
        tracker: ParticleSwarm,
        problem: ProblemOnDevice,
        spaces: Sequence[SearchSpace],
        settings: Sequence[SwarmSettings],
    ) -> None:
        super().__init__(tracker, spaces)
        self._problem = problem
        self._swarm = DeviceSwarm(problem.device, spaces[0], len(spaces))

    def begin(
        self,
        previous: Sequence[FilterState],
        numbers: Sequence[RandomNumbers],
        settings: Sequence[SwarmSettings],
    ) -> None:
        """Sample the first stage's swarms about x̂."""
        shared = settings[0]
        first = stages_of(self._spaces[0].hierarchy, shared)[0]
        starts = np.array([predict_pose(one, shared) for one in previous])
        moments = [Moment(*one.key) for one in numbers]
        samples = self._sampling(shared, first.freedom)
        sampled = self._swarm.sample(starts, moments, first.particles, samples, shared.constraints)
        self._set = _Staged(sampled, first.freedom)

    def take(self, sets: Sequence[ParticleSet]) -> None:
        """Go on from swarms of the host."""
        self._set = _Staged(self._swarm.take(sets), sets[0].extra[FREEDOM])

    def particles(self) -> list[ParticleSet]:
        """The swarms that the next iteration weighs, or the last one's with their values, on the host."""
        assert self._set is not None
        return self._swarm.give(self._set.swarm, self._set.freedom)

    def _launch(
        self, given: _Staged, layer: int, moments: Sequence[Moment], settings: Sequence[SwarmSettings]
    ) -> Launched[_Staged]:
        shared = settings[0]
        stages = stages_of(self._spaces[0].hierarchy, shared)
        now = moment_of(stages, layer)
        stage = stages[now.number]
        trunk_first = seen_in(stage, given.freedom) == TRUNK_FIRST
        steps, sampled, freedom = None, 0, given.freedom
        if now.iteration < stage.iterations:
            c = acceleration(now.iteration + 1, stage.iterations, shared.c_first, shared.c_last)
            steps = [SwarmStep(one.sigma, c) for one in self._sampling(shared, freedom)]
        elif now.number + 1 < len(stages):
            following = stages[now.number + 1]
            freedom, sampled = following.freedom, following.particles
            steps = self._sampling(shared, freedom)
        weighed, moved = self._swarm.step(
            given.swarm,
            self._problem,
            moments,
            steps,
            constraints=shared.constraints,
            trunk_first=trunk_first,
            sampled=sampled,
        )
        sent = self._swarm.send(weighed, layer, is_last=steps is None)
        return Launched(_Staged(moved, freedom), weighed.count, sent)

    def _kept(self, given: _Staged) -> _Staged:
        return dataclasses.replace(given, swarm=self._swarm.kept(given.swarm))

    def _put_back(self, kept: _Staged) -> _Staged:
        return dataclasses.replace(kept, swarm=self._swarm.put_back(kept.swarm))

    def _sampling(self, settings: SwarmSettings, freedom: Array) -> list[SwarmStep]:
        """The samples of swarms with a stage's freedom."""
        moving = settings.start_velocity == "uniform"
        factor = settings.diffusion_scale * freedom
        return [SwarmStep(space.sigma * factor, moving=moving) for space in self._spaces]
