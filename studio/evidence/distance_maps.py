"""Distances of pixels from the silhouette's border, and the border's points, for gradient-based refinement."""

from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Bytes, Floats
from studio.evidence.frame_evidence import FrameEvidence

FOREGROUND = 128
"""Mask values from here on are silhouette."""
MOST_POINTS = 300
"""Border points kept of a view: about every other pixel of a person 200 pixels tall."""
SMOOTHED = 1.5
"""Standard deviation, pixels, of the smoothing before a border's direction is measured."""
BESIDE_HIDDEN = 2
"""Pixels from where a mask says nothing within which its border is none of the body's."""
MARGIN_SHARE = 16
"""Distances are kept up to this from the silhouette, as a share of the picture's longer side."""


@dataclass(frozen=True, slots=True, eq=False)
class SilhouetteDistances:
    """One view's silhouette as distances.

    size : width and height of the picture. corner : left and top of the part of it that `signed` (H, W) covers: pixels
    from the border, which runs between pixels; negative inside, 0 where the mask says nothing. border : (K, 2) centres
    of silhouette pixels at its border, evenly spread, without those at the picture's own border and beside where the
    mask says nothing. outward : (K, 2) unit vectors away from the silhouette.
    """

    size: tuple[int, int]
    corner: tuple[int, int]
    signed: Floats
    border: Array
    outward: Array


def silhouette_distances(evidence: FrameEvidence, most: int = MOST_POINTS) -> tuple[SilhouetteDistances, ...]:
    """The distances of every view's mask. most : border points kept of a view."""
    return tuple(distances_of(view.mask, most, hidden=view.hidden) for view in evidence.views)


_known: WeakKeyDictionary[FrameEvidence, dict[int, Mapping[str, SilhouetteDistances]]] = WeakKeyDictionary()


def silhouettes_by_camera(
    evidence: FrameEvidence, most: int = MOST_POINTS
) -> Mapping[str, SilhouetteDistances]:
    """The distances of every view's mask by its camera, summed over steps from pixel to pixel: a quarter of the time,
    and up to a fiftieth too long. Kept as long as the evidence is, so that they can be made ready beforehand.
    """
    by_points = _known.setdefault(evidence, {})
    if most not in by_points:
        by_points[most] = {
            view.camera: distances_of(view.mask, most, exact=False, hidden=view.hidden)
            for view in evidence.views
        }
    return by_points[most]


def distances_of(
    mask: Bytes, most: int = MOST_POINTS, *, exact: bool = True, hidden: Bytes | None = None
) -> SilhouetteDistances:
    """The distances of a mask (H, W); empty and full masks have no border. hidden : as in `ViewEvidence`."""
    size = (mask.shape[1], mask.shape[0])
    silhouette = np.greater_equal(mask, FOREGROUND).astype(np.uint8)
    left, top, width, height = cv2.boundingRect(silhouette)
    if width and hidden is not None:
        left, top, width, height = cv2.boundingRect(silhouette | (hidden > 0).astype(np.uint8))
    if not width:
        return SilhouetteDistances(
            size, (0, 0), np.zeros((0, 0), np.float32), np.zeros((0, 2)), np.zeros((0, 2))
        )
    margin = max(size) // MARGIN_SHARE
    right, bottom = min(left + width + margin, size[0]), min(top + height + margin, size[1])
    left, top = max(left - margin, 0), max(top - margin, 0)
    inside = np.ascontiguousarray(silhouette[top:bottom, left:right])
    measure = _distances if exact else _stepped_distances
    signed = np.where(inside > 0, 0.5 - measure(inside), measure(1 - inside) - 0.5).astype(np.float32)
    unknown = None if hidden is None else np.ascontiguousarray(hidden[top:bottom, left:right])
    contours, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    points = np.concatenate([np.zeros((0, 2), np.int64), *(contour[:, 0] for contour in contours)])
    at = points + np.array([left, top])
    kept = (at > 0).all(axis=1) & (at < np.array(size) - 1).all(axis=1)
    if unknown is not None:
        side = 2 * BESIDE_HIDDEN + 1
        near = np.asarray(cv2.dilate(unknown, np.ones((side, side), np.uint8)))
        column, row = points.astype(np.int64).T
        kept &= near[row, column] == 0
    points = points[kept][:: max(1, -(-int(kept.sum()) // most))].astype(np.int64)
    smooth = np.asarray(cv2.GaussianBlur(signed, (0, 0), SMOOTHED))
    columns, rows = points[:, 0], points[:, 1]
    slope = np.stack(
        [
            smooth[rows, columns + 1] - smooth[rows, columns - 1],
            smooth[rows + 1, columns] - smooth[rows - 1, columns],
        ],
        axis=1,
    ).astype(np.float64)
    if unknown is not None:
        signed = np.where(unknown > 0, np.float32(0.0), signed)
    outward = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    return SilhouetteDistances(size, (left, top), signed, points + np.array([left, top], np.float64), outward)


def _distances(mask: NDArray[np.uint8]) -> Floats:
    """(H, W) from every pixel's centre to that of the nearest pixel that is 0.

    OpenCV's last bits depend on the mask's memory address, and a descent amplifies them to millimetres. Squared
    distances between pixels are whole numbers, so the exact values are restored by rounding.
    """
    found = cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.sqrt(np.rint(found * found))


def _stepped_distances(mask: NDArray[np.uint8]) -> Floats:
    """The same, summed over steps to neighbours and knights' moves (Borgefors 1986, 5 × 5)."""
    return np.asarray(cv2.distanceTransform(mask, cv2.DIST_L2, cv2.DIST_MASK_5), dtype=np.float32)
