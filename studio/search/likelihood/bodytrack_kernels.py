# pyright: standard
"""The sums of the benchmark's score for many poses: as many samples as a limb is long and wide in the
picture.

Two passes, as in `edge_region_kernels`: indices into a buffer, then bare loads. Lines are short, so sixteen poses are
filled side by side: a row of the buffer is one sample of each, and a pose whose line has fewer samples, or leaves the
picture, reads an entry that is 0 there. Sixteen poses of which one is so near to a camera that the buffer cannot hold
its lines are filled one by one. Maps are 16-bit and hold (255 - e)² and "no foreground" (0 or 1), so that sums are
exact, whatever their order.
"""

import numpy as np

from studio.foundations.arrays import Floats, Indices
from studio.foundations.numba_in_threads import FAST, FAST_INLINED, njit
from studio.search.likelihood.edge_region_kernels import CHUNK, add_lanes, add_up, as_pairs
from studio.search.likelihood.outline_kernels import HALF, LANES, ONE, ZERO
from studio.search.likelihood.picture_maps import Maps

LEAST, MOST = 4, np.float32(1.0e6)
EDGE_STEP, INSIDE_STEP = np.float32(5.0), np.float32(10.0)
MOST_ROWS = 4096
"""Rows of the buffer: of ten limbs about 200 are used."""
AT_ONCE = 4
"""Rows that `add_lanes` reads at once; the last ones are filled up."""
# Rows of sixteen lanes of the lines at hand: place of the first sample (pixels, half a pixel on), way to the last,
# 1 / intervals, number of the last sample (-1: none).
X, Y, ACROSS, DOWN, STEP, LAST, LINE_ROWS = 0, LANES, 2 * LANES, 3 * LANES, 4 * LANES, 5 * LANES, 6


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


@njit(**FAST_INLINED)
def lane_corners(outline, corners, seen):
    """Fill corners (128,), as `limb_corners`, and seen (16,) of a limb of sixteen poses from its outlines (160,);
    whether it is wholly inside the picture in all of them.
    """
    whole = True
    for lane in range(LANES):
        for row in range(8):
            corners[row * LANES + lane] = outline[row * LANES + lane] + HALF
        seen[lane] = outline[8 * LANES + lane] >= -HALF
        whole &= outline[8 * LANES + lane] > HALF
    return whole


@njit(**FAST_INLINED)
def lane_intervals(x, y, step):
    """As `intervals`, 32 bits wide."""
    return np.int32(max(np.float32(LEAST), np.floor(min(np.sqrt(x * x + y * y) / step, MOST) + HALF)))


@njit(**FAST_INLINED)
def side_lines(corners, seen, begin, end, lines):
    """Fill the lines (96,) of one side of a limb, from one corner to another; the largest number of a sample."""
    most = np.int32(-1)
    for lane in range(LANES):
        x, y = corners[2 * begin * LANES + lane], corners[(2 * begin + 1) * LANES + lane]
        dx, dy = corners[2 * end * LANES + lane] - x, corners[(2 * end + 1) * LANES + lane] - y
        count = lane_intervals(dx, dy, EDGE_STEP)
        last = count if seen[lane] else np.int32(-1)
        lines[X + lane], lines[Y + lane], lines[ACROSS + lane], lines[DOWN + lane] = x, y, dx, dy
        lines[STEP + lane], lines[LAST + lane] = 1.0 / np.float64(count), np.float64(last)
        most = max(most, last)
    return most


@njit(**FAST_INLINED)
def lane_of(corners, lane):
    """Corners A0, A1, B1, B0 of one pose."""
    return (
        corners[lane], corners[LANES + lane], corners[2 * LANES + lane], corners[3 * LANES + lane],
        corners[4 * LANES + lane], corners[5 * LANES + lane], corners[6 * LANES + lane], corners[7 * LANES + lane],
    )  # fmt: skip


