"""Edge proximity maps (section 4.2.1): gradient, threshold, Gaussian smoothing, remap to 0...255.

`proximity_edges` is the studio's own, with the remap chosen so that the middle of a straight edge, as wide
as a lens makes it, reaches 1 and the value falls off as a Gaussian with the distance from it.
`bodytrack_edges` is the map of the benchmark published with the Lee-walk data, bit for bit: Sobel / 8,
squared magnitude of at least 16, a 7-tap Gaussian of sigma 4 cut off to 8 bits after each pass, and a border
of 3 pixels that is 0.
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.masks import disc
from studio.foundations.arrays import Bytes
from studio.foundations.numba_in_threads import EXACT, KERNEL, njit

EDGE_WIDTH = 4.0
"""Pixels on which the gradient of a body's edge passes the threshold; thinner edges stay below 1. On the sample walk
4 tracks better than 2 (22 mm against 24, six seeds), where most of a clothed body's outline is saturated."""
REACH = 2.0
"""The Gaussian is cut off at this many sigma."""
BODYTRACK_SIGMA, BODYTRACK_TAPS = 4.0, 7
BODYTRACK_THRESHOLD = 16.0


def grey(picture: Bytes) -> Bytes:
    """(H, W) uint8 brightness of a BGR picture; a grey picture's own values."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def proximity_edges(
    picture: Bytes, threshold: float, smoothing: float, near: Bytes | None = None, reach: int = 0
) -> Bytes:
    """(H, W) uint8 edge proximity, 255 on an edge.

    threshold : grey levels per pixel. smoothing : sigma, pixels. near, reach : if reach > 0, edges
    further than this many pixels from the mask `near` are dropped.
    """
    edges = edge_pixels(grey(picture), 64.0 * threshold * threshold)
    if near is not None and reach > 0:
        edges = np.asarray(cv2.bitwise_and(edges, cv2.dilate(near, disc(reach))), dtype=np.uint8)
    # The blurred middle of a straight edge of EDGE_WIDTH pixels is to reach 255.
    peak = math.erf(0.5 * EDGE_WIDTH / (smoothing * math.sqrt(2.0)))
    return blurred(edges, whole_taps(smoothing, 2 * round(REACH * smoothing) + 1), 255.0 / (255.0 * peak))


def whole_taps(sigma: float, count: int) -> NDArray[np.int64]:
    """(count,) a Gaussian in whole numbers that sum to 256, each rounded with what the one before it left over: the
    taps with which OpenCV blurs bytes.
    """
    exact = np.exp(-0.5 * ((np.arange(count) - count // 2) / sigma) ** 2)
    exact *= 256.0 / exact.sum()
    taps, left = np.zeros(count, np.int64), 0.0
    for k in range(count // 2):
        taps[k] = taps[-1 - k] = round(exact[k] + left)
        left += exact[k] - taps[k]
    taps[count // 2] = 256 - taps.sum()
    return taps


def bodytrack_edges(picture: Bytes) -> Bytes:
    """(H, W) uint8 edge map exactly as the benchmark makes it."""
    edges = edge_pixels(grey(picture), 64.0 * BODYTRACK_THRESHOLD)
    return blur_twice_truncated(edges, bodytrack_taps())


def bodytrack_taps() -> NDArray[np.float32]:
    """(7,) the benchmark's Gaussian, summing to 1."""
    offset = np.arange(BODYTRACK_TAPS) - BODYTRACK_TAPS // 2
    weights = np.exp(-0.5 * (offset / BODYTRACK_SIGMA) ** 2)
    return (weights / weights.sum()).astype(np.float32)


