"""Which edge samples of a limb are hidden behind nearer limbs.

A limb's outline in a view is convex, so the part of another limb's straight side that lies behind it is one
interval, found by clipping the side against four half-planes. Limbs are ordered by the depth of their
middles. Sixteen poses at a time, like the outlines.
"""

import numpy as np
from numba import njit, prange

LANES = 16
ZERO, HALF, ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
NOWHERE = np.float32(2.0)
PARALLEL = np.float32(1e-9)

FLAGS = {"contract", "reassoc", "nsz", "arcp", "afn"}
OPTIONS = {"fastmath": FLAGS, "error_model": "numpy", "nogil": True, "cache": True}
INLINED = {**OPTIONS, "forceinline": True}


@njit(**INLINED)
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


@njit(**INLINED)
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


@njit(**INLINED)
def sample_bits(interval, samples):
    """Bits of the samples at (j + 1/2) / samples that lie in an interval."""
    first = np.int64(np.ceil(max(interval[0], ZERO) * samples - HALF))
    last = np.int64(np.floor(min(interval[1], ONE) * samples - HALF))
    count = np.uint64(max(last - first + 1, 0))
    ones = ~np.uint64(0) if count > np.uint64(63) else (np.uint64(1) << count) - np.uint64(1)
    return ones << np.uint64(min(first, 63))


@njit(**INLINED)
def limb_hidden(outline, near, samples, hidden):
    """Add to `hidden` (32,) the bits of both sides of a limb (160,) that another limb hides, where it is
    nearer.
    """
    for lane in range(LANES):
        corners = (
            near[lane], near[LANES + lane], near[2 * LANES + lane], near[3 * LANES + lane],
            near[4 * LANES + lane], near[5 * LANES + lane], near[6 * LANES + lane], near[7 * LANES + lane],
        )  # fmt: skip
        a = outline[lane], outline[LANES + lane], outline[2 * LANES + lane], outline[3 * LANES + lane]
        b = (
            outline[6 * LANES + lane],
            outline[7 * LANES + lane],
            outline[4 * LANES + lane],
            outline[5 * LANES + lane],
        )
        nearer = near[9 * LANES + lane] < outline[9 * LANES + lane]
        both_seen = (near[8 * LANES + lane] > -HALF) & (outline[8 * LANES + lane] > -HALF)
        a_bits = sample_bits(hidden_interval(a, corners), samples)
        b_bits = sample_bits(hidden_interval(b, corners), samples)
        nothing = np.uint64(0)
        hidden[lane] |= a_bits if nearer & both_seen else nothing
        hidden[LANES + lane] |= b_bits if nearer & both_seen else nothing


@njit(**OPTIONS)
def chunk_hidden(first, last, outlines, samples, hidden):
    """Bits of the hidden edge samples of the blocks first..last - 1; hidden (B, V, L, 2, 16) uint64.

    samples : on each side of a limb, at most 64.
    """
    outline, near = np.zeros(outlines.shape[3], np.float32), np.zeros(outlines.shape[3], np.float32)
    bits = np.zeros(2 * LANES, np.uint64)
    count = np.float32(samples)
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            for limb in range(outlines.shape[2]):
                bits[:] = np.uint64(0)
                for i in range(outline.shape[0]):
                    outline[i] = outlines[block, view, limb, i]
                for other in range(outlines.shape[2]):
                    if other == limb:
                        continue
                    for i in range(near.shape[0]):
                        near[i] = outlines[block, view, other, i]
                    limb_hidden(outline, near, count, bits)
                for lane in range(LANES):
                    hidden[block, view, limb, 0, lane] = bits[lane]
                    hidden[block, view, limb, 1, lane] = bits[LANES + lane]


@njit(parallel=True, **OPTIONS)
def all_hidden(chunks, outlines, samples, hidden):
    """`chunk_hidden` of all blocks, shared among `chunks` threads."""
    share = (hidden.shape[0] + chunks - 1) // chunks
    for chunk in prange(chunks):
        chunk_hidden(chunk * share, min((chunk + 1) * share, hidden.shape[0]), outlines, samples, hidden)
