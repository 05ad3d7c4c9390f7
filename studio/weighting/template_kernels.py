"""Rendered templates against silhouettes, a row of pixels in 64-bit words at a time.

A projected limb is a convex quadrilateral, so a row of pixel centres meets it in one span, found from its
four half-planes. A row's spans are set as bits, limb after limb (their union is the template), and counted:
pixels of the template, and pixels of it that lie in the silhouette. Double precision, so that a pixel belongs
to the template exactly where its centre does.
"""

import numpy as np
from numba import njit, prange
from numba.core import types
from numba.extending import intrinsic

LANES = 16
EDGES = 4
ALL_BITS = np.uint64(0xFFFFFFFFFFFFFFFF)

# Not a number and infinity keep their meaning: a row outside a half-plane has an infinite bound.
FLAGS = {"contract", "nsz"}
OPTIONS = {"fastmath": FLAGS, "error_model": "numpy", "nogil": True, "cache": True}
INLINED = {**OPTIONS, "forceinline": True}


@intrinsic
def bit_count(typingctx, word):
    """How many bits of a 64-bit word are set: one instruction where the processor has it."""
    signature = types.int64(types.uint64)

    def generate(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return signature, generate


@njit(**OPTIONS)
def half_planes(outlines, block, view, limb, lane, planes, first):
    """Rows a, b, c of the limb's four edges, inside being a x + b y + c >= 0; returns its first and last row."""
    x = np.empty(EDGES)
    y = np.empty(EDGES)
    for corner in range(EDGES):
        x[corner] = outlines[block, view, limb, 2 * corner * LANES + lane]
        y[corner] = outlines[block, view, limb, (2 * corner + 1) * LANES + lane]
    area = (x[2] - x[0]) * (y[3] - y[1]) - (y[2] - y[0]) * (x[3] - x[1])
    sign = 1.0 if area > 0.0 else -1.0
    top, bottom = y[0], y[0]
    for corner in range(EDGES):
        following = (corner + 1) % EDGES
        a, b = sign * (y[corner] - y[following]), sign * (x[following] - x[corner])
        planes[first + corner, 0] = a
        planes[first + corner, 1] = b
        planes[first + corner, 2] = -a * x[corner] - b * y[corner]
        top, bottom = min(top, y[corner]), max(bottom, y[corner])
    return top, bottom


@njit(**OPTIONS)
def row_span(planes, first, y, width):
    """First and last pixel of a row whose centres lie within a limb; first > last where there is none."""
    left, right = 0.0, width - 1.0
    for edge in range(first, first + EDGES):
        a, rest = planes[edge, 0], planes[edge, 1] * y + planes[edge, 2]
        if a > 0.0:
            left = max(left, -rest / a)
        elif a < 0.0:
            right = min(right, -rest / a)
        elif rest < 0.0:
            right = -1.0
    return int(np.ceil(min(left, float(width)))), int(np.floor(max(right, -1.0)))


@njit(**INLINED)
def set_span(words, left, right):
    """Set the bits left...right of a row."""
    first, last = left >> 6, right >> 6
    from_left = ALL_BITS << np.uint64(left & 63)
    to_right = ALL_BITS >> np.uint64(63 - (right & 63))
    if first == last:
        words[first] |= from_left & to_right
        return
    words[first] |= from_left
    for word in range(first + 1, last):
        words[word] = ALL_BITS
    words[last] |= to_right


@njit(**OPTIONS)
def template_pixels(
    outlines, block, view, lane, height, width, silhouette, base, stride, planes, rows, words
):
    """Pixels of one pose's template in one view, and how many of them lie in the silhouette."""
    limbs = 0
    for limb in range(outlines.shape[2]):
        if outlines[block, view, limb, 8 * LANES + lane] < -0.5:
            continue
        top, bottom = half_planes(outlines, block, view, limb, lane, planes, EDGES * limbs)
        rows[limbs, 0], rows[limbs, 1] = min(max(top, 0.0), height), max(min(bottom, height - 1.0), -1.0)
        limbs += 1
    begin, end = height, -1
    for limb in range(limbs):
        begin, end = min(begin, int(np.ceil(rows[limb, 0]))), max(end, int(np.floor(rows[limb, 1])))
    drawn, shared = 0, 0
    for y in range(begin, end + 1):
        words[:stride] = np.uint64(0)
        low, high = stride, -1
        for limb in range(limbs):
            if y < rows[limb, 0] or y > rows[limb, 1]:
                continue
            left, right = row_span(planes, EDGES * limb, float(y), width)
            if left <= right:
                set_span(words, left, right)
                low, high = min(low, left >> 6), max(high, right >> 6)
        for word in range(low, high + 1):
            seen = words[word] & silhouette[base + y * stride + word]
            drawn += bit_count(words[word])  # pyright: ignore[reportCallIssue] - Numba gives the context
            shared += bit_count(seen)  # pyright: ignore[reportCallIssue]
    return drawn, shared


@njit(**OPTIONS)
def chunk_templates(first, last, outlines, views, silhouettes, counts):
    """Counts of the blocks first..last - 1: (B, V, 16, 2) int64 pixels of the template, those in the
    silhouette.

    views : (V, 4) where a view's silhouette begins (64-bit words), words a row, width, height.
    """
    limbs = outlines.shape[2]
    planes, rows = np.zeros((EDGES * limbs, 3)), np.zeros((limbs, 2))
    words = np.zeros(max(views[:, 1].max(), 1), np.uint64)
    for block in range(first, last):
        for view in range(outlines.shape[1]):
            base, stride, width, height = views[view, 0], views[view, 1], views[view, 2], views[view, 3]
            for lane in range(LANES):
                drawn, shared = template_pixels(
                    outlines, block, view, lane, height, width, silhouettes, base, stride, planes, rows, words
                )
                counts[block, view, lane, 0] = drawn
                counts[block, view, lane, 1] = shared


@njit(parallel=True, **OPTIONS)
def all_templates(chunks, outlines, views, silhouettes, counts):
    """`chunk_templates` of all blocks, shared among `chunks` threads."""
    share = (counts.shape[0] + chunks - 1) // chunks
    for chunk in prange(chunks):
        last = min((chunk + 1) * share, counts.shape[0])
        chunk_templates(chunk * share, last, outlines, views, silhouettes, counts)
