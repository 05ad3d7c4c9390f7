# pyright: standard
"""What a layer of tempered sequential Monte Carlo does with its particles, on a CUDA device, for many runs side by
side.

As in `device_search_kernels`, R runs have N particles each, particle n of run r is column r N + n of poses (D, R N),
single precision, and random numbers are counted. The prior of run r is a mixture of K Gaussians about columns r K + k
of centres (D, R K), with shares (R K,): logs of what each counts; none (K = 0) is the uniform density. widths (R, D)
are its standard deviations, 0 of a parameter that has no room. Symbols and equations are those of `tempered` and
`frame_prior`.

Of a move that is proposed it is known what it is (kinds, int32), with which particle of its run limbs are exchanged
(partners, int32, else the particle itself), and how much likelier the move is than the one back (back, logs).
"""

import math

import numpy as np

from studio.foundations.numba_in_threads import EXACT_INLINED, njit
from studio.foundations.numba_on_devices import cuda
from studio.search.trackers.counted_numbers import (
    OF_CUTS,
    OF_KINDS,
    OF_MOVES,
    OF_NOISE,
    OF_PARENTS,
    OF_RUN,
    as_share,
    random_words,
)
from studio.search.trackers.device_search_kernels import (
    BETA,
    FITNESS,
    FRAME,
    KNOWN,
    LAYER,
    LOG_WEIGHT,
    MOST,
    NO_PARENT,
    SEED,
    SUMMING,
    TOTAL,
    UTMOST,
    WANTED,
    WEIGHTED,
    add_up,
    fill_normals,
    particle_at,
    weight_of,
)
from studio.search.trackers.layer_plan import WIDEST

WHOLE, ONE_LIMB, EXCHANGE = 0, 1, 2
"""Kinds of moves."""
TEMPER, EVIDENCE, STEP, WALK, WEIGHED_AT, TAKEN, ALPHA = range(7)
RUNGS = 7
"""Numbers of a run's ladder: t that the layer's weights lead to, log evidence of it, s, width of a limb's walk; t of
the set that was weighed, the share of its moves that were taken, and the share that was to survive, NaN where the
ladder's end decided."""
LONGEST, LIMB_MOVES, PAIRED, AT_END = range(4)
"""Rules of a layer (4,): T; share of moves that step one limb; particles that exchange limbs, an even number; whether
it is a frame's last."""
FIRST_STEP, WIDEST_WALK = 0.5, 2.38
BEST_SHARE, LEAST_CHANGE, MOST_CHANGE = 0.25, 0.5, 2.0
"""As in `tempered`."""
MIXING = 128
"""Threads that sum up a prior's Gaussians for some poses: a power of two."""
TOGETHER = 8
"""Poses whose Gaussians a block sums up, so that each centre is loaded once for all."""
NOTHING = 45.0
"""A log this far below the largest adds nothing to their sum."""
ROOT_HALF, LEAST_SHARE, MOST_OF_ONE = math.sqrt(0.5), 1e-300, 1.0 - 2.0**-53
MIDDLE = (
    (
        *(2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4, 4.5921953931549871457e4),
        *(1.3731693765509461125e4, 1.9715909503065514427e3, 1.3314166789178437745e2, 3.3871328727963666080),
    ),
    (
        *(5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4, 2.1213794301586595867e4),
        *(5.3941960214247511077e3, 6.8718700749205790830e2, 4.2313330701600911252e1, 1.0),
    ),
)
TAIL = (
    (
        *(7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1),
        *(1.27045825245236838258, 3.64784832476320460504, 5.76949722146069140550),
        *(4.63033784615654529590, 1.42343711074968357734),
    ),
    (
        *(1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2),
        *(1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940),
        *(2.05319162663775882187, 1.0),
    ),
)
FAR_TAIL = (
    (
        *(2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3),
        *(2.65321895265761230930e-2, 2.96560571828504891230e-1, 1.78482653991729133580),
        *(5.46378491116411436990, 6.65790464350110377720),
    ),
    (
        *(2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5),
        *(7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1),
        *(5.99832206555887937690e-1, 1.0),
    ),
)
"""Numerators and denominators of `normal_at`, highest powers first."""


