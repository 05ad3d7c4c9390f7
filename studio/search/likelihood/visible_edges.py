"""The edges of a body that a picture may show, and how well an edge map agrees (Fleischmann et al. 2012, section 2.2).

    f_e = mean of the edge map p, 0...1, over samples along the visible edges of the projected limbs

Counted are the edges parallel to the limbs' axes, and "the upper edge of the torso ... because it provides a
valuable hint for the z-location": the end of a trunk limb that lies nearest to the head. Never the head's, whose
"shape is only a very crude approximation". In the first stage of a search only the trunk's are; a body without a
trunk shows all its edges in both stages.

Every edge has the same number of samples, evenly spread. What lies behind a nearer limb is left out of the mean; a
sample outside the picture, or of a limb that cannot be projected, is not: it reads 0, so nothing is gained there. A
view in which no edge is visible gives 0.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence
from studio.foundations.arrays import Array, Floats
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.edge_region_kernels import CHUNK
from studio.search.likelihood.occlusion_kernels import hidden_blocks
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import joined_maps
from studio.search.likelihood.problem import TRUNK_FIRST
from studio.search.likelihood.visible_edge_kernels import edge_blocks, record_edges

IntArray = NDArray[np.int64]
Words = NDArray[np.uint64]

TRUNK, HEAD = "trunk", "head"
SIDES, NEAR_EDGE, FAR_EDGE = ((0, 1), (3, 2)), (0, 3), (1, 2)
"""First and last corners (A0 A1 B1 B0) of an outline's edges."""
BLOCKS_A_THREAD = 24
"""About half a millisecond of a four-camera frame."""


@dataclass(frozen=True, slots=True, eq=False)
class BodyEdges:
    """The edges that are used, (K, 3): drawn limb, corner where it begins, corner where it ends.

    whole : of the body. trunk : in the first stage of a search.
    """

    whole: IntArray
    trunk: IntArray

    def of_stage(self, stage: int) -> IntArray:
        """The edges of WHOLE_BODY or TRUNK_FIRST."""
        return self.trunk if stage == TRUNK_FIRST else self.whole


def body_edges(body: BodyModel) -> BodyEdges:
    """The edges of a body that the paper's fitness uses."""
    trunk = [index for index, limb in enumerate(body.drawn) if limb.part == TRUNK]
    shown = [(index, *side) for index, limb in enumerate(body.drawn) if limb.part != HEAD for side in SIDES]
    if not trunk:
        edges = np.array(shown, dtype=np.int64).reshape(-1, 3)
        return BodyEdges(edges, edges)
    edges = np.array([*shown, _upper_edge(body, trunk)], dtype=np.int64)
    return BodyEdges(edges, edges[np.isin(edges[:, 0], trunk)])


def limb_sides(limbs: int) -> IntArray:
    """(2 L, 3) both sides of every limb, in the order of the limbs."""
    return np.array([(limb, *side) for limb in range(limbs) for side in SIDES], dtype=np.int64).reshape(-1, 3)


def hidden_samples(outlines: Floats, edges: IntArray, samples: int) -> Words:
    """(B, V, K, 16) a bit for each of an edge's samples (at most 64) that lies behind a nearer limb."""
    hidden = np.empty((*outlines.shape[:2], len(edges), LANES), dtype=np.uint64)
    parallel_blocks(hidden_blocks, len(outlines), BLOCKS_A_THREAD, outlines, edges, samples, hidden)
    return hidden


class EdgeMaps:
    """The edge maps of a frame."""

    def __init__(self, evidence: FrameEvidence) -> None:
        self.maps = joined_maps([[(view.edges, None)] for view in evidence.views], (0, 0), np.uint8)

    def fitness(self, outlines: Floats, edges: IntArray, chunks: int, count: int) -> Array:
        """(N, V) f_e of the first `count` poses of outlines (B, V, L, 160); `chunks` times sixteen samples an edge."""
        found = np.empty((*outlines.shape[:2], LANES))
        hidden = hidden_samples(outlines, edges, chunks * CHUNK)
        given = outlines, edges, hidden, chunks, self.maps
        parallel_blocks(edge_blocks, len(outlines), BLOCKS_A_THREAD, *given, found)
        return found.transpose(0, 2, 1).reshape(-1, outlines.shape[1])[:count]

    def recorded_indices(self, outlines: Floats, edges: IntArray, chunks: int) -> NDArray[np.uint32]:
        """(B, V, 16, K, chunks, 1, 16) the pixels that the kernel reads, numbered from 0 in each picture; for tests."""
        shape = (*outlines.shape[:2], LANES, len(edges), chunks, 1, CHUNK)
        indices = np.zeros(shape, dtype=np.uint32)
        hidden = hidden_samples(outlines, edges, chunks * CHUNK)
        record_edges(outlines, edges, hidden, self.maps.views, indices)
        return indices


def _upper_edge(body: BodyModel, trunk: list[int]) -> tuple[int, int, int]:
    """The trunk's edge that lies nearest to where the head begins in the neutral pose; without a head the far end of
    the last of its limbs.
    """
    heads = [index for index, limb in enumerate(body.drawn) if limb.part == HEAD]
    if not heads:
        return trunk[-1], *FAR_EDGE
    ends = limb_ends(body, body.neutral[None])[0]
    away = np.linalg.norm(ends[trunk] - ends[heads[0], 0], axis=2)
    number, end = np.unravel_index(np.argmin(away), away.shape)
    return trunk[int(number)], *(FAR_EDGE if end else NEAR_EDGE)
