# pyright: standard
"""The mean of the edge map along visible edges, for many poses (Fleischmann et al. 2012, section 2.2).

An edge is a straight line of n samples, n a multiple of sixteen, from one corner of a limb's outline to another.
As for Eq. 14 the first pass writes which entries of the map the samples of sixteen poses fall on, the second adds those
up. Maps are bytes, 255 on an edge, followed by two entries that add nothing: NOTHING_SEEN for a sample that falls on no
pixel, which is counted all the same, and NOT_COUNTED for a hidden one.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.numba_in_threads import FAST, njit
from studio.search.likelihood.edge_region_kernels import (
    CHUNK,
    LINE,
    add_lanes,
    as_pairs,
    fill_lines,
    hide,
    record_lines,
    store_line,
)
from studio.search.likelihood.outline_kernels import HALF, LANES, ZERO
from studio.search.likelihood.picture_maps import Maps

BRIGHTEST = 255


@njit(**FAST)
def fill_edge(outline, corners, hidden, samples, view, line, indices, lost):
    """Indices (samples, 16) of an edge (limb, corner where it begins, corner where it ends) of sixteen poses, from its
    limb's outlines (160,). hidden : (1, 16) bits of its samples. line : (1, 64), scratch. lost : (16,), how many are
    hidden is added."""
    first, last = np.uint64(2 * LANES) * np.uint64(corners[1]), np.uint64(2 * LANES) * np.uint64(corners[2])
    begin, end = outline[first : first + np.uint64(2 * LANES)], outline[last : last + np.uint64(2 * LANES)]
    kept, count = line[0], np.float32(samples)
    for lane in range(LANES):
        x, y = begin[lane] + HALF, begin[LANES + lane] + HALF
        edge = x, y, end[lane] + HALF - x, end[LANES + lane] + HALF - y
        store_line(kept, 0, lane, edge, edge, ZERO, count)
    fill_lines(outline, line, samples, view, indices)
    hide(hidden, samples, view, indices, lost)


@njit(**FAST)
def edge_blocks(
    first: int,
    last: int,
    outlines: Floats,
    corners: Indices,
    hidden: NDArray[np.uint64],
    chunks: int,
    maps: Maps,
    found: Array,
) -> None:
    """Mean of the edge maps, 0...1, over the visible samples of the blocks first..last - 1; 0 where none is visible.

    corners : (K, 3) limb, corner where the edge begins, corner where it ends. hidden : (B, V, K, 16) bits of hidden
    samples. chunks : how many times sixteen samples an edge has. found : (B, V, 16).
    """
    values, views = maps.values, maps.views
    samples = chunks * CHUNK
    indices = np.zeros((samples, LANES), np.uint32)
    pairs = as_pairs(indices).ravel()
    line = np.zeros((1, LINE), np.float32)
    sums, lost = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64)
    size = corners.shape[0] * samples
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            sums[:], lost[:] = 0, 0
            for number in range(corners.shape[0]):
                outline, bits = (
                    outlines[block, view, corners[number, 0]],
                    hidden[block, view, number : number + 1],
                )
                fill_edge(outline, corners[number], bits, samples, views[view], line, indices, lost)
                add_lanes(values, np.uint64(views[view, 0]), pairs, sums)
            for lane in range(LANES):
                mean = 0.0
                if lost[lane] < size:
                    mean = sums[lane] / (BRIGHTEST * (size - lost[lane]))
                found[block, view, lane] = mean


@njit(**FAST)
def record_edges(
    outlines: Floats,
    corners: Indices,
    hidden: NDArray[np.uint64],
    views: Indices,
    found: NDArray[np.uint32],
) -> None:
    """The index stream of `edge_blocks`: (B, V, 16, K, chunks, 1, 16). For tests."""
    samples = found.shape[4] * CHUNK
    indices = np.zeros((samples, LANES), np.uint32)
    line, lost = np.zeros((1, LINE), np.float32), np.zeros(LANES, np.int64)
    for block in range(found.shape[0]):
        for view in range(found.shape[1]):
            for number in range(corners.shape[0]):
                outline, bits = (
                    outlines[block, view, corners[number, 0]],
                    hidden[block, view, number : number + 1],
                )
                fill_edge(outline, corners[number], bits, samples, views[view], line, indices, lost)
                record_lines(indices, samples, found[block, view, :, number])
