# pyright: standard
"""The mean of the edge map along visible edges, for many poses (Fleischmann et al. 2012, section 2.2).

An edge is a straight line of n samples, n a multiple of sixteen, from one corner of a limb's outline to another.
As for Eq. 14 the first pass writes which entries of the map the samples fall on, the second adds those up. Maps are
bytes, 255 on an edge, followed by two entries that add nothing: NOTHING_SEEN for a sample that falls on no pixel,
which is counted all the same, and NOT_COUNTED for a hidden one.
"""

import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Floats, Indices
from studio.likelihood.area_kernels import bit_count
from studio.likelihood.edge_region_kernels import (
    CHUNK,
    NOT_COUNTED,
    add_up,
    as_pairs,
    fill_clipped,
    hide,
    line_at,
    pixel,
    store_line,
)
from studio.likelihood.outline_kernels import HALF, LANES, ZERO
from studio.likelihood.picture_maps import Maps
from studio.numba_in_threads import FAST, FAST_INLINED, njit

BRIGHTEST = 255


@njit(**FAST)
def edge_lines(outlines, block, view, corners, lines, samples):
    """Fill lines (K, 64), four rows of sixteen lanes each, of all edges of sixteen poses in one view; pixels, half a
    pixel on so that truncation rounds."""
    ends = np.zeros(4 * LANES, np.float32)
    for number in range(corners.shape[0]):
        limb = corners[number, 0]
        first = np.uint64(2 * LANES) * np.uint64(corners[number, 1])
        last = np.uint64(2 * LANES) * np.uint64(corners[number, 2])
        for i in range(2 * LANES):
            ends[i] = outlines[block, view, limb, first + np.uint64(i)]
            ends[2 * LANES + i] = outlines[block, view, limb, last + np.uint64(i)]
        line = lines[number]
        for lane in range(LANES):
            x, y = ends[lane] + HALF, ends[LANES + lane] + HALF
            edge = x, y, ends[2 * LANES + lane] + HALF - x, ends[3 * LANES + lane] + HALF - y
            store_line(line, 0, lane, edge, edge, ZERO, samples)


@njit(**FAST_INLINED)
def fill_edge(line, bits, not_counted, width, indices, number):
    """Indices of the samples of an edge of a limb that is wholly inside the picture."""
    for chunk in range(indices.shape[1]):
        dropped = np.uint32(bits & np.uint64(0xFFFF))
        for j in range(CHUNK):
            index = pixel(line, chunk * CHUNK + j, width)
            indices[number, chunk, 0, j] = not_counted if (dropped >> np.uint32(j)) & np.uint32(1) else index
        bits >>= np.uint64(CHUNK)


@njit(**FAST)
def fill_edge_clipped(line, bits, not_counted, view, unseen, indices, number):
    """Indices of the samples of an edge of a limb that may leave the picture, or is not seen at all."""
    fill_clipped(line, view, unseen, indices, number, 0)
    if bits:
        hide(bits, not_counted, indices, number, 0)


@njit(**FAST_INLINED)
def fill_edges(outlines, corners, hidden, block, view, lane, lines, views, indices):
    """Indices (K, chunks, 1, 16) of all samples of one pose in one view; returns how many are hidden."""
    width = np.float32(views[view, 2])
    not_counted = np.uint32(views[view, 2] * views[view, 3] + NOT_COUNTED)
    lost = 0
    for number in range(corners.shape[0]):
        seen = outlines[block, view, corners[number, 0], 8 * LANES + lane]
        bits = hidden[block, view, number, lane]
        line = line_at(lines, number, 0, lane)
        if seen > HALF:
            fill_edge(line, bits, not_counted, width, indices, number)
        else:
            fill_edge_clipped(line, bits, not_counted, views[view], seen < -HALF, indices, number)
        lost += bit_count(bits)  # pyright: ignore[reportCallIssue] - Numba gives the context
    return lost


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
    indices = np.zeros((corners.shape[0], chunks, 1, CHUNK), np.uint32)
    pairs = as_pairs(indices)
    lines = np.zeros((corners.shape[0], 4 * LANES), np.float32)
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            edge_lines(outlines, block, view, corners, lines, np.float32(chunks * CHUNK))
            base = np.uint64(views[view, 0])
            for lane in range(LANES):
                lost = fill_edges(outlines, corners, hidden, block, view, lane, lines, views, indices)
                mean = 0.0
                if lost < indices.size:
                    mean = add_up(values, base, pairs) / (BRIGHTEST * (indices.size - lost))
                found[block, view, lane] = mean


@njit(**FAST)
def record_edges(
    outlines: Floats,
    corners: Indices,
    hidden: NDArray[np.uint64],
    views: Indices,
    indices: NDArray[np.uint32],
) -> None:
    """The index stream of `edge_blocks`: (B, V, 16, K, chunks, 1, 16). For tests."""
    lines = np.zeros((corners.shape[0], 4 * LANES), np.float32)
    samples = np.float32(indices.shape[4] * CHUNK)
    for block in range(indices.shape[0]):
        for view in range(indices.shape[1]):
            edge_lines(outlines, block, view, corners, lines, samples)
            for lane in range(LANES):
                fill_edges(
                    outlines, corners, hidden, block, view, lane, lines, views, indices[block, view, lane]
                )
