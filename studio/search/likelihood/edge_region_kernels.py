# pyright: standard
"""Edge and region sums of Eq. 14 and 15 for many poses, in two passes: indices first, then bare loads.

A limb in a view is five straight lines of n samples: its two sides (edges) and three lines within (region), n
a multiple of sixteen, found for sixteen poses at a time. The first pass steps along the lines of a limb and writes
which entries of the maps the samples fall on, a row of sixteen poses for each sample; the second adds those entries up,
two indices in each 64-bit load. Sixteen poses of a cloud have a limb in nearly the same place, so what one of them has
loaded into the cache the others find there, however the map is laid out. Maps are bytes that hold 255 (1 - p)²
already. Each is followed by two entries for samples that fall on no pixel: NOTHING_SEEN costs the most that a sample
can, NOT_COUNTED costs nothing and is left out of N.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.numba_in_threads import FAST, FAST_INLINED, njit
from studio.search.likelihood.outline_kernels import HALF, LANES, ONE, ZERO
from studio.search.likelihood.picture_maps import Maps

CHUNK = 16
EDGE_LINES, REGION_LINES = 2, 3
LINE = 4 * LANES
# Across a limb: the middles of three equal strips.
FIRST_STRIP, SECOND_STRIP, THIRD_STRIP = np.float32(1.0 / 6.0), np.float32(0.5), np.float32(5.0 / 6.0)
NOTHING_SEEN, NOT_COUNTED = 0, 1
PADDING = 2
WORST = 255
UPPER, LOW = np.uint64(32), np.uint64(0xFFFFFFFF)
# Words from one to the next, to the next sample's, to those of the sample after it.
ONE_ON, ROW_ON, TWO_ROWS_ON = np.uint64(1), np.uint64(8), np.uint64(16)


@njit(**FAST_INLINED)
def line_between(a, b, fraction, samples):
    """The line at a fraction of the way from side a to side b (x, y, dx, dy): the place of its first sample and the
    step to the next; samples lie at (j + 1/2) / samples."""
    step_x, step_y = (a[2] + fraction * (b[2] - a[2])) / samples, (a[3] + fraction * (b[3] - a[3])) / samples
    x, y = a[0] + fraction * (b[0] - a[0]) + HALF * step_x, a[1] + fraction * (b[1] - a[1]) + HALF * step_y
    return x, y, step_x, step_y


@njit(**FAST_INLINED)
def sides_of(corners):
    """Both sides (x, y, dx, dy) of a limb from its corners A0, A1, B1, B0, half a pixel on so that flooring rounds."""
    ax, ay, ex, ey = corners[0] + HALF, corners[1] + HALF, corners[6] + HALF, corners[7] + HALF
    a = ax, ay, corners[2] + HALF - ax, corners[3] + HALF - ay
    return a, (ex, ey, corners[4] + HALF - ex, corners[5] + HALF - ey)


@njit(**FAST_INLINED)
def store_line(lines, number, lane, a, b, fraction, samples):
    """Keep the line between two sides as line `number`."""
    x, y, step_x, step_y = line_between(a, b, fraction, samples)
    lines[number * LINE + lane] = x
    lines[number * LINE + LANES + lane] = y
    lines[number * LINE + 2 * LANES + lane] = step_x
    lines[number * LINE + 3 * LANES + lane] = step_y


@njit(**FAST)
def limb_lines(outline, lines, edge_samples, region_samples):
    """The five lines of a limb of sixteen poses, from its outlines (160,) in one view.

    lines : (320,): four rows of sixteen lanes a line, pixels, half a pixel on so that flooring rounds.
    """
    for lane in range(LANES):
        corners = (
            outline[lane], outline[LANES + lane], outline[2 * LANES + lane], outline[3 * LANES + lane],
            outline[4 * LANES + lane], outline[5 * LANES + lane], outline[6 * LANES + lane], outline[7 * LANES + lane],
        )  # fmt: skip
        a, b = sides_of(corners)
        store_line(lines, 0, lane, a, b, ZERO, edge_samples)
        store_line(lines, 1, lane, a, b, ONE, edge_samples)
        store_line(lines, 2, lane, a, b, FIRST_STRIP, region_samples)
        store_line(lines, 3, lane, a, b, SECOND_STRIP, region_samples)
        store_line(lines, 4, lane, a, b, THIRD_STRIP, region_samples)


@njit(**FAST_INLINED)
def stepped(line, number):
    """Where a sample of a line (first place and step) lies."""
    return line[0] + number * line[2], line[1] + number * line[3]


@njit(**FAST_INLINED)
def sample_place(line, number, lane):
    """Where a sample of one pose's line lies."""
    return stepped((line[lane], line[LANES + lane], line[2 * LANES + lane], line[3 * LANES + lane]), number)


