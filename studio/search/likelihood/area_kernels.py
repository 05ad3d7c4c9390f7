# pyright: standard
"""Areas of projected bodies and of what they share with silhouettes, eight rows of pixels at a time.

A projected limb is a convex quadrilateral, so a row of pixel centres meets it in one span: the largest of its
left edges' crossings to the smallest of its right ones'. Where the body lies in a picture, rows are kept as columns
of 64-bit words, so that the spans of neighbouring rows are found, turned into bits and added to the union together.
The silhouette is stored in the same way, once for every possible start of a body's window (`window`), and set bits
are counted: pixels of the union, and pixels of it that lie in the silhouette.

Double precision, so that a pixel is in the union exactly where its centre lies in a limb. On this design single
precision is no faster.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats, Indices, Mask
from studio.foundations.numba_in_threads import (
    CONTRACTED,
    CONTRACTED_INLINED,
    EXACT,
    KERNEL,
    intrinsic,
    njit,
    types,
)
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps

ROWS = 8
PARTS = 8
"""Sums that NumPy makes side by side."""
WORD = 64
WINDOW_STEP = 16
"""Pixels between the places where a window may begin."""
ALL_BITS, NO_BITS = np.uint64(0xFFFFFFFFFFFFFFFF), np.uint64(0)
GATHERING = np.uint64(0x0102040810204080)
"""Times a word of eight bytes, each 0 or 1: its last byte has a bit of each."""
FAR = 1.0e9
# Rows of a limb's table: slope and crossing of each edge as a left one, then as a right one; first and last row of
# pixels; first and last column; area.
RIGHT, FIRST_ROW, LAST_ROW, FIRST_COLUMN, LAST_COLUMN, AREA, FIELDS = 8, 16, 17, 18, 19, 20, 21


@intrinsic
def bit_count(typingctx, word):
    """Number of set bits of a 64-bit word: one instruction where the processor has it."""
    signature = types.int64(types.uint64)

    def generate(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return signature, generate


@njit(**CONTRACTED_INLINED)
def store_edge(table, corner, lane, px, py, qx, qy, sign, first):
    """Keep the edge from p to q: its slope and where it crosses row `first`, as a left or a right one."""
    a, b = sign * (py - qy), sign * (qx - px)
    slope = -b / (1.0 if a == 0.0 else a)
    crossing = px + slope * (first - py)
    table[2 * corner * LANES + lane] = slope if a > 0.0 else 0.0
    table[(2 * corner + 1) * LANES + lane] = crossing if a > 0.0 else -FAR
    table[(RIGHT + 2 * corner) * LANES + lane] = slope if a < 0.0 else 0.0
    table[(RIGHT + 2 * corner + 1) * LANES + lane] = crossing if a < 0.0 else FAR


@njit(**CONTRACTED)
def limb_table(outline, table, scale, width, height):
    """Fill the table (336,) of a limb from its outlines (160,) in one view; see the names above for its rows.

    scale : pixels of the silhouette a pixel of the picture.
    """
    shift = 0.5 - 0.5 * scale
    for lane in range(LANES):
        ax, ay = scale * outline[lane] - shift, scale * outline[LANES + lane] - shift
        bx, by = scale * outline[2 * LANES + lane] - shift, scale * outline[3 * LANES + lane] - shift
        cx, cy = scale * outline[4 * LANES + lane] - shift, scale * outline[5 * LANES + lane] - shift
        dx, dy = scale * outline[6 * LANES + lane] - shift, scale * outline[7 * LANES + lane] - shift
        area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
        sign = 1.0 if area > 0.0 else -1.0
        first = max(np.ceil(min(min(ay, by), min(cy, dy))), 0.0)
        last = min(np.floor(max(max(ay, by), max(cy, dy))), height - 1.0)
        left = max(np.ceil(min(min(ax, bx), min(cx, dx))), 0.0)
        right = min(np.floor(max(max(ax, bx), max(cx, dx))), width - 1.0)
        nothing = (outline[8 * LANES + lane] < -0.5) | (left > right)
        table[FIRST_ROW * LANES + lane] = first
        table[LAST_ROW * LANES + lane] = -1.0 if nothing else last
        table[FIRST_COLUMN * LANES + lane] = left
        table[LAST_COLUMN * LANES + lane] = right
        table[AREA * LANES + lane] = 0.5 * abs(area)
        store_edge(table, 0, lane, ax, ay, bx, by, sign, first)
        store_edge(table, 1, lane, bx, by, cx, cy, sign, first)
        store_edge(table, 2, lane, cx, cy, dx, dy, sign, first)
        store_edge(table, 3, lane, dx, dy, ax, ay, sign, first)


@njit(**CONTRACTED_INLINED)
def limb_edges(table, lane):
    """One lane's eight pairs of slope and crossing."""
    return (
        table[0 * LANES + lane], table[1 * LANES + lane], table[2 * LANES + lane],
        table[3 * LANES + lane], table[4 * LANES + lane], table[5 * LANES + lane],
        table[6 * LANES + lane], table[7 * LANES + lane], table[8 * LANES + lane],
        table[9 * LANES + lane], table[10 * LANES + lane], table[11 * LANES + lane],
        table[12 * LANES + lane], table[13 * LANES + lane], table[14 * LANES + lane],
        table[15 * LANES + lane],
    )  # fmt: skip


