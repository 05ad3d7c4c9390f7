"""What the benchmarks look at: cameras around a person, and the person filled in as cones."""

import numpy as np
from numpy.typing import NDArray

from studio.geometry.camera import Camera

Array = NDArray[np.float64]

DISTORTION = (-0.32, 0.14, 0.0, 0.0, 0.0)


def camera_towards(name: str, size: tuple[int, int], focal: float, centre: Array, target: Array) -> Camera:
    """An upright camera at `centre` that looks at `target`, mm, with the distortion of a usual lens."""
    width, height = size
    matrix = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return Camera(name, width, height, matrix, np.array(DISTORTION), rotation, -rotation @ centre)


def filled(outlines: Array, width: int, height: int) -> NDArray[np.uint8]:
    """(H, W) 255 where a pixel's centre lies in any of the convex outlines (L, 4, 2)."""
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    mask = np.zeros((height, width), dtype=np.bool_)
    for outline in outlines[np.isfinite(outlines).all(axis=(1, 2))]:
        edges = zip(outline, np.roll(outline, -1, axis=0), strict=True)
        sides = np.array([(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in edges])
        mask |= (sides >= 0.0).all(axis=0) | (sides <= 0.0).all(axis=0)
    return np.where(mask, np.uint8(255), np.uint8(0))