@njit(**FAST_INLINED)
def grid_sizes(corners, seen, columns, rows, lines):
    """Fill columns (16,) and rows (16,) of the grid within a limb, and the lines' steps; returns the most columns, and
    the largest number of a row.
    """
    most_columns, most = np.int32(0), np.int32(-1)
    for lane in range(LANES):
        ax, ay, bx, by, cx, cy, ex, ey = lane_of(corners, lane)
        down = lane_intervals(bx - ax, by - ay, INSIDE_STEP)
        across = lane_intervals(HALF * (ex + cx - ax - bx), HALF * (ey + cy - ay - by), INSIDE_STEP)
        columns[lane] = across if seen[lane] else np.int32(0)
        rows[lane] = down
        lines[STEP + lane] = 1.0 / np.float64(down)
        most_columns = max(most_columns, columns[lane])
        most = max(most, down if seen[lane] else np.int32(-1))
    return most_columns, most


@njit(**FAST_INLINED)
def column_lines(corners, column, columns, rows, lines):
    """Fill the lines (96,) of one column of the grid within a limb."""
    number = np.float32(column)
    for lane in range(LANES):
        ax, ay, bx, by, cx, cy, ex, ey = lane_of(corners, lane)
        across = number / np.float32(columns[lane])
        x, y = ax + across * (ex - ax), ay + across * (ey - ay)
        lines[X + lane], lines[Y + lane] = x, y
        lines[ACROSS + lane] = bx + across * (cx - bx) - x
        lines[DOWN + lane] = by + across * (cy - by) - y
        lines[LAST + lane] = np.float64(rows[lane]) if np.int32(column) < columns[lane] else -1.0


@njit(**FAST_INLINED)
def lane_sample(lines, number, lane):
    """Place of a sample of one pose's line."""
    t = number * lines[STEP + lane]
    return lines[X + lane] + t * lines[ACROSS + lane], lines[Y + lane] + t * lines[DOWN + lane]


@njit(**FAST_INLINED)
def fill_whole_rows(lines, most, across, nothing, buffer, at, counts):
    """Rows of the buffer from `at` on: samples 0 to `most` of lines that lie inside the picture."""
    for sample in range(most + 1):
        number, row = np.float64(sample), buffer[at + sample]
        for lane in range(LANES):
            u, v = lane_sample(lines, number, lane)
            index = np.uint32(np.int32(v) * across + np.int32(u))
            row[lane] = index if number <= lines[LAST + lane] else nothing
    for lane in range(LANES):
        counts[lane] += np.int32(lines[LAST + lane]) + np.int32(1)


@njit(**FAST_INLINED)
def fill_clipped_rows(lines, most, across, down, nothing, buffer, at, counts):
    """The same for lines that may leave the picture of `across` by `down` pixels."""
    width, height = np.float64(across), np.float64(down)
    for sample in range(most + 1):
        number, row = np.float64(sample), buffer[at + sample]
        for lane in range(LANES):
            u, v = lane_sample(lines, number, lane)
            inside = (number <= lines[LAST + lane]) & (u >= 0.0) & (u < width) & (v >= 0.0) & (v < height)
            index = np.uint32(np.int32(v) * across + np.int32(u))
            row[lane] = index if inside else nothing
            counts[lane] += np.int32(inside)


@njit(**FAST_INLINED)
def fill_rows(whole, lines, most, size, nothing, buffer, at, counts):
    """Rows of samples 0 to `most` of sixteen lines; returns the row after them, -1 where the buffer cannot hold them.
    counts : (16,), the samples that count are added.
    """
    if at < 0 or at + most + AT_ONCE > buffer.shape[0]:
        return -1
    if whole:
        fill_whole_rows(lines, most, size[0], nothing, buffer, at, counts)
    else:
        fill_clipped_rows(lines, most, size[0], size[1], nothing, buffer, at, counts)
    return at + most + 1