@njit(**CONTRACTED_INLINED)
def span(edges, row):
    """First pixel and one past the last of a row, counted from the limb's first."""
    left = max(
        max(edges[1] + edges[0] * row, edges[3] + edges[2] * row),
        max(edges[5] + edges[4] * row, edges[7] + edges[6] * row),
    )
    right = min(
        min(edges[9] + edges[8] * row, edges[11] + edges[10] * row),
        min(edges[13] + edges[12] * row, edges[15] + edges[14] * row),
    )
    return np.ceil(left), np.floor(right) + 1.0


@njit(**CONTRACTED_INLINED)
def bits_from(place):
    """A word whose bits from `place` on (0...64) are set."""
    count = np.uint64(np.uint32(np.int32(place)))
    return (ALL_BITS << (count & np.uint64(63))) if count < np.uint64(64) else NO_BITS


@njit(**CONTRACTED_INLINED)
def add_word(edges, begin, chunks, rows, base, most, words, offset):
    """Set the bits of a limb's rows in one column of words, the first of whose pixels is `base`.

    begin : place of the limb's first row in the column. rows : of the limb less one. most : pixels of the word that
    lie in the picture.
    """
    for chunk in range(chunks):
        place, start = np.uint64(offset + begin + chunk * ROWS), np.float64(chunk * ROWS)
        for i in range(ROWS):
            row = start + np.float64(i)
            left, after = span(edges, row)
            after = after - base if row <= rows else 0.0
            from_left = bits_from(min(max(left - base, 0.0), float(WORD)))
            from_after = bits_from(min(max(after, 0.0), most))
            words[place + np.uint64(i)] |= from_left & ~from_after


@njit(**CONTRACTED)
def outside_area(table, lane, edges, width):
    """Part of a limb's area outside the picture: its whole area less its pixels."""
    inside = 0.0
    first, last = int(table[FIRST_ROW * LANES + lane]), int(table[LAST_ROW * LANES + lane])
    for row in range(last - first + 1):
        left, after = span(edges, np.float64(row))
        inside += max(min(after, float(width)) - max(left, 0.0), 0.0)
    return max(table[AREA * LANES + lane] - inside, 0.0)


