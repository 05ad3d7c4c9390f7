"""A frame as a function of the poses of a body with meshes: the area by which its silhouettes differ from the masks."""

from collections.abc import Sequence

import numpy as np

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, half_mask
from studio.foundations.arrays import Array, Floats, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.likelihood.mesh_kernels import compare_silhouettes
from studio.search.likelihood.mesh_outlines import all_meshes
from studio.search.likelihood.problem import WHOLE_BODY, BaseFrameLikelihood

LONGEST = 80
"""Pixels of a mask's longer side, of the pictures that are compared."""
COARSE = 1.0 / 9.0
"""Cubes in which a mesh keeps one point, as a share of its longest side."""
STEEPNESS = 20.0
"""Log weight a camera of silhouettes that have nothing in common with the masks, halved."""
FOREGROUND = 128


class MeshSilhouettes(BaseFrameLikelihood):
    """One frame. No likelihood of a run: it is a hundred times slower than those of cones."""

    def __init__(
        self, body: BodyModel, cameras: Sequence[Camera], evidence: FrameEvidence | Sequence[Mask]
    ) -> None:
        """evidence : a frame's, or its masks (H, W)."""
        self.priors = HardPriors(body)
        self._body = body
        self._points, self._triangles, self._joints = all_meshes(body, COARSE)
        self._cameras = camera_table(cameras, outward_limit)
        masks = (
            [np.asarray(half_mask(view)) >= FOREGROUND for view in evidence.views]
            if isinstance(evidence, FrameEvidence)
            else evidence
        )
        self._shrink = np.array([_shrink(mask) for mask in masks])
        small = [_shrunk(mask, factor) for mask, factor in zip(masks, self._shrink.tolist(), strict=True)]
        self._sizes = np.array([mask.shape for mask in small], dtype=np.int64)
        self._masks = np.concatenate([mask.ravel() for mask in small])

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        return -STEEPNESS * len(self._cameras) * self.wrong(poses)

    def wrong(self, poses: Array) -> Array:
        """(N,) the share of the masks' area by which the silhouettes of poses (N, D) differ from them."""
        wrong = np.zeros(len(poses))
        compare_silhouettes(
            joint_frames(self._body, poses),
            self._points,
            self._joints,
            self._triangles,
            self._cameras,
            self._shrink,
            self._masks,
            self._sizes,
            wrong,
        )
        return wrong


def _shrink(mask: Mask) -> int:
    """How many times smaller a mask may be for what it shows to be LONGEST pixels."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return max(1, max(mask.shape) // LONGEST)
    return max(1, round(max(np.ptp(rows), np.ptp(columns)) / LONGEST))


def _shrunk(mask: Mask, factor: int) -> Floats:
    """(H, W) shares of a mask's pixels; what is left at its right and below is dropped."""
    height, width = mask.shape[0] // factor, mask.shape[1] // factor
    cells = mask[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return cells.mean(axis=(1, 3), dtype=np.float32)
