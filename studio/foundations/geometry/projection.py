"""World points to pixels, by the distortion model of the Bouguet toolbox and OpenCV."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.foundations.geometry.camera import Camera

ROUNDS = 10
"""Of the inversion of a lens."""


def project(camera: Camera, points: Array) -> tuple[Array, Array]:
    """Pixels and depths of world points.

    points : (..., 3) world, mm.

    Returns pixels (..., 2) and depths (...) along the optical axis, mm; points with depth <= 0 lie behind the camera
    and their pixels are NaN.
    """
    seen = points @ camera.rotation.T + camera.translation
    depth = seen[..., 2]
    safe = np.where(depth > 0.0, depth, np.nan)
    xd, yd, _ = distorted(seen[..., 0] / safe, seen[..., 1] / safe, camera.distortion)
    m = camera.matrix
    pixels = np.stack([m[0, 0] * xd + m[0, 1] * yd + m[0, 2], m[1, 1] * yd + m[1, 2]], axis=-1)
    return pixels, depth


def nearest_pixels(camera: Camera, points: Array) -> tuple[Indices, NDArray[np.bool_]]:
    """(..., 2) the pixels nearest to world points (..., 3), mm, and (...) whether the camera's picture has them."""
    pixels, depths = project(camera, points)
    near = np.rint(np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0).clip(-1.0, 1e6)).astype(np.int64)
    fits = (near >= 0).all(axis=-1) & (near < (camera.width, camera.height)).all(axis=-1)
    return near, (depths > 0.0) & fits


def directions(camera: Camera, pixels: Array) -> Array:
    """(K, 3) directions through pixels (K, 2), in the camera's frame, of depth 1; the lens is inverted by fixed-point
    iteration.
    """
    seen = np.linalg.solve(camera.matrix, np.column_stack([pixels, np.ones(len(pixels))]).T)[:2]
    flat = seen.copy()
    for _ in range(ROUNDS):
        x, y, _ = distorted(flat[0], flat[1], camera.distortion)
        flat += seen - np.stack([x, y])
    return np.column_stack([*flat, np.ones(len(pixels))])


def distorted(x: Any, y: Any, lens: Any) -> tuple[Any, Any, Any]:  # noqa: ANN401 - numbers or arrays
    """Distorted position of x, y (at depth 1), and the radial factor there; kernels compile this too.

    lens : k1 k2 p1 p2 k3.
    """
    k1, k2, p1, p2, k3 = lens
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    xd = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
    yd = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
    return xd, yd, radial
