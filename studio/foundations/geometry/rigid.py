"""Rigid motions as (..., 3, 4) arrays: rotation in the first three columns, translation (mm) in the last.

`a_from_b` takes points written in frame b to frame a.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.geometry.rotations import nearest_rotation


def rigid(rotation: Array, translation: Array) -> Array:
    """(..., 3, 4) from (..., 3, 3) and (..., 3)."""
    return np.concatenate([rotation, translation[..., None]], axis=-1)


def compose(a_from_b: Array, b_from_c: Array) -> Array:
    """a_from_c, (..., 3, 4)."""
    rotation = a_from_b[..., :3] @ b_from_c[..., :3]
    return rigid(rotation, transform(a_from_b, b_from_c[..., 3]))


def inverse(a_from_b: Array) -> Array:
    """b_from_a, (..., 3, 4)."""
    back = np.swapaxes(a_from_b[..., :3], -1, -2)
    return rigid(back, -(back @ a_from_b[..., 3:])[..., 0])


def transform(a_from_b: Array, points: Array) -> Array:
    """Points in frame a. points : (..., 3) in frame b, broadcast against the motions' leading dimensions."""
    return (a_from_b[..., :3] @ points[..., None])[..., 0] + a_from_b[..., 3]


def best_fit(source: Array, target: Array) -> Array:
    """The (3, 4) motion target_from_source that leaves the least sum of squared distances (Kabsch).

    source, target : (K, 3), K >= 1; with fewer than three points the rotation is one of many.
    """
    middle_source, middle_target = source.mean(axis=0), target.mean(axis=0)
    rotation = nearest_rotation((target - middle_target).T @ (source - middle_source))
    return rigid(rotation, middle_target - rotation @ middle_source)