@njit(**FAST_INLINED)
def fill_sides(limbs, size, nothing, scratch, buffer, counts):
    """Rows of both sides of all limbs (L, 160); returns how many, -1 where there is no room."""
    corners, seen, lines, _, _ = scratch
    at = 0
    for limb in range(limbs.shape[0]):
        whole = lane_corners(limbs[limb], corners, seen)
        most = side_lines(corners, seen, 0, 1, lines)
        at = fill_rows(whole, lines, most, size, nothing, buffer, at, counts)
        most = side_lines(corners, seen, 3, 2, lines)
        at = fill_rows(whole, lines, most, size, nothing, buffer, at, counts)
    return at


@njit(**FAST_INLINED)
def fill_grids(limbs, size, nothing, scratch, buffer, counts):
    """Rows of the grids within all limbs (L, 160); returns how many, -1 where there is no room."""
    corners, seen, lines, columns, rows = scratch
    at = 0
    for limb in range(limbs.shape[0]):
        whole = lane_corners(limbs[limb], corners, seen)
        count, most = grid_sizes(corners, seen, columns, rows, lines)
        if count * (most + 1) > buffer.shape[0]:
            return -1
        for column in range(count):
            column_lines(corners, column, columns, rows, lines)
            at = fill_rows(whole, lines, most, size, nothing, buffer, at, counts)
    return at


@njit(**FAST)
def score_blocks(
    first: int,
    last: int,
    outlines: Floats,
    maps: Maps,
    capacity: int,
    most_rows: int,
    sums: Indices,
) -> None:
    """Sums of the blocks first..last - 1 over all limbs and views.

    sums : (B, 16, 4) int64: edge map, edge samples, inside map, inside samples. capacity : a multiple of
    sixteen, the most samples of one kind in one view of a pose filled by itself. most_rows : of the buffer for sixteen.
    """
    values, views = maps.values, maps.views
    buffer = np.zeros((most_rows, LANES), np.uint32)
    rows_of_pairs = as_pairs(buffer).ravel()
    scratch = (
        np.zeros(8 * LANES, np.float32),
        np.zeros(LANES, np.bool_),
        np.zeros(LINE_ROWS * LANES),
        np.zeros(LANES, np.int32),
        np.zeros(LANES, np.int32),
    )
    counts, found = np.zeros(LANES, np.int32), np.zeros(LANES, np.int64)
    indices = np.zeros(capacity, np.uint32)
    pairs = as_pairs(indices)
    for block in range(first, last):
        sums[block] = 0
        for view in range(outlines.shape[1]):
            limbs, size = outlines[block, view], (np.int32(views[view, 2]), np.int32(views[view, 3]))
            width, height = np.float32(views[view, 2]), np.float32(views[view, 3])
            nothing = np.uint32(views[view, 2] * views[view, 3])
            for kind in range(2):
                base = np.uint64(views[view, kind])
                counts[:] = 0
                if kind == 0:
                    rows = fill_sides(limbs, size, nothing, scratch, buffer, counts)
                else:
                    rows = fill_grids(limbs, size, nothing, scratch, buffer, counts)
                if rows >= 0:
                    end = -(-rows // AT_ONCE) * AT_ONCE
                    buffer[rows:end], found[:] = nothing, 0
                    add_lanes(values, base, rows_of_pairs[: end * LANES // 2], found)
                    for lane in range(LANES):
                        sums[block, lane, 2 * kind] += found[lane]
                        sums[block, lane, 2 * kind + 1] += counts[lane]
                    continue
                for lane in range(LANES):
                    if kind == 0:
                        count = fill_edges(outlines, block, view, lane, width, height, indices)
                    else:
                        count = fill_inside(outlines, block, view, lane, width, height, indices)
                    sums[block, lane, 2 * kind] += add_samples(values, base, nothing, indices, pairs, count)
                    sums[block, lane, 2 * kind + 1] += count