@njit(**CONTRACTED)
def body_box(tables, lane):
    """First and last row and column of pixels of all limbs of one pose; last < first where there are none."""
    top, bottom, left, right = FAR, -1.0, FAR, -1.0
    for limb in range(tables.shape[0]):
        if tables[limb, LAST_ROW * LANES + lane] >= tables[limb, FIRST_ROW * LANES + lane]:
            top = min(top, tables[limb, FIRST_ROW * LANES + lane])
            bottom = max(bottom, tables[limb, LAST_ROW * LANES + lane])
            left = min(left, tables[limb, FIRST_COLUMN * LANES + lane])
            right = max(right, tables[limb, LAST_COLUMN * LANES + lane])
    return int(min(top, bottom + 1.0)), int(bottom), int(min(left, right + 1.0)), int(right)


@njit(**CONTRACTED)
def draw_union(tables, lane, top, window, width, height, words):
    """Set the bits of all limbs of one pose in the columns of words that begin at pixel `window`, `height` words
    each, whose first row is `top`."""
    for limb in range(tables.shape[0]):
        table = tables[limb]
        first, last = int(table[FIRST_ROW * LANES + lane]), int(table[LAST_ROW * LANES + lane])
        if last < first:
            continue
        edges = limb_edges(table, lane)
        chunks = (last - first) // ROWS + 1
        low = (int(table[FIRST_COLUMN * LANES + lane]) - window) // WORD
        high = (int(table[LAST_COLUMN * LANES + lane]) - window) // WORD
        for column in range(low, high + 1):
            base = window + column * WORD
            most = np.float64(min(width - base, WORD))
            rows = np.float64(last - first)
            add_word(edges, first - top, chunks, rows, np.float64(base), most, words, column * height)


@njit(**CONTRACTED_INLINED)
def count_bits(words, begin, silhouette, base, rows):
    """Number of set bits in `rows` words, and of those that are also set in the silhouette."""
    drawn, shared = 0, 0
    first, second = np.uint64(begin), np.uint64(base)
    for row in range(np.uint64(rows)):
        word = words[first + row]
        both = word & silhouette[second + row]
        drawn += bit_count(word)  # pyright: ignore[reportCallIssue] - Numba gives the context
        shared += bit_count(both)  # pyright: ignore[reportCallIssue]
    return drawn, shared


@njit(**CONTRACTED)
def pose_areas(tables, lane, view, silhouettes, words):
    """Pixels of the union of one pose's limbs in one view, and how many of them lie in the silhouette."""
    top, bottom, left, right = body_box(tables, lane)
    if bottom < top:
        return 0, 0
    window = left // WINDOW_STEP * WINDOW_STEP
    columns = (right - window) // WORD + 1
    rows = (bottom - top) // ROWS * ROWS + ROWS
    # A limb's last rows may reach further down than the body's.
    height = rows + ROWS
    words[: columns * height] = NO_BITS
    draw_union(tables, lane, top, window, view[2], height, words)
    drawn, shared = 0, 0
    for column in range(columns):
        base = view[0] + (window + column * WORD) // WINDOW_STEP * view[1] + top
        more_drawn, more_shared = count_bits(words, column * height, silhouettes, base, rows)
        drawn += more_drawn
        shared += more_shared
    return drawn, shared


