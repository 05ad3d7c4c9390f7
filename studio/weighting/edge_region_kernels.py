"""Edge and region sums of Eq. 14 and 15 for many poses, in two passes: where to look, then bare loads.

A limb in a view is five straight lines of n samples: its two sides (edges) and three lines within (region), n
a multiple of sixteen. The first pass interpolates them between the outline's corners and writes which entries
of the maps they fall on; the second adds those entries up, two indices in each 64-bit load. Maps are bytes
that hold 255 (1 - p)² already. Each is followed by two entries for samples that fall on no pixel:
NOTHING_SEEN costs the most that a sample can, NOT_COUNTED costs nothing and is left out of N.
"""

import numpy as np
from numba import njit, prange

LANES = 16
CHUNK = 16
EDGE_LINES, REGION_LINES = 2, 3
# Across a limb: the middles of three equal strips.
FIRST_STRIP, SECOND_STRIP, THIRD_STRIP = np.float32(1.0 / 6.0), np.float32(0.5), np.float32(5.0 / 6.0)
NOTHING_SEEN, NOT_COUNTED = 0, 1
PADDING = 2
WORST = 255
HALF = np.float32(0.5)
UPPER, LOW = np.uint64(32), np.uint64(0xFFFFFFFF)

FLAGS = {"contract", "reassoc", "nsz", "arcp", "afn"}
OPTIONS = {"fastmath": FLAGS, "error_model": "numpy", "nogil": True, "cache": True}
INLINED = {**OPTIONS, "forceinline": True}


@njit(**INLINED)
def limb_lines(outlines, block, view, limb, lane):
    """Both sides as start and direction in pixels (x, y, dx, dy), half a pixel on so that truncation rounds."""
    ax, ay = outlines[block, view, limb, lane] + HALF, outlines[block, view, limb, LANES + lane] + HALF
    ex, ey = (
        outlines[block, view, limb, 6 * LANES + lane] + HALF,
        outlines[block, view, limb, 7 * LANES + lane] + HALF,
    )
    bx = outlines[block, view, limb, 2 * LANES + lane] + HALF - ax
    by = outlines[block, view, limb, 3 * LANES + lane] + HALF - ay
    cx = outlines[block, view, limb, 4 * LANES + lane] + HALF - ex
    cy = outlines[block, view, limb, 5 * LANES + lane] + HALF - ey
    return (ax, ay, bx, by), (ex, ey, cx, cy)


@njit(**INLINED)
def between(a, b, fraction):
    """The line at a fraction of the way from one line to another."""
    return (
        a[0] + fraction * (b[0] - a[0]),
        a[1] + fraction * (b[1] - a[1]),
        a[2] + fraction * (b[2] - a[2]),
        a[3] + fraction * (b[3] - a[3]),
    )


@njit(**INLINED)
def fill_edges(a, b, along, width, indices, at):
    """Indices of both sides of a limb that is wholly inside the picture."""
    for chunk in range(along.shape[0]):
        for j in range(CHUNK):
            t = along[chunk, j]
            indices[at, j] = np.uint32(
                np.int32(np.floor(a[1] + t * a[3]) * width + np.floor(a[0] + t * a[2]))
            )
            indices[at + 1, j] = np.uint32(
                np.int32(np.floor(b[1] + t * b[3]) * width + np.floor(b[0] + t * b[2]))
            )
        at += EDGE_LINES


@njit(**INLINED)
def fill_region(a, b, along, width, indices, at):
    """Indices of the three inner lines of a limb that is wholly inside the picture."""
    p, q, r = between(a, b, FIRST_STRIP), between(a, b, SECOND_STRIP), between(a, b, THIRD_STRIP)
    for chunk in range(along.shape[0]):
        for j in range(CHUNK):
            t = along[chunk, j]
            indices[at, j] = np.uint32(
                np.int32(np.floor(p[1] + t * p[3]) * width + np.floor(p[0] + t * p[2]))
            )
            indices[at + 1, j] = np.uint32(
                np.int32(np.floor(q[1] + t * q[3]) * width + np.floor(q[0] + t * q[2]))
            )
            indices[at + 2, j] = np.uint32(
                np.int32(np.floor(r[1] + t * r[3]) * width + np.floor(r[0] + t * r[2]))
            )
        at += REGION_LINES


