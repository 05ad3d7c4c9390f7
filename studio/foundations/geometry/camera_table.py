"""Cameras as kernels read them: a table of numbers, and the limit of each camera's field of view."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import distorted

# tan²θ = 1e6 is 90 degrees off the axis less 3.4 arc minutes; no camera sees beyond.
WIDEST_VIEW = 1.0e6
BEYOND_PICTURE = 1.3
RADII = np.linspace(0.0, 4.0, 4001)


CameraTable = NDArray[np.void]
"""(V,) records, as kernels read them without counting references to arrays. rotation (3, 3), translation (3,), centre
(3,), matrix (3, 3), size (2,) as in `Camera`. lens : (5,) k1 k2 p1 p2 k3. limit : greatest x² + y² at depth 1 that is
projected."""
FIELDS = {
    "rotation": (3, 3),
    "translation": (3,),
    "centre": (3,),
    "matrix": (3, 3),
    "lens": (5,),
    "size": (2,),
}


def camera_table(
    cameras: Sequence[Camera], limit: Callable[[Camera], float], dtype: type = np.float64
) -> CameraTable:
    """The table of some cameras. limit : `outward_limit` or `picture_limit`."""
    fields = [(name, dtype, shape) for name, shape in FIELDS.items()]
    table = np.zeros(len(cameras), dtype=[*fields, ("limit", dtype)])
    for row, c in zip(table, cameras, strict=True):
        row["rotation"], row["translation"], row["centre"] = c.rotation, c.translation, c.centre
        row["matrix"], row["lens"], row["size"] = c.matrix, c.distortion, (c.width, c.height)
        row["limit"] = limit(c)
    return table


def outward_limit(camera: Camera) -> float:
    """The squared tangent up to which radial distortion moves points outwards, at most WIDEST_VIEW.

    Beyond it the polynomial folds back and would draw what lies outside the picture into it. The first
    positive root of d/dr [r (1 + k1 r² + k2 r⁴ + k3 r⁶)] = 1 + 3 k1 s + 5 k2 s² + 7 k3 s³, s = r².
    """
    k1, k2, _, _, k3 = (float(value) for value in camera.distortion)
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    real = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0.0)]
    return float(min(real.min(initial=WIDEST_VIEW), WIDEST_VIEW))


def picture_limit(camera: Camera) -> float:
    """As far as the polynomial moves points outwards, at most 1.3 times the radius of the farthest corner."""
    k1, k2, _, _, k3 = camera.distortion
    bent = RADII * distorted(RADII, 0.0, (k1, k2, 0.0, 0.0, k3))[2]
    falling = np.flatnonzero(np.diff(bent) <= 0.0)
    last = falling[0] if len(falling) else len(RADII) - 1
    m = camera.matrix
    corners = np.array([[x, y] for x in (0, camera.width) for y in (0, camera.height)], dtype=np.float64)
    yd = (corners[:, 1] - m[1, 2]) / m[1, 1]
    xd = (corners[:, 0] - m[0, 2] - m[0, 1] * yd) / m[0, 0]
    reached = np.searchsorted(bent[: last + 1], BEYOND_PICTURE * float(np.hypot(xd, yd).max()))
    return float(RADII[min(int(reached), int(last))] ** 2)
