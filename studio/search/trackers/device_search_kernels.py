# pyright: standard
"""What a layer of a filter does with its particles, on a CUDA device, for many runs side by side.

R runs have N particles each; particle n of run r is column r N + n of poses (D, R N), single precision. Random numbers
are counted (`counted_numbers`): keys (R, 3) uint64 say each run's seed, frame and layer. Sums are made in a fixed
order, so a run repeats itself bit for bit on one card. Methods are those of `annealing`, `resampling`, `crossover` and
`diffusion`, whose equations they cite.
"""

import math

import numpy as np

from studio.foundations.numba_on_devices import cuda
from studio.search.trackers.counted_numbers import (
    OF_CUTS,
    OF_NOISE,
    OF_PARENTS,
    OF_RUN,
    as_normals,
    as_share,
    random_words,
)
from studio.search.trackers.layer_plan import WIDEST
from studio.search.trackers.particle_kernels import SMALLEST

SEED, FRAME, LAYER = 0, 1, 2
BETA, SURVIVAL, MOST, TOTAL, BEST = range(5)
ANNEALED = 5
"""Numbers of an annealed layer: β, the survival rate reached, the largest log-weight, the sum of what follows from the
others, and which particle weighs most."""
WANTED, KNOWN, UTMOST, CROSSED, KEPT, SCALE, OF_SAMPLE, CORRELATED, SIGMA = range(9)
"""Dials of a run in a layer: share that is to survive; β where that is given, else NaN; what it is at most; share of
children; how far particles stay from the mean when noise is added, what all noise is multiplied by, whether its
deviations are the sample's, and whether it is correlated; the first of the standard deviations σ (D,)."""
WEIGHED, WEIGHTED, SURVIVING, DIFFUSED, MOMENTS = 0, 2, 4, 6, 8
"""Rows of a layer's moments (8, R, D), each a mean and the variance in the row after it: of the set as it was weighed,
by its weights, of the survivors, of the next set."""
FITNESS, LOG_WEIGHT = 0, 1
"""Rows of a set's weights (2, R N)."""
NO_PARENT = -1
SUMMING = 512
"""Threads that sum up a run's particles: a power of two."""
NEWTON_STEPS, CLOSE = 60, 1e-7
FARTHEST = 40.0
BETA_LIMIT = 690.0


@cuda.jit(device=True)
def add_up(sums, rows, thread):
    """Add up the first rows of sums (K, SUMMING) over their columns, in a fixed order: column 0 has the sums then."""
    half = SUMMING >> 1
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            for k in range(rows):
                sums[k, thread] += sums[k, thread + half]
        half >>= 1
    cuda.syncthreads()


@cuda.jit(device=True)
def particle_at(cumulated, first, count, share):
    """The first of `count` particles from `first` on whose cumulated weight lies beyond a share (0...1) of all."""
    mark = share * cumulated[first + count - 1]
    low, high = np.int64(0), np.int64(count)
    while low < high:
        middle = (low + high) >> 1
        if cumulated[first + middle] <= mark:
            low = middle + 1
        else:
            high = middle
    return min(low, np.int64(count - 1))


@cuda.jit(device=True)
def weight_of(cumulated, first, n):
    """The weight of particle n of those from `first` on, by weights cumulated."""
    return cumulated[first + n] - (cumulated[first + n - 1] if n > 0 else 0.0)


@cuda.jit(device=True)
def fill_normals(seed, frame, layer, particle, size, normals):
    """Fill the first `size` of normals (WIDEST,) with a particle's independent normal numbers, four at a time."""
    for d in range(0, size, 4):
        a, b, c, e = random_words(seed, frame, layer, particle, OF_NOISE + d)
        one, two = as_normals(a, b)
        three, four = as_normals(c, e)
        normals[d] = one
        if d + 1 < size:
            normals[d + 1] = two
        if d + 2 < size:
            normals[d + 2] = three
        if d + 3 < size:
            normals[d + 3] = four


