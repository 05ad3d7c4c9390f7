# pyright: standard
"""How plainly thin lines show in a picture: masks hold only pieces of what is three pixels wide.

A pixel is on a line of a direction if it differs from both sides, in the same sense, by more than noise: of the picture
less the empty view, so that what stands still is none; averaged along the direction. Cameras around a small animal miss
each other by pixels: what lies beside a line counts, too, the less the farther.
"""

import numpy as np
import scipy

from studio.foundations.arrays import Array, Bytes, Floats, Mask
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.trackers.limb_places import cover

DIRECTIONS = 16
LONG = 3
"""A direction's average is so many widths long."""
PLAIN = 8.0
"""Grey levels between a line and its sides, from which it is plain."""
FARTHEST = 0.2
"""What a plain line counts at the farthest distance from it that counts, a width."""
GREY = np.array([0.114, 0.587, 0.299], np.float32)
"""Of blue, green and red."""


def line_strength(picture: Bytes, empty: Bytes, width: int) -> Floats:
    """(DIRECTIONS, h, w) 0 to 1: how plainly a pixel is on a line of each direction, or up to a width beside one.
    picture, empty : (h, w, 3) BGR, with and without the subject. width : of the line, pixels, odd.
    """
    change = picture @ GREY - empty @ GREY
    across = np.asarray(scipy.ndimage.uniform_filter(change, width, mode="nearest"), np.float32)
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    found = np.zeros((DIRECTIONS, *change.shape), np.float32)
    fill_lines(across, width, np.stack([np.cos(angles), np.sin(angles)], axis=1), found)
    return found


def free_of(quads: Array, height: int, width: int) -> Mask:
    """(height, width) where none of some quadrilaterals (N, 4, 2), pixels, lies; NaN for those that are not there."""
    bits, near = np.zeros((height, width), np.uint32), np.zeros((height, width), np.uint8)
    cover(np.ascontiguousarray(quads), np.zeros(len(quads), np.int64), 0.0, bits, near)
    return bits == 0


def is_broad(mask: Bytes, width: int) -> Mask:
    """(h, w) where a mask is broader than twice a line and a bit: discs of that size fit into it."""
    inside = scipy.ndimage.distance_transform_edt(np.pad(mask > 0, 1, mode="edge"))[1:-1, 1:-1]
    middles = inside > width
    if not middles.any():
        return np.zeros(mask.shape, np.bool_)
    return scipy.ndimage.distance_transform_edt(~middles) <= width


@njit(**EXACT)
def fill_lines(across: Floats, width: int, along: Array, found: Floats) -> None:
    """Fill in `line_strength`. across : (h, w) changed grey levels, averaged over a width. along : (DIRECTIONS, 2) unit
    vectors.
    """
    reach, side = LONG * width // 2, width + 1
    wide = _with_border(across, reach + 1)
    mean, one, other = np.zeros_like(across), np.zeros_like(across), np.zeros_like(across)
    for number in range(len(along)):
        x, y = along[number]
        mean[:] = 0.0
        for step in range(-reach, reach + 1):
            _move(wide, step * x, step * y, one)
            mean += one
        mean /= np.float32(2 * reach + 1)
        beside, best = _with_border(mean, side + 1), found[number]
        _move(beside, -side * y, side * x, one)
        _move(beside, side * y, -side * x, other)
        for row in range(len(mean)):
            for column in range(mean.shape[1]):
                up, down = mean[row, column] - one[row, column], mean[row, column] - other[row, column]
                plain = max(min(up, down), min(-up, -down), np.float32(0.0)) / np.float32(PLAIN)
                best[row, column] = min(plain, np.float32(1.0))
        wider = _with_border(best, side + 1)
        for off in range(1, width + 1):
            less = np.float32(1.0 - (1.0 - FARTHEST) * off / width)
            _move(wider, -off * y, off * x, one)
            _move(wider, off * y, -off * x, other)
            for row in range(len(mean)):
                for column in range(mean.shape[1]):
                    best[row, column] = max(
                        best[row, column], less * max(one[row, column], other[row, column])
                    )


@njit(**EXACT)
def _move(wide: Floats, x: float, y: float, moved: Floats) -> None:
    """Fill in (h, w) the values of a picture x and y pixels farther on, between its pixels. wide : with its border."""
    left, up = int(np.floor(x)), int(np.floor(y))
    right, down = np.float32(x - left), np.float32(y - up)
    height, width = moved.shape
    column, row = (wide.shape[1] - width) // 2 + left, (wide.shape[0] - height) // 2 + up
    rest, below = np.float32(1.0) - right, np.float32(1.0) - down
    for at in range(height):
        first, second, into = wide[row + at], wide[row + at + 1], moved[at]
        for n in range(width):
            into[n] = below * (rest * first[column + n] + right * first[column + n + 1]) + down * (
                rest * second[column + n] + right * second[column + n + 1]
            )


@njit(**EXACT)
def _with_border(picture: Floats, pixels: int) -> Floats:
    """The picture with its border continued by so many pixels on each side."""
    height, width = picture.shape
    wide = np.zeros((height + 2 * pixels, width + 2 * pixels), np.float32)
    for row in range(len(wide)):
        own = picture[min(max(row - pixels, 0), height - 1)]
        wide[row, :pixels] = own[0]
        wide[row, pixels : pixels + width] = own
        wide[row, pixels + width :] = own[width - 1]
    return wide
