"""A mixture of Gaussians: densities, labels and the symmetric square roots of its covariances."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class GaussianMixture:
    """K Gaussians in p dimensions. weights : (K,), they sum to 1. means : (K, p). covariances : (K, p, p)."""

    weights: Array
    means: Array
    covariances: Array

    @property
    def size(self) -> int:
        """K, the number of components."""
        return len(self.weights)

    @cached_property
    def whiteners(self) -> Array:
        """(K, p, p) lower triangular inverses of the Cholesky factors: |W (x - μ)|² is the Mahalanobis distance."""
        factors = np.linalg.cholesky(self.covariances)
        return np.tril(np.linalg.inv(factors)).astype(np.float64)

    @cached_property
    def log_scales(self) -> Array:
        """(K,) logs of the densities at the means, -½ ln((2π)^p |Σ|)."""
        diagonals = np.diagonal(self.whiteners, axis1=1, axis2=2)
        return np.log(diagonals).sum(axis=1) - 0.5 * self.means.shape[1] * math.log(2.0 * math.pi)

    @cached_property
    def roots(self) -> Array:
        """(K, p, p) square roots V √D Vᵀ of the covariances (Caillette et al. 2007, 5.2)."""
        values, vectors = np.linalg.eigh(self.covariances)
        return (vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ vectors.transpose(0, 2, 1)

    @property
    def variances(self) -> Array:
        """(p,) variances of the whole mixture in each dimension."""
        mean = self.weights @ self.means
        inner = np.diagonal(self.covariances, axis1=1, axis2=2)
        return self.weights @ (inner + (self.means - mean) ** 2)

    def log_densities(self, points: Array) -> Array:
        """(n, K) natural logs of the components' densities at the points (n, p), weights left out."""
        found = np.empty((len(points), self.size))
        for component in range(self.size):
            away = (points - self.means[component]) @ self.whiteners[component].T
            found[:, component] = self.log_scales[component] - 0.5 * np.einsum("ni,ni->n", away, away)
        return found

    def log_joint(self, points: Array) -> Array:
        """(n, K) logs of weight times density."""
        with np.errstate(divide="ignore"):
            return self.log_densities(points) + np.log(self.weights)

    def log_likelihood(self, points: Array) -> float:
        """The sum over the points of the log of the mixture's density."""
        return float(np.logaddexp.reduce(self.log_joint(points), axis=1).sum())

    def responsibilities(self, points: Array) -> Array:
        """(n, K) probabilities of the components given the points; rows sum to 1."""
        joint = self.log_joint(points)
        return np.exp(joint - np.logaddexp.reduce(joint, axis=1, keepdims=True))

    def labels(self, points: Array) -> IntArray:
        """(n,) the component that each point most probably belongs to."""
        return np.argmax(self.log_joint(points), axis=1).astype(np.int64)

    def chosen(self, components: IntArray) -> "GaussianMixture":
        """The mixture of some components, weights made to sum to 1."""
        weights = self.weights[components]
        return GaussianMixture(weights / weights.sum(), self.means[components], self.covariances[components])

    def mapped(self, matrix: Array, offset: Array | float = 0.0) -> "GaussianMixture":
        """The mixture of matrix · x + offset. matrix : (q, p) of full row rank."""
        return GaussianMixture(
            self.weights, self.means @ matrix.T + offset, matrix @ self.covariances @ matrix.T
        )
