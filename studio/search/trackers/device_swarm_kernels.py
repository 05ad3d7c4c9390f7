# pyright: standard
"""What an iteration of a swarm does with its particles, on a CUDA device, for many runs side by side.

As in `device_search_kernels`, R runs have N particles each, particle n of run r is column r N + n of places and
velocities (D, R N), single precision, and random numbers are counted. p_i are bests (D, R N) with reached (2, R N),
rows VALUE and POSSIBLE; p_g are leaders (D, R) with standing (R, 5), columns VALUE, POSSIBLE and, of the last weighing,
MOST, its best value, and BEST, the particle that has it. Symbols and equations are those of `particle_swarm`.
"""

import math

import numpy as np

from studio.foundations.numba_on_devices import cuda
from studio.search.trackers.constraints import MOST_REDRAWS
from studio.search.trackers.counted_numbers import (
    OF_TRIES,
    OF_TRY,
    OF_VELOCITIES,
    as_normals,
    as_share,
    random_words,
)
from studio.search.trackers.device_search_kernels import BEST, FRAME, LAYER, MOST, SEED, SUMMING

VALUE, POSSIBLE = 0, 1
STANDING = 5
"""Numbers of a run; column 3 is not used, so that MOST and BEST are those of `device_search_kernels`."""
PULL, SHRINK, MOVING, SIGMA = range(4)
"""Dials of a run (R, 3 + D): c = c1 = c2, χ, whether a sampled swarm has velocities, the first of the σ (D,)."""
NOBODY = -1.0


@cuda.jit(device=True)
def outranks(possible, value, other_possible, other_value):
    """Whether a pose is better than another: a possible one always is than an impossible one."""
    return possible > other_possible or (possible == other_possible and value > other_value)


@cuda.jit(device=True)
def is_kept(poses, at, limits):
    """Whether pose `at` of poses (D, R N) lies within its limits (2, D)."""
    kept = True
    for d in range(poses.shape[0]):
        kept = kept and limits[0, d] <= poses[d, at] <= limits[1, d]
    return kept


def find_bests(places, weights, row, limits, count, bests, reached, leaders, standing):
    """p_i and p_g after a weighing, whose values are a row of weights (2, R N). A value equal to the best so far does
    not replace it; of equal ones the first particle's is taken. A block of SUMMING threads for each run.
    """
    run, thread = cuda.blockIdx.x, cuda.threadIdx.x
    first = run * count
    possible = cuda.shared.array((2, SUMMING), np.float64)
    values = cuda.shared.array((2, SUMMING), np.float64)
    numbers = cuda.shared.array((2, SUMMING), np.int64)
    for k in range(2):
        possible[k, thread], values[k, thread], numbers[k, thread] = NOBODY, -math.inf, count
    for n in range(thread, count, SUMMING):
        at = first + n
        value, kept = weights[row, at], 0.0
        if is_kept(places, at, limits):
            kept = 1.0
        if outranks(kept, value, reached[POSSIBLE, at], reached[VALUE, at]):
            reached[POSSIBLE, at], reached[VALUE, at] = kept, value
            for d in range(places.shape[0]):
                bests[d, at] = places[d, at]
        if outranks(reached[POSSIBLE, at], reached[VALUE, at], possible[0, thread], values[0, thread]):
            possible[0, thread], values[0, thread] = reached[POSSIBLE, at], reached[VALUE, at]
            numbers[0, thread] = n
        if outranks(kept, value, possible[1, thread], values[1, thread]):
            possible[1, thread], values[1, thread], numbers[1, thread] = kept, value, n
    half = SUMMING >> 1
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            for k in range(2):
                held, value, number = (
                    possible[k, thread + half],
                    values[k, thread + half],
                    numbers[k, thread + half],
                )
                equal = held == possible[k, thread] and value == values[k, thread]
                before = equal and number < numbers[k, thread]
                if before or outranks(held, value, possible[k, thread], values[k, thread]):
                    possible[k, thread], values[k, thread], numbers[k, thread] = held, value, number
        half >>= 1
    cuda.syncthreads()
    better = outranks(possible[0, 0], values[0, 0], standing[run, POSSIBLE], standing[run, VALUE])
    cuda.syncthreads()
    if better:
        for d in range(thread, places.shape[0], SUMMING):
            leaders[d, run] = bests[d, first + numbers[0, 0]]
    if thread == 0:
        if better:
            standing[run, POSSIBLE], standing[run, VALUE] = possible[0, 0], values[0, 0]
        standing[run, MOST], standing[run, BEST] = values[1, 0], numbers[1, 0]


