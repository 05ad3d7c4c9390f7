"""The annealing schedule: how peaked the weights are in each layer (Deutscher & Reid 2005, section 3.1).

Symbols: w, a particle's weight; β, the exponent of a layer, w_m = w^β (Eq. 3); π, the weights normalised to
sum 1 (Eq. 6); D = 1 / Σ π², the survival diagnostic (Eq. 11); α = D / N, the survival rate (Eq. 12). D falls
monotonically with β from N (β = 0) to the number of particles that share the best weight (β → ∞), so that the
β of a target α is the root of one monotone function; it is solved for in log β, where that function is smooth.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from studio.foundations.arrays import Array

# Tolerance of log β, absolute and relative.
ROOT_TOLERANCE = 1e-12
# exp(-FAR) is below double precision relative to 1.
FAR = 40.0
LOG_BETA_BOUND = 690.0


@dataclass(frozen=True, slots=True, eq=False)
class Annealed:
    """Weights of one layer.

    beta : exponent used.
    survival : α reached.
    log_weights : (N,) logs of normalised π.
    """

    beta: float
    survival: float
    log_weights: Array


def normalised(log_weights: Array, beta: float) -> Array:
    """(N,) logs of π ∝ w^β (Eq. 3, 6), from log w (N,) with any offset; -inf stays -inf."""
    with np.errstate(over="ignore"):
        scaled = -(np.max(log_weights) - log_weights) * beta
    return scaled - math.log(float(np.sum(np.exp(scaled))))


def survival_rate(log_weights: Array) -> float:
    """α (Eq. 11, 12) of normalised log-weights (N,)."""
    return float(1.0 / (np.sum(np.exp(2.0 * log_weights)) * len(log_weights)))


def anneal(log_weights: Array, wanted: float) -> Annealed:
    """The layer's weights: β such that the survival rate α is `wanted`.

    log_weights : (N,) log w, finite, or -inf for particles that cannot survive (at least one is finite).
    Where no β reaches `wanted` (equal weights; one particle; more particles sharing the best weight
    than may survive), the nearest rate is taken.
    """
    below = np.max(log_weights) - log_weights
    known = below[np.isfinite(below)]
    gaps = known[known > 0.0]
    if gaps.size == 0:
        beta = 1.0
    else:
        beta = _root(known, float(np.min(gaps)), wanted * len(log_weights))
    return at_exponent(log_weights, beta)


def at_exponent(log_weights: Array, beta: float) -> Annealed:
    """The layer's weights at a given β; log_weights : (N,) log w."""
    weights = normalised(log_weights, beta)
    return Annealed(beta, survival_rate(weights), weights)


def _root(below: Array, smallest_gap: float, effective: float) -> float:
    """β at which D (Eq. 11) equals `effective`, or the nearest bound; below : (K,) max log w - log w."""
    negative = -below
    powers, squares = np.empty_like(negative), np.empty_like(negative)

    def excess(log_beta: float) -> float:
        np.multiply(negative, math.exp(log_beta), powers)
        np.exp(powers, powers)
        np.multiply(powers, powers, squares)
        return float(np.add.reduce(powers)) ** 2 / float(np.add.reduce(squares)) - effective

    lowest = max(math.log(1e-9) - math.log(float(np.max(below))), -LOG_BETA_BOUND)
    highest = min(math.log(FAR) - math.log(smallest_gap), LOG_BETA_BOUND)
    with np.errstate(over="ignore", under="ignore"):
        low, high = _bracket(excess, lowest, highest, _first_guess(below))
        if low == lowest and excess(low) <= 0.0:
            return math.exp(low)
        if high == highest and excess(high) >= 0.0:
            return math.exp(high)
        root = brentq(excess, low, high, xtol=ROOT_TOLERANCE, rtol=np.float64(ROOT_TOLERANCE), maxiter=200)
    return math.exp(float(root))


def _first_guess(below: Array) -> float:
    """The log β that spreads the weights over about one e-fold."""
    most = float(np.max(below))
    shares = below / most
    away = shares - np.add.reduce(shares) / len(shares)
    spread = math.sqrt(float(np.add.reduce(away * away)) / len(away))
    return -math.log(most) - math.log(max(spread, 1e-12))


def _bracket(
    excess: Callable[[float], float], lowest: float, highest: float, guess: float
) -> tuple[float, float]:
    """Widen an interval around `guess` until the root lies inside."""
    low = high = min(max(guess, lowest), highest)
    width = 1.0
    while excess(low) < 0.0 and low > lowest:
        low, high, width = max(low - width, lowest), low, 2.0 * width
    while excess(high) > 0.0 and high < highest:
        low, high, width = high, min(high + width, highest), 2.0 * width
    return low, high
