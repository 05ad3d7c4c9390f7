"""Laying one set of points over another: at a root point, or by the best similarity."""

import numpy as np

from studio.arrays import Array

FEWEST_POINTS = 3


def moved_to_root(points: Array, wanted: Array, root: int) -> Array:
    """(M, 3) `points` moved so that point `root` lies where it lies in `wanted`, (M, 3)."""
    return points + (wanted[root] - points[root])


def similarity_aligned(points: Array, wanted: Array) -> Array:
    """(M, 3) `points` turned, scaled and moved to come closest to `wanted`, (M, 3), in the sum of squares.

    The closed form of Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 13(4), 1991, Eq. 40-43; mirroring is not allowed. Points that all coincide are only moved.
    """
    from_middle, to_middle = points.mean(axis=0), wanted.mean(axis=0)
    spread, target = points - from_middle, wanted - to_middle
    size = float(np.sum(spread**2))
    if size == 0.0:
        return np.broadcast_to(to_middle, points.shape).copy()
    left, stretches, right = np.linalg.svd(target.T @ spread)
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left) * np.linalg.det(right))])
    turn = (left * signs) @ right
    scale = float(np.sum(stretches * signs)) / size
    return scale * spread @ turn.T + to_middle