@njit(**EXACT_INLINED)
def quotient(series, x):
    """A numerator over a denominator, both series of powers of x."""
    above, below = 0.0, 0.0
    for k in range(8):
        above = above * x + series[0][k]
        below = below * x + series[1][k]
    return above / below


@njit(**EXACT_INLINED)
def share_below(x):
    """The share of normal numbers below x."""
    return 0.5 * math.erfc(-x * ROOT_HALF)


@njit(**EXACT_INLINED)
def normal_at(share):
    """The number below which a share of normal numbers lies (Wichura 1988, algorithm AS 241), to sixteen digits."""
    share = min(max(share, LEAST_SHARE), MOST_OF_ONE)
    away = share - 0.5
    if abs(away) <= 0.425:
        return away * quotient(MIDDLE, 0.180625 - away * away)
    length = math.sqrt(-math.log(min(share, 1.0 - share)))
    value = quotient(TAIL, length - 1.6) if length <= 5.0 else quotient(FAR_TAIL, length - 5.0)
    return value if away > 0.0 else -value


def share_centres(centres, before, log_weights, widths, edges, shares):
    """What each Gaussian of a prior counts: its weight over the share of it that lies within the limits, in logs.

    log_weights, shares : (R K,), K = before. edges : (2, D) limits.
    """
    at = cuda.grid(1)
    if at >= centres.shape[1]:
        return
    run = at // before
    share = log_weights[at]
    for d in range(centres.shape[0]):
        width = widths[run, d]
        if width > 0.0:
            centre = np.float64(centres[d, at])
            low = share_below((edges[0, d] - centre) / width)
            share -= math.log(share_below((edges[1, d] - centre) / width) - low)
    shares[at] = share


