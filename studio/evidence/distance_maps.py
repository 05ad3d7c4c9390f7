"""Distances of pixels from the silhouette's border, and the border's points, for gradient-based refinement."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes, Floats, Indices
from studio.foundations.numba_in_threads import EXACT, KERNEL, njit

FOREGROUND = 128
"""Mask values from here on are silhouette."""
MOST_POINTS = 300
"""Border points kept of a view: about every other pixel of a person 200 pixels tall."""
SMOOTHED = 1.5
"""Standard deviation, pixels, of the smoothing before a border's direction is measured."""
BESIDE_UNKNOWN = 2
"""Pixels from what is unknown within which a mask's border may be none of the body's."""
MARGIN_SHARE = 16
"""Distances are kept up to this from the silhouette, as a share of the picture's longer side."""


@dataclass(frozen=True, slots=True, eq=False)
class SilhouetteDistances:
    """One view's silhouette as distances.

    size : width and height of the picture. corner : left and top of the part of it that `signed` (H, W) covers: pixels
    from the border, which runs between pixels; negative inside. border : (K, 2) centres of silhouette pixels at its
    border, evenly spread, without those at the picture's own border. outward : (K, 2) unit vectors away from the
    silhouette. Where something hides the body `signed` is 0 and there is no border; at a shadow that is doubted
    `signed` is half the distance, and every second point of the border is left out.
    """

    size: tuple[int, int]
    corner: tuple[int, int]
    signed: Floats
    border: Array
    outward: Array


def silhouette_distances(evidence: FrameEvidence, most: int = MOST_POINTS) -> tuple[SilhouetteDistances, ...]:
    """The distances of every view's mask. most : border points kept of a view."""
    return tuple(_distances_of_view(view, most, exact=True) for view in evidence.views)


_known: WeakKeyDictionary[FrameEvidence, dict[int, Mapping[str, SilhouetteDistances]]] = WeakKeyDictionary()


def silhouettes_by_camera(
    evidence: FrameEvidence,
    most: int = MOST_POINTS,
    spots: Mapping[str, tuple[Indices, float]] | None = None,
) -> Mapping[str, SilhouetteDistances]:
    """The distances of every view's mask by its camera, summed over steps from pixel to pixel: a quarter of the time,
    and up to a fiftieth too long. Kept as long as the evidence is, so that they can be made ready beforehand.

    spots : by camera pixels (K, 2) up to so many pixels from which the masks have what looks like a shadow, too, and
    what cannot be told; these are not kept.
    """
    if spots is not None:
        shown = [_with_spots(view, *spots[view.camera]) for view in evidence.views]
        return {view.camera: _distances_of_view(view, most, exact=False) for view in shown}
    by_points = _known.setdefault(evidence, {})
    if most not in by_points:
        by_points[most] = {
            view.camera: _distances_of_view(view, most, exact=False) for view in evidence.views
        }
    return by_points[most]


def _distances_of_view(view: ViewEvidence, most: int, *, exact: bool) -> SilhouetteDistances:
    # What is unknown of a view with shadows is a shadow that is doubted.
    return distances_of(view.mask, most, exact=exact, unknown=view.unknown, doubted=view.shadow is not None)


def _with_spots(view: ViewEvidence, pixels: Indices, radius: float) -> ViewEvidence:
    """The view, its mask as of `silhouettes_by_camera`."""
    near = np.zeros_like(view.mask)
    for at in pixels:
        cv2.circle(near, (int(at[0]), int(at[1])), max(1, round(radius)), (255,), -1)
    # What the mask has already adds nothing.
    shadow, doubted = (view.mask if one is None else one for one in (view.shadow, view.unknown))
    near &= shadow | doubted
    unknown = None if view.unknown is None else view.unknown & ~near
    return replace(view, mask=view.mask | near, unknown=unknown)


