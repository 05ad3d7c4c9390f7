# pyright: standard
"""The inner loops of component-wise EM: shares of one component, and the mixture's density when it is replaced."""

import math

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.numba_in_threads import KERNEL, njit

# Components below e^-40 of the mixture's density do not change it.
NOTHING = -40.0


@njit(**KERNEL)
def shares_of(log_densities: Array, log_weight: float, totals: Array) -> Array:
    """(n,) probabilities that the points belong to a component. log_densities, totals : (n,), logs."""
    found = np.zeros(len(totals))
    for point in range(len(totals)):
        log_share = log_weight + log_densities[point] - totals[point]
        if log_share > NOTHING:
            found[point] = min(1.0, math.exp(log_share))
    return found


@njit(**KERNEL)
def sum_of_others(log_densities: Array, log_weights: Array, number: int, point: int) -> float:
    """Log density of a point under all components but one."""
    largest = -np.inf
    for other in range(len(log_weights)):
        if other != number:
            largest = max(largest, log_weights[other] + log_densities[other, point])
    if largest == -np.inf:
        return largest
    total = 0.0
    for other in range(len(log_weights)):
        if other != number:
            total += math.exp(log_weights[other] + log_densities[other, point] - largest)
    return largest + math.log(total)


@njit(**KERNEL)
def replace_component(
    log_densities: Array, log_weights: Array, number: int, densities: Array, log_weight: float, totals: Array
) -> None:
    """Puts a component's new log densities (n,) into row `number` of (k, n) and corrects the totals (n,) in place.

    log_weights : (k,) as used in the totals. log_weight : the component's new one. Where the old component was
    nearly all of the total, the others are summed afresh: a difference would leave rounding errors.
    """
    for point in range(len(totals)):
        old = log_weights[number] + log_densities[number, point] - totals[point]
        new = log_weight + densities[point] - totals[point]
        log_densities[number, point] = densities[point]
        if old < NOTHING and new < NOTHING:
            continue
        share = math.exp(min(old, 0.0))
        if share < 0.999:
            rest = totals[point] + math.log1p(-share)
        else:
            rest = sum_of_others(log_densities, log_weights, number, point)
        joint = log_weight + densities[point]
        largest = max(rest, joint)
        totals[point] = largest + math.log(math.exp(rest - largest) + math.exp(joint - largest))


@njit(**KERNEL)
def losses_without(log_densities: Array, log_weights: Array, totals: Array) -> Array:
    """(k,) by how much the points' log-likelihood falls without each component, the others sharing its weight."""
    size, count = log_densities.shape
    losses = np.empty(size)
    for number in range(size):
        losses[number] = count * math.log1p(-math.exp(log_weights[number]))
    for point in range(count):
        for number in range(size):
            log_share = log_weights[number] + log_densities[number, point] - totals[point]
            if log_share > NOTHING:
                share = math.exp(min(log_share, 0.0))
                if share < 0.999:
                    losses[number] -= math.log1p(-share)
                else:
                    losses[number] += totals[point] - sum_of_others(log_densities, log_weights, number, point)
    return losses