def line_up(leaders, dials, keys, count, places, velocities, reached, starts, standing):
    """A stage's swarm before it is sampled: all at x̂, which are the leaders (D, R), with v ← U(-σ, σ) or zero; nothing
    reached. starts : (D, R) x̂, filled.
    """
    at = cuda.grid(1)
    if at >= places.shape[1]:
        return
    run = at // count
    n = at - run * count
    for d in range(0, places.shape[0], 4):
        words = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], n, OF_VELOCITIES + d)
        for k in range(4):
            if d + k < places.shape[0]:
                places[d + k, at] = leaders[d + k, run]
                drawn = dials[run, MOVING] * (2.0 * as_share(words[k]) - 1.0) * dials[run, SIGMA + d + k]
                velocities[d + k, at] = np.float32(drawn)
                if n == 0:
                    starts[d + k, run] = leaders[d + k, run]
    reached[VALUE, at], reached[POSSIBLE, at] = -math.inf, 0.0
    if n == 0:
        standing[run, VALUE], standing[run, POSSIBLE] = -math.inf, 0.0


def step_swarm(
    places,
    velocities,
    bests,
    leaders,
    dials,
    keys,
    limits,
    sampled,
    redrawn,
    count,
    new_places,
    new_velocities,
):
    """The swarm one step further, or sampled: x ← N(x, Σ), v as it is, which is all that the bests are then.

    A step is v ← χ (v + c ε1 (p_i - x) + c ε2 (p_g - x)), limited to 2 σ, and x ← x + v. What passes a limit is set on
    it, its velocity zero; or, where steps are redrawn, the particle's step is drawn again, and after MOST_REDRAWS it
    stays where it was without velocity. Where all would stay and none of them is possible, the first steps are taken. A
    block of SUMMING threads for each run.
    """
    run, thread = cuda.blockIdx.x, cuda.threadIdx.x
    first, size = run * count, places.shape[0]
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    stranded = cuda.shared.array(SUMMING, np.int64)
    tries = 1 + MOST_REDRAWS if redrawn else 1
    for turn in range(2):
        own = np.int64(0)
        for n in range(thread, count, SUMMING):
            at = first + n
            kept, attempt = False, 0
            while attempt < tries and not kept:
                kept = True
                for d in range(0, size, 2):
                    words = random_words(seed, frame, layer, n, OF_TRIES + OF_TRY * attempt + d)
                    normals = as_normals(words[0], words[1])
                    for k in range(2):
                        if d + k < size:
                            sigma, x = dials[run, SIGMA + d + k], np.float64(places[d + k, at])
                            speed = np.float64(velocities[d + k, at])
                            away = sigma * normals[k]
                            if not sampled:
                                one, other = as_share(words[2 * k]), as_share(words[2 * k + 1])
                                own_pull = dials[run, PULL] * one * (np.float64(bests[d + k, at]) - x)
                                pull = dials[run, PULL] * other * (np.float64(leaders[d + k, run]) - x)
                                speed = dials[run, SHRINK] * (speed + own_pull + pull)
                                speed = min(max(speed, -2.0 * sigma), 2.0 * sigma)
                                away = speed
                            place = np.float32(x + away)
                            low, high = limits[0, d + k], limits[1, d + k]
                            if redrawn:
                                kept = kept and low <= place <= high
                            elif not low <= place <= high:
                                place, speed = np.float32(min(max(np.float64(place), low), high)), 0.0
                            new_places[d + k, at], new_velocities[d + k, at] = place, np.float32(speed)
                attempt += 1
            if turn == 0 and not kept:
                for d in range(size):
                    new_places[d, at], new_velocities[d, at] = places[d, at], np.float32(0.0)
                if not is_kept(places, at, limits):
                    own += 1
            if sampled:
                for d in range(size):
                    bests[d, at] = new_places[d, at]
        stranded[thread] = own
        half = SUMMING >> 1
        while half > 0:
            cuda.syncthreads()
            if thread < half:
                stranded[thread] += stranded[thread + half]
            half >>= 1
        cuda.syncthreads()
        all_stranded = stranded[0] == count
        cuda.syncthreads()
        if not all_stranded:
            break
        tries = 1
