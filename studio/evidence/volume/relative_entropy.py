"""Relative entropy of one mixture of blobs to another, the Kullback-Leibler divergence (Caillette, Galata &
Howard 2007, section 6.4, Eq. 7 to 10). F = Σ α_i f_i is the model's mixture, G = Σ β_j g_j the pictures'.

**Eq. 10 as printed** is

    ½ (ln |Σf| / |Σg| - d + tr(Σf⁻¹ Σg) + (μg - μf)ᵀ Σf⁻¹ (μg - μf)),

which is the divergence of f from g, D(g||f), and not the D(f||g) on its left-hand side, which its own first line,
∫ P(x|f) ln P(x|f) / P(x|g) dx, defines: f and g are exchanged throughout. The textbook form, which a Monte-Carlo
estimate of that integral confirms (tests), is

    D(f||g) = ½ (ln |Σg| / |Σf| - d + tr(Σg⁻¹ Σf) + (μg - μf)ᵀ Σg⁻¹ (μg - μf)),

is used here, so that Eq. 8 and 9 hold. It also costs less: Σg⁻¹ belongs to the pictures and is computed once a frame.

Eq. 8 takes for each f_i the nearest g_j. Eq. 9, which is used here, keeps the correspondence f_i ↔ g_i that fitting
from the model's own blobs gives, and costs one divergence a blob. With weights that sum to 1 all terms of Eq. 9
together are never negative.

**Space alone.** Blobs are of place and colour in the paper (d = 6). Colours add the same to every pose's divergence,
whatever the pose; here it is left out (d = 3). Where a weight is 1 / D that is a choice and no saving alone: without
the added constant D comes nearer to 0 for good poses, and weights are more peaked.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.volume.blob_model import BlobMixture, BlobModel
from studio.foundations.arrays import Array, Indices
from studio.foundations.numba_in_threads import KERNEL, njit

DIMENSIONS = 3


@dataclass(frozen=True, slots=True, eq=False)
class DivergenceOfPoses:
    """Eq. 9 of any pose against one image's mixture, with all terms that do not depend on the pose precomputed.

    joint : (B,) joint each blob's limb is on. offset, spread : (B,), (B, 3) the model's. share : (B,) α. means (B, 3),
    precisions (B, 3, 3) : the image's. constant : the part of the divergence common to all poses.
    """

    body: BodyModel
    joint: NDArray[np.int64]
    offset: Array
    spread: Array
    share: Array
    means: Array
    precisions: Array
    constant: float

    @classmethod
    def against(
        cls, body: BodyModel, model: BlobModel, image: BlobMixture, blobs: NDArray[np.int64] | None = None
    ) -> "DivergenceOfPoses":
        """The model's poses against `image`, whose blobs are the model's in the same order. blobs : use only these;
        their shares are made to sum to 1 on both sides.
        """
        chosen = np.arange(len(model.limb)) if blobs is None else blobs
        alpha = model.weight[chosen] / model.weight[chosen].sum()
        beta = image.weights[chosen] / image.weights[chosen].sum()
        spread = model.eigenvalues[chosen]
        logs = np.linalg.slogdet(image.covariances[chosen])[1] - np.log(spread).sum(axis=1)
        constant = alpha @ (0.5 * (logs - DIMENSIONS) + np.log(alpha / beta))
        return cls(
            body,
            kinematic_tables(body).limb_joint[model.limb[chosen]],
            np.ascontiguousarray(model.offset[chosen]),
            np.ascontiguousarray(spread),
            alpha,
            np.ascontiguousarray(image.means[chosen]),
            np.ascontiguousarray(np.linalg.inv(image.covariances[chosen]), dtype=np.float64),
            float(constant),
        )

    def __call__(self, poses: Array) -> Array:
        """(N, D) poses to (N,) divergences D(F||G), nats. Raises BodyError for poses that are not the body's."""
        frames = joint_frames(self.body, poses)
        divergences = np.empty(len(frames))
        _pose_divergences(
            frames, self.joint, self.offset, self.spread, self.share, self.means, self.precisions, divergences
        )
        return divergences + self.constant


@njit(**KERNEL)
def _pose_divergences(
    frames: Array,
    joint: Indices,
    offset: Array,
    spread: Array,
    share: Array,
    means: Array,
    precisions: Array,
    out: Array,
) -> None:
    """Σ α ½ (tr(Σg⁻¹ Σf) + (μg - μf)ᵀ Σg⁻¹ (μg - μf)) of frames (N, F, 3, 4) into found (N,): the trace is
    Σ λ_k u_kᵀ Σg⁻¹ u_k over the bone's axes u_k.
    """
    for n in range(frames.shape[0]):
        total = 0.0
        for b in range(joint.shape[0]):
            frame = frames[n, joint[b]]
            inverse = precisions[b]
            xx, yy, zz = inverse[0, 0], inverse[1, 1], inverse[2, 2]
            xy, xz, yz = 2.0 * inverse[0, 1], 2.0 * inverse[0, 2], 2.0 * inverse[1, 2]
            x = frame[0, 3] + offset[b] * frame[0, 2] - means[b, 0]
            y = frame[1, 3] + offset[b] * frame[1, 2] - means[b, 1]
            z = frame[2, 3] + offset[b] * frame[2, 2] - means[b, 2]
            terms = xx * x * x + yy * y * y + zz * z * z + xy * x * y + xz * x * z + yz * y * z
            for k in range(3):
                x, y, z = frame[0, k], frame[1, k], frame[2, k]
                form = xx * x * x + yy * y * y + zz * z * z + xy * x * y + xz * x * z + yz * y * z
                terms += spread[b, k] * form
            total += 0.5 * share[b] * terms
        out[n] = total
