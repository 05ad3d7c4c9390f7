"""Gaussian mixtures with an unknown number of components (Figueiredo & Jain, PAMI 24(3), 2002; their CEM²).

EM that updates one component at a time. A component's weight is max(0, n_m - N / 2) / Σ_j max(0, n_j - N / 2): n_m
points support it, N is the number of its parameters; one with too few points for its parameters is annihilated, so that
no component can collapse onto a few points. When EM has converged, one component is removed and EM continues, down to
`least`; the mixture of the shortest message is the result. As it starts from many components throughout the data, it
is insensitive to the start. Ours differs from the paper in three places, each measured on mixtures with known truth (30
draws each of three to five components in two and three dimensions):

- The message is N / 2 Σ_m ln n_m + k / 2 ln n - ln p(points). Their Eq. 15 has n α_m / 12 for n_m and k (N + 1) / 2
  more. With the twelfths components of three or four points have negative cost (right in 25, 22 and 25 draws of 30);
    their own program leaves the constants out, which we follow, and α_m is small by N / 2 points where those matter
    most.
- The component whose removal costs least likelihood is removed, not the one of the smallest weight: that may be a small
  cluster far from all others, while a large one exists twice.
- EM has converged when a sweep shortens the message by less than `tolerance` nats a point. A share of the length, which
  may be 0, depends on the points' units.
"""

import math
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError
from studio.foundations.progress import Progress, no_progress
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.mixture_kernels import losses_without, replace_component, shares_of

COVARIANCES = ("full", "diagonal")

# A spherical start: this share of the data's mean variance (Figueiredo & Jain, section 6.1).
START_VARIANCE = 0.1

# Variance that every direction keeps, as a share of the data's mean variance: constant features are allowed.
FLOOR = 1e-6

# Points with a smaller share of a component do not move its moments.
LEAST_SHARE = 1e-10

MOST_SWEEPS = 500


@dataclass(frozen=True, slots=True)
class Converged:
    """One mixture that EM converged to. length : its message length in nats. sweeps : updates of all components."""

    components: int
    length: float
    log_likelihood: float
    sweeps: int


@dataclass(frozen=True, slots=True)
class Search:
    """Settings of the search for the number of components.

    most : components at the start. least : fewest tried. covariance : "full" or "diagonal". tolerance : EM has
    converged when a sweep changes the message length by less than this, nats a point. patience : components removed in
    a row without a shorter message before the search ends; 0 goes on to `least`. floor : variances (p,) added to every
    component, beside FLOOR; () for none.
    """

    most: int
    least: int = 1
    covariance: str = "full"
    tolerance: float = 1e-3
    patience: int = 0
    floor: tuple[float, ...] = ()


def fit_mixture(
    points: Array, rng: np.random.Generator, search: Search, progress: Progress = no_progress
) -> tuple[GaussianMixture, tuple[Converged, ...]]:
    """The mixture of the shortest message for points (n, p), and what EM converged to on the way.

    progress(step in words, components removed, components at the start). Raises BehaviourError where there are too few
    points for one component, values that are not finite, and for an invalid search.
    """
    _check(points, search)
    state = _Components(points, rng, search)
    best, history, fruitless = None, list[Converged](), 0
    while True:
        sweeps = state.converge(search.tolerance)
        reached = Converged(state.size, state.message_length(), state.log_likelihood, sweeps)
        fruitless += 1
        if best is None or reached.length < min(entry.length for entry in history):
            best, fruitless = state.mixture(), 0
        history.append(reached)
        progress("finding clusters", search.most - state.size, search.most)
        if state.size <= search.least or (search.patience and fruitless >= search.patience):
            return best, tuple(history)
        state.remove_least_missed()


def parameters_of(dimensions: int, covariance: str) -> int:
    """N, the number of parameters of one component."""
    shape = dimensions * (dimensions + 1) // 2 if covariance == "full" else dimensions
    return dimensions + shape


def _check(points: Array, search: Search) -> None:
    if search.covariance not in COVARIANCES:
        raise BehaviourError(
            f"There is no covariance '{search.covariance}'.", f"Choose {' or '.join(COVARIANCES)}."
        )
    if not 1 <= search.least <= search.most:
        raise BehaviourError(
            f"A search from {search.most} down to {search.least} clusters is impossible.",
            "Give 1 <= least <= most.",
        )
    if points.ndim != 2 or not np.isfinite(points).all():
        raise BehaviourError("Points to cluster hold values that are not finite.", "Leave such frames out.")
    needed = parameters_of(points.shape[1], search.covariance) // 2 + 1
    if len(points) < max(2, needed):
        raise BehaviourError(
            f"{len(points)} frames are too few for one cluster in {points.shape[1]} dimensions.",
            f"Give {max(2, needed)} or more, fewer reduced dimensions, or a diagonal covariance.",
        )


