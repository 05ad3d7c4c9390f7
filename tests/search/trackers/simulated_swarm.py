"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what swarms do on a device, in Numba's simulator of one.
Writes it to the file named. Poses are weighed by NumPy, but for one frame that the device's own kernels weigh.
"""

import dataclasses
import pickle
import sys
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from simulated_weighing import scene_of
from threads_in_turn import take_threads_in_turn
from toy_problems import toy_space

from studio.runs.search_space import search_space
from studio.search.likelihood.edge_region import EdgeRegionLikelihood, EdgeRegionSettings
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers import device_runs, device_search_kernels, device_swarm, device_swarm_kernels
from studio.search.trackers.device_runs import Moment
from studio.search.trackers.device_swarm import DeviceSwarm, SwarmStep
from studio.search.trackers.frame_loop import FrameSearch, SearchState, search_together
from studio.search.trackers.particle_swarm import ParticleSwarm
from studio.search.trackers.swarm_settings import SwarmSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, SearchSpace, start_of

SIZE, COUNT, NEXT_COUNT, RUNS = 5, 6, 5, 3
FIRST = 1 << 31
TRUNK, ALL = "trunk", "all"
SPACE = dataclasses.replace(
    toy_space(SIZE), lower=np.full(SIZE, -0.35), upper=np.array([0.5, 0.5, 0.6, 0.5, np.inf])
)
SIGMA = np.array([0.3, 0.2, 0.0, 0.3, 0.3])
NEXT_SIGMA = np.array([0.03, 0.3, 0.3, 0.3, 0.3])
INSIDE = np.array([0.2, -0.1, 0.35, 0.3, 4.0])
NEAR, OUTSIDE = INSIDE.copy(), INSIDE.copy()
NEAR[2], OUTSIDE[2] = SPACE.upper[2], 0.7
"""In the first swarm, x2 is fixed: where it begins on its limit, or beyond, all are there. Single precision rounds that
limit up."""


@dataclass(frozen=True)
class Scenario:
    """constraints : what happens beyond a limit. start : x̂. moving : whether a sampled swarm has velocities."""

    constraints: str
    start: np.ndarray = field(default_factory=lambda: INSIDE)
    moving: bool = True


SCENARIOS = {
    "clamped": Scenario("clamp"),
    "ignored": Scenario("ignore", moving=False),
    "redrawn": Scenario("redraw"),
    "redrawn on a limit": Scenario("redraw", NEAR),
    "redrawn outside": Scenario("redraw", OUTSIDE),
}
SAMPLES = {"edge_samples": 16, "region_samples": 16}
PULLS = (2.05, 2.4, 3.0)
NO_ROOM = 0.1


def values_of(poses: np.ndarray, seen: str = ALL) -> np.ndarray:
    """(2, N) fitness and log-weights of poses (N, D), in steps, so that some are equal; the trunk's are others."""
    away = poses - (0.1 if seen == ALL else -0.2)
    fitness = np.round(-(away * away).sum(axis=1)) / 2.0
    return np.stack([fitness, 3.0 * fitness])


class NumpyDevice:
    """Weighs by `values_of` what lies on the device."""

    def __init__(self) -> None:
        self.arrays: dict[Any, Any] = {}

    def lend_arrays(self, borrower: object) -> dict[Any, Any]:
        return self.arrays

    def edges_of(self, limbs: Any) -> str:  # noqa: ANN401
        return ALL if limbs is None else TRUNK

    def weigh(self, poses, problem, edges, every, found, stream, memory) -> None:
        found.copy_to_device(values_of(poses.copy_to_host().T.astype(np.float64), edges))