def distances_of(
    mask: Bytes,
    most: int = MOST_POINTS,
    *,
    exact: bool = True,
    unknown: Bytes | None = None,
    doubted: bool = False,
) -> SilhouetteDistances:
    """The distances of a mask (H, W); empty and full masks have no border. unknown : as in `ViewEvidence`. doubted :
    whether that is a shadow, which counts half here as in likelihoods: with no border at all a descent slides into the
    shadow of the feet.
    """
    size = (mask.shape[1], mask.shape[0])
    left, top, right, bottom = box_of(mask, np.uint8(FOREGROUND))
    if right and unknown is not None:
        box = box_of(unknown, np.uint8(1))
        if box[2]:
            left, top = min(left, box[0]), min(top, box[1])
            right, bottom = max(right, box[2]), max(bottom, box[3])
    if not right:
        return SilhouetteDistances(
            size, (0, 0), np.zeros((0, 0), np.float32), np.zeros((0, 2)), np.zeros((0, 2))
        )
    margin = max(size) // MARGIN_SHARE
    right, bottom = min(right + margin, size[0]), min(bottom + margin, size[1])
    left, top = max(left - margin, 0), max(top - margin, 0)
    inside = np.greater_equal(mask[top:bottom, left:right], FOREGROUND).view(np.uint8)
    measure = _distances if exact else _stepped_distances
    signed = signed_of(inside, measure(inside), measure(1 - inside))
    open_part = None if unknown is None else np.ascontiguousarray(unknown[top:bottom, left:right])
    contours, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([np.zeros((0, 2), np.int64), *(contour[:, 0] for contour in contours)]).astype(
        np.int64
    )
    x, y = points[:, 0] + left, points[:, 1] + top
    kept = (x > 0) & (y > 0) & (x < size[0] - 1) & (y < size[1] - 1)
    if open_part is not None:
        side = 2 * BESIDE_UNKNOWN + 1
        near = np.asarray(cv2.dilate(open_part, np.ones((side, side), np.uint8)))
        beside = np.flatnonzero(kept & (near[points[:, 1], points[:, 0]] > 0))
        kept[beside[1::2] if doubted else beside] = False
    points = points[kept][:: max(1, -(-int(kept.sum()) // most))]
    outward = slopes_at(points, np.asarray(cv2.GaussianBlur(signed, (0, 0), SMOOTHED), np.float32))
    if open_part is not None:
        counts = np.float32(0.5 if doubted else 0.0)
        signed = np.where(open_part > 0, counts * signed, signed)
    return SilhouetteDistances(size, (left, top), signed, points + np.array([left, top], np.float64), outward)


@njit(**KERNEL)
def box_of(picture: Bytes, least: np.uint8) -> tuple[int, int, int, int]:
    """Left, top, right and bottom (one past the last) of pixels at least so bright in (H, W); 0 if there are none."""
    height, width = picture.shape
    columns = np.zeros(width, np.uint8)
    top = bottom = 0
    for y in range(height):
        row, brightest = picture[y], np.uint8(0)
        for x in range(width):
            columns[x] = max(columns[x], row[x])
            brightest = max(brightest, row[x])
        if brightest >= least:
            top, bottom = top if bottom else y, y + 1
    left, right = 0, width
    while left < right and columns[left] < least:
        left += 1
    while right > left and columns[right - 1] < least:
        right -= 1
    return (left, top, right, bottom) if bottom else (0, 0, 0, 0)


@njit(**EXACT)
def signed_of(inside: Bytes, within: Floats, beyond: Floats) -> Floats:
    """(H, W) pixels to the border between pixels, negative where inside (H, W) is not 0, of distances `within` and
    `beyond` to pixels' centres. Overwrites `beyond`.
    """
    half = np.float32(0.5)
    for y in range(inside.shape[0]):
        row_inside, one, signed = inside[y], within[y], beyond[y]
        for x in range(inside.shape[1]):
            signed[x] = half - one[x] if row_inside[x] else signed[x] - half
    return beyond


@njit(**EXACT)
def slopes_at(points: Indices, values: Floats) -> Array:
    """(K, 2) directions in which values (H, W) rise most at points (K, 2); 0 where they do not."""
    slopes = np.empty((len(points), 2))
    for k in range(len(points)):
        x, y = points[k]
        across = np.float64(values[y, x + 1] - values[y, x - 1])
        along = np.float64(values[y + 1, x] - values[y - 1, x])
        length = max(np.sqrt(across * across + along * along), 1e-9)
        slopes[k, 0], slopes[k, 1] = across / length, along / length
    return slopes


def _distances(mask: NDArray[np.uint8]) -> Floats:
    """(H, W) from every pixel's centre to that of the nearest pixel that is 0.

    OpenCV's last bits depend on the mask's memory address, and a descent amplifies them to millimetres. Squared
    distances between pixels are whole numbers, so the exact values are restored by rounding.
    """
    distances = _within_picture(cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE))
    return np.sqrt(np.rint(distances * distances))


def _stepped_distances(mask: NDArray[np.uint8]) -> Floats:
    """The same, summed over steps to neighbours and knights' moves (Borgefors 1986, 5 × 5)."""
    return _within_picture(cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5))


def _within_picture(distances: NDArray[np.generic]) -> Floats:
    """The distances; where no pixel is 0, the picture's diagonal instead of what OpenCV says there, which is another
    large number on each kind of processor.
    """
    pixels, diagonal = np.asarray(distances, dtype=np.float32), math.hypot(*distances.shape)
    return np.full_like(pixels, diagonal) if pixels.size and pixels[0, 0] > 2.0 * diagonal else pixels
