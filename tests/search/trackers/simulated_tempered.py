"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what tempered sequential Monte Carlo does on a device, in
Numba's simulator of one. Writes it to the file named. Poses are weighed by NumPy, but for one frame that the device's
own kernels weigh.
"""

import dataclasses
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from simulated_swarm import NumpyDevice
from simulated_weighing import scene_of
from threads_in_turn import take_threads_in_turn
from toy_problems import Bowl, toy_space

from studio.runs.search_space import search_space
from studio.search.likelihood.edge_region_silhouette import (
    EdgeRegionSilhouetteLikelihood,
    EdgeRegionSilhouetteSettings,
)
from studio.search.trackers import (
    device_runs,
    device_search,
    device_search_kernels,
    device_tempered,
    device_tempered_kernels,
)
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.frame_loop import FrameSearch, SearchState, search_together
from studio.search.trackers.settings import AnnealedSettings, TemperedSettings
from studio.search.trackers.tempered import TemperedFilter
from studio.search.trackers.tracker import AnyTracker, FilterState, LayerRecord, SearchSpace, start_of

SIZE, COUNT, LAYERS = 6, 20, 6
SPACE = dataclasses.replace(
    toy_space(SIZE, sigma=0.4),
    lower=np.array([-0.4, -0.6, -2.0, -2.0, -np.inf, -2.0]),
    upper=np.array([0.9, 0.5, 2.0, 2.0, np.inf, 2.0]),
    limb=np.array([0, 0, 1, 1, 1, 2]),
)
"""Two parameters have limits near where the search begins, one has none."""
STEEP = np.linspace(1.0, 8.0, SIZE)
START = np.array([0.35, -0.2, 0.1, 0.0, 3.0, -0.3])
CENTRE = np.array([0.8, -0.5, 0.4, 0.1, 3.4, 0.0])
SETTINGS = TemperedSettings(
    layers=LAYERS, particles=COUNT, crossover=0.4, limb_moves=0.4, likelihood_scale=2.0, diffusion_scale=1.0
)
SCENARIOS: dict[str, tuple[TemperedSettings, ...]] = {
    "the ladder ends before the layers": (SETTINGS,) * 2,
    "the last layer takes the rest": (dataclasses.replace(SETTINGS, likelihood_scale=60.0),) * 2,
    "without limits": (
        dataclasses.replace(SETTINGS, constraints="ignore", resampling="multinomial", crossover=0.0),
    )
    * 2,
    "with velocity": (dataclasses.replace(SETTINGS, dynamics="constant_velocity", survival=0.7),) * 3,
}
"""Settings of a run's frames."""
MOVED = (
    SETTINGS,
    SETTINGS,
    dataclasses.replace(SETTINGS, survival=0.8),
    dataclasses.replace(SETTINGS, survival=0.8),
    dataclasses.replace(SETTINGS, survival=0.8, constraints="ignore", likelihood_scale=4.0),
    dataclasses.replace(SETTINGS, survival=0.8, constraints="ignore", likelihood_scale=4.0, limb_moves=0.9),
)
"""Settings of a frame's layers, of which knobs are moved."""


def values_of(poses: np.ndarray) -> np.ndarray:
    """(N,) log-weights of poses (N, D): one maximum, partly beyond limits, whose parameters depend on each other."""
    away = poses - CENTRE
    return -(STEEP * away * away).sum(axis=1) - 4.0 * (away[:, 2] + away[:, 3]) ** 2


class ValuedDevice(NumpyDevice):
    """Weighs by `values_of` what lies on the device."""

    def bring(self, poses: np.ndarray, there: Any) -> None:  # noqa: ANN401
        there.copy_to_device(np.ascontiguousarray(poses.T.astype(np.float32)))

    def weigh(self, poses, problem, edges, every, found, stream, memory) -> None:
        values = values_of(poses.copy_to_host().T.astype(np.float64))
        found.copy_to_device(np.stack([np.zeros(len(values)), values]))


class ValuedProblem(Bowl):
    """The same weighing here and there. there : whether a device weighs."""

    def __init__(
        self, space: SearchSpace = SPACE, *, there: bool = True, device: ValuedDevice | None = None
    ) -> None:
        super().__init__(CENTRE)
        self.space, self.there, self.device = space, there, device or ValuedDevice()

    def on_device(self) -> Any:  # noqa: ANN401
        frame = SimpleNamespace(observed=[0], memory=0, scale=1.0)
        return SimpleNamespace(device=self.device, frame=frame, factors=(1.0,)) if self.there else None

    def give_up_device(self, error: Exception) -> None:
        raise error

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return values_of(poses)

    def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
        return ((self.space.lower <= poses) & (poses <= self.space.upper)).all(axis=1)