@njit(**KERNEL)
def edge_pixels(image: Bytes, least: float) -> Bytes:
    """255 where the squared magnitude of the plain Sobel sums is at least `least` (64 times Sobel / 8's).

    image : (H, W) uint8. The outermost pixels are 0.
    """
    height, width = image.shape
    out = np.zeros((height, width), np.uint8)
    limit = np.int32(math.ceil(least))
    smooth, slope = np.empty(width, np.int16), np.empty(width, np.int16)
    right, left = smooth[2:], smooth[: width - 2]
    before, middle, after = slope[: width - 2], slope[1 : width - 1], slope[2:]
    for y in range(1, height - 1):
        above, centre, below, row = image[y - 1], image[y], image[y + 1], out[y, 1 : width - 1]
        for x in range(width):
            smooth[x] = np.int16(np.int16(above[x]) + np.int16(2) * np.int16(centre[x]) + np.int16(below[x]))
            slope[x] = np.int16(np.int16(below[x]) - np.int16(above[x]))
        for x in range(width - 2):
            across = np.int32(np.int16(right[x] - left[x]))
            along = np.int32(np.int16(before[x] + np.int16(2) * middle[x] + after[x]))
            strength = np.int32(across * across) + np.int32(along * along)
            row[x] = np.uint8(255) if strength >= limit else np.uint8(0)
    return out


@njit(**EXACT)
def blurred(image: Bytes, taps: NDArray[np.int64], factor: float) -> Bytes:
    """Rows, then columns, each a sum with `taps` (K,), times a factor, at most 255; beyond the picture all is 0.

    image : (H, W) uint8. Whole numbers up to the rounding of each sum and of its product, as OpenCV's GaussianBlur and
    a table would give; halves to even.
    """
    height, width = image.shape
    reach = len(taps) // 2
    rows, padded = np.zeros((height + 2 * reach, width), np.uint16), np.zeros(width + 2 * reach, np.uint16)
    for y in range(height):
        source, target, centre = image[y], rows[y + reach], padded[reach : reach + width]
        for x in range(width):
            centre[x] = source[x]
            target[x] = np.uint16(taps[reach]) * np.uint16(source[x])
        for k in range(reach):
            tap, before = np.uint16(taps[k]), padded[k : k + width]
            after = padded[2 * reach - k : 2 * reach - k + width]
            for x in range(width):
                target[x] = np.uint16(target[x] + tap * np.uint16(before[x] + after[x]))
    out, total = np.empty((height, width), np.uint8), np.empty(width, np.uint32)
    for y in range(height):
        centre, target, middle = rows[y + reach], out[y], np.uint32(taps[reach])
        for x in range(width):
            total[x] = np.uint32(1 << 15) + middle * np.uint32(centre[x])
        for k in range(reach):
            tap, above, below = np.uint32(taps[k]), rows[y + k], rows[y + 2 * reach - k]
            for x in range(width):
                total[x] = np.uint32(total[x] + tap * (np.uint32(above[x]) + np.uint32(below[x])))
        for x in range(width):
            value = np.rint(np.float64(np.int32(total[x] >> np.uint32(16))) * factor)
            target[x] = np.uint8(min(255.0, value))
    return out


@njit(**KERNEL)
def blur_twice_truncated(image: Bytes, taps: NDArray[np.float32]) -> Bytes:
    """Rows, then columns, each sum of 7 in float32 cut off to 8 bits; a border of 3 pixels is 0.

    image : (H, W) uint8. taps : (7,) float32. The sums are written out so that they vectorise over a row.
    """
    height, width = image.shape
    a, b, c, d, e, f, g = taps[0], taps[1], taps[2], taps[3], taps[4], taps[5], taps[6]
    rows = np.zeros((height, width), np.uint8)
    for y in range(height):
        source, target = image[y], rows[y]
        for x in range(3, width - 3):
            total = np.float32(source[x - 3]) * a + np.float32(source[x - 2]) * b
            total = total + np.float32(source[x - 1]) * c + np.float32(source[x]) * d
            total = total + np.float32(source[x + 1]) * e + np.float32(source[x + 2]) * f
            target[x] = np.uint8(total + np.float32(source[x + 3]) * g)
    out = np.zeros((height, width), np.uint8)
    for y in range(3, height - 3):
        target = out[y]
        r, s, t, u = rows[y - 3], rows[y - 2], rows[y - 1], rows[y]
        v, w, z = rows[y + 1], rows[y + 2], rows[y + 3]
        for x in range(3, width - 3):
            total = np.float32(r[x]) * a + np.float32(s[x]) * b
            total = total + np.float32(t[x]) * c + np.float32(u[x]) * d
            total = total + np.float32(v[x]) * e + np.float32(w[x]) * f
            target[x] = np.uint8(total + np.float32(z[x]) * g)
    return out
