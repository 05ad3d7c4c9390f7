# pyright: standard
"""Edge and region sums of Eq. 14 and 15 for many poses, in two passes: indices first, then bare loads.

A limb in a view is five straight lines of n samples: its two sides (edges) and three lines within (region), n
a multiple of sixteen, found for sixteen poses at a time. The first pass steps along a pose's lines, sixteen
samples at a time, and writes which entries of the maps they fall on; the second adds those entries up, two
indices in each 64-bit load. Maps are bytes that hold 255 (1 - p)² already. Each is followed by two entries for
samples that fall on no pixel: NOTHING_SEEN costs the most that a sample can, NOT_COUNTED costs nothing and is
left out of N.
"""

import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Floats, Indices
from studio.likelihood.outline_kernels import HALF, LANES, ONE, ZERO
from studio.likelihood.picture_maps import Maps
from studio.numba_in_threads import FAST, FAST_INLINED, njit

CHUNK = 16
EDGE_LINES, REGION_LINES = 2, 3
LINE_ROWS = 4 * (EDGE_LINES + REGION_LINES)
# Across a limb: the middles of three equal strips.
FIRST_STRIP, SECOND_STRIP, THIRD_STRIP = np.float32(1.0 / 6.0), np.float32(0.5), np.float32(5.0 / 6.0)
NOTHING_SEEN, NOT_COUNTED = 0, 1
PADDING = 2
WORST = 255
UPPER, LOW = np.uint64(32), np.uint64(0xFFFFFFFF)


@njit(**FAST_INLINED)
def store_line(row, number, lane, a, b, fraction, samples):
    """Keep the line at a fraction of the way from side a to side b (x, y, dx, dy) as a limb's line `number`:
    the place of its first sample and the step to the next; samples lie at (j + 1/2) / samples."""
    step_x, step_y = (a[2] + fraction * (b[2] - a[2])) / samples, (a[3] + fraction * (b[3] - a[3])) / samples
    row[4 * number * LANES + lane] = a[0] + fraction * (b[0] - a[0]) + HALF * step_x
    row[(4 * number + 1) * LANES + lane] = a[1] + fraction * (b[1] - a[1]) + HALF * step_y
    row[(4 * number + 2) * LANES + lane] = step_x
    row[(4 * number + 3) * LANES + lane] = step_y


@njit(**FAST_INLINED)
def limb_lines(outline, row, edge_samples, region_samples):
    """The five lines of a limb of sixteen poses, from its outlines (160,) in one view.

    row : (320,): four rows of sixteen lanes a line, pixels, half a pixel on so that truncation rounds.
    """
    for lane in range(LANES):
        ax, ay = outline[lane] + HALF, outline[LANES + lane] + HALF
        ex, ey = outline[6 * LANES + lane] + HALF, outline[7 * LANES + lane] + HALF
        bx, by = outline[2 * LANES + lane] + HALF - ax, outline[3 * LANES + lane] + HALF - ay
        cx, cy = outline[4 * LANES + lane] + HALF - ex, outline[5 * LANES + lane] + HALF - ey
        a, b = (ax, ay, bx, by), (ex, ey, cx, cy)
        store_line(row, 0, lane, a, b, ZERO, edge_samples)
        store_line(row, 1, lane, a, b, ONE, edge_samples)
        store_line(row, 2, lane, a, b, FIRST_STRIP, region_samples)
        store_line(row, 3, lane, a, b, SECOND_STRIP, region_samples)
        store_line(row, 4, lane, a, b, THIRD_STRIP, region_samples)


@njit(**FAST)
def view_lines(outlines, block, view, lines, edge_samples, region_samples):
    """The lines (L, 320) of all limbs of sixteen poses in one view."""
    for limb in range(lines.shape[0]):
        limb_lines(outlines[block, view, limb], lines[limb], edge_samples, region_samples)


@njit(**FAST_INLINED)
def line_at(lines, limb, number, lane):
    """One line of one pose: place of its first sample and step, x, y, dx, dy."""
    return (
        lines[limb, 4 * number * LANES + lane],
        lines[limb, (4 * number + 1) * LANES + lane],
        lines[limb, (4 * number + 2) * LANES + lane],
        lines[limb, (4 * number + 3) * LANES + lane],
    )


@njit(**FAST_INLINED)
def pixel(line, sample, width):
    """Number of the pixel nearest to a sample of a line (first place and step) inside the picture."""
    number = np.float32(sample)
    x, y = line[0] + number * line[2], line[1] + number * line[3]
    return np.uint32(np.int32(np.floor(y) * width + np.floor(x)))


