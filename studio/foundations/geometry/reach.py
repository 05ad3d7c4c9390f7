"""Plausible range of coordinates: numbers beyond it have a wrong unit or are corrupt."""

import numpy as np
from numpy.typing import ArrayLike

FARTHEST_MM = 1e7
"""10 km: more than any hall or field, and a pose's angles lie far below it, too."""
REACH_HINT = "Coordinates lie within 10 km (1e7 mm) of the world's origin: check the unit and their source."


def within_reach(values: ArrayLike) -> bool:
    """Whether all numbers (mm or radians) are finite and none is farther than FARTHEST_MM."""
    array = np.asarray(values, dtype=np.float64)
    return bool(np.isfinite(array).all() and (np.abs(array) <= FARTHEST_MM).all())
