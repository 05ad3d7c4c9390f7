"""The background as a full Gaussian in YUV for each pixel, with a second one for shadow (Caillette et al. 2007, 6.1).

Y = 0.299 R + 0.587 G + 0.114 B, U = 0.492 (B - Y), V = 0.877 (R - Y), not rounded. The shadow's Gaussian has the
same covariance and a mean whose Y is 10 % lower; the one whose mean luminance is nearer to the pixel's is
used (the paper: "a simple test on the luminance"). The paper sums "Mahalanobis distances d_M" and compares
them with a χ² threshold of 3 degrees of freedom a pixel: that is the distribution of the *squared* distance, which
is computed here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array, Bytes, Floats

SHADOW = 0.1
"""Share of the luminance that a shadow takes away."""
LEAST_NOISE = 2.5
"""Grey levels: the smallest standard deviation of a pixel in any direction of BGR."""
LUMINANCE = np.array([0.114, 0.587, 0.299])
"""Weights of B, G and R in Y."""
YUV_OF_BGR: Array = np.stack(
    [LUMINANCE, 0.492 * (np.array([1.0, 0, 0]) - LUMINANCE), 0.877 * (np.array([0, 0, 1.0]) - LUMINANCE)]
)


@dataclass(frozen=True, slots=True, eq=False)
class YuvBackground:
    """One camera's empty view. mean : (H, W, 3) float32 YUV. precision : (H, W, 3, 3) float32, inverse covariance."""

    mean: Floats
    precision: Floats

    def packed(self) -> Floats:
        """(9, H W) float32 for the kernels: the mean, then precision 00, 11, 22, 01, 02, 12."""
        p = self.precision
        parts = (p[..., 0, 0], p[..., 1, 1], p[..., 2, 2], p[..., 0, 1], p[..., 0, 2], p[..., 1, 2])
        rows = [*np.moveaxis(self.mean, -1, 0), *parts]
        return np.stack([row.ravel() for row in rows]).astype(np.float32)

    def squared_distances(self, picture: Bytes, shadow: float = SHADOW, deepest: float = 0.0) -> Array:
        """(H, W) squared Mahalanobis distance of each pixel of a BGR picture from background or shadow.

        deepest : beyond the paper, of pixels in shadow the smaller of that and the distance from the background
        darkened, all of YUV, to the pixel's own luminance, but by no larger a share than this.
        """
        seen = picture @ YUV_OF_BGR.T
        mean = self.mean.astype(np.float64)
        in_shadow = seen[..., 0] < (1.0 - 0.5 * shadow) * mean[..., 0]
        shift = np.where(in_shadow, shadow * mean[..., 0], 0.0)
        squared = self._squared(seen - mean + shift[..., None] * np.array([1.0, 0.0, 0.0]))
        if deepest > 0.0:
            left = np.maximum(seen[..., 0] / np.maximum(mean[..., 0], 1.0), 1.0 - deepest)
            squared = np.where(
                in_shadow, np.minimum(squared, self._squared(seen - left[..., None] * mean)), squared
            )
        return squared

    def _squared(self, away: Array) -> Array:
        return np.einsum("hwi,hwij,hwj->hw", away, self.precision, away)


def learn_background(pictures: Sequence[Bytes], least_noise: float = LEAST_NOISE) -> YuvBackground:
    """The Gaussian of each pixel's next value, from an empty clip of n pictures or a plate (n = 1).

    Its covariance is (1 + 1 / n) times that of the noise, as the mean of n pictures has noise of its own.

    pictures : (H, W, 3) uint8 BGR each, at least one. least_noise : grey levels; no direction of BGR has a smaller
    standard deviation, so a plate, or a pixel that never changes, has a covariance that can be inverted.
    """
    height, width = pictures[0].shape[:2]
    total = np.zeros((height, width, 3))
    products = np.zeros((height, width, 3, 3))
    for picture in pictures:
        level = picture.astype(np.float64)
        total += level
        products += level[..., :, None] * level[..., None, :]
    mean = total / len(pictures)
    covariance = products / len(pictures) - mean[..., :, None] * mean[..., None, :]
    return _background(mean, covariance, least_noise, len(pictures))


def independent_background(
    mean: Floats, variance: Floats, least_noise: float = LEAST_NOISE, pictures: int = 1
) -> YuvBackground:
    """Gaussians of a mean and a variance (H, W, 3) of each colour of BGR, taken as independent of each other.

    pictures : that the mean is of.
    """
    return _background(mean.astype(np.float64), variance[..., None] * np.eye(3), least_noise, pictures)


def _background(mean: Array, covariance: Array, least_noise: float, pictures: int) -> YuvBackground:
    """YUV Gaussians of BGR mean (H, W, 3) and covariance (H, W, 3, 3), raised to the noise floor."""
    spread, axes = np.linalg.eigh(covariance)
    # YUV is linear in the colours, so the floor is applied in BGR, where a sensor's noise is isotropic.
    axes = np.linalg.inv(YUV_OF_BGR).T @ axes
    spread = (1.0 + 1.0 / pictures) * np.maximum(spread, least_noise**2)
    precision = (axes / spread[..., None, :]) @ np.swapaxes(axes, -1, -2)
    return YuvBackground((mean @ YUV_OF_BGR.T).astype(np.float32), precision.astype(np.float32))
