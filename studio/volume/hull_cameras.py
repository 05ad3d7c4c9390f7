"""Cameras as rows of numbers for the kernels of the hull."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studio.geometry.camera import Camera

Array = NDArray[np.float64]

ROTATION, TRANSLATION, DISTORTION, MATRIX = 0, 9, 12, 17
WIDTH, HEIGHT, RADIUS, CENTRE, COLUMNS = 22, 23, 24, 25, 28
"""Columns of a row: rotation (9), translation (3), k1 k2 p1 p2 k3, fx skew cx fy cy, width, height, the greatest
squared distance from the optical axis at depth 1 that is projected, the camera's centre (3)."""

BEYOND_PICTURE = 1.3
RADII = np.linspace(0.0, 4.0, 4001)


def camera_rows(cameras: Sequence[Camera]) -> Array:
    """(V, COLUMNS) one row a camera."""
    rows = np.empty((len(cameras), COLUMNS))
    for row, camera in zip(rows, cameras, strict=True):
        m = camera.matrix
        row[ROTATION:TRANSLATION] = camera.rotation.ravel()
        row[TRANSLATION:DISTORTION] = camera.translation
        row[DISTORTION:MATRIX] = camera.distortion
        row[MATRIX:WIDTH] = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2]
        row[WIDTH:CENTRE] = camera.width, camera.height, radius_limit(camera)
        row[CENTRE:] = camera.centre
    return rows


def radius_limit(camera: Camera) -> float:
    """Greatest x² + y² at depth 1 that may be projected.

    With barrel distortion the polynomial 1 + k1 r² + k2 r⁴ + k3 r⁶ turns back at some radius, and points far outside
    the picture would land in it: nothing beyond that radius is projected, nor beyond 1.3 times the radius of the
    picture's farthest corner.
    """
    k1, k2, _, _, k3 = camera.distortion
    square = RADII**2
    bent = RADII * (1.0 + square * (k1 + square * (k2 + square * k3)))
    falling = np.flatnonzero(np.diff(bent) <= 0.0)
    last = falling[0] if len(falling) else len(RADII) - 1
    m = camera.matrix
    corners = np.array([[x, y] for x in (0, camera.width) for y in (0, camera.height)], dtype=np.float64)
    yd = (corners[:, 1] - m[1, 2]) / m[1, 1]
    xd = (corners[:, 0] - m[0, 2] - m[0, 1] * yd) / m[0, 0]
    reached = np.searchsorted(bent[: last + 1], BEYOND_PICTURE * float(np.hypot(xd, yd).max()))
    return float(RADII[min(int(reached), int(last))] ** 2)
