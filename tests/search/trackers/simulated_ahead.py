"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: searches on a device, in Numba's simulator of one, whose
knobs are moved between layers, and arrays that are sent to the host while others are made. Writes them to the file
named. Poses are weighed by NumPy.
"""

import dataclasses
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
import simulated_swarm as swarms
import simulated_tempered as made
from threads_in_turn import take_threads_in_turn

from studio.foundations.numba_on_devices import cuda
from studio.search.trackers import (
    device_runs,
    device_search,
    device_search_kernels,
    device_swarm,
    device_swarm_kernels,
)
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.device_runs import DeviceRuns
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.particle_swarm import ParticleSwarm
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import AnyTracker, SearchSpace, start_of

SLOW = AnnealedSettings(layers=5, particles=12, crossover=0.5)
FAST = dataclasses.replace(SLOW, survival=0.7, diffusion_fraction=0.3)
WIDE = dataclasses.replace(swarms.SETTINGS, c_first=2.6, constraints="ignore")
SCHEDULES: dict[str, tuple[Any, ...]] = {
    "annealed": (SLOW, FAST, FAST, SLOW, FAST),
    "swarm": (swarms.SETTINGS,) * 2 + (WIDE,) * 3 + (swarms.SETTINGS, WIDE),
}
"""Settings of each layer. With the seed below some of the swarm's particles are best beyond limits, just before these
are kept again.
"""


def search_of(name: str) -> tuple[FrameSearch, SearchSpace]:
    """A frame's search."""
    tracker: AnyTracker = AnnealedParticleFilter() if name == "annealed" else ParticleSwarm()
    space = made.SPACE if name == "annealed" else swarms.SPACE
    start = made.START if name == "annealed" else swarms.INSIDE
    return FrameSearch(tracker, start_of(tuple(start)), space, seed=29, frame=2), space


def with_moved_knobs(name: str, *, there: bool, looked_at: bool = False) -> dict[str, Any]:
    """Records of a frame, and sets after its layers where these are looked at."""
    search, space = search_of(name)
    problem = made.ValuedProblem(space, there=there) if name == "annealed" else swarms.ToyProblem(there=there)
    records, sets = [], []
    for settings in SCHEDULES[name]:
        records.append(search.step(problem, 0, settings))
        if looked_at:
            sets.append(search.state.particles)
    return {"records": records, "sets": sets, "last": search.result().carried.particles}


def stopped(name: str, after: int) -> dict[str, Any]:
    """The set that a frame has on the card after some layers, which was not looked at before; and its search there goes
    on from it by the processor.
    """
    search, space = search_of(name)
    made_there, made_here = (
        (made.ValuedProblem(space, there=there) if name == "annealed" else swarms.ToyProblem(there=there))
        for there in (True, False)
    )
    schedule = SCHEDULES[name]
    records = [search.step(made_there, 0, settings) for settings in schedule[:after]]
    assert search.on_device is not None
    assert search.on_device._ahead is not None, "the next layer has been launched"
    records += [search.step(made_here, 0, settings) for settings in schedule[after:]]
    return {"records": records}


def sent() -> list[np.ndarray]:
    """Three times what an array had when it was sent, read when two more had been."""
    device = swarms.NumpyDevice()
    runs = DeviceRuns(device, made.SPACE, 2)  # pyright: ignore[reportArgumentType]
    there = cuda.to_device(np.zeros((2, 3)))
    on_the_way, found = [], []
    for number in range(4):
        there.copy_to_device(np.full((2, 3), float(number)))
        on_the_way.append(runs._send({"numbers": there}))
        if number:
            found.append(on_the_way[number - 1].arrive()["numbers"])
    there.copy_to_device(np.full((2, 3), 9.0))
    return [*found, on_the_way[-1].arrive()["numbers"]]


def everything() -> dict[str, Any]:
    """What the tests read."""
    found: dict[str, Any] = {"sent": sent()}
    for name in SCHEDULES:
        found[name] = {
            "moved": with_moved_knobs(name, there=True),
            "looked at": with_moved_knobs(name, there=True, looked_at=True),
            "stopped": {after: stopped(name, after) for after in (1, 3)},
        }
    return found


if __name__ == "__main__":
    take_threads_in_turn()
    for module in (device_search_kernels, device_search, device_swarm_kernels, device_swarm):
        module.SUMMING = 2
    device_runs.THREADS = device_search.THREADS = device_swarm.THREADS = 8
    device_runs.record_launches = lambda launches, stream: None
    Path(sys.argv[1]).write_bytes(pickle.dumps(everything()))
