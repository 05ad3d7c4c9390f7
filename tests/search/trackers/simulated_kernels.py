"""Run with NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1: what single kernels of filters and swarms make of small
arrays, in Numba's simulator of a card. Writes it to the file named.
"""

import math
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np
from threads_in_turn import take_threads_in_turn

from studio.foundations.numba_on_devices import cuda
from studio.search.trackers import device_search_kernels, device_swarm_kernels

THREADS = 4
"""Of a block that sums up; sets have more particles than that, and fewer, and none as many."""
RUNS = 2
KEYS = np.array([[3, 7, 2], [1 << 40, 8, 5]], dtype=np.uint64)
"""Seed, frame and layer of each run."""
DIALS = 8
"""Numbers of a run's dials before its standard deviations."""
rng = np.random.default_rng(0)

ANNEALED: dict[str, tuple[list[list[float]], list[list[float]]]] = {
    "two particles": ([[0.0, -3.0], [-5.0, -5.5]], [[0.9, math.nan, math.inf]] * 2),
    "given, and at most": (
        [[-2.0, -1.0, -1.0, -4.0, -9.0, -1.0, -30.0], [-5.0, -4.0, -3.0, -1.0, -3.0, -4.0, -1.0]],
        [[0.3, 0.5, 0.2], [0.2, math.nan, 0.25]],
    ),
    "equal": ([[-4.0] * 3, [2.0] * 3], [[0.3, math.nan, math.inf], [0.3, math.nan, 0.5]]),
    "narrow and wide": (
        [(1e-3 * rng.normal(size=65) - 4.0).tolist(), (1e3 * rng.normal(size=65)).tolist()],
        [[0.3, math.nan, math.inf], [0.05, math.nan, math.inf]],
    ),
}
"""Log-weights of each run's particles; share that is to survive, β where it is given, and what it is at most."""

COUNT, SIZE = 7, 5
POSES = (1000.0 + rng.normal(size=(SIZE, RUNS * COUNT))).astype(np.float32)
SHARES = np.array([0.0, 3.0, 0.0, 1.0, 2.0, 0.0, 4.0, 1.0, 1.0, 0.0, 5.0, 0.0, 0.0, 0.0])
"""Weights of both runs' particles, some of which weigh nothing."""
CUMULATED = np.cumsum(SHARES.reshape(RUNS, COUNT), axis=1).ravel()
DEPENDENT = rng.integers(-9, 9, (4, RUNS * COUNT)).astype(np.float32)
DEPENDENT[2], DEPENDENT[3] = DEPENDENT[0] + DEPENDENT[1], 3.0
"""Poses of which one parameter is the sum of two others and one is the same in all."""
PLACE = np.array([1, 1, 2, 2, 3])
CROSSED = (1.0, 0.0)

BEFORE, AFTER = 3, 5
LAST = rng.normal(size=(2, RUNS * BEFORE)).astype(np.float32)
LAST_CUMULATED = np.array([1.0, 1.0, 4.0, 2.0, 5.0, 5.5])
SHIFT = np.array([[10.0, 20.0], [-10.0, -20.0]])

SPREAD_COUNT, SPREAD_SIZE = 3, 6
CENTRES = rng.normal(size=(SPREAD_SIZE, RUNS * SPREAD_COUNT)).astype(np.float32)
MOMENTS = rng.uniform(0.5, 2.0, (8, RUNS, SPREAD_SIZE))
ROOT = np.tril(rng.uniform(0.2, 1.0, (RUNS, SPREAD_SIZE, SPREAD_SIZE)))
LIMITS = np.array([[-0.1] + [-np.inf] * 5, [np.inf] * 5 + [0.1]])
SIGMA = rng.uniform(0.5, 2.0, (RUNS, SPREAD_SIZE))
SPREADS = {
    "of the sample": (0.8, 0.6, 1.0, 1.0),
    "of its own": (1.0, 0.7, 0.0, 0.0),
    "about the mean": (0.25, 1.5, 0.0, 1.0),
}
"""How far particles stay from the mean, factor of all noise, whether deviations are the sample's, and whether noise is
correlated."""