@njit(**OPTIONS)
def fill_clipped(line, along, width, height, unseen, indices, at, step):
    """Indices of a line that may leave the picture: samples outside it cost the most."""
    nothing = np.uint32(width * height + NOTHING_SEEN)
    for chunk in range(along.shape[0]):
        for j in range(CHUNK):
            x, y = line[0] + along[chunk, j] * line[2], line[1] + along[chunk, j] * line[3]
            inside = (x >= 0.0) & (x < width) & (y >= 0.0) & (y < height)
            index = nothing
            if inside and not unseen:
                index = np.uint32(np.int64(y) * width + np.int64(x))
            indices[at + chunk * step, j] = index


@njit(**OPTIONS)
def fill_limb_clipped(a, b, along_edge, along_region, view, unseen, indices, edge_at, region_at):
    """Indices of a limb that is not wholly inside the picture, or not seen at all."""
    width, height = view[2], view[3]
    fill_clipped(a, along_edge, width, height, unseen, indices, edge_at, EDGE_LINES)
    fill_clipped(b, along_edge, width, height, unseen, indices, edge_at + 1, EDGE_LINES)
    p, q, r = between(a, b, FIRST_STRIP), between(a, b, SECOND_STRIP), between(a, b, THIRD_STRIP)
    fill_clipped(p, along_region, width, height, unseen, indices, region_at, REGION_LINES)
    fill_clipped(q, along_region, width, height, unseen, indices, region_at + 1, REGION_LINES)
    fill_clipped(r, along_region, width, height, unseen, indices, region_at + 2, REGION_LINES)


@njit(**OPTIONS)
def hide(bits, not_counted, indices, first, last):
    """Replace the indices of one side's hidden samples (a bit each); returns how many there were."""
    count = 0
    for at in range(first, last, EDGE_LINES):
        for j in range(CHUNK):
            if bits & np.uint64(1):
                indices[at, j] = not_counted
                count += 1
            bits >>= np.uint64(1)
    return count


@njit(**INLINED)
def fill_view(outlines, hidden, block, view, lane, along_edge, along_region, views, indices):
    """Indices of all samples of one pose in one view: first all edges, limb by limb, then all regions.

    hidden : (B, V, L, 2, 16) bits of edge samples, no blocks where none are looked for. Returns how many are
    hidden."""
    limbs = outlines.shape[2]
    width = np.float32(views[view, 2])
    edge_rows, region_rows = EDGE_LINES * along_edge.shape[0], REGION_LINES * along_region.shape[0]
    count = 0
    for limb in range(limbs):
        a, b = limb_lines(outlines, block, view, limb, lane)
        edge_at, region_at = limb * edge_rows, limbs * edge_rows + limb * region_rows
        state = outlines[block, view, limb, 8 * LANES + lane]
        if state > HALF:
            fill_edges(a, b, along_edge, width, indices, edge_at)
            fill_region(a, b, along_region, width, indices, region_at)
        else:
            fill_limb_clipped(
                a, b, along_edge, along_region, views[view], state < -HALF, indices, edge_at, region_at
            )
        if hidden.shape[0]:
            not_counted = np.uint32(views[view, 2] * views[view, 3] + NOT_COUNTED)
            for side in range(EDGE_LINES):
                bits = hidden[block, view, limb, side, lane]
                if bits:
                    count += hide(bits, not_counted, indices, edge_at + side, edge_at + side + edge_rows)
    return count


@njit(**INLINED)
def add_up(maps, base, pairs, first, last):
    """The sum of a map's entries at the indices of rows first..last - 1, two indices a load.

    The test that never stops the loop keeps the compiler from turning it into gathers, which are slower.
    """
    a = b = c = d = np.uint64(0)
    end = np.uint64(maps.shape[0])
    for k in range(first, last):
        if pairs[k, 0] & LOW >= end:
            break
        p, q, r, s = pairs[k, 0], pairs[k, 1], pairs[k, 2], pairs[k, 3]
        a += maps[(p & LOW) + base]
        b += maps[(p >> UPPER) + base]
        c += maps[(q & LOW) + base]
        d += maps[(q >> UPPER) + base]
        a += maps[(r & LOW) + base]
        b += maps[(r >> UPPER) + base]
        c += maps[(s & LOW) + base]
        d += maps[(s >> UPPER) + base]
        p, q, r, s = pairs[k, 4], pairs[k, 5], pairs[k, 6], pairs[k, 7]
        a += maps[(p & LOW) + base]
        b += maps[(p >> UPPER) + base]
        c += maps[(q & LOW) + base]
        d += maps[(q >> UPPER) + base]
        a += maps[(r & LOW) + base]
        b += maps[(r >> UPPER) + base]
        c += maps[(s & LOW) + base]
        d += maps[(s >> UPPER) + base]
    return np.int64(a + b + c + d)


