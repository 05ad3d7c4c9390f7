"""Noise that spreads the survivors (Deutscher & Reid 2005, Eq. 7, 9, 13 and 18).

Symbols: P, covariance of the noise B added to a particle; σ0, the square root of the diagonal of P_0. The
paper sets "each diagonal element in P_0" to half the largest movement expected in a frame; a movement is a
length or an angle, so that number is read here as a *standard deviation* (σ0 = half of `max_step` a frame),
not as a variance.

Eq. 13 plans the noise ahead: P_m = α_M ··· α_{m-1} P_0. Eq. 18 takes it from what is still uncertain: P_m is
proportional to the covariance V of the survivors before noise. The factor decides: noise on top of survivors
makes the variance (1 + c) V, and the cloud grows whenever a layer's selection takes away less than that. The
form "shrink" (the smoothed kernel of Liu & West 2001) first draws the survivors towards their mean by √(1 -
h²) and then adds noise of h times their standard deviation, so that the variance stays V.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.particle_kernels import Moments, root_of
from studio.search.trackers.random_numbers import RandomNumbers, place_of_try


def planned_sigma(sigma: Array, survivals: Sequence[float], decay: str) -> Array:
    """(D,) standard deviation of the noise after some layers (Eq. 13).

    sigma : (D,) σ0. survivals : α of the layers so far, this one included, and of the next. decay : "variance" when the
    α of the layers so far multiply the covariance, as Eq. 13 reads beside Eq. 7; "deviation" when they multiply σ0 (a
    faster narrowing); "printed" when that of the next layer multiplies the covariance, too: the product as it is
    printed, α_M ··· α_{m-1}.
    """
    product = float(np.prod(survivals if decay == "printed" else survivals[:-1]))
    return sigma * (product if decay == "deviation" else np.sqrt(product))


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Gaussian noise about N poses, which may be redrawn for some of them.

    centres : (N, D). scale : a factor of all noise. deviation : (D,) standard deviations. root : (D, D), lower, the
    Cholesky root of the correlations, by which independent normals are multiplied before `deviation`; None: they stay
    independent.
    """

    centres: Array
    scale: float
    deviation: Array
    root: Array | None = None

    def draw(self, numbers: RandomNumbers) -> Array:
        """(N, D) poses about all centres."""
        return self._about(self.centres, numbers.normals(len(self.centres), len(self.deviation)))

    def draw_again(self, numbers: RandomNumbers, rows: Indices, attempt: int) -> Array:
        """(K, D) poses about the centres of some rows (K,), others with each attempt, from 1."""
        place = place_of_try(attempt)
        return self._about(self.centres[rows], numbers.normals(rows, len(self.deviation), place))

    def _about(self, centres: Array, normals: NDArray[np.float32]) -> Array:
        noise = normals if self.root is None else normals @ self.root.T
        return centres + self.scale * (noise * self.deviation)


def noise_about(poses: Array, sigma: Array) -> Spread:
    """Poses (N, D) plus Gaussian noise of standard deviation sigma (D,) (Eq. 7, 9)."""
    return Spread(poses, 1.0, sigma)


def shrunk_noise(poses: Array, own: Moments, fraction: float, covariance: str) -> Spread:
    """Poses (N, D) perturbed without changing their mean and covariance in expectation.

    own : their moments. fraction : h, noise as a share of the sample's standard deviation. covariance : "diagonal" or
    "full".
    """
    kept = own.mean + np.sqrt(1.0 - fraction * fraction) * (poses - own.mean)
    return Spread(kept, fraction, *_sample_noise(poses, own, covariance))


def proportional_noise(poses: Array, own: Moments, constant: float, covariance: str) -> Spread:
    """Poses (N, D), whose moments these are, plus noise of covariance `constant` × their own (Eq. 18 as written)."""
    return Spread(poses, float(np.sqrt(constant)), *_sample_noise(poses, own, covariance))


def _sample_noise(poses: Array, own: Moments, covariance: str) -> tuple[Array, Array | None]:
    """Deviation and root of noise with the sample's variances, or its full covariance (Eq. 18's sum over N)."""
    deviation = np.sqrt(own.variance)
    if covariance == "diagonal":
        return deviation, None
    # Scaled to unit variances first: millimetres beside radians would drown the small pivots.
    centred = (poses - own.mean) / np.where(deviation > 0.0, deviation, 1.0)
    return deviation, root_of(centred.T @ centred / len(poses))