def anneal_weights(weights, count, dials, annealed, cumulated):
    """β with which a share WANTED of each run's particles survives (Eq. 3, 11, 12), at most UTMOST, or KNOWN where that
    is a number; the weights cumulated (R N,).

    weights : (2, R N). dials : (R, 8 + D). annealed : (R, 5). A block of SUMMING threads for each run.
    """
    run, thread = cuda.blockIdx.x, cuda.threadIdx.x
    first = run * count
    sums = cuda.shared.array((4, SUMMING), np.float64)
    numbers = cuda.shared.array(SUMMING, np.int64)
    most, best = -math.inf, np.int64(0)
    for n in range(thread, count, SUMMING):
        if weights[LOG_WEIGHT, first + n] > most:
            most, best = weights[LOG_WEIGHT, first + n], np.int64(n)
    sums[0, thread], numbers[thread] = most, best
    half = SUMMING >> 1
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            value, number = sums[0, thread + half], numbers[thread + half]
            if value > sums[0, thread] or (value == sums[0, thread] and number < numbers[thread]):
                sums[0, thread], numbers[thread] = value, number
        half >>= 1
    cuda.syncthreads()
    most, best = sums[0, 0], numbers[0]
    cuda.syncthreads()
    farthest, nearest, total, squares = 0.0, math.inf, 0.0, 0.0
    for n in range(thread, count, SUMMING):
        below = most - weights[LOG_WEIGHT, first + n]
        farthest = max(farthest, below)
        if below > 0.0:
            nearest = min(nearest, below)
        total += below
        squares += below * below
    sums[0, thread], sums[1, thread], sums[2, thread], sums[3, thread] = farthest, nearest, total, squares
    half = SUMMING >> 1
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            sums[0, thread] = max(sums[0, thread], sums[0, thread + half])
            sums[1, thread] = min(sums[1, thread], sums[1, thread + half])
            sums[2, thread] += sums[2, thread + half]
            sums[3, thread] += sums[3, thread + half]
        half >>= 1
    cuda.syncthreads()
    farthest, nearest, total, squares = sums[0, 0], sums[1, 0], sums[2, 0] / count, sums[3, 0] / count
    cuda.syncthreads()
    beta = dials[run, KNOWN]
    if not math.isfinite(beta):
        beta = 1.0
        if farthest > 0.0:
            low = max(math.log(SMALLEST) - math.log(farthest), -BETA_LIMIT)
            high = min(math.log(FARTHEST) - math.log(nearest), BETA_LIMIT)
            spread = math.sqrt(max(squares - total * total, 0.0))
            at = min(max(-math.log(max(spread, SMALLEST * farthest)), low), high)
            aim = math.log(dials[run, WANTED] * count)
            for _ in range(NEWTON_STEPS):
                beta = math.exp(at)
                mine, mine_squared, turned, turned_squared = 0.0, 0.0, 0.0, 0.0
                for n in range(thread, count, SUMMING):
                    below = most - weights[LOG_WEIGHT, first + n]
                    power = np.float64(math.exp(np.float32(-beta * below)))
                    square = power * power
                    mine += power
                    mine_squared += square
                    turned += below * power
                    turned_squared += below * square
                sums[0, thread], sums[1, thread] = mine, mine_squared
                sums[2, thread], sums[3, thread] = turned, turned_squared
                add_up(sums, 4, thread)
                excess = 2.0 * math.log(sums[0, 0]) - math.log(sums[1, 0]) - aim
                slope = 2.0 * beta * (sums[3, 0] / sums[1, 0] - sums[2, 0] / sums[0, 0])
                cuda.syncthreads()
                if abs(excess) < CLOSE:
                    break
                if excess > 0.0:
                    low = at
                else:
                    high = at
                if high - low < CLOSE:
                    break
                step = at - excess / slope if slope < 0.0 else math.inf
                at = step if low < step < high else 0.5 * (low + high)
        beta = min(beta, dials[run, UTMOST])
    own = (count + SUMMING - 1) // SUMMING
    begin, end = min(thread * own, count), min((thread + 1) * own, count)
    mine, mine_squared = 0.0, 0.0
    for n in range(begin, end):
        power = np.float64(math.exp(np.float32(-beta * (most - weights[LOG_WEIGHT, first + n]))))
        mine += power
        mine_squared += power * power
    sums[0, thread], sums[1, thread], sums[2, thread] = mine, mine_squared, mine
    add_up(sums, 2, thread)
    reach = 1
    while reach < SUMMING:
        cuda.syncthreads()
        before = sums[2, thread - reach] if thread >= reach else 0.0
        cuda.syncthreads()
        sums[2, thread] += before
        reach <<= 1
    cuda.syncthreads()
    running = sums[2, thread] - mine
    for n in range(begin, end):
        running += np.float64(math.exp(np.float32(-beta * (most - weights[LOG_WEIGHT, first + n]))))
        cumulated[first + n] = running
    if thread == 0:
        annealed[run, BETA] = beta
        annealed[run, SURVIVAL] = sums[0, 0] * sums[0, 0] / (sums[1, 0] * count)
        annealed[run, MOST], annealed[run, TOTAL], annealed[run, BEST] = most, sums[0, 0], best


