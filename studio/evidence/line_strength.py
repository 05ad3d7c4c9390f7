"""How plainly thin lines show in a picture: masks hold only pieces of what is three pixels wide.

A pixel is on a line of a direction if it differs from both sides, in the same sense, by more than noise: of the picture
less the empty view, so that what stands still is none; averaged along the direction. Cameras around a small animal miss
each other by pixels: what lies beside a line counts, too, the less the farther.
"""

import cv2
import numpy as np

from studio.foundations.arrays import Array, Bytes, Floats, Mask

DIRECTIONS = 16
LONG = 3
"""A direction's average is so many widths long."""
PLAIN = 8.0
"""Grey levels between a line and its sides, from which it is plain."""
FARTHEST = 0.2
"""What a plain line counts at the farthest distance from it that counts, a width."""


def line_strength(picture: Bytes, empty: Bytes, width: int) -> Floats:
    """(DIRECTIONS, h, w) 0 to 1: how plainly a pixel is on a line of each direction, or up to a width beside one.
    picture, empty : (h, w, 3) BGR, with and without the subject. width : of the line, pixels, odd.
    """
    across = np.asarray(cv2.blur(_grey(picture) - _grey(empty), (width, width)), np.float32)
    found = np.zeros((DIRECTIONS, *across.shape), np.float32)
    for number, along in enumerate(_directions()):
        mean = np.asarray(cv2.filter2D(across, -1, _average_along(along, LONG * width)), np.float32)
        side = (width + 1) * np.array([-along[1], along[0]])
        one, other = (mean - _moved(mean, way * side) for way in (1.0, -1.0))
        plain = np.maximum(np.minimum(one, other), np.minimum(-one, -other)) / PLAIN
        plain = np.clip(plain, 0.0, 1.0).astype(np.float32)
        found[number] = plain
        for off in range(1, width + 1):
            less = 1.0 - (1.0 - FARTHEST) * off / width
            for way in (1.0, -1.0):
                beside = _moved(plain, way * off / (width + 1) * side)
                np.maximum(found[number], np.float32(less) * beside, out=found[number])
    return found


def free_of(quads: Array, height: int, width: int) -> Mask:
    """(height, width) where none of some quadrilaterals (N, 4, 2), pixels, lies; NaN for those that are not there."""
    covered = np.zeros((height, width), np.uint8)
    for quad in quads:
        if np.isfinite(quad).all():
            cv2.fillPoly(covered, [np.rint(quad).astype(np.int32)], (1,))
    return covered == 0


def is_broad(mask: Bytes, width: int) -> Mask:
    """(h, w) where a mask, 0 or 255, is broader than twice a line and a bit."""
    round_spot = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * width + 1, 2 * width + 1))
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, round_spot)) > 0


def _directions() -> Array:
    """(DIRECTIONS, 2) unit vectors."""
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _average_along(along: Array, length: int) -> Floats:
    """A kernel that averages along a direction."""
    reach = length // 2
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    ahead, beside = x * along[0] + y * along[1], y * along[0] - x * along[1]
    kernel = np.clip(length / 2.0 - np.abs(ahead) + 0.5, 0.0, 1.0) * np.clip(1.0 - np.abs(beside), 0.0, 1.0)
    return (kernel / kernel.sum()).astype(np.float32)


def _moved(picture: Floats, by: Array) -> Floats:
    """(h, w) a picture moved by (2,) pixels, its border continued."""
    matrix = np.array([[1.0, 0.0, by[0]], [0.0, 1.0, by[1]]])
    size = picture.shape[1], picture.shape[0]
    moved = cv2.warpAffine(picture, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def _grey(picture: Bytes) -> Floats:
    return cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_BGR2GRAY).astype(np.float32)