class _Components:
    """The components that are alive, with the log densities of all points.

    log_densities : (k, n) rows in the order of `weights`. totals : (n,) logs of the mixture's density.
    """

    def __init__(self, points: Array, rng: np.random.Generator, search: Search) -> None:
        self.points = np.ascontiguousarray(points, dtype=np.float64)
        self.count, self.dimensions = points.shape
        self.full = search.covariance == "full"
        self.parameters = parameters_of(self.dimensions, search.covariance)
        size = min(search.most, self.count)
        variance = max(float(points.var(axis=0).mean()), 1e-300)
        self.floor = FLOOR * variance * np.eye(self.dimensions)
        if search.floor:
            self.floor = self.floor + np.diag(search.floor)
        self.weights = np.full(size, 1.0 / size)
        self.means = self.points[rng.choice(self.count, size, replace=False)].copy()
        self.covariances = np.repeat(
            (START_VARIANCE * variance * np.eye(self.dimensions))[None], size, axis=0
        )
        self.log_densities = np.stack([self._densities(number) for number in range(size)])
        self.totals = self._totals()

    @property
    def size(self) -> int:
        return len(self.weights)

    @property
    def log_likelihood(self) -> float:
        return float(self.totals.sum())

    def mixture(self) -> GaussianMixture:
        return GaussianMixture(self.weights.copy(), self.means.copy(), self.covariances.copy())

    def message_length(self) -> float:
        """L, nats."""
        joint = self.log_densities + np.log(self.weights)[:, None]
        support = np.exp(joint - self.totals).sum(axis=1)
        shape = 0.5 * self.parameters * float(np.log(support).sum())
        return shape + 0.5 * self.size * math.log(self.count) - self.log_likelihood

    def converge(self, tolerance: float) -> int:
        """EM until the message length stays. Returns the number of sweeps."""
        length = math.inf
        for sweep in range(1, MOST_SWEEPS + 1):
            self._sweep()
            before, length = length, self.message_length()
            if abs(length - before) < tolerance * self.count:
                return sweep
        return MOST_SWEEPS

    def remove_least_missed(self) -> None:
        """Removes the component without which the points' likelihood falls least."""
        self._remove(int(np.argmin(losses_without(self.log_densities, np.log(self.weights), self.totals))))

    def _sweep(self) -> None:
        """One update of every component in turn (component-wise EM: each uses the others' updated values)."""
        number = 0
        while number < self.size:
            shares = shares_of(self.log_densities[number], math.log(self.weights[number]), self.totals)
            strength = max(0.0, float(shares.sum()) - 0.5 * self.parameters) / self.count
            if strength <= 0.0 and self.size > 1:
                self._remove(number)
                continue
            self._update(number, shares, max(strength, 1.0 / self.count))
            number += 1
        self.totals = self._totals()

    def _update(self, number: int, shares: Array, strength: float) -> None:
        """Update a component's weight and moments, and the densities."""
        active = np.flatnonzero(shares > LEAST_SHARE)
        own, share = self.points[active], shares[active]
        self.means[number] = share @ own / share.sum()
        away = own - self.means[number]
        if self.full:
            covariance = (away * share[:, None]).T @ away / share.sum()
        else:
            covariance = np.diag(share @ (away * away) / share.sum())
        self.covariances[number] = covariance + self.floor
        densities = self._densities(number)
        log_weights = np.log(self.weights)
        replace_component(self.log_densities, log_weights, number, densities, math.log(strength), self.totals)
        self.weights[number] = strength
        # Summed, not 1 - old + new: that error would grow with every component.
        whole = float(self.weights.sum())
        self.weights /= whole
        self.totals -= math.log(whole)

    def _remove(self, number: int) -> None:
        """Annihilates a component; the others share its weight."""
        stay = np.arange(self.size) != number
        self.weights = self.weights[stay] / self.weights[stay].sum()
        self.means, self.covariances = self.means[stay], self.covariances[stay]
        self.log_densities = self.log_densities[stay]
        self.totals = self._totals()

    def _densities(self, number: int) -> Array:
        """(n,) log densities of one component."""
        one = slice(number, number + 1)
        component = GaussianMixture(np.ones(1), self.means[one], self.covariances[one])
        return component.log_densities(self.points)[:, 0]

    def _totals(self) -> Array:
        joint = self.log_densities + np.log(self.weights)[:, None]
        largest = joint.max(axis=0)
        return largest + np.log(np.exp(joint - largest).sum(axis=0))