@njit(**FAST_INLINED)
def pixel(place, width):
    """Number of the pixel at a place inside the picture."""
    return np.uint32(np.int32(np.floor(place[1]) * width + np.floor(place[0])))


@njit(**FAST)
def fill_whole(lines, samples, width, indices):
    """Indices (K samples, 16) of lines (K, 64) of a limb that is wholly inside the picture in all sixteen poses.

    Two samples at once, so that the lanes are vectorised and not written out one by one.
    """
    row = indices.ravel()
    at = np.uint64(0)
    for number in range(lines.shape[0]):
        line = lines[number]
        for sample in range(0, samples, 2):
            one, two = np.float32(np.int32(sample)), np.float32(np.int32(sample + 1))
            for lane in range(np.uint64(LANES)):
                row[at + lane] = pixel(sample_place(line, one, lane), width)
                row[at + np.uint64(LANES) + lane] = pixel(sample_place(line, two, lane), width)
            at += np.uint64(2 * LANES)


@njit(**FAST)
def fill_clipped(lines, outline, samples, width, height, nothing, indices):
    """Indices of lines (K, 64) of a limb that may leave the picture: samples outside it, and all of a pose that does
    not see the limb, read `nothing`."""
    for number in range(lines.shape[0]):
        line = lines[number]
        for sample in range(samples):
            step, row = np.float32(np.int32(sample)), indices[number * samples + sample]
            for lane in range(LANES):
                place = sample_place(line, step, lane)
                x, y = place
                inside = (
                    (x >= ZERO)
                    & (x < width)
                    & (y >= ZERO)
                    & (y < height)
                    & (outline[8 * LANES + lane] > -HALF)
                )
                row[lane] = pixel(place, width) if inside else nothing


@njit(**FAST_INLINED)
def fill_lines(outline, lines, samples, view, indices):
    """Indices (K samples, 16) of lines (K, 64) of a limb of sixteen poses, whose outlines (160,) say how it is seen."""
    inside = np.int32(0)
    for lane in range(LANES):
        inside += np.int32(outline[8 * LANES + lane] > HALF)
    width = np.float32(view[2])
    if inside == LANES:
        fill_whole(lines, samples, width, indices)
    else:
        nothing = np.uint32(view[2] * view[3] + NOTHING_SEEN)
        fill_clipped(lines, outline, samples, width, np.float32(view[3]), nothing, indices)


@njit(**FAST)
def hide(hidden, samples, view, indices, lost):
    """Replace the indices of hidden samples, a bit each in hidden (K, 16). lost : (16,), their number is added."""
    not_counted = np.uint32(view[2] * view[3] + NOT_COUNTED)
    for number in range(hidden.shape[0]):
        for lane in range(LANES):
            bits = hidden[number, lane]
            if not bits:
                continue
            for sample in range(samples):
                if (bits >> np.uint64(sample)) & np.uint64(1):
                    indices[number * samples + sample, lane] = not_counted
                    lost[lane] += 1