FLYING, FLIGHT = 6, 3
PLACES = rng.normal(size=(FLIGHT, RUNS * FLYING)).astype(np.float32)
VELOCITIES = rng.normal(size=(FLIGHT, RUNS * FLYING)).astype(np.float32)
FREE = np.array([[-np.inf] * FLIGHT, [np.inf] * FLIGHT])
CLOSED = np.array([[-0.5, -np.inf, -1.0], [0.5, 0.3, np.inf]])
WIDE = 10.0
OUTSIDE = np.tile(np.float32([2.0, 0.0, 0.0])[:, None], RUNS * FLYING)
OUTSIDE[0, FLYING + 4] = 0.25
"""All of the first run lie beyond a limit, all but one of the second."""
BOX = np.array([[-1.0, -9.0, -9.0], [1.0, 9.0, 9.0]])
AWAY = np.full((FLIGHT, RUNS * FLYING), 4.0, np.float32)

VALUES = np.array([[9.0, 1.0, 5.0, 5.0, 2.0, 5.0], [-7.0, -3.0, -3.0, -np.inf, -8.0, -4.0]])
"""What both runs' particles weigh; the first of the first run lies beyond a limit, all of the second do."""
REACHED = np.array([[9.5, 0.5, 5.0, 6.0, 2.5, 4.0], [-6.0, -9.0, -3.0, -20.0, -1.0, -4.0]])
REACHED_POSSIBLE = np.array([[0.0, 1.0, 1.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
STANDING = np.array([[4.5, 1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0, 0.0]])


def launched(kernel: Any, grid: Any, threads: int, *arrays: Any) -> None:  # noqa: ANN401
    cuda.jit(kernel)[grid, threads](*arrays)


def dials_of(rows: list[list[float]], first: int, size: int) -> np.ndarray:
    """Dials (R, 8 + D) that have some numbers from `first` on."""
    dials = np.zeros((RUNS, DIALS + size))
    dials[:, first : first + len(rows[0])] = rows
    return dials


def annealed(name: str) -> dict[str, np.ndarray]:
    logs, rules = ANNEALED[name]
    weights = np.stack([np.full(np.size(logs), np.nan), np.ravel(logs)])
    found, cumulated = np.zeros((RUNS, 5)), np.zeros(np.size(logs))
    launched(
        device_search_kernels.anneal_weights, RUNS, THREADS, weights, len(logs[0]), dials_of(rules, 0, 2),
        found, cumulated,
    )  # fmt: skip
    return {"annealed": found, "cumulated": cumulated}


def moments() -> np.ndarray:
    found = np.full((8, RUNS, SIZE), np.nan)
    launched(device_search_kernels.find_moments, (SIZE, RUNS), THREADS, POSES, COUNT, 4, found)
    launched(
        device_search_kernels.find_weighted_moments, (SIZE, RUNS), THREADS, POSES, CUMULATED, COUNT, found
    )
    return found


def correlations() -> tuple[np.ndarray, np.ndarray]:
    size = len(DEPENDENT)
    of_set, found = np.zeros((8, RUNS, size)), np.zeros((RUNS, size, size))
    launched(device_search_kernels.find_moments, (size, RUNS), THREADS, DEPENDENT, COUNT, 4, of_set)
    launched(
        device_search_kernels.find_correlations, (size, size, RUNS), THREADS, DEPENDENT, COUNT, of_set, found
    )
    lower = found.copy()
    launched(device_search_kernels.find_root, 1, 3, found)
    return lower, found


def survivors(systematic: bool) -> tuple[np.ndarray, np.ndarray]:
    drawn, parents = np.zeros_like(POSES), np.zeros((2, RUNS * COUNT), np.int32)
    dials = dials_of([[share] for share in CROSSED], 3, SIZE)
    launched(
        device_search_kernels.draw_survivors, 3, 5, POSES, CUMULATED, KEYS, COUNT, systematic, dials, PLACE,
        drawn, parents,
    )  # fmt: skip
    return drawn, parents


def carried(how: int, systematic: bool) -> np.ndarray:
    poses = np.zeros((2, RUNS * AFTER), np.float32)
    launched(
        device_search_kernels.carry_over, 4, 3, LAST, BEFORE, LAST_CUMULATED, KEYS, how, systematic, SHIFT,
        AFTER, poses,
    )  # fmt: skip
    return poses


def spread(name: str) -> np.ndarray:
    dials = dials_of([list(SPREADS[name])] * RUNS, 4, SPREAD_SIZE)
    dials[:, DIALS:] = SIGMA
    poses = np.zeros_like(CENTRES)
    launched(
        device_search_kernels.spread, 2, 4, CENTRES, MOMENTS, ROOT, dials, KEYS, LIMITS, SPREAD_COUNT, poses
    )
    return poses


def rows() -> tuple[np.ndarray, np.ndarray]:
    found, values = np.zeros((RUNS, 4, SIZE)), np.zeros((2, RUNS, 4))
    weights, best = np.stack([SHARES, 100.0 + SHARES]), np.zeros((RUNS, 5))
    best[:, 4] = 5, 1
    launched(device_search_kernels.take_rows, 2, 5, POSES, weights, best, COUNT, 3, found, values)
    return found, values


def flown(
    pull: float,
    shrink: float,
    sigma: float,
    limits: np.ndarray,
    *,
    at_best: bool = False,
    redrawn: bool = False,
    places: np.ndarray = PLACES,
    velocities: np.ndarray = VELOCITIES,
) -> tuple[np.ndarray, np.ndarray]:
    """Places and velocities a step on. at_best : whether each particle's best place is its own, as the leader's is."""
    dials = np.zeros((RUNS, 3 + FLIGHT))
    dials[:, 0], dials[:, 1], dials[:, 3:] = pull, shrink, sigma
    given = np.tile(places[:, :1], RUNS * FLYING) if at_best else places
    bests = given.copy() if at_best else AWAY.copy()
    leaders = np.repeat(given[:, :1], RUNS, axis=1) if at_best else AWAY[:, :RUNS].copy()
    after, moved = np.zeros_like(given), np.zeros_like(given)
    launched(
        device_swarm_kernels.step_swarm, RUNS, THREADS, given, velocities, bests, leaders, dials, KEYS, limits,
        False, redrawn, FLYING, after, moved,
    )  # fmt: skip
    return after, moved


def bests() -> dict[str, np.ndarray]:
    places = np.arange(FLIGHT * RUNS * FLYING, dtype=np.float32).reshape(FLIGHT, -1)
    places[1, 0], places[1, FLYING:] = -1.0, 1e6
    limits = np.array([[-np.inf, 0.0, -np.inf], [np.inf, 1e5, np.inf]])
    found = {
        "places": places,
        "bests": np.full_like(places, -5.0),
        "reached": np.stack([REACHED.ravel(), REACHED_POSSIBLE.ravel()]),
        "leaders": np.full((FLIGHT, RUNS), -6.0, np.float32),
        "standing": STANDING.copy(),
    }
    weights = np.stack([np.full(RUNS * FLYING, np.nan), VALUES.ravel()])
    launched(
        device_swarm_kernels.find_bests, RUNS, THREADS, places, weights, 1, limits, FLYING, found["bests"],
        found["reached"], found["leaders"], found["standing"],
    )  # fmt: skip
    return found


def everything() -> dict[str, Any]:
    """What the tests read."""
    return {
        "annealed": {name: annealed(name) for name in ANNEALED},
        "moments": moments(),
        "correlations": correlations(),
        "survivors": {systematic: survivors(systematic) for systematic in (True, False)},
        "carried": {
            (how, systematic): carried(how, systematic) for how in range(3) for systematic in (True, False)
        },
        "spread": {name: spread(name) for name in SPREADS},
        "rows": rows(),
        "flown": {
            "freely": flown(0.0, 1.0, WIDE, FREE),
            "slowed": flown(0.0, 0.25, WIDE, FREE),
            "fast": flown(0.0, 1.0, 0.1, FREE),
            "against limits": flown(0.0, 1.0, WIDE, CLOSED),
            "about the best": flown(2.05, 0.7298437881283576, WIDE, FREE, at_best=True),
            "pulled": flown(1.5, 0.5, 100.0, FREE, velocities=np.zeros_like(VELOCITIES)),
            "beyond": flown(0.0, 1.0, WIDE, BOX, redrawn=True, places=OUTSIDE, velocities=np.abs(VELOCITIES)),
        },
        "bests": bests(),
    }


if __name__ == "__main__":
    take_threads_in_turn()
    device_search_kernels.SUMMING = device_swarm_kernels.SUMMING = THREADS
    Path(sys.argv[1]).write_bytes(pickle.dumps(everything()))
