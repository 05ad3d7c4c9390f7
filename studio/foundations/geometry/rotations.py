"""Rotations as 3 by 3 matrices (column vectors, right-handed turns, radians)."""

import numpy as np
from numpy.typing import ArrayLike

from studio.foundations.arrays import Array

# Below this angle (radians) sin(a)/a is 1 to the last bit of a double.
SMALL_ANGLE = 1e-8


def axis_turn(axis: int, angle: ArrayLike) -> Array:
    """The right-handed turn about one coordinate axis.

    axis : 0, 1 or 2. angle : (...) radians. Returns (..., 3, 3).
    """
    angle = np.asarray(angle, dtype=float)
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.zeros((*angle.shape, 3, 3))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    turn[..., axis, axis] = 1.0
    turn[..., one, one] = cosine
    turn[..., two, two] = cosine
    turn[..., one, two] = -sine
    turn[..., two, one] = sine
    return turn


def rotation_from_vector(vector: ArrayLike) -> Array:
    """The matrix of a rotation vector (Rodrigues' formula).

    vector : (3,) axis times angle, radians. Returns (3, 3).
    """
    vector = np.asarray(vector, dtype=float)
    angle = float(np.linalg.norm(vector))
    if angle < SMALL_ANGLE:
        return np.eye(3) + cross_matrix(vector)
    across = cross_matrix(vector / angle)
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def vector_from_rotation(rotation: ArrayLike) -> Array:
    """The rotation vector of a matrix: axis times angle, 0 <= angle <= pi.

    rotation : (3, 3) orthonormal, determinant 1. Returns (3,) radians. Exact near 0 and near pi as well: the
    axis is taken from the antisymmetric part, or at half a turn from the largest column of the symmetric
    part.
    """
    rotation = np.asarray(rotation, dtype=float)
    across = 0.5 * np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(across)), 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if angle < SMALL_ANGLE:
        return across
    if cosine > -0.9:
        return across * (angle / sine)
    outer = 0.5 * (rotation + rotation.T) - cosine * np.eye(3)
    column = outer[:, int(np.argmax(np.diag(outer)))]
    axis = column / np.linalg.norm(column)
    return axis * (angle if float(axis @ across) >= 0.0 else -angle)


def cross_matrix(vector: ArrayLike) -> Array:
    """(3, 3) matrix whose product with any w is the cross product vector × w."""
    x, y, z = np.asarray(vector, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def orthonormality_error(matrix: ArrayLike) -> float:
    """How far a (3, 3) matrix is from a rotation: the largest entry of |MᵀM - 1|, infinite when it mirrors
    space (negative determinant) or holds a NaN."""
    matrix = np.asarray(matrix, dtype=float)
    if not np.isfinite(matrix).all() or np.linalg.det(matrix) < 0.0:
        return float("inf")
    return float(np.abs(matrix.T @ matrix - np.eye(3)).max())


def nearest_rotation(matrix: ArrayLike) -> Array:
    """The rotations closest to (..., 3, 3) matrices in the sum of squares (orthogonal Procrustes)."""
    left, _, right = np.linalg.svd(np.asarray(matrix, dtype=float))
    left[..., 2] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right


def frames_along(up: Array, left: Array) -> Array:
    """(F, 3, 3) frames with z along `up` and y as close to `left` as that allows; (F, 3) each."""
    z: Array = up / np.linalg.norm(up, axis=1, keepdims=True)
    x: Array = np.cross(left, z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)