def carry_over(last, before, cumulated, keys, how, systematic, shift, count, poses):
    """The particles that a frame starts from: all in turn (how 0, Eq. 9), drawn by weight (1) or the heaviest (2),
    moved by shift (R, D) (Eq. 10). last : (D, R M), of M = before particles a run. poses : (D, R N), to be filled.
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n = at - run * count
    first = run * before
    source = np.int64(n) * before // count
    if how == 1:
        own = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], n, OF_PARENTS)
        common = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], 0, OF_RUN)
        share = (n + as_share(common[0])) / count if systematic else as_share(own[0])
        source = particle_at(cumulated, first, before, share)
    elif how == 2:
        source = np.int64(0)
        heaviest = 0.0
        for k in range(before):
            weight = weight_of(cumulated, first, k)
            if weight > heaviest:
                heaviest, source = weight, np.int64(k)
    for d in range(poses.shape[0]):
        poses[d, at] = last[d, first + source] + shift[run, d]


def draw_survivors(poses, cumulated, keys, count, systematic, dials, place, survivors, parents):
    """Survivors drawn by weight with replacement (step 4), some of them children of two (Eq. 19).

    dials : (R, 8 + D). place : (D,) number of each parameter's limb, from 1. survivors : (D, R N) and
    parents (2, R N), to be filled.
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n, first = at - run * count, run * count
    common = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], 0, OF_RUN)
    own = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], n, OF_PARENTS)
    cuts = random_words(keys[run, SEED], keys[run, FRAME], keys[run, LAYER], n, OF_CUTS)
    parent = particle_at(
        cumulated, first, count, (n + as_share(common[0])) / count if systematic else as_share(own[0])
    )
    other = particle_at(cumulated, first, count, as_share(own[1]))
    low, high = np.int64(0), np.int64(0)
    if as_share(own[2]) < dials[run, CROSSED]:
        limbs = place[place.shape[0] - 1]
        one, two = 1 + np.int64(as_share(cuts[0]) * limbs), 1 + np.int64(as_share(cuts[1]) * limbs)
        low, high = min(one, two), max(one, two)
    used = NO_PARENT
    for d in range(poses.shape[0]):
        if low < place[d] <= high:
            survivors[d, at] = poses[d, first + other]
            used = other
        else:
            survivors[d, at] = poses[d, first + parent]
    parents[0, at], parents[1, at] = parent, used


def find_moments(poses, count, row, moments):
    """Mean and variance of poses (D, R N), rows `row` and the next of moments (8, R, D): a block of SUMMING threads for
    each parameter and run. Sums are of what lies beyond the first particle, so that squares stay small.
    """
    parameter, run, thread = cuda.blockIdx.x, cuda.blockIdx.y, cuda.threadIdx.x
    first = run * count
    sums = cuda.shared.array((2, SUMMING), np.float64)
    start = np.float64(poses[parameter, first])
    own, squares = 0.0, 0.0
    for n in range(thread, count, SUMMING):
        away = np.float64(poses[parameter, first + n]) - start
        own += away
        squares += away * away
    sums[0, thread], sums[1, thread] = own, squares
    add_up(sums, 2, thread)
    if thread == 0:
        middle = sums[0, 0] / count
        moments[row, run, parameter] = start + middle
        moments[row + 1, run, parameter] = max(sums[1, 0] / count - middle * middle, 0.0)


def find_weighted_moments(poses, cumulated, count, moments):
    """Weighted mean (Eq. 1, 8) and variance of poses (D, R N), by weights cumulated (R N,); as `find_moments`."""
    parameter, run, thread = cuda.blockIdx.x, cuda.blockIdx.y, cuda.threadIdx.x
    first = run * count
    sums = cuda.shared.array((2, SUMMING), np.float64)
    start, total = np.float64(poses[parameter, first]), cumulated[first + count - 1]
    own, squares = 0.0, 0.0
    for n in range(thread, count, SUMMING):
        away = np.float64(poses[parameter, first + n]) - start
        weight = weight_of(cumulated, first, n)
        own += weight * away
        squares += weight * away * away
    sums[0, thread], sums[1, thread] = own, squares
    add_up(sums, 2, thread)
    if thread == 0:
        middle = sums[0, 0] / total
        moments[WEIGHTED, run, parameter] = start + middle
        moments[WEIGHTED + 1, run, parameter] = max(sums[1, 0] / total - middle * middle, 0.0)


