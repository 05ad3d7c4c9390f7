# pyright: standard
"""The inner loops of prediction: the choice of Eq. 3 over the transitions there are, and noise of Eq. 4."""

import math

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.numba_in_threads import KERNEL, njit

IntArray = NDArray[np.int64]


@njit(**KERNEL)
def squared_distance(point: Array, mean: Array, whitener: Array) -> float:
    """Squared Mahalanobis distance. point, mean : (p,). whitener : (p, p) lower triangular."""
    total = 0.0
    for row in range(len(point)):
        value = 0.0
        for column in range(row + 1):
            value += whitener[row, column] * (point[column] - mean[column])
        total += value * value
    return total


@njit(**KERNEL)
def choose_arcs(
    points: Array, states: IntArray, luck: Array, free: NDArray[np.bool_],
    first: IntArray, symbols: IntArray, log_probabilities: Array,
    means: Array, whiteners: Array, log_scales: Array,
) -> IntArray:  # fmt: skip
    """(N,) labels drawn with probability ∝ N(point | label) γ(state, label), over the arcs of each particle's state.

    points : (N, p). luck : (N,) uniform in [0, 1). free : (N,) particles whose likelihood does not count. first,
    symbols, log_probabilities : the automaton's arcs. means, whiteners, log_scales : the clusters'.
    """
    chosen = np.empty(len(states), dtype=np.int64)
    most = 0
    for state in range(len(first) - 1):
        most = max(most, first[state + 1] - first[state])
    weights = np.empty(most)
    for particle in range(len(states)):
        begin, end = first[states[particle]], first[states[particle] + 1]
        largest = -np.inf
        for arc in range(begin, end):
            label = symbols[arc]
            weights[arc - begin] = log_probabilities[arc]
            if not free[particle]:
                distance = squared_distance(points[particle], means[label], whiteners[label])
                weights[arc - begin] += log_scales[label] - 0.5 * distance
            largest = max(largest, weights[arc - begin])
        total = 0.0
        for arc in range(end - begin):
            weights[arc] = math.exp(weights[arc] - largest)
            total += weights[arc]
        left = luck[particle] * total
        place = 0
        while place < end - begin - 1 and left >= weights[place]:
            left -= weights[place]
            place += 1
        chosen[particle] = symbols[begin + place]
    return chosen


@njit(**KERNEL)
def rooted_noise(roots: Array, labels: IntArray, normals: Array) -> Array:
    """(N, q) normals (N, q) times the symmetric square root (K, q, q) of each particle's cluster."""
    found = np.empty_like(normals)
    for particle in range(len(labels)):
        root = roots[labels[particle]]
        for row in range(normals.shape[1]):
            value = 0.0
            for column in range(normals.shape[1]):
                value += root[row, column] * normals[particle, column]
            found[particle, row] = value
    return found