@njit(**FAST_INLINED)
def fill_edges(lines, limb, lane, width, edges):
    """Indices of both sides of a limb that is wholly inside the picture."""
    a, b = line_at(lines, limb, 0, lane), line_at(lines, limb, 1, lane)
    for chunk in range(edges.shape[1]):
        for j in range(CHUNK):
            edges[limb, chunk, 0, j] = pixel(a, chunk * CHUNK + j, width)
            edges[limb, chunk, 1, j] = pixel(b, chunk * CHUNK + j, width)


@njit(**FAST_INLINED)
def fill_region(lines, limb, lane, width, region):
    """Indices of the three inner lines of a limb that is wholly inside the picture."""
    a, b, c = line_at(lines, limb, 2, lane), line_at(lines, limb, 3, lane), line_at(lines, limb, 4, lane)
    for chunk in range(region.shape[1]):
        for j in range(CHUNK):
            region[limb, chunk, 0, j] = pixel(a, chunk * CHUNK + j, width)
            region[limb, chunk, 1, j] = pixel(b, chunk * CHUNK + j, width)
            region[limb, chunk, 2, j] = pixel(c, chunk * CHUNK + j, width)


@njit(**FAST)
def fill_clipped(line, view, unseen, indices, limb, number):
    """Indices of a limb's line that may leave the picture: samples outside it cost the most."""
    width, height = view[2], view[3]
    nothing = np.uint32(width * height + NOTHING_SEEN)
    for chunk in range(indices.shape[1]):
        for j in range(CHUNK):
            sample = np.float32(chunk * CHUNK + j)
            x, y = line[0] + sample * line[2], line[1] + sample * line[3]
            inside = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
            index = nothing
            if inside and not unseen:
                index = np.uint32(np.int64(y) * width + np.int64(x))
            indices[limb, chunk, number, j] = index


@njit(**FAST)
def fill_limb_clipped(lines, limb, lane, view, unseen, edges, region):
    """Indices of a limb that is not wholly inside the picture, or not seen at all."""
    for side in range(EDGE_LINES):
        fill_clipped(line_at(lines, limb, side, lane), view, unseen, edges, limb, side)
    for strip in range(REGION_LINES):
        fill_clipped(line_at(lines, limb, EDGE_LINES + strip, lane), view, unseen, region, limb, strip)


@njit(**FAST)
def hide(bits, not_counted, edges, limb, side):
    """Replace the indices of one side's hidden samples (a bit each); returns how many there were."""
    count = 0
    for chunk in range(edges.shape[1]):
        for j in range(CHUNK):
            if bits & np.uint64(1):
                edges[limb, chunk, side, j] = not_counted
                count += 1
            bits >>= np.uint64(1)
    return count


@njit(**FAST_INLINED)
def fill_view(outlines, lines, hidden, block, view, lane, views, edges, region):
    """Indices of all samples of one pose in one view.

    lines : of this block and view. hidden : (B, V, L, 2, 16) bits of edge samples, of no blocks where none are
    looked for. edges, region :     (L, chunks, lines, 16), filled. Returns how many edge samples are hidden.
    """
    width = np.float32(views[view, 2])
    count = 0
    for limb in range(outlines.shape[2]):
        state = outlines[block, view, limb, 8 * LANES + lane]
        if state > HALF:
            fill_edges(lines, limb, lane, width, edges)
            fill_region(lines, limb, lane, width, region)
        else:
            fill_limb_clipped(lines, limb, lane, views[view], state < -HALF, edges, region)
        if hidden.shape[0]:
            not_counted = np.uint32(views[view, 2] * views[view, 3] + NOT_COUNTED)
            for side in range(EDGE_LINES):
                bits = hidden[block, view, limb, side, lane]
                if bits:
                    count += hide(bits, not_counted, edges, limb, side)
    return count


@njit(**FAST_INLINED)
def add_up(values, base, pairs):
    """The sum of the entries of a map that begins at `base` at indices (rows, 8), two of them in each word.

    The test that never stops the loop keeps the compiler from turning it into gathers, which are slower.
    """
    a = b = c = d = np.uint64(0)
    end = np.uint64(values.shape[0])
    for k in range(pairs.shape[0]):
        if pairs[k, 0] & LOW >= end:
            break
        p, q, r, s = pairs[k, 0], pairs[k, 1], pairs[k, 2], pairs[k, 3]
        a += values[(p & LOW) + base]
        b += values[(p >> UPPER) + base]
        c += values[(q & LOW) + base]
        d += values[(q >> UPPER) + base]
        a += values[(r & LOW) + base]
        b += values[(r >> UPPER) + base]
        c += values[(s & LOW) + base]
        d += values[(s >> UPPER) + base]
        p, q, r, s = pairs[k, 4], pairs[k, 5], pairs[k, 6], pairs[k, 7]
        a += values[(p & LOW) + base]
        b += values[(p >> UPPER) + base]
        c += values[(q & LOW) + base]
        d += values[(q >> UPPER) + base]
        a += values[(r & LOW) + base]
        b += values[(r >> UPPER) + base]
        c += values[(s & LOW) + base]
        d += values[(s >> UPPER) + base]
    return np.int64(a + b + c + d)