def draw_prior(centres, before, cumulated, widths, edges, limits, keys, count, poses):
    """Poses (D, R N) drawn from a prior (`FramePrior.draw`). cumulated : (R K,) weights. edges : (2, D) limits.
    limits : (2, D) the same in single precision.
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n = at - run * count
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    own = random_words(seed, frame, layer, n, OF_PARENTS)
    source = run * before + particle_at(cumulated, run * before, before, as_share(own[0]))
    for d in range(0, poses.shape[0], 4):
        words = random_words(seed, frame, layer, n, OF_NOISE + d)
        for k in range(4):
            if d + k < poses.shape[0]:
                width, value = widths[run, d + k], np.float64(centres[d + k, source])
                if width > 0.0:
                    low = share_below((edges[0, d + k] - value) / width)
                    high = share_below((edges[1, d + k] - value) / width)
                    value += width * normal_at(low + as_share(words[k]) * (high - low))
                poses[d + k, at] = np.float32(min(max(value, limits[0, d + k]), limits[1, d + k]))


def find_densities(poses, centres, before, shares, widths, limits, count, densities):
    """Logs of a prior's density (R N,) at poses (D, R N), less what is the same everywhere; -inf beyond the limits
    (2, D). A block of MIXING threads for TOGETHER poses, a row of blocks for each run.
    """
    run, thread = cuda.blockIdx.y, cuda.threadIdx.x
    begin, first, size = cuda.blockIdx.x * TOGETHER, run * count, poses.shape[0]
    places = cuda.shared.array((TOGETHER, WIDEST), np.float32)
    inverse = cuda.shared.array(WIDEST, np.float32)
    mosts = cuda.shared.array((TOGETHER, MIXING), np.float64)
    totals = cuda.shared.array((TOGETHER, MIXING), np.float64)
    for at in range(thread, size * TOGETHER, MIXING):
        d = at // TOGETHER
        p = at - d * TOGETHER
        places[p, d] = poses[d, first + min(begin + p, count - 1)]
    for d in range(thread, size, MIXING):
        width = widths[run, d]
        inverse[d] = np.float32(1.0 / width if width > 0.0 else 0.0)
    for p in range(TOGETHER):
        mosts[p, thread], totals[p, thread] = -math.inf, 0.0
    cuda.syncthreads()
    squares = cuda.local.array(TOGETHER, np.float32)
    for k in range(thread, before, MIXING):
        for p in range(TOGETHER):
            squares[p] = np.float32(0.0)
        for d in range(size):
            centre, scale = centres[d, run * before + k], inverse[d]
            for p in range(TOGETHER):
                step = (places[p, d] - centre) * scale
                squares[p] += step * step
        for p in range(TOGETHER):
            value = shares[run * before + k] - 0.5 * np.float64(squares[p])
            most = mosts[p, thread]
            if value > most:
                totals[p, thread] = totals[p, thread] * math.exp(most - value) + 1.0
                mosts[p, thread] = value
            elif value > most - NOTHING:
                totals[p, thread] += math.exp(value - most)
    half = MIXING >> 1
    while half > 0:
        cuda.syncthreads()
        if thread < half:
            for p in range(TOGETHER):
                one, other = mosts[p, thread], mosts[p, thread + half]
                if other > one:
                    totals[p, thread] = totals[p, thread] * math.exp(one - other) + totals[p, thread + half]
                    mosts[p, thread] = other
                elif other > one - NOTHING:
                    totals[p, thread] += totals[p, thread + half] * math.exp(other - one)
        half >>= 1
    cuda.syncthreads()
    for p in range(thread, TOGETHER, MIXING):
        if begin + p < count:
            inside = True
            for d in range(size):
                inside = inside and limits[0, d] <= places[p, d] <= limits[1, d]
            density = -math.inf
            if inside and before == 0:
                density = 0.0
            elif inside and totals[p, 0] > 0.0:
                density = mosts[p, 0] + math.log(totals[p, 0])
            densities[first + begin + p] = density


def take_moves(
    proposed, before, weights, densities, before_raw, before_prior, kinds, partners, back, ladder, keys, count,
    poses, moved_weights, moved_prior, taken,
):  # fmt: skip
    """The set after its proposals (D, R N) were weighed and taken or refused, two that exchange limbs both or neither.

    before : (D, R N) where the moves lead from, with before_raw and before_prior (R N,), logs of likelihood and prior.
    ladder : (R, 7). poses, moved_weights (2, R N), moved_prior and taken (R N,), int32, are filled.
    """
    at = cuda.grid(1)
    if at >= proposed.shape[1]:
        return
    run = at // count
    n = at - run * count
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    temper, other = ladder[run, TEMPER], run * count + partners[at]
    gained = temper * (weights[LOG_WEIGHT, at] - before_raw[at])
    gained += densities[at] - before_prior[at] - back[at]
    share = as_share(random_words(seed, frame, layer, n, OF_MOVES)[0])
    if kinds[at] == EXCHANGE:
        gained += temper * (weights[LOG_WEIGHT, other] - before_raw[other])
        gained += densities[other] - before_prior[other] - back[other]
        share = min(share, as_share(random_words(seed, frame, layer, partners[at], OF_MOVES)[0]))
    is_taken = math.log(share) < gained
    raw, density = before_raw[at], before_prior[at]
    if is_taken:
        raw, density = weights[LOG_WEIGHT, at], densities[at]
    for d in range(poses.shape[0]):
        poses[d, at] = proposed[d, at] if is_taken else before[d, at]
    moved_weights[FITNESS, at], moved_weights[LOG_WEIGHT, at], moved_prior[at] = raw, raw, density
    taken[at] = 1 if is_taken else 0


def adapt_steps(taken, kinds, count, is_first, rules, dials, ladder, following):
    """Steps by the share of moves that were taken, and how far a layer may climb. A block of SUMMING threads for each
    run.

    taken, kinds : (R N,), not read where the set was drawn from the prior. rules : (4,). dials : (R, 8 + D), what β may
    be is filled in. ladder : (R, 7). following : (R, 7), filled.
    """
    run, thread = cuda.blockIdx.x, cuda.threadIdx.x
    sums = cuda.shared.array((5, SUMMING), np.float64)
    all_taken, steps, steps_taken, walks, walks_taken = 0.0, 0.0, 0.0, 0.0, 0.0
    if not is_first:
        for n in range(thread, count, SUMMING):
            one, kind = np.float64(taken[run * count + n]), kinds[run * count + n]
            all_taken += one
            if kind == WHOLE:
                steps += 1.0
                steps_taken += one
            elif kind == ONE_LIMB:
                walks += 1.0
                walks_taken += one
    sums[0, thread], sums[1, thread], sums[2, thread] = all_taken, steps, steps_taken
    sums[3, thread], sums[4, thread] = walks, walks_taken
    add_up(sums, 5, thread)
    if thread > 0:
        return
    temper, evidence, step, walk, share = 0.0, 0.0, FIRST_STEP, 1.0, math.nan
    if not is_first:
        temper, evidence = ladder[run, TEMPER], ladder[run, EVIDENCE]
        step, walk, share = ladder[run, STEP], ladder[run, WALK], sums[0, 0] / count
        if sums[1, 0] > 0.0:
            wider = min(max(sums[2, 0] / sums[1, 0] / BEST_SHARE, LEAST_CHANGE), MOST_CHANGE)
            step = min(step * wider, 1.0)
        if sums[3, 0] > 0.0:
            walk *= min(max(sums[4, 0] / sums[3, 0] / BEST_SHARE, LEAST_CHANGE), MOST_CHANGE)
    left = max(rules[LONGEST] - temper, 0.0)
    dials[run, UTMOST] = left
    dials[run, KNOWN] = left if rules[AT_END] > 0.0 or left == 0.0 else math.nan
    following[run, TEMPER], following[run, EVIDENCE] = temper, evidence
    following[run, STEP], following[run, WALK] = step, walk
    following[run, WEIGHED_AT], following[run, TAKEN] = temper, share


def climb(annealed, dials, count, following):
    """The ladder at t + δ, with the evidence that log Σ w^δ / N adds: a thread for each run. annealed : (R, 5)."""
    run = cuda.grid(1)
    if run >= following.shape[0]:
        return
    delta = annealed[run, BETA]
    if delta > 0.0:
        gained = delta * annealed[run, MOST] + math.log(annealed[run, TOTAL] / count)
        following[run, TEMPER] += delta
        following[run, EVIDENCE] += gained
    following[run, ALPHA] = dials[run, WANTED] if delta < dials[run, UTMOST] else math.nan


def draw_sample(
    poses, weights, prior, cumulated, annealed, keys, count, systematic, survivors, raw, density, parents, lots,
):  # fmt: skip
    """Survivors (D, R N) of a set drawn by weight; where δ is 0, all of them in turn.

    weights : (2, R N). prior : (R N,) logs. raw, density : (R N,) of the survivors, and parents (2, R N), filled.
    lots : (R N,) uint32, filled, by whose order particles exchange limbs.
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n, first = at - run * count, run * count
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    parent = np.int64(n)
    if annealed[run, BETA] > 0.0:
        share = as_share(random_words(seed, frame, layer, n, OF_PARENTS)[0])
        if systematic:
            share = (n + as_share(random_words(seed, frame, layer, 0, OF_RUN)[0])) / count
        parent = particle_at(cumulated, first, count, share)
    for d in range(poses.shape[0]):
        survivors[d, at] = poses[d, first + parent]
    raw[at], density[at] = weights[LOG_WEIGHT, first + parent], prior[first + parent]
    parents[0, at], parents[1, at] = parent, NO_PARENT
    lots[at] = random_words(seed, frame, layer, n, OF_KINDS)[0]


