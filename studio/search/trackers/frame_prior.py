"""The prior of a frame as a density: the last cloud, moved on and spread by σ0 (Deutscher & Reid 2005, Eq. 9 and 10).

A mixture of one Gaussian a particle of the last frame, with independent parameters of standard deviation σ0, each cut
off at the joint limits and made to integrate to one within them; a parameter without noise stays as its particle has
it. A run without a start pose begins with the uniform density between the limits.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from studio.foundations.arrays import Array, Mask
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.trackers.counted_numbers import OF_PARENTS
from studio.search.trackers.particle_kernels import drawn
from studio.search.trackers.particles import predict, uniform_poses
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import Arrays, FilterState, SearchSpace

CENTRES, LOG_WEIGHTS, DEVIATION = "prior_centres", "prior_log_weights", "prior_deviation"
"""Names of a prior's arrays in a set."""
NOTHING = 45.0
"""A log this far below the largest adds nothing to their sum in double precision."""


@dataclass(frozen=True, slots=True, eq=False)
class FramePrior:
    """centres : (K, D) of the Gaussians, within the limits; none of the uniform density. log_weights : (K,) of the
    Gaussians, normalised. deviation : (D,). space : with the limits. bounded : these are kept.
    """

    centres: Array
    log_weights: Array
    deviation: Array
    space: SearchSpace
    bounded: bool

    @staticmethod
    def of_frame(
        previous: FilterState, space: SearchSpace, *, scale: float, dynamics: str, bounded: bool
    ) -> "FramePrior":
        """From what the last frame left. scale : times σ0. dynamics : as in `predict`."""
        deviation, last = scale * space.sigma, previous.particles
        if last is None:
            return FramePrior(np.zeros((0, len(deviation))), np.zeros(0), deviation, space, bounded)
        centres = predict(last.poses, previous, dynamics)
        if bounded:
            centres = np.clip(centres, space.lower, space.upper)
        return FramePrior(centres, last.log_weights, deviation, space, bounded)

    @staticmethod
    def of_arrays(extra: Arrays, space: SearchSpace, *, bounded: bool) -> "FramePrior":
        """The prior that a set keeps."""
        return FramePrior(extra[CENTRES], extra[LOG_WEIGHTS], extra[DEVIATION], space, bounded)

    @property
    def arrays(self) -> Arrays:
        """What a set keeps of it."""
        return {CENTRES: self.centres, LOG_WEIGHTS: self.log_weights, DEVIATION: self.deviation}

    def draw(self, numbers: RandomNumbers, count: int) -> Array:
        """(count, D) independent poses. Raises RunError for a uniform density where a parameter has no limits."""
        if not len(self.centres):
            return uniform_poses(numbers, count, self.space)
        parents = drawn(np.exp(self.log_weights), numbers.shares(count, 1, OF_PARENTS)[:, 0])
        poses, moving = self.centres[parents], self._moving
        low, high = self._shares_below_limits(poses[:, moving])
        shares = low + numbers.shares(count, poses.shape[1])[:, moving] * (high - low)
        poses[:, moving] += self.deviation[moving] * ndtri(shares)
        return np.clip(poses, *self._limits)

    def log_density(self, poses: Array) -> Array:
        """(N,) its logs at poses (N, D), less what is the same everywhere; -inf beyond the limits."""
        lower, upper = self._limits
        inside = np.all((poses >= lower) & (poses <= upper), axis=1)
        if not len(self.centres):
            return np.where(inside, 0.0, -np.inf)
        moving = self._moving
        deviation, centres = self.deviation[moving], self.centres[:, moving]
        low, high = self._shares_below_limits(centres)
        shares = self.log_weights - np.log(high - low).sum(axis=1)
        across = np.ascontiguousarray((centres / deviation).T)
        return np.where(inside, _log_mixture(poses[:, moving] / deviation, across, shares), -np.inf)

    @property
    def _limits(self) -> tuple[Array, Array]:
        if self.bounded:
            return self.space.lower, self.space.upper
        return np.full(len(self.deviation), -np.inf), np.full(len(self.deviation), np.inf)

    @property
    def _moving(self) -> Mask:
        """(D,) which parameters have noise and room for it."""
        lower, upper = self._limits
        return (self.deviation > 0.0) & (upper > lower)

    def _shares_below_limits(self, centres: Array) -> tuple[Array, Array]:
        """Of Gaussians about centres (N, M), the shares (N, M) below the lower and the upper limits."""
        (lower, upper), moving = self._limits, self._moving
        deviation = self.deviation[moving]
        return ndtr((lower[moving] - centres) / deviation), ndtr((upper[moving] - centres) / deviation)


@njit(**EXACT)
def _log_mixture(places: Array, centres: Array, shares: Array) -> Array:
    """(N,) log Σ exp(shares - |place - centre|² / 2) of places (N, M), centres (M, K) and shares (K,)."""
    count, kinds = len(places), len(shares)
    logs, own = np.empty(count), np.empty(kinds)
    for n in range(count):
        # A centre after the other in the inner loop, so that several are taken at once.
        own[:] = 0.0
        for d in range(len(centres)):
            place = places[n, d]
            for k in range(kinds):
                step = place - centres[d, k]
                own[k] += step * step
        most = -np.inf
        for k in range(kinds):
            own[k] = shares[k] - 0.5 * own[k]
            most = max(most, own[k])
        total = 0.0
        for k in range(kinds):
            if own[k] > most - NOTHING:
                total += np.exp(own[k] - most)
        logs[n] = most + np.log(total)
    return logs
