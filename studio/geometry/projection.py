"""World points to pixels, by the distortion model of the Bouguet toolbox and OpenCV."""

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
    k1, k2, p1, p2, k3 = camera.distortion
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    m = camera.matrix
    pixels = np.stack([m[0, 0] * xd + m[0, 1] * yd + m[0, 2], m[1, 1] * yd + m[1, 2]], axis=-1)
    return pixels, depth