def find_weighted_correlations(poses, cumulated, count, moments, correlations):
    """Correlations (R, D, D) of a set (D, R N) by weights cumulated (R N,) and its moments: a block of SUMMING threads
    for each pair of parameters (x >= y) and run.
    """
    one, other, run = cuda.blockIdx.x, cuda.blockIdx.y, cuda.blockIdx.z
    if one < other:
        return
    thread, first = cuda.threadIdx.x, run * count
    sums = cuda.shared.array((1, SUMMING), np.float64)
    own = 0.0
    for n in range(thread, count, SUMMING):
        away = np.float64(poses[one, first + n]) - moments[WEIGHTED, run, one]
        away *= np.float64(poses[other, first + n]) - moments[WEIGHTED, run, other]
        own += weight_of(cumulated, first, n) * away
    sums[0, thread] = own
    add_up(sums, 1, thread)
    if thread == 0:
        both = math.sqrt(moments[WEIGHTED + 1, run, one] * moments[WEIGHTED + 1, run, other])
        total = cumulated[first + count - 1]
        correlations[run, one, other] = sums[0, 0] / (total * both) if both > 0.0 else 0.0


def rank_lots(lots, rules, count, ranks, order):
    """Of each particle how many of its run have a lesser lot, or an equal one and a lesser number: ranks (R N,); and of
    the first PAIRED ranks which particle has each: order (R N,). Both int32.
    """
    at = cuda.grid(1)
    if at >= lots.shape[0]:
        return
    run = at // count
    n, first = at - run * count, run * count
    paired = np.int64(rules[PAIRED])
    own, rank = lots[at], np.int64(0)
    if paired == 0:
        rank = np.int64(count)
    else:
        for k in range(count):
            other = lots[first + k]
            if other < own or (other == own and k < n):
                rank += 1
    ranks[at] = rank
    if rank < paired:
        order[first + rank] = n