def find_correlations(poses, count, moments, correlations):
    """Correlations (R, D, D) of survivors (D, R N) by their moments: a block for each pair of parameters (x >= y) and
    run.
    """
    one, other, run = cuda.blockIdx.x, cuda.blockIdx.y, cuda.blockIdx.z
    if one < other:
        return
    thread, first = cuda.threadIdx.x, run * count
    sums = cuda.shared.array((1, SUMMING), np.float64)
    own = 0.0
    for n in range(thread, count, SUMMING):
        away = np.float64(poses[one, first + n]) - moments[SURVIVING, run, one]
        own += away * (np.float64(poses[other, first + n]) - moments[SURVIVING, run, other])
    sums[0, thread] = own
    add_up(sums, 1, thread)
    if thread == 0:
        both = math.sqrt(moments[SURVIVING + 1, run, one] * moments[SURVIVING + 1, run, other])
        correlations[run, one, other] = sums[0, 0] / (count * both) if both > 0.0 else 0.0


def find_root(correlations):
    """Each run's correlations (R, D, D), lower half, by their Cholesky root: a thread for each run. A direction that is
    a sum of others, or does not vary, has no noise of its own.
    """
    run = cuda.grid(1)
    if run >= correlations.shape[0]:
        return
    for j in range(correlations.shape[1]):
        left = correlations[run, j, j]
        for k in range(j):
            left -= correlations[run, j, k] * correlations[run, j, k]
        pivot = math.sqrt(left) if left > SMALLEST else 0.0
        correlations[run, j, j] = pivot
        for i in range(j + 1, correlations.shape[1]):
            value = correlations[run, i, j]
            for k in range(j):
                value -= correlations[run, i, k] * correlations[run, j, k]
            correlations[run, i, j] = value / pivot if pivot > 0.0 else 0.0


def spread(centres, moments, root, dials, keys, limits, count, poses):
    """Centres (D, R N) with noise, set on the limits where these are passed (Eq. 7, 9, 13, 18).

    moments : (8, R, D), of which the survivors' are read. root : (R, D, D), see `find_root`. dials : (R, 8 + D).
    limits : (2, D). poses : filled.
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n = at - run * count
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    kept, scale = dials[run, KEPT], dials[run, SCALE]
    of_sample, correlated = dials[run, OF_SAMPLE] > 0.0, dials[run, CORRELATED] > 0.0
    normals = cuda.local.array(WIDEST, np.float32)
    size = poses.shape[0]
    fill_normals(seed, frame, layer, n, size, normals)
    for d in range(size):
        value = normals[d]
        if correlated:
            value = np.float32(0.0)
            for k in range(d + 1):
                value += np.float32(root[run, d, k]) * normals[k]
        deviation = math.sqrt(moments[SURVIVING + 1, run, d]) if of_sample else dials[run, SIGMA + d]
        drawn = np.float64(centres[d, at])
        if kept < 1.0:
            middle = moments[SURVIVING, run, d]
            drawn = middle + kept * (drawn - middle)
        drawn += scale * deviation * value
        poses[d, at] = np.float32(min(max(drawn, limits[0, d]), limits[1, d]))


def take_rows(poses, weights, annealed, count, step, found, values):
    """Every step-th particle of each run, then its heaviest: poses (R, K, D) and what they weigh (2, R, K), for the
    host.
    """
    here = cuda.grid(1)
    rows = found.shape[1]
    if here >= found.shape[0] * rows:
        return
    run = here // rows
    row = here - run * rows
    number = np.int64(row) * step
    if row == rows - 1:
        number = np.int64(annealed[run, BEST])
    at = run * count + number
    for d in range(found.shape[2]):
        found[run, row, d] = poses[d, at]
    values[FITNESS, run, row], values[LOG_WEIGHT, run, row] = weights[FITNESS, at], weights[LOG_WEIGHT, at]
