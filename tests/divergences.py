"""Divergences of mixtures of blobs by the textbook's formulas, for comparison with the kernels."""

import numpy as np

from studio.evidence.volume.blob_model import BlobMixture

Array = np.ndarray


def gaussian_divergence(mean_f: Array, covariance_f: Array, mean_g: Array, covariance_g: Array) -> Array:
    """D(f||g) in nats of Gaussians (..., d) with covariances (..., d, d)."""
    apart = mean_g - mean_f
    precision = np.linalg.inv(covariance_g)
    trace = np.einsum("...ij,...ji->...", precision, covariance_f)
    distance = np.einsum("...i,...ij,...j->...", apart, precision, apart)
    logs = np.linalg.slogdet(covariance_g)[1] - np.linalg.slogdet(covariance_f)[1]
    return 0.5 * (logs - mean_f.shape[-1] + trace + distance)


def kept_divergence(model: BlobMixture, image: BlobMixture) -> float:
    """D(F||G) by Eq. 9, blob i of the model against blob i of the pictures (nats, in space)."""
    between = gaussian_divergence(model.means, model.covariances, image.means, image.covariances)
    return float(model.weights @ (between + np.log(model.weights / image.weights)))
