"""What a layer does with small sets of poses, in one pass each: NumPy's several calls cost more than the work itself.

Every sum is made in NumPy's order, so that the results are NumPy's bit for bit.
"""

from typing import NamedTuple

import numpy as np

from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.numba_in_threads import EXACT, njit

SMALLEST = 1e-9
"""Pivots of correlations below this are those of a direction that is a sum of others, or does not vary."""


class Moments(NamedTuple):
    """Mean and variance (D,) of the poses of a set, all weighing the same."""

    mean: Array
    variance: Array


def moments(poses: Array) -> Moments:
    """Of poses (N, D), N >= 1: `poses.mean(axis=0)` and `poses.var(axis=0)`."""
    return Moments(*_moments(poses))


@njit(**EXACT)
def _moments(poses: Array) -> tuple[Array, Array]:
    count, size = poses.shape
    mean, variance = np.zeros(size), np.zeros(size)
    for n in range(count):
        for d in range(size):
            mean[d] += poses[n, d]
    for d in range(size):
        mean[d] /= count
    for n in range(count):
        for d in range(size):
            away = poses[n, d] - mean[d]
            variance[d] += away * away
    for d in range(size):
        variance[d] /= count
    return mean, variance


@njit(**EXACT)
def drawn(weights: Array, marks: Array) -> Indices:
    """(K,) for each of marks (K,) in [0, 1): the first whose cumulated share of weights (N,) lies beyond it, and the
    last that weighs anything where rounding leaves none.
    """
    count = len(weights)
    cumulated = np.cumsum(weights)
    total, last = cumulated[count - 1], count - 1
    while last > 0 and weights[last] == 0.0:
        last -= 1
    for n in range(count):
        cumulated[n] /= total
    found = np.empty(len(marks), np.int64)
    for k in range(len(marks)):
        low, high = 0, count
        while low < high:
            middle = (low + high) // 2
            if cumulated[middle] <= marks[k]:
                low = middle + 1
            else:
                high = middle
        found[k] = min(low, last)
    return found


@njit(**EXACT)
def children(first: Array, second: Array, place: Indices, chosen: Mask, cuts: Array) -> tuple[Array, Mask]:
    """(N, D) `first`, but of each that is chosen (N,) the parameters between its two cuts from `second`; (N,) which
    have any. place : (D,) 1 to L of each parameter. cuts : (N, 2) in [0, 1), shares of L.
    """
    count, size = first.shape
    made, crossed = first.copy(), np.zeros(count, np.bool_)
    for n in range(count):
        if not chosen[n]:
            continue
        one = 1 + np.int64(np.floor(cuts[n, 0] * place[size - 1]))
        other = 1 + np.int64(np.floor(cuts[n, 1] * place[size - 1]))
        low, high = min(one, other), max(one, other)
        for d in range(size):
            if low < place[d] <= high:
                made[n, d] = second[n, d]
                crossed[n] = True
    return made, crossed


@njit(**EXACT)
def places(limb: Indices) -> Indices:
    """(D,) 1, 2, … : how many runs of equal values `limb` (D,) has up to each."""
    found = np.ones(len(limb), np.int64)
    for d in range(1, len(limb)):
        found[d] = found[d - 1] + (limb[d] != limb[d - 1])
    return found


@njit(**EXACT)
def root_of(correlations: Array) -> Array:
    """(D, D) lower Cholesky root of correlations (D, D); a direction that is a sum of others, or does not vary, has no
    noise of its own.
    """
    size = len(correlations)
    root = np.zeros((size, size))
    for j in range(size):
        left = correlations[j, j]
        for k in range(j):
            left -= root[j, k] * root[j, k]
        if left <= SMALLEST:
            continue
        root[j, j] = np.sqrt(left)
        for i in range(j + 1, size):
            value = correlations[i, j]
            for k in range(j):
                value -= root[i, k] * root[j, k]
            root[i, j] = value / root[j, j]
    return root


@njit(**EXACT)
def standardised(root: Array, rows: Array) -> Array:
    """(N, D) what a root (D, D) of `root_of` makes rows (N, D) of; zero in directions without noise of their own."""
    made = np.zeros_like(rows)
    for n in range(len(rows)):
        for i in range(len(root)):
            if root[i, i] > 0.0:
                value = rows[n, i]
                for k in range(i):
                    value -= root[i, k] * made[n, k]
                made[n, i] = value / root[i, i]
    return made
