"""The sums of the benchmark's score for many poses: as many samples as a limb is long and wide in the
picture.

Two passes, as in `edge_region_kernels`: indices into a buffer, filled up to a multiple of sixteen with the
index of an entry that is 0, then bare loads. Maps are 16-bit and hold (255 - e)² and "no foreground" (0 or
1), so that sums are exact.
"""

import numpy as np

from studio.numba_in_threads import FAST, FAST_INLINED, njit
from studio.weighting.edge_region_kernels import CHUNK, add_up, as_pairs
from studio.weighting.outline_kernels import HALF, LANES, ONE, ZERO

LEAST, MOST = 4, np.float32(1.0e6)
EDGE_STEP, INSIDE_STEP = np.float32(5.0), np.float32(10.0)


@njit(**FAST_INLINED)
def intervals(x, y, step):
    """Number of intervals of about `step` pixels on a line, at least LEAST."""
    return max(LEAST, int(min(np.sqrt(x * x + y * y) / step, MOST) + HALF))


@njit(**FAST)
def fill_line(x, y, dx, dy, step, count, width, indices, at):
    """Indices of `count` samples x + i step dx (pixels, half a pixel on), all inside the picture."""
    for i in range(count):
        t = np.float32(i) * step
        indices[at + i] = np.uint32(np.int32(np.floor(y + t * dy) * width + np.floor(x + t * dx)))
    return at + count


@njit(**FAST)
def fill_clipped(x, y, dx, dy, step, count, width, height, indices, at):
    """The same for a line that may leave the picture: samples outside are skipped."""
    for i in range(count):
        t = np.float32(i) * step
        u, v = x + t * dx, y + t * dy
        if (u >= ZERO) & (u < width) & (v >= ZERO) & (v < height):
            indices[at] = np.uint32(np.int32(np.floor(v) * width + np.floor(u)))
            at += 1
    return at


@njit(**FAST_INLINED)
def line(whole, x, y, dx, dy, step, count, width, height, indices, at):
    """`fill_line` or `fill_clipped`; nothing where the buffer is full."""
    if at + count + CHUNK > indices.shape[0]:
        return at
    if whole:
        return fill_line(x, y, dx, dy, step, count, width, indices, at)
    return fill_clipped(x, y, dx, dy, step, count, width, height, indices, at)


@njit(**FAST)
def limb_corners(outlines, block, view, limb, lane):
    """Corners A0, A1, B1, B0 of a limb, pixels, half a pixel on so that flooring rounds."""
    ax, ay = outlines[block, view, limb, lane] + HALF, outlines[block, view, limb, LANES + lane] + HALF
    bx = outlines[block, view, limb, 2 * LANES + lane] + HALF
    by = outlines[block, view, limb, 3 * LANES + lane] + HALF
    cx = outlines[block, view, limb, 4 * LANES + lane] + HALF
    cy = outlines[block, view, limb, 5 * LANES + lane] + HALF
    ex = outlines[block, view, limb, 6 * LANES + lane] + HALF
    ey = outlines[block, view, limb, 7 * LANES + lane] + HALF
    return ax, ay, bx, by, cx, cy, ex, ey


@njit(**FAST)
def fill_edges(outlines, block, view, lane, width, height, indices):
    """Indices of the samples along both sides of every limb; returns how many."""
    at = 0
    for limb in range(outlines.shape[2]):
        state = outlines[block, view, limb, 8 * LANES + lane]
        if state < -HALF:
            continue
        ax, ay, bx, by, cx, cy, ex, ey = limb_corners(outlines, block, view, limb, lane)
        n = intervals(bx - ax, by - ay, EDGE_STEP)
        at = line(state > HALF, ax, ay, bx - ax, by - ay, ONE / n, n + 1, width, height, indices, at)
        n = intervals(cx - ex, cy - ey, EDGE_STEP)
        at = line(state > HALF, ex, ey, cx - ex, cy - ey, ONE / n, n + 1, width, height, indices, at)
    return at


@njit(**FAST)
def fill_inside(outlines, block, view, lane, width, height, indices):
    """Indices of the grid within every limb, its last column left out as the benchmark does; returns how
    many.
    """
    at = 0
    for limb in range(outlines.shape[2]):
        state = outlines[block, view, limb, 8 * LANES + lane]
        if state < -HALF:
            continue
        ax, ay, bx, by, cx, cy, ex, ey = limb_corners(outlines, block, view, limb, lane)
        rows = intervals(bx - ax, by - ay, INSIDE_STEP)
        columns = intervals(HALF * (ex + cx - ax - bx), HALF * (ey + cy - ay - by), INSIDE_STEP)
        for column in range(columns):
            across = np.float32(column) / np.float32(columns)
            x, y = ax + across * (ex - ax), ay + across * (ey - ay)
            dx, dy = bx + across * (cx - bx) - x, by + across * (cy - by) - y
            at = line(state > HALF, x, y, dx, dy, ONE / rows, rows + 1, width, height, indices, at)
    return at


@njit(**FAST)
def add_samples(values, base, nothing, indices, pairs, count):
    """The sum of a map's entries at the first `count` indices; those that fill up the last sixteen become `nothing`."""
    rounds = (count + CHUNK - 1) // CHUNK
    for i in range(count, rounds * CHUNK):
        indices[i] = nothing
    return add_up(values, base, pairs[:rounds])


@njit(**FAST)
def score_blocks(first, last, outlines, maps, capacity, sums):
    """Sums of the blocks first..last - 1 over all limbs and views.

    sums : (B, 16, 4) int64: edge map, edge samples, inside map, inside samples. capacity : a multiple of
    sixteen, the most samples of one kind in one view.
    """
    values, views = maps.values, maps.views
    indices = np.zeros(capacity, np.uint32)
    pairs = as_pairs(indices)
    for block in range(first, last):
        sums[block] = 0
        for view in range(outlines.shape[1]):
            width, height = np.float32(views[view, 2]), np.float32(views[view, 3])
            nothing = np.uint32(views[view, 2] * views[view, 3])
            edges, inside = np.uint64(views[view, 0]), np.uint64(views[view, 1])
            for lane in range(LANES):
                count = fill_edges(outlines, block, view, lane, width, height, indices)
                sums[block, lane, 0] += add_samples(values, edges, nothing, indices, pairs, count)
                sums[block, lane, 1] += count
                count = fill_inside(outlines, block, view, lane, width, height, indices)
                sums[block, lane, 2] += add_samples(values, inside, nothing, indices, pairs, count)
                sums[block, lane, 3] += count
