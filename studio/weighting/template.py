"""A rendered template against a silhouette: the weighting of Deutscher & Reid 2005, section 6.1 (Figs. 11 to
18).

The limbs are drawn as filled quadrilaterals, their projected outlines; a pixel belongs to the template where
its centre lies in any of them. The weight compares template and silhouette over **all** pixels, so that what
is drawn but not seen counts as much as what is seen but not drawn ("both directions"; Eq. 15 alone looks only
inside the model):

    log w = - Σ over cameras of the mean squared difference of template and silhouette, both 0 or 1.

One camera facing the plane of the arm is the paper's case. A limb that reaches behind the camera is not
drawn: what the silhouette shows of it is then missed, so nothing is gained. log w lies between -cameras and
0.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.geometry.camera import Camera
from studio.weighting.block_threads import run_blocks
from studio.weighting.evidence_check import check_views
from studio.weighting.hard_priors import HardPriors
from studio.weighting.outlines import OutlineProjector
from studio.weighting.template_kernels import LANES, all_templates, chunk_templates

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Words = NDArray[np.uint64]

FOREGROUND = 128
"""Mask values from here on are silhouette."""
BLOCKS_A_THREAD = 8
"""About half a millisecond of a body in one picture of 320 × 240."""


@dataclass(frozen=True, slots=True)
class TemplateSettings:
    """The template has nothing to turn: all pixels count, equally."""

    title: ClassVar[str] = "Template"


class TemplateWeigher:
    """Makes the problem of any frame; holds nothing that changes."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...], settings: TemplateSettings) -> None:
        self.settings, self.cameras = settings, cameras
        self.projector = OutlineProjector.of_body(body, cameras)
        self.priors = HardPriors(body)

    def problem(self, evidence: FrameEvidence) -> "TemplateProblem":
        """One frame as a function of poses. Raises FootageError where masks do not fit the cameras."""
        check_views(self.cameras, evidence, edges=False)
        return TemplateProblem(self, *packed_silhouettes(evidence))


class TemplateProblem:
    """One frame as a function of poses."""

    def __init__(
        self, weigher: TemplateWeigher, silhouettes: Words, views: IntArray, pixels: IntArray
    ) -> None:
        self.weigher, self.silhouettes, self.views, self.silhouette_pixels = (
            weigher,
            silhouettes,
            views,
            pixels,
        )

    def weigh(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights. Raises BodyError for poses that are no finite (N, D)."""
        return -self.differences(np.asarray(poses, dtype=np.float64)).sum(axis=1)

    def differences(self, poses: Array) -> Array:
        """(N, V) mean squared difference over all pixels of poses (N, D)."""
        outlines = self.weigher.projector.blocks(poses)
        counts = np.zeros((*outlines.shape[:2], LANES, 2), dtype=np.int64)
        run_blocks(
            chunk_templates,
            all_templates,
            len(outlines),
            BLOCKS_A_THREAD,
            *(outlines, self.views, self.silhouettes, counts),
        )
        counts = counts.transpose(0, 2, 1, 3).reshape(-1, outlines.shape[1], 2)[: len(poses)]
        differing = counts[..., 0] + self.silhouette_pixels - 2 * counts[..., 1]
        return differing / (self.views[:, 2] * self.views[:, 3])

    def fitness(self, poses: Array, stage: int = 0) -> Array:
        """(N,) the log-weights of poses (N, D): this weighting defines no other fitness."""
        return self.weigh(poses, stage)

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        return self.weigher.priors.hold(poses, limbs_apart)


def packed_silhouettes(evidence: FrameEvidence) -> tuple[Words, IntArray, IntArray]:
    """All masks as rows of 64-bit words (bit k of word w is pixel 64 w + k), one after another; (V, 4) where
    each begins, words a row, width, height; (V,) its pixels.
    """
    parts: list[Words] = []
    views = np.zeros((len(evidence.views), 4), dtype=np.int64)
    start = 0
    for row, view in zip(views, evidence.views, strict=True):
        height, width = view.mask.shape
        stride = -(-width // 64)
        padded = np.zeros((height, stride * 64), dtype=np.bool_)
        padded[:, :width] = view.mask >= FOREGROUND
        parts.append(np.packbits(padded, axis=1, bitorder="little").view("<u8").astype(np.uint64).ravel())
        row[:] = start, stride, width, height
        start += height * stride
    pixels = np.array([int(np.bitwise_count(part).sum()) for part in parts], dtype=np.int64)
    return np.concatenate(parts), views, pixels