def propose_moves(
    survivors, moments, root, ladder, rules, keys, place, ranks, order, count, poses, kinds, partners, back
):
    """A move of each survivor (D, R N), with what is needed to take or refuse it.

    moments : (8, R, D), of which those by weight are read. root : (R, D, D), see `find_root`. ladder : (R, 7).
    place : (D,) number of each parameter's limb, from 1. poses : (D, R N), filled, as kinds, partners and back (R N,).
    """
    at = cuda.grid(1)
    if at >= poses.shape[1]:
        return
    run = at // count
    n, first, size = at - run * count, run * count, poses.shape[0]
    seed, frame, layer = keys[run, SEED], keys[run, FRAME], keys[run, LAYER]
    lots = random_words(seed, frame, layer, n, OF_KINDS)
    limbs = place[size - 1]
    if ranks[at] < np.int64(rules[PAIRED]):
        odd = ranks[at] & 1
        partner = order[first + ranks[at] + 1 - 2 * odd]
        cuts = random_words(seed, frame, layer, order[first + ranks[at] - odd], OF_CUTS)
        one, two = 1 + np.int64(as_share(cuts[0]) * limbs), 1 + np.int64(as_share(cuts[1]) * limbs)
        low, high = min(one, two), max(one, two)
        for d in range(size):
            poses[d, at] = survivors[d, first + partner if low < place[d] <= high else at]
        kinds[at], partners[at], back[at] = EXCHANGE, partner, 0.0
        return
    normals = cuda.local.array(WIDEST, np.float32)
    fill_normals(seed, frame, layer, n, size, normals)
    partners[at] = n
    if as_share(lots[1]) < rules[LIMB_MOVES]:
        chosen, many = 1 + np.int64(as_share(lots[2]) * limbs), 0
        for d in range(size):
            if place[d] == chosen:
                many += 1
        width = WIDEST_WALK * ladder[run, WALK] / math.sqrt(np.float64(max(many, 1)))
        for d in range(size):
            value = np.float64(survivors[d, at])
            if place[d] == chosen:
                noise = 0.0
                for k in range(d + 1):
                    noise += root[run, d, k] * np.float64(normals[k])
                value += width * noise * math.sqrt(moments[WEIGHTED + 1, run, d])
            poses[d, at] = np.float32(value)
        kinds[at], back[at] = ONE_LIMB, 0.0
        return
    # Where the pose stands among independent normal numbers; the move's own place among them is known from it.
    standard = cuda.local.array(WIDEST, np.float64)
    step = ladder[run, STEP]
    kept, likelier = math.sqrt(1.0 - step * step), 0.0
    for d in range(size):
        deviation = math.sqrt(moments[WEIGHTED + 1, run, d])
        middle = moments[WEIGHTED, run, d]
        away = np.float64(survivors[d, at]) - middle
        noise, value = 0.0, away / deviation if deviation > 0.0 else away
        for k in range(d + 1):
            noise += root[run, d, k] * np.float64(normals[k])
        poses[d, at] = np.float32(middle + kept * away + step * noise * deviation)
        standard[d] = 0.0
        if root[run, d, d] > 0.0:
            for k in range(d):
                value -= root[run, d, k] * standard[k]
            value /= root[run, d, d]
            standard[d] = value
            moved = kept * value + step * np.float64(normals[d])
            likelier += 0.5 * (value * value - moved * moved)
    kinds[at], back[at] = WHOLE, likelier
