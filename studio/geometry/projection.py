"""World points to pixels, by the distortion model of the Bouguet toolbox and OpenCV."""

from collections.abc import Sequence

import numpy as np

from studio.arrays import Array
from studio.geometry.camera import Camera


def project(camera: Camera, points: Array) -> tuple[Array, Array]:
    """Pixels and depths of world points.

    points : (..., 3) world, mm. Returns pixels (..., 2) and depths (...) along the optical axis, mm; points with
    depth <= 0 lie behind the camera and their pixels are NaN.
    """
    seen = points @ camera.rotation.T + camera.translation
    depth = seen[..., 2]
    safe = np.where(depth > 0.0, depth, np.nan)
    x, y = seen[..., 0] / safe, seen[..., 1] / safe
    xd, yd = distorted(x, y, camera.distortion)
    m = camera.matrix
    pixels = np.stack([m[0, 0] * xd + m[0, 1] * yd + m[0, 2], m[1, 1] * yd + m[1, 2]], axis=-1)
    return pixels, depth


def distorted(x: Array, y: Array, coefficients: Sequence[Array] | Array) -> tuple[Array, Array]:
    """Where a lens sends points of the plane at distance 1: x, y (...) as they are bent.

    coefficients : (5,) or (5, ...) k1 k2 p1 p2 k3.
    """
    k1, k2, p1, p2, k3 = coefficients
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
