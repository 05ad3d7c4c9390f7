"""A mask of several subjects, shared among them by who explains which pixel."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Bytes


def shared_mask(whole: Bytes, silhouettes: Sequence[Bytes], reach: float = np.inf) -> list[Bytes]:
    """(H, W) 0 or 255 for each subject: its part of the mask of all of them.

    whole : (H, W), foreground above 0. silhouettes : (H, W) each, where the subject is expected, above 0. A pixel is
    whose silhouette it lies in; of several that hide one another it is each one's, for none of them denies it. One that
    nobody explains is the nearest one's. reach : pixels beyond which it is nobody's.
    """
    inside = np.stack([one > 0 for one in silhouettes])
    apart = np.stack([_distance(one) for one in inside])
    nearest = (apart == apart.min(axis=0)) & (apart <= reach)
    foreground = whole > 0
    return [
        np.where(foreground & own, np.uint8(255), np.uint8(0))
        for own in inside | (nearest & ~inside.any(axis=0))
    ]


def _distance(inside: NDArray[np.bool_]) -> Array:
    """(H, W) pixels to the nearest one inside; inf where there is none."""
    if not inside.any():
        return np.full(inside.shape, np.inf)
    outside = np.where(inside, np.uint8(0), np.uint8(1))
    return np.asarray(cv2.distanceTransform(outside, cv2.DIST_L2, 5), dtype=np.float64)
