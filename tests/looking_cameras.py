"""Cameras that look at a point."""

import numpy as np
from numpy.typing import ArrayLike

Array = np.ndarray


def turned_to(centre: Array, target: ArrayLike) -> Array:
    """(3, 3) rotation of an upright camera at `centre` (3,) that looks at a point."""
    ahead = np.asarray(target) - centre
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])
