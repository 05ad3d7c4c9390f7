import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studio.foundations.geometry.rotations import (
    axis_turn,
    cross_matrix,
    nearest_rotation,
    orthonormality_error,
    rotation_from_vector,
    vector_from_rotation,
)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_axis_turns_are_those_of_scipy(axis: int) -> None:
    angles = np.array([[-3.0, -0.4, 0.0], [0.7, 2.0, 5.0]])
    expected = Rotation.from_euler("xyz"[axis], angles.reshape(-1, 1)).as_matrix().reshape(2, 3, 3, 3)
    np.testing.assert_allclose(axis_turn(axis, angles), expected, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-9, 1e-4, 1.0, 2.5, 3.1, np.pi - 1e-7, np.pi - 1e-12])
def test_rotation_vectors_are_those_of_opencv_and_return(angle: float) -> None:
    for seed in range(5):
        axis = np.random.default_rng(seed).standard_normal(3)
        vector = angle * axis / np.linalg.norm(axis)
        matrix = rotation_from_vector(vector)
        np.testing.assert_allclose(matrix, cv2.Rodrigues(vector)[0], atol=1e-14)
        np.testing.assert_allclose(vector_from_rotation(matrix), vector, atol=1e-9)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, -0.8), (-0.6, 0.64, 0.48)])
def test_half_a_turn_gives_its_axis_either_way(axis: tuple[float, float, float]) -> None:
    half = 2.0 * np.outer(axis, axis) - np.eye(3)
    vector = vector_from_rotation(half)
    assert np.linalg.norm(vector) == pytest.approx(np.pi)
    np.testing.assert_allclose(np.abs(vector @ np.array(axis)), np.pi, atol=1e-9)


def test_orthonormality_sees_scale_mirror_and_nan() -> None:
    rotation = rotation_from_vector([0.3, -2.0, 1.0])
    assert orthonormality_error(rotation) < 1e-14
    assert orthonormality_error(1.01 * rotation) == pytest.approx(0.0201)
    assert orthonormality_error(rotation @ np.diag([1.0, 1.0, -1.0])) == np.inf
    rotation[0, 0] = np.nan
    assert orthonormality_error(rotation) == np.inf


def test_nearest_rotation_undoes_noise_and_never_mirrors() -> None:
    rng = np.random.default_rng(4)
    rotation = rotation_from_vector([0.5, 0.2, -1.0])
    found = nearest_rotation(rotation + 1e-3 * rng.standard_normal((3, 3)))
    assert orthonormality_error(found) < 1e-12
    np.testing.assert_allclose(found, rotation, atol=5e-3)
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -1.0]))) == pytest.approx(1.0)


def test_cross_matrix_is_the_cross_product() -> None:
    one, two = np.array([1.0, -2.0, 3.0]), np.array([0.5, 4.0, -1.0])
    np.testing.assert_allclose(cross_matrix(one) @ two, np.cross(one, two))
