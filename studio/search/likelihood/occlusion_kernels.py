# pyright: standard
"""Which samples on limbs' edges are hidden behind nearer limbs.

A limb's outline in a view is convex, so the part of another limb's straight edge that lies behind it is one
interval, found by clipping the edge against four half-planes. Limbs are ordered by the depth of their
middles. Sixteen poses at a time, like the outlines; pairs of limbs that lie apart in all of them are left out.
"""

import math

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Floats, Indices
from studio.foundations.numba_in_threads import FAST, FAST_INLINED, njit
from studio.search.likelihood.outline_kernels import HALF, LANES, ONE, ZERO

NOWHERE = np.float32(2.0)
PARALLEL = np.float32(1e-9)


@njit(**FAST_INLINED)
def clip(interval, sx, sy, dx, dy, px, py, qx, qy, sign):
    """Keep of `interval` (in t of s + t d) what lies on the inner side of the edge from p to q."""
    ex, ey = (qx - px) * sign, (qy - py) * sign
    offset = ex * (sy - py) - ey * (sx - px)
    slope = ex * dy - ey * dx
    flat = abs(slope) < PARALLEL
    crossing = -offset / (ONE if flat else slope)
    first = crossing if (slope > ZERO) and not flat else interval[0]
    last = crossing if (slope < ZERO) and not flat else interval[1]
    outside = flat and offset < ZERO
    return NOWHERE if outside else max(interval[0], first), min(interval[1], last)


@njit(**FAST_INLINED)
def hidden_interval(side, near):
    """Begin and end, in 0...1, of the part of a side (start and end point) inside an outline (four corners)."""
    ax, ay, bx, by, cx, cy, ex, ey = near
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) + (cx - ax) * (ey - ay) - (cy - ay) * (ex - ax)
    sign = ONE if area > ZERO else -ONE
    sx, sy, dx, dy = side[0], side[1], side[2] - side[0], side[3] - side[1]
    interval = ZERO, ONE
    interval = clip(interval, sx, sy, dx, dy, ax, ay, bx, by, sign)
    interval = clip(interval, sx, sy, dx, dy, bx, by, cx, cy, sign)
    interval = clip(interval, sx, sy, dx, dy, cx, cy, ex, ey, sign)
    return clip(interval, sx, sy, dx, dy, ex, ey, ax, ay, sign)


@njit(**FAST_INLINED)
def sample_bits(interval, samples):
    """Bits of the samples at (j + 1/2) / samples that lie in an interval."""
    first = np.int64(math.ceil(max(interval[0], ZERO) * samples - HALF))
    last = np.int64(math.floor(max(min(interval[1], ONE), -ONE) * samples - HALF))
    count = np.uint64(max(last - first + 1, 0))
    ones = ~np.uint64(0) if count > np.uint64(63) else (np.uint64(1) << count) - np.uint64(1)
    return ones << np.uint64(min(first, 63))


@njit(**FAST)
def line_hidden(line, near, samples, bits):
    """Add to `bits` (16,) those of a line (64,) that another limb (160,) hides, where it is nearer.

    line : x and y of its first and of its last point, how its limb is seen, depth of its limb's middle.
    """
    for lane in range(LANES):
        corners = (
            near[lane], near[LANES + lane], near[2 * LANES + lane], near[3 * LANES + lane],
            near[4 * LANES + lane], near[5 * LANES + lane], near[6 * LANES + lane], near[7 * LANES + lane],
        )  # fmt: skip
        ends = line[lane], line[LANES + lane], line[2 * LANES + lane], line[3 * LANES + lane]
        nearer = near[9 * LANES + lane] < line[5 * LANES + lane]
        both_seen = (near[8 * LANES + lane] > -HALF) & (line[4 * LANES + lane] > -HALF)
        found = sample_bits(hidden_interval(ends, corners), samples)
        bits[lane] |= found if nearer & both_seen else np.uint64(0)


@njit(**FAST)
def limb_boxes(outlines, block, view, boxes):
    """Fill (L, 80) of sixteen poses: least and largest x and y of every limb's corners, depth of its middle."""
    corners = np.zeros(outlines.shape[3], np.float32)
    for limb in range(outlines.shape[2]):
        for i in range(corners.shape[0]):
            corners[i] = outlines[block, view, limb, i]
        box = boxes[limb]
        for lane in range(LANES):
            ax, ay, bx, by = (
                corners[lane],
                corners[LANES + lane],
                corners[2 * LANES + lane],
                corners[3 * LANES + lane],
            )
            cx, cy = corners[4 * LANES + lane], corners[5 * LANES + lane]
            ex, ey = corners[6 * LANES + lane], corners[7 * LANES + lane]
            box[lane] = min(min(ax, bx), min(cx, ex))
            box[LANES + lane] = max(max(ax, bx), max(cx, ex))
            box[2 * LANES + lane] = min(min(ay, by), min(cy, ey))
            box[3 * LANES + lane] = max(max(ay, by), max(cy, ey))
            box[4 * LANES + lane] = corners[9 * LANES + lane]


@njit(**FAST_INLINED)
def may_hide(box, near):
    """Whether in any of sixteen poses a limb with box `near` (80,) is nearer and over one with `box`."""
    count = 0
    for lane in range(LANES):
        across = (near[lane] <= box[LANES + lane]) & (box[lane] <= near[LANES + lane])
        along = (near[2 * LANES + lane] <= box[3 * LANES + lane]) & (
            box[2 * LANES + lane] <= near[3 * LANES + lane]
        )
        nearer = near[4 * LANES + lane] < box[4 * LANES + lane]
        count += np.int64(across & along & nearer)
    return count > 0


@njit(**FAST_INLINED)
def load_line(outlines, block, view, limb, first, last, line):
    """Fill a line (96,) from one corner of a limb to another; see `line_hidden`."""
    for i in range(2 * LANES):
        line[i] = outlines[block, view, limb, np.uint64(2 * LANES) * first + np.uint64(i)]
        line[2 * LANES + i] = outlines[block, view, limb, np.uint64(2 * LANES) * last + np.uint64(i)]
        line[4 * LANES + i] = outlines[block, view, limb, 8 * LANES + i]


@njit(**FAST)
def hidden_blocks(
    first: int,
    last: int,
    outlines: Floats,
    lines: Indices,
    samples: int,
    hidden: NDArray[np.uint64],
) -> None:
    """Bits of the hidden samples of the blocks first..last - 1; hidden (B, V, K, 16) uint64.

    lines : (K, 3) limb, its corner where the line begins (0...3: A0 A1 B1 B0), its corner where it ends. samples :
    on each line, at most 64.
    """
    line, near = np.zeros(6 * LANES, np.float32), np.zeros(outlines.shape[3], np.float32)
    boxes = np.zeros((outlines.shape[2], 5 * LANES), np.float32)
    bits = np.zeros(LANES, np.uint64)
    count = np.float32(samples)
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            limb_boxes(outlines, block, view, boxes)
            for number in range(lines.shape[0]):
                limb = lines[number, 0]
                load_line(
                    outlines,
                    block,
                    view,
                    limb,
                    np.uint64(lines[number, 1]),
                    np.uint64(lines[number, 2]),
                    line,
                )
                bits[:] = np.uint64(0)
                for other in range(outlines.shape[2]):
                    if other != limb and may_hide(boxes[limb], boxes[other]):
                        for i in range(near.shape[0]):
                            near[i] = outlines[block, view, other, i]
                        line_hidden(line, near, count, bits)
                for lane in range(LANES):
                    hidden[block, view, number, lane] = bits[lane]