@njit(**FAST)
def add_lanes(values, base, pairs, sums):
    """Add the entries of a map that begins at `base` to the sums (16,) of sixteen poses. pairs : flat, eight words of
    two indices for each sample, of four samples at least.

    As in `add_up` the test never stops the loop. All sixteen in one call: references to arrays are counted at each.
    """
    end, stop = np.uint64(values.shape[0]), np.uint64(pairs.shape[0])
    for quarter in range(LANES // 4):
        a = b = c = d = np.uint64(0)
        k = np.uint64(2 * quarter)
        while k < stop:
            p, q, r, s = pairs[k], pairs[k + ONE_ON], pairs[k + ROW_ON], pairs[k + ROW_ON + ONE_ON]
            if (p & LOW) >= end:
                break
            a += values[(p & LOW) + base]
            b += values[(p >> UPPER) + base]
            c += values[(q & LOW) + base]
            d += values[(q >> UPPER) + base]
            a += values[(r & LOW) + base]
            b += values[(r >> UPPER) + base]
            c += values[(s & LOW) + base]
            d += values[(s >> UPPER) + base]
            p, q = pairs[k + TWO_ROWS_ON], pairs[k + TWO_ROWS_ON + ONE_ON]
            r, s = pairs[k + TWO_ROWS_ON + ROW_ON], pairs[k + TWO_ROWS_ON + ROW_ON + ONE_ON]
            a += values[(p & LOW) + base]
            b += values[(p >> UPPER) + base]
            c += values[(q & LOW) + base]
            d += values[(q >> UPPER) + base]
            a += values[(r & LOW) + base]
            b += values[(r >> UPPER) + base]
            c += values[(s & LOW) + base]
            d += values[(s >> UPPER) + base]
            k += TWO_ROWS_ON + TWO_ROWS_ON
        at = np.uint64(4 * quarter)
        sums[at] += np.int64(a)
        sums[at + np.uint64(1)] += np.int64(b)
        sums[at + np.uint64(2)] += np.int64(c)
        sums[at + np.uint64(3)] += np.int64(d)


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
    edge_samples, region_samples = edge_chunks * CHUNK, region_chunks * CHUNK
    edges = np.zeros((EDGE_LINES * edge_samples, LANES), np.uint32)
    region = np.zeros((REGION_LINES * region_samples, LANES), np.uint32)
    edge_pairs, region_pairs = as_pairs(edges).ravel(), as_pairs(region).ravel()
    lines = np.zeros((EDGE_LINES + REGION_LINES) * LINE, np.float32)
    sides = lines[: EDGE_LINES * LINE].reshape((EDGE_LINES, LINE))
    strips = lines[EDGE_LINES * LINE :].reshape((REGION_LINES, LINE))
    edge_sums, region_sums, lost = (
        np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64),
        np.zeros(LANES, np.int64),
    )
    edge_count, region_count = limbs * edges.shape[0], limbs * region.shape[0]
    for block in range(first, last):
        log_weights[block] = 0.0
        for view in range(outlines.shape[1]):
            edge_sums[:], region_sums[:], lost[:] = 0, 0, 0
            for limb in range(limbs):
                outline = outlines[block, view, limb]
                limb_lines(outline, lines, np.float32(edge_samples), np.float32(region_samples))
                fill_lines(outline, sides, edge_samples, views[view], edges)
                fill_lines(outline, strips, region_samples, views[view], region)
                if hidden.shape[0]:
                    hide(hidden[block, view, limb], edge_samples, views[view], edges, lost)
                add_lanes(values, np.uint64(views[view, 0]), edge_pairs, edge_sums)
                add_lanes(values, np.uint64(views[view, 1]), region_pairs, region_sums)
            for lane in range(min(LANES, count - block * LANES)):
                edge, region_term = 1.0, region_sums[lane] / (WORST * region_count)
                if lost[lane] < edge_count:
                    edge = edge_sums[lane] / (WORST * (edge_count - lost[lane]))
                terms[block, lane, view, 0] = edge
                terms[block, lane, view, 1] = region_term
                log_weights[block, lane] -= weights[0] * edge + weights[1] * region_term


@njit(**FAST)
def record_lines(indices, samples, found):
    """Fill found (16, chunks, K, 16), pose by pose, from the indices (K samples, 16) of a limb's lines."""
    for row in range(indices.shape[0]):
        number, sample = row // samples, row % samples
        for lane in range(LANES):
            found[lane, sample // CHUNK, number, sample % CHUNK] = indices[row, lane]


@njit(**FAST)
def record_indices(
    outlines: Floats,
    hidden: NDArray[np.uint64],
    views: Indices,
    edges: NDArray[np.uint32],
    region: NDArray[np.uint32],
) -> None:
    """The index stream of `weight_blocks`, pose by pose, (B, V, 16, L, chunks, lines, 16): for benchmark and tests."""
    edge_samples, region_samples = edges.shape[4] * CHUNK, region.shape[4] * CHUNK
    side_indices = np.zeros((EDGE_LINES * edge_samples, LANES), np.uint32)
    strip_indices = np.zeros((REGION_LINES * region_samples, LANES), np.uint32)
    lines = np.zeros((EDGE_LINES + REGION_LINES) * LINE, np.float32)
    sides = lines[: EDGE_LINES * LINE].reshape((EDGE_LINES, LINE))
    strips = lines[EDGE_LINES * LINE :].reshape((REGION_LINES, LINE))
    lost = np.zeros(LANES, np.int64)
    for block in range(edges.shape[0]):
        for view in range(edges.shape[1]):
            for limb in range(edges.shape[3]):
                outline = outlines[block, view, limb]
                limb_lines(outline, lines, np.float32(edge_samples), np.float32(region_samples))
                fill_lines(outline, sides, edge_samples, views[view], side_indices)
                fill_lines(outline, strips, region_samples, views[view], strip_indices)
                if hidden.shape[0]:
                    hide(hidden[block, view, limb], edge_samples, views[view], side_indices, lost)
                record_lines(side_indices, edge_samples, edges[block, view, :, limb])
                record_lines(strip_indices, region_samples, region[block, view, :, limb])


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