def tracked(
    settings: tuple[Any, ...],
    *,
    there: bool = True,
    space: SearchSpace = SPACE,
    start: FilterState | None = None,
    repeats: int = 1,
    tracker: AnyTracker | None = None,
) -> dict[str, Any]:
    """Frames of a run. settings : of each. there : whether a device does them."""
    problem, previous, records = ValuedProblem(space, there=there), start or start_of(tuple(START)), []
    for frame, of_frame in enumerate(settings):
        search = FrameSearch(
            tracker or TemperedFilter(), previous, space, seed=5, frame=frame, repeats=repeats
        )
        while not search.finished:
            records.append(search.step(problem, 0, of_frame))
        previous = search.result().carried
    return {"records": records, "carried": previous}


def layer_by_layer(there: tuple[bool, ...], *, resumed: bool = True) -> dict[str, Any]:
    """A frame whose knobs are moved. there : which layers a device does. resumed : whether each layer is done by a
    search that goes on from the last one's state.
    """
    state, records, sets, search, device = SearchState(), [], [], None, ValuedDevice()
    for on_device, settings in zip(there, MOVED, strict=True):
        if search is None or resumed:
            search = FrameSearch(
                TemperedFilter(), start_of(tuple(START)), SPACE, seed=5, frame=2, state=state
            )
        records.append(search.step(ValuedProblem(there=on_device, device=device), 0, settings))
        state = search.state
        sets.append(state.particles)
    return {"records": records, "sets": sets}


def together(runs: tuple[int, ...]) -> dict[int, list[LayerRecord]]:
    """Records of two frames of runs side by side, that differ by seed, σ0 and start."""
    problem, records = ValuedProblem(), list[LayerRecord]()
    spaces = {run: dataclasses.replace(SPACE, sigma=(1.0 + run) * SPACE.sigma) for run in runs}
    carried = [start_of(tuple(START + 0.01 * run)) for run in runs]
    for frame in range(2):
        searches = [
            FrameSearch(TemperedFilter(), last, spaces[run], seed=run, frame=frame)
            for run, last in zip(runs, carried, strict=True)
        ]
        done = search_together(searches, problem, lambda: (0, SETTINGS), records.append)
        carried = [result.carried for result in done]
    return {run: records[place :: len(runs)] for place, run in enumerate(runs)}


def fixed_space() -> SearchSpace:
    """One parameter has no room, at a number that single precision does not have."""
    return dataclasses.replace(
        SPACE,
        lower=np.where(np.arange(SIZE) == 3, 0.1, SPACE.lower),
        upper=np.where(np.arange(SIZE) == 3, 0.1, SPACE.upper),
    )


WITHOUT_ROOM: dict[str, dict[str, Any]] = {
    "tempered": {"settings": (SETTINGS,), "space": fixed_space()},
    "annealed": {
        "settings": (AnnealedSettings(layers=3, particles=8),),
        "space": fixed_space(),
        "tracker": AnnealedParticleFilter(),
    },
}


def weighed_there() -> dict[str, Any]:
    """A frame of a body that the device's own kernels weigh."""
    body, cameras, evidence, poses = scene_of("planar_arm4")
    one_view = type(evidence)(evidence.frame, evidence.views[:1])
    settings = EdgeRegionSilhouetteSettings(device="gpu", edge_samples=16, region_samples=16)
    problem = EdgeRegionSilhouetteLikelihood(body, cameras[:1], settings).problem(one_view)
    space = search_space(body, np.full(len(body.parameters), 0.1))
    search = FrameSearch(TemperedFilter(), start_of(tuple(poses[0])), space, seed=1, frame=0)
    records: list[LayerRecord] = []
    small = dataclasses.replace(SETTINGS, layers=3, particles=4, crossover=0.5)
    while not search.finished:
        records.append(search.step(problem, 0, small))
    return {"records": records, "estimate": search.result().estimate.pose}


def everything() -> dict[str, Any]:
    """What the tests read."""
    bounded = dataclasses.replace(SPACE, lower=np.full(SIZE, -1.0), upper=np.full(SIZE, 4.0))
    return {
        "scenarios": {name: tracked(settings) for name, settings in SCENARIOS.items()},
        "uniform": tracked((SETTINGS,), space=bounded, start=FilterState(None), repeats=2),
        "knobs moved": layer_by_layer((True,) * LAYERS, resumed=False),
        "resumed": layer_by_layer((True,) * LAYERS),
        "in turns": layer_by_layer((True, False, True, True, False, True)),
        "together": (together((0, 1)), together((0,)) | together((1,))),
        "without room": {name: tracked(**given) for name, given in WITHOUT_ROOM.items()},
        "weighed there": weighed_there(),
    }


if __name__ == "__main__":
    take_threads_in_turn()
    device_search_kernels.SUMMING = device_search.SUMMING = 2
    device_tempered_kernels.SUMMING = device_tempered.SUMMING = 2
    device_tempered_kernels.MIXING = device_tempered.MIXING = 2
    device_tempered_kernels.TOGETHER = device_tempered.TOGETHER = 3
    device_runs.THREADS = device_search.THREADS = device_tempered.THREADS = 8
    device_runs.record_launches = lambda launches, stream: None
    Path(sys.argv[1]).write_bytes(pickle.dumps(everything()))