@njit(**OPTIONS)
def chunk_weights(
    first, last, outlines, hidden, along_edge, along_region, views, maps, weights, terms, log_weights
):
    """Eq. 14, 15 and 17 for the blocks first..last - 1.

    weights : (2,) of the edge and region terms. terms : (B, 16, V, 2) float64, filled with Σe and Σr.
    log_weights : (B, 16)."""
    limbs = outlines.shape[2]
    edge_rows = limbs * EDGE_LINES * along_edge.shape[0]
    rows = edge_rows + limbs * REGION_LINES * along_region.shape[0]
    edge_worst, region_worst = float(WORST * edge_rows * CHUNK), float(WORST * (rows - edge_rows) * CHUNK)
    indices = np.zeros((rows, CHUNK), np.uint32)
    pairs = indices.view(np.uint64)
    for block in range(first, last):
        log_weights[block] = 0.0
        for view in range(outlines.shape[1]):
            edge_base, region_base = np.uint64(views[view, 0]), np.uint64(views[view, 1])
            for lane in range(LANES):
                lost = fill_view(
                    outlines, hidden, block, view, lane, along_edge, along_region, views, indices
                )
                edge, region = 1.0, add_up(maps, region_base, pairs, edge_rows, rows) / region_worst
                if lost < edge_rows * CHUNK:
                    edge = add_up(maps, edge_base, pairs, 0, edge_rows) / (edge_worst - WORST * lost)
                terms[block, lane, view, 0] = edge
                terms[block, lane, view, 1] = region
                log_weights[block, lane] -= weights[0] * edge + weights[1] * region


@njit(parallel=True, **OPTIONS)
def all_weights(chunks, outlines, hidden, along_edge, along_region, views, maps, weights, terms, log_weights):
    """`chunk_weights` of all blocks, shared among `chunks` threads."""
    share = (terms.shape[0] + chunks - 1) // chunks
    for chunk in prange(chunks):
        chunk_weights(
            chunk * share, min((chunk + 1) * share, terms.shape[0]), outlines, hidden, along_edge,
            along_region, views, maps, weights, terms, log_weights,
        )  # fmt: skip


@njit(**OPTIONS)
def record_indices(outlines, hidden, along_edge, along_region, views, indices):
    """The index stream that `chunk_weights` produces: indices (B, V, 16, rows, 16) uint32. For benchmark and
    overlay.
    """
    for block in range(indices.shape[0]):
        for view in range(outlines.shape[1]):
            for lane in range(LANES):
                fill_view(
                    outlines,
                    hidden,
                    block,
                    view,
                    lane,
                    along_edge,
                    along_region,
                    views,
                    indices[block, view, lane],
                )


@njit(**OPTIONS)
def loads_only(maps, views, pairs, edge_rows, passes, sums):
    """Nothing but the loads of `chunk_weights`, `passes` times over: its limit.

    pairs : indices recorded by `record_indices`, seen as (B, V, 16, rows, 8) uint64. sums : (B, V, 16, 2),
    added to."""
    for _ in range(passes):
        for block in range(pairs.shape[0]):
            for view in range(pairs.shape[1]):
                edge_base, region_base = np.uint64(views[view, 0]), np.uint64(views[view, 1])
                for lane in range(LANES):
                    stream = pairs[block, view, lane]
                    sums[block, view, lane, 0] += add_up(maps, edge_base, stream, 0, edge_rows)
                    sums[block, view, lane, 1] += add_up(
                        maps, region_base, stream, edge_rows, stream.shape[0]
                    )
