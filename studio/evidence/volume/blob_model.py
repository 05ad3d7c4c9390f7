"""Coloured Gaussian blobs on the bones of a body (Caillette, Galata & Howard 2007, section 6.2).

A blob keeps what does not change with the pose: the limb it sits on, its offset along that bone, three eigenvalues in
the bone's own axes, a colour, and its share of the body's volume. Any pose then gives a mixture of Gaussians by forward
kinematics. Colours are those of the pictures (blue, green, red, 0...255); NaN where unknown.

Before anything is learnt the blobs are those of the cones: the mean and the second moments of a solid truncated cone of
even density.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]

SMALLEST_VARIANCE = 25.0
"""mm²: least variance of a blob (5 mm), also of a sheet or a thread of voxels."""


@dataclass(frozen=True, slots=True, eq=False)
class BlobMixture:
    """Gaussians with colours. means : (..., B, 3) mm, world. covariances : (..., B, 3, 3) mm². colours,
    colour_variances : (B, 3) levels and levels², blue green red, NaN where unknown. weights : (B,), sum 1.
    """

    means: Array
    covariances: Array
    colours: Array
    colour_variances: Array
    weights: Array

    def at(self, index: int) -> "BlobMixture":
        """The mixture of one pose of several."""
        return BlobMixture(
            self.means[index], self.covariances[index], self.colours, self.colour_variances, self.weights
        )


@dataclass(frozen=True, slots=True, eq=False)
class BlobModel:
    """B blobs on a body's drawn limbs.

    limb : (B,) place in `BodyModel.drawn`, ascending. offset : (B,) mm along the limb's z. eigenvalues : (B, 3) mm²
    along the limb's x, y, z. colour, colour_variance : (B, 3) levels and levels², NaN where unknown. weight : (B,)
    share of the volume, sum 1.
    """

    limb: IntArray
    offset: Array
    eigenvalues: Array
    colour: Array
    colour_variance: Array
    weight: Array

    def mixture(self, body: BodyModel, poses: Array) -> BlobMixture:
        """The mixtures of poses (N, D): means (N, B, 3), covariances (N, B, 3, 3). Raises BodyError for other poses."""
        frames = limb_frames(body, poses)[:, self.limb]
        axes = frames[..., :3]
        means = frames[..., 3] + axes[..., 2] * self.offset[:, None]
        covariances = np.einsum("nbik,bk,nbjk->nbij", axes, self.eigenvalues, axes)
        return BlobMixture(means, covariances, self.colour, self.colour_variance, self.weight)

    def in_colour(self, colour: Array, variance: Array) -> "BlobModel":
        """The model with colour (3,) and its variance (3,) where they are unknown."""
        known = np.isfinite(self.colour).all(axis=1, keepdims=True)
        return BlobModel(
            self.limb,
            self.offset,
            self.eigenvalues,
            np.where(known, self.colour, colour),
            np.where(known, self.colour_variance, variance),
            self.weight,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ConeMoments:
    """Of each drawn limb: volume (L,) mm³, offset (L,) mm along z of its centre, variances (L, 3) mm² about it."""

    volume: Array
    offset: Array
    variances: Array


def cone_moments(body: BodyModel) -> ConeMoments:
    """The moments of the body's cones, exactly (Gauss-Legendre: the integrands are polynomials of degree 4)."""
    shape = kinematic_tables(body).limb_shape
    nodes, node_weights = np.polynomial.legendre.leggauss(4)
    along = (nodes + 1.0) / 2.0
    length, start, end = shape[:, :1], shape[:, 1:2], shape[:, 2:3]
    scales = shape[:, 3:5]
    radii = start + (end - start) * along
    heights = length * along
    areas = node_weights / 2.0 * np.maximum(radii, 1e-3) ** 2
    total = areas.sum(axis=1)
    offset = (areas * heights).sum(axis=1) / total
    lengthwise = (areas * heights**2).sum(axis=1) / total - offset**2
    across = (areas * radii**2).sum(axis=1)[:, None] / (4.0 * total[:, None]) * scales**2
    variances = np.maximum(np.column_stack([across, lengthwise]), SMALLEST_VARIANCE)
    volume = math.pi * np.abs(length[:, 0]) * scales.prod(axis=1) * total
    return ConeMoments(volume, offset, variances)


def cone_blobs(body: BodyModel) -> BlobModel:
    """One blob a limb from the body's dimensions alone; no colours."""
    moments = cone_moments(body)
    count = len(moments.volume)
    unknown = np.full((count, 3), np.nan)
    share = moments.volume / moments.volume.sum()
    return BlobModel(np.arange(count), moments.offset, moments.variances, unknown, unknown, share)
