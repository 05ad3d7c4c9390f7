"""Principal components before the clustering (the first future work of Caillette et al. 2007, section 8).

A Gaussian with a full covariance in p dimensions has N = p + p (p + 1) / 2 parameters and dies below N / 2 points
(Figueiredo & Jain): with the 38 features of a 25-parameter body that is 390 frames, so that 13 000 frames hold at most
33 clusters (16 were found; 113 with diagonal covariances). In the first 6 principal components it is 14 frames, and 124
clusters were found, those that particles track best with.
"""

from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.search.behaviour.gaussian_mixture import GaussianMixture

SMALLEST_SCALE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Reduction:
    """An affine map from features (p,) to the space (r,) in which clusters are found: loadings · ((X - mean) / scale).

    mean, scale : (p,). loadings : (r, p) orthonormal rows. kept : share of the (scaled) variance that the r have.
    """

    mean: Array
    scale: Array
    loadings: Array
    kept: float

    def reduced(self, features: Array) -> Array:
        """(n, p) features to (n, r)."""
        return ((features - self.mean) / self.scale) @ self.loadings.T


def fit_reduction(features: Array, dimensions: int) -> Reduction:
    """The map for features (n, 2 d); dimensions : r, 0 for all of them (scaled, not turned).

    One scale for all angles and one for all their derivatives, whose variances then count alike; within either, a
    joint that moves more counts more.
    """
    half = features.shape[1] // 2
    mean = features.mean(axis=0)
    deviation = features.std(axis=0)
    spreads = [max(float(np.sqrt((part**2).mean())), SMALLEST_SCALE) for part in np.split(deviation, [half])]
    scale = np.repeat(spreads, [half, features.shape[1] - half])
    if not 0 < dimensions < features.shape[1]:
        return Reduction(mean, scale, np.eye(features.shape[1]), 1.0)
    covariance = np.cov(((features - mean) / scale).T, bias=True)
    values, vectors = np.linalg.eigh(covariance)
    chosen = vectors[:, ::-1][:, :dimensions].T
    largest = np.abs(chosen).argmax(axis=1)
    # An eigenvector's sign is arbitrary: the largest entry is made positive.
    signs = np.sign(chosen[np.arange(dimensions), largest])
    kept = float(values[::-1][:dimensions].sum() / max(values.sum(), SMALLEST_SCALE))
    return Reduction(mean, scale, chosen * signs[:, None], kept)


def full_clusters(features: Array, shares: Array, floor: Array) -> GaussianMixture:
    """Clusters found in a reduced space as Gaussians of the features: moments weighted by `shares` (n, K).

    The first r principal components determine a frame's cluster; the others still differ between clusters and are
    correlated with them. Hence not loadings · Σ · loadingsᵀ plus one residual, but every
    cluster's own mean and covariance in the full space, shrunk to the clusters' pooled covariance by as many frames as
    there are features, since a cluster may hold fewer frames than that. floor : (p,) variances added.
    """
    size, width = shares.shape[1], features.shape[1]
    strength = shares.sum(axis=0)
    means = (shares.T @ features) / strength[:, None]
    scatter = np.empty((size, width, width))
    for cluster in range(size):
        away = features - means[cluster]
        scatter[cluster] = (away * shares[:, cluster, None]).T @ away
    pooled = scatter.sum(axis=0) / strength.sum()
    drawn = (scatter + width * pooled) / (strength + width)[:, None, None]
    return GaussianMixture(strength / strength.sum(), means, drawn + np.diag(floor))