@njit(**CONTRACTED)
def most_words(views):
    """Words that a union may take in any of the views (V, 4) of `Maps`."""
    width, height = 0, 0
    for view in range(views.shape[0]):
        width, height = max(width, views[view, 2]), max(height, views[view, 3])
    return ((width - 1) // WORD + 2) * (height + 2 * ROWS)


@njit(**CONTRACTED)
def area_blocks(
    first: int,
    last: int,
    count: int,
    outlines: Floats,
    scale: float,
    silhouettes: Maps,
    counts: Indices,
    outside: Array,
) -> None:
    """Areas of the blocks first..last - 1 of sixteen poses, `count` of them in all blocks.

    scale : pixels of the silhouettes a pixel of the pictures. silhouettes : `Maps` of columns of words, of which the
    second number of a view says how many words each has. counts : (B, V, 16, 2) pixels of the union, those in the
    silhouette. outside : (B, V, 16) area of limbs beyond the picture, overlaps counted twice; the whole picture's
    for a limb that reaches behind the camera.
    """
    tables = np.zeros((outlines.shape[2], FIELDS * LANES))
    views = silhouettes.views
    words = np.zeros(most_words(views), np.uint64)
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            width, height = views[view, 2], views[view, 3]
            for limb in range(outlines.shape[2]):
                limb_table(outlines[block, view, limb], tables[limb], scale, float(width), float(height))
            for lane in range(min(LANES, count - block * LANES)):
                drawn, shared = pose_areas(tables, lane, views[view], silhouettes.values, words)
                counts[block, view, lane, 0] = drawn
                counts[block, view, lane, 1] = shared
                beyond = 0.0
                for limb in range(outlines.shape[2]):
                    seen = outlines[block, view, limb, 8 * LANES + lane]
                    if seen < -0.5:
                        beyond += float(width * height)
                    elif seen < 0.5:
                        beyond += outside_area(tables[limb], lane, limb_edges(tables[limb], lane), width)
                outside[block, view, lane] = beyond


@njit(**CONTRACTED)
def record_tables(outlines: Floats, scale: float, views: Indices, tables: Array) -> None:
    """The tables of `area_blocks`: fill (B, V, L, 336). For the benchmark."""
    for block in range(tables.shape[0]):
        for view in range(tables.shape[1]):
            width, height = float(views[view, 2]), float(views[view, 3])
            for limb in range(tables.shape[2]):
                limb_table(outlines[block, view, limb], tables[block, view, limb], scale, width, height)


@njit(**CONTRACTED)
def spans_only(tables: Array, silhouettes: Maps, passes: int, sums: Array) -> None:
    """Nothing but the spans and the counting of `area_blocks`, from recorded tables (B, V, L, 336), `passes` times
    over: its limit. sums : (B, V, 16), lengths of spans and bits are added.
    """
    views, values = silhouettes.views, silhouettes.values
    words = np.full(most_words(views), ALL_BITS)
    for _ in range(passes):
        for block in range(tables.shape[0]):
            for view in range(tables.shape[1]):
                for lane in range(LANES):
                    total = 0.0
                    for limb in range(tables.shape[2]):
                        table = tables[block, view, limb]
                        first, last = (
                            int(table[FIRST_ROW * LANES + lane]),
                            int(table[LAST_ROW * LANES + lane]),
                        )
                        if last < first:
                            continue
                        edges = limb_edges(table, lane)
                        for chunk in range((last - first) // ROWS + 1):
                            for i in range(ROWS):
                                begin, after = span(edges, np.float64(chunk * ROWS) + np.float64(i))
                                total += max(after - begin, 0.0)
                    top, bottom, left, right = body_box(tables[block, view], lane)
                    if bottom >= top:
                        window, rows = left // WINDOW_STEP * WINDOW_STEP, (bottom - top) // ROWS * ROWS + ROWS
                        for column in range((right - window) // WORD + 1):
                            base = (
                                views[view, 0]
                                + (window + column * WORD) // WINDOW_STEP * views[view, 1]
                                + top
                            )
                            drawn, shared = count_bits(words, column * (rows + ROWS), values, base, rows)
                            total += drawn + shared
                    sums[block, view, lane] += total


@njit(**KERNEL)
def halve(mask: Mask, found: Mask) -> None:
    """Fill found (ceil(H / 2), ceil(W / 2)) from a mask (H, W): the majority of each square of four; of two and two,
    every second one. A last row or column without a neighbour counts twice, which changes no majority.
    """
    height, width = mask.shape
    pairs, last = width // 2, width - 1
    for y in range(found.shape[0]):
        above, below, row = mask[2 * y], mask[min(2 * y + 1, height - 1)], found[y]
        for x in range(pairs):
            left, right = 2 * x, 2 * x + 1
            row[x] = is_most(above[left], above[right], below[left], below[right], x + y)
        if pairs < found.shape[1]:
            row[pairs] = is_most(above[last], above[last], below[last], below[last], pairs + y)


@njit(**KERNEL)
def is_most(a, b, c, d, place):
    """Whether more than two of four are true, or two of them at an even place."""
    count = np.uint8(a) + np.uint8(b) + np.uint8(c) + np.uint8(d)
    return (count > 2) | ((count == 2) & (place & 1 == 0))


@njit(**KERNEL)
def pack_windows(mask: Mask, words: int, out: NDArray[np.uint64]) -> None:
    """Fill out (columns * words,) with a mask (H, W) as `silhouette_areas.packed_windows` describes."""
    height, width = mask.shape
    columns = -(-width // WINDOW_STEP)
    row = np.zeros(columns * WINDOW_STEP, np.uint8)
    eighths, parts = row.view(np.uint64), np.zeros(columns + WORD // WINDOW_STEP, np.uint64)
    out[:] = NO_BITS
    for y in range(height):
        for x in range(width):
            row[x] = mask[y, x]
        for c in range(columns):
            low = (eighths[2 * c] * GATHERING) >> np.uint64(56)
            high = (eighths[2 * c + 1] * GATHERING) >> np.uint64(56)
            parts[c] = low | (high << np.uint64(8))
        for c in range(columns):
            both = parts[c] | (parts[c + 1] << np.uint64(16))
            out[c * words + y] = both | (parts[c + 2] << np.uint64(32)) | (parts[c + 3] << np.uint64(48))


@njit(**EXACT)
def mean_in_order(values: Array, in_parts: bool) -> float:
    """Mean of (K,) numbers, summed one by one, or `in_parts`, as NumPy sums a row of up to 128."""
    count = values.shape[0]
    total, first = 0.0, 0
    if in_parts and count >= PARTS:
        parts = values[:PARTS].copy()
        first = count // PARTS * PARTS
        for k in range(PARTS, first):
            parts[k % PARTS] += values[k]
        total = ((parts[0] + parts[1]) + (parts[2] + parts[3])) + (
            (parts[4] + parts[5]) + (parts[6] + parts[7])
        )
    for k in range(first, count):
        total += values[k]
    return total / count


@njit(**EXACT)
def is_in_parts(count):
    """Whether NumPy would sum the views of each of `count` poses in parts: what is found for one block of poses lies
    view by view in memory, and is summed so.
    """
    return count == 1 or count > LANES


@njit(**EXACT)
def areas_fitness(both, projected, observed, outside, found):
    """Fill found (V,) with the fitness (`Areas`) of one pose's areas."""
    for v in range(found.shape[0]):
        own = np.float64(both[v]) / max(np.float64(projected[v]) + outside[v], 1.0)
        seen = np.float64(both[v]) / max(np.float64(observed[v]), 1.0)
        found[v] = 0.5 * own + 0.5 * seen


@njit(**EXACT)
def three_terms(
    edge: Array,
    region: Array,
    both: Indices,
    projected: Indices,
    observed: Indices,
    outside: Array,
    weights: Array,
) -> Array:
    """(N,) of N poses the means over the views of 1 - edge, 1 - region and the areas' fitness (`Areas`), times weights
    (3,) and summed. edge, region : (N, V). In one pass, as NumPy's several calls cost more than the work itself, and
    bit for bit theirs.
    """
    found = np.empty(edge.shape[0])
    views = edge.shape[1]
    sides, within, covered = np.empty(views), np.empty(views), np.empty(views)
    for n in range(edge.shape[0]):
        for v in range(views):
            sides[v], within[v] = 1.0 - edge[n, v], 1.0 - region[n, v]
        areas_fitness(both[n], projected[n], observed, outside[n], covered)
        found[n] = weights[0] * mean_in_order(sides, True) + weights[1] * mean_in_order(within, True)
        found[n] += weights[2] * mean_in_order(covered, is_in_parts(edge.shape[0]))
    return found
