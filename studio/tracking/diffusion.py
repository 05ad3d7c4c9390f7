"""Noise that spreads the survivors (Deutscher & Reid 2005, Eq. 7, 9, 13 and 18).

Symbols: P, covariance of the noise B added to a particle; σ0, the square root of the diagonal of P_0. The
paper sets "each diagonal element in P_0" to half the largest movement expected in a frame; a movement is a
length or an angle, so that number is read here as a *standard deviation* (σ0 = half of `max_step` a frame),
not as a variance.

Eq. 13 plans the noise ahead: P_m = α_M ··· α_{m-1} P_0. Eq. 18 takes it from what is still uncertain: P_m is
proportional to the covariance V of the survivors before noise. The factor decides: noise on top of survivors
makes the variance (1 + c) V, and the cloud grows whenever a layer's selection takes away less than that. The
form "shrink" (the smoothed kernel of Liu & West 2001) first draws the survivors towards their mean by √(1 -
h²) and then adds noise of h times their standard deviation: the variance before and after is V, so nothing
gained is lost.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studio.tracking.tracker import SearchSpace

Array = NDArray[np.float64]


def planned_sigma(sigma: Array, survivals: Sequence[float], decay: str) -> Array:
    """(D,) standard deviation of the noise after some layers (Eq. 13).

    sigma : (D,) σ0. survivals : α of the layers so far, this one included. decay : "variance" when the α
    multiply the covariance, as Eq. 13 reads beside Eq. 7; "deviation" when they multiply σ0 (a faster
    narrowing).
    """
    product = float(np.prod(survivals))
    return sigma * (np.sqrt(product) if decay == "variance" else product)


def diffuse(rng: np.random.Generator, poses: Array, sigma: Array) -> Array:
    """Poses (N, D) plus Gaussian noise of standard deviation sigma (D,) (Eq. 7, 9)."""
    return poses + rng.standard_normal(poses.shape) * sigma


def diffuse_shrunk(rng: np.random.Generator, poses: Array, fraction: float, covariance: str) -> Array:
    """Poses (N, D) spread anew without changing their mean and covariance in expectation.

    fraction : h, noise as a share of the sample's standard deviation. covariance : "diagonal" or "full".
    """
    mean = poses.mean(axis=0)
    kept = mean + np.sqrt(1.0 - fraction * fraction) * (poses - mean)
    return kept + fraction * _sample_noise(rng, poses, covariance)


def diffuse_proportionally(rng: np.random.Generator, poses: Array, constant: float, covariance: str) -> Array:
    """Poses (N, D) plus noise of covariance `constant` × their own (Eq. 18 as written)."""
    return poses + np.sqrt(constant) * _sample_noise(rng, poses, covariance)


def _sample_noise(rng: np.random.Generator, poses: Array, covariance: str) -> Array:
    """(N, D) Gaussian noise with the sample's own variances, or its whole covariance (Eq. 18's sum over
    N).
    """
    normal = rng.standard_normal(poses.shape)
    deviation = poses.std(axis=0)
    if covariance == "diagonal":
        return normal * deviation
    # Scaled to unit variances first: millimetres beside radians would drown the small eigenvalues.
    unit = np.where(deviation > 0.0, deviation, 1.0)
    centred = (poses - poses.mean(axis=0)) / unit
    values, vectors = np.linalg.eigh(centred.T @ centred / len(poses))
    return (normal * np.sqrt(np.maximum(values, 0.0))) @ vectors.T * unit


def within_limits(poses: Array, space: SearchSpace, limits: str) -> Array:
    """Poses (N, D) brought back into [lower, upper].

    limits : "clamp" sets a parameter beyond a limit on it; "reflect" mirrors it at the limit (and clamps what
    is then beyond the other one); "ignore" changes nothing. NaN never arises, infinite limits do nothing.
    """
    if limits == "ignore":
        return poses
    if limits == "reflect":
        poses = np.where(poses < space.lower, 2.0 * space.lower - poses, poses)
        poses = np.where(poses > space.upper, 2.0 * space.upper - poses, poses)
    return np.clip(poses, space.lower, space.upper)
