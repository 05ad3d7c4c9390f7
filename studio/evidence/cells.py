"""Cells of some pixels, on which it is decided what a picture shows: their size, and in which one a place is seen.

Without OpenCV, so that searches, too, may ask.
"""

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.hull_projection import distorted
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.numba_in_threads import EXACT, njit

CELLS = 320
"""Cells along the longer side of a picture."""


def cell_size(height: int, width: int) -> int:
    """Pixels along the side of a picture's cells."""
    return max(1, -(-max(height, width) // CELLS))


def numbers_of(camera: Camera) -> Array:
    """(23,) a camera's numbers as `cell_at` reads them."""
    parts = camera.matrix[:2].ravel(), camera.distortion, camera.rotation.ravel(), camera.translation
    return np.concatenate(parts)


@njit(**EXACT)
def cell_at(
    maps: NDArray[np.int64], views: Array, other: int, x: float, y: float, z: float
) -> tuple[int, int]:
    """Row and column of the cell in which a camera sees a place (mm); -1, -1 where it does not. maps : (V, 4) where a
    camera's cells begin among all, their rows and columns, and their size, pixels. views : (V, 23 or more) K's rows,
    distortion, rotation and translation.
    """
    view = views[other]
    depth = view[17] * x + view[18] * y + view[19] * z + view[22]
    if depth <= 0.0:
        return -1, -1
    across = (view[11] * x + view[12] * y + view[13] * z + view[20]) / depth
    down = (view[14] * x + view[15] * y + view[16] * z + view[21]) / depth
    xd, yd, radial = distorted(across, down, (view[6], view[7], view[8], view[9], view[10]))
    if not radial > 0.0:
        return -1, -1
    _, high, wide, size = maps[other]
    column = (view[0] * xd + view[1] * yd + view[2] + 0.5) / size
    row = (view[4] * yd + view[5] + 0.5) / size
    if not (0.0 <= column < wide and 0.0 <= row < high):
        return -1, -1
    return int(row), int(column)