class ToyProblem:
    """The same weighing here and there. there : whether a device weighs."""

    def __init__(
        self, *, there: bool = True, device: NumpyDevice | None = None, space: SearchSpace = SPACE
    ) -> None:
        self.there, self.device, self.space = there, device or NumpyDevice(), space

    def on_device(self) -> Any:  # noqa: ANN401
        frame = SimpleNamespace(observed=[0], memory=0, scale=1.0)
        problem = SimpleNamespace(
            device=self.device, frame=frame, factors=(1.0,), trunk=np.array([0]), ranked=0
        )
        return problem if self.there else None

    def give_up_device(self, error: Exception) -> None:
        raise error

    def fitness(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return values_of(poses, TRUNK if stage else ALL)[0]

    log_likelihood = fitness

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        return ((self.space.lower <= poses) & (poses <= self.space.upper)).all(axis=1)


def contents(there: Any) -> dict[str, np.ndarray]:  # noqa: ANN401
    """A set's arrays, copied to the host."""
    names = "places", "velocities", "bests", "reached", "leaders", "starts", "standing"
    return {name: np.array(getattr(there, name).copy_to_host()) for name in names}


def stepped(scenario: Scenario, runs: tuple[int, ...]) -> list[dict[str, np.ndarray]]:
    """Runs side by side through four weighings: sampled, moved twice, sampled again, and the last one."""
    problem = ToyProblem().on_device()
    swarm = DeviceSwarm(problem.device, SPACE, len(runs))
    rules, found = scenario.constraints, list[dict[str, np.ndarray]]()

    def moments(layer: int) -> list[Moment]:
        return [Moment(run + (1 << 40), 7, layer) for run in runs]

    samples = [SwarmStep(SIGMA, moving=scenario.moving)] * len(runs)
    moves = [SwarmStep(SIGMA, PULLS[run]) for run in runs]
    again = [SwarmStep(NEXT_SIGMA, moving=scenario.moving)] * len(runs)
    starts = np.repeat(scenario.start[None], len(runs), axis=0)
    now = swarm.sample(starts, moments(FIRST), COUNT, samples, rules)
    found.append(contents(now))
    for layer, (steps, count) in enumerate(((moves, 0), (moves, 0), (again, NEXT_COUNT), (None, 0))):
        weighed, now = swarm.step(
            now, problem, moments(layer), steps, constraints=rules, trunk_first=layer < 3, sampled=count
        )
        records = swarm.records(weighed, layer, is_last=steps is None)
        found.append(
            contents(now) | {"weights": np.array(weighed.weights.copy_to_host()), "records": records}
        )
    return found


SETTINGS = SwarmSettings(
    stage1_particles=4, stage1_iterations=3, stage2_particles=5, stage2_iterations=4, limbs_apart=False
)


def searched(
    settings: SwarmSettings,
    there: tuple[bool, ...] = (True,) * 14,
    space: SearchSpace = SPACE,
    start: FilterState | None = None,
    *,
    resumed: bool = False,
) -> dict[str, Any]:
    """A frame that is searched twice over. there : which layers a device does. resumed : whether each layer is done by
    a search that goes on from the last one's state.
    """
    previous = start or start_of(tuple(INSIDE))
    state, records, sets, search = SearchState(), [], [], None
    device = NumpyDevice()
    for on_device in there:
        if search is None or resumed:
            search = FrameSearch(ParticleSwarm(), previous, space, seed=5, frame=2, repeats=2, state=state)
        problem = ToyProblem(there=on_device, device=None if resumed else device, space=space)
        records.append(search.step(problem, 0, settings))
        if resumed:
            state = search.state
            sets.append(state.particles)
    return {"records": records, "sets": sets, "result": search.result()}


def without_room(constraints: str, *, there: bool) -> dict[str, Any]:
    """A frame in which the last but one parameter has no room, at a number that single precision does not have."""
    fixed = np.arange(SIZE) == SIZE - 2
    space = dataclasses.replace(
        SPACE,
        lower=np.where(fixed, NO_ROOM, SPACE.lower),
        upper=np.where(fixed, NO_ROOM, SPACE.upper),
        sigma=np.where(fixed, 0.0, SPACE.sigma),
    )
    settings = dataclasses.replace(SETTINGS, constraints=constraints)
    start = start_of(tuple(np.where(fixed, NO_ROOM, INSIDE)))
    return searched(settings, (there,) * 14, space, start)


def together(runs: tuple[int, ...]) -> dict[int, list[LayerRecord]]:
    """Records of a frame of runs side by side, that differ by seed and σ0."""
    problem, records = ToyProblem(), list[LayerRecord]()
    searches = [
        FrameSearch(
            ParticleSwarm(),
            start_of(tuple(INSIDE + 0.01 * run)),
            dataclasses.replace(SPACE, sigma=(1.0 + run) * SPACE.sigma),
            seed=run,
            frame=2,
            repeats=2,
        )
        for run in runs
    ]
    search_together(searches, problem, lambda: (0, SETTINGS), records.append)
    return {run: records[place :: len(runs)] for place, run in enumerate(runs)}


def weighed_there() -> dict[str, Any]:
    """A frame of a body that the device's own kernels weigh, and what the device is told of a person's trunk."""
    body, cameras, evidence, poses = scene_of("planar_arm4")
    settings = EdgeRegionSilhouetteSettings(device="gpu", **SAMPLES)
    problem = EdgeRegionSilhouetteLikelihood(body, cameras, settings).problem(evidence)
    space = search_space(body, np.array([entry.max_step for entry in body.parameters]) / 60.0)
    small = dataclasses.replace(SETTINGS, stage1_particles=2, stage2_particles=3, stage2_iterations=3)
    search = FrameSearch(ParticleSwarm(), start_of(tuple(poses[0])), space, seed=1, frame=0)
    records: list[LayerRecord] = []
    while not search.finished:
        records.append(search.step(problem, 0, small))
    person, cameras, evidence, _ = scene_of("human31")
    three = EdgeRegionSilhouetteLikelihood(person, cameras, settings)
    two = EdgeRegionLikelihood(person, cameras, EdgeRegionSettings(device="gpu", **SAMPLES))
    of_three, of_two = three.problem(evidence).on_device(), two.problem(evidence).on_device()
    return {
        "records": records,
        "leader": search.result().estimate.mode,
        "trunk": (three.trunk, of_three.trunk, of_three.ranked),
        "two": (of_two.trunk, of_two.ranked),
    }


def everything() -> dict[str, Any]:
    """What the tests read."""
    even = dataclasses.replace(SETTINGS, stage2_particles=SETTINGS.stage1_particles)
    bounded = dataclasses.replace(SPACE, upper=np.full(SIZE, 0.5))
    first = searched(SETTINGS)
    return {
        "sets": {name: stepped(scenario, (0, 1, 2)) for name, scenario in SCENARIOS.items()},
        "alone": {run: stepped(SCENARIOS["redrawn outside"], (run,)) for run in range(RUNS)},
        "frame": (first, searched(SETTINGS, resumed=True)),
        "stages of one size": (searched(even), searched(even, resumed=True)),
        "next frame": searched(SETTINGS, start=first["result"].carried),
        "in turns": searched(SETTINGS, (True, False, False, True) * 3 + (False, True), resumed=True),
        "begun by the processor": searched(SETTINGS, space=bounded, start=FilterState(None), resumed=True),
        "together": (together((0, 1, 2)), together((0,)) | together((1,)) | together((2,))),
        "without room": {rule: without_room(rule, there=True) for rule in ("clamp", "redraw")},
        "weighed there": weighed_there(),
    }


if __name__ == "__main__":
    take_threads_in_turn()
    device_search_kernels.SUMMING = device_swarm_kernels.SUMMING = device_swarm.SUMMING = 2
    device_runs.THREADS = device_swarm.THREADS = 8
    device_runs.record_launches = lambda launches, stream: None
    Path(sys.argv[1]).write_bytes(pickle.dumps(everything()))