@njit(**FAST_INLINED)
def as_pairs(indices):
    """Indices (..., 16) uint32 as (rows, 8) uint64: two in each word."""
    return indices.reshape((indices.size // CHUNK, CHUNK)).view(np.uint64)


@njit(**FAST)
def weight_blocks(
    first: int,
    last: int,
    count: int,
    outlines: Floats,
    hidden: NDArray[np.uint64],
    edge_chunks: int,
    region_chunks: int,
    maps: Maps,
    weights: Array,
    terms: Array,
    log_weights: Array,
) -> None:
    """Eq. 14, 15 and 17 for the blocks first..last - 1 of sixteen poses, `count` of them in all blocks.

    edge_chunks, region_chunks : how many times sixteen samples a line has. weights : (2,) of the edge and region
    terms. terms : (B, 16, V, 2) float64, filled with Σe and Σr. log_weights : (B, 16).
    """
    values, views = maps.values, maps.views
    limbs = outlines.shape[2]
    edges = np.zeros((limbs, edge_chunks, EDGE_LINES, CHUNK), np.uint32)
    region = np.zeros((limbs, region_chunks, REGION_LINES, CHUNK), np.uint32)
    edge_pairs, region_pairs = as_pairs(edges), as_pairs(region)
    lines = np.zeros((limbs, LINE_ROWS * LANES), np.float32)
    edge_samples, region_samples = np.float32(edge_chunks * CHUNK), np.float32(region_chunks * CHUNK)
    for block in range(first, last):
        log_weights[block] = 0.0
        for view in range(outlines.shape[1]):
            edge_base, region_base = np.uint64(views[view, 0]), np.uint64(views[view, 1])
            view_lines(outlines, block, view, lines, edge_samples, region_samples)
            for lane in range(min(LANES, count - block * LANES)):
                lost = fill_view(outlines, lines, hidden, block, view, lane, views, edges, region)
                edge, region_term = 1.0, add_up(values, region_base, region_pairs) / (WORST * region.size)
                if lost < edges.size:
                    edge = add_up(values, edge_base, edge_pairs) / (WORST * (edges.size - lost))
                terms[block, lane, view, 0] = edge
                terms[block, lane, view, 1] = region_term
                log_weights[block, lane] -= weights[0] * edge + weights[1] * region_term


@njit(**FAST)
def record_indices(
    outlines: Floats,
    hidden: NDArray[np.uint64],
    views: Indices,
    edges: NDArray[np.uint32],
    region: NDArray[np.uint32],
) -> None:
    """The index stream of `weight_blocks`: (B, V, 16, L, chunks, lines, 16) each. For benchmark and tests."""
    lines = np.zeros((outlines.shape[2], LINE_ROWS * LANES), np.float32)
    edge_samples, region_samples = np.float32(edges.shape[4] * CHUNK), np.float32(region.shape[4] * CHUNK)
    for block in range(edges.shape[0]):
        for view in range(edges.shape[1]):
            view_lines(outlines, block, view, lines, edge_samples, region_samples)
            for lane in range(LANES):
                fill_view(outlines, lines, hidden, block, view, lane, views,
                    edges[block, view, lane], region[block, view, lane],
                )  # fmt: skip


@njit(**FAST)
def loads_only(
    maps: Maps,
    edge_pairs: NDArray[np.uint64],
    region_pairs: NDArray[np.uint64],
    passes: int,
    sums: Indices,
) -> None:
    """Nothing but the loads of `weight_blocks` at recorded indices, `passes` times over: its limit.

    edge_pairs, region_pairs : (B, V, 16, rows, 8) uint64. sums : (B, V, 16, 2), added to.
    """
    values, views = maps.values, maps.views
    for _ in range(passes):
        for block in range(edge_pairs.shape[0]):
            for view in range(edge_pairs.shape[1]):
                edge_base, region_base = np.uint64(views[view, 0]), np.uint64(views[view, 1])
                for lane in range(LANES):
                    sums[block, view, lane, 0] += add_up(values, edge_base, edge_pairs[block, view, lane])
                    sums[block, view, lane, 1] += add_up(values, region_base, region_pairs[block, view, lane])
