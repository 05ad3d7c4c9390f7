import numpy as np
from scipy.spatial.transform import Rotation

from studio.foundations.geometry.rigid import best_fit, compose, inverse, rigid, transform


def _motions(seed: int, count: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rigid(Rotation.random(count, rng=rng).as_matrix(), 1000.0 * rng.standard_normal((count, 3)))


def _square(motions: np.ndarray) -> np.ndarray:
    bottom = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(motions), 1, 4))
    return np.concatenate([motions, bottom], axis=1)


def test_compose_and_inverse_are_products_of_four_by_four_matrices() -> None:
    one, two = _motions(0, 6), _motions(1, 6)
    np.testing.assert_allclose(compose(one, two), (_square(one) @ _square(two))[:, :3], atol=1e-9)
    np.testing.assert_allclose(inverse(one), np.linalg.inv(_square(one))[:, :3], atol=1e-9)


def test_transform_broadcasts_motions_over_points() -> None:
    motions = _motions(2, 4)[:, None]
    points = np.random.default_rng(3).standard_normal((5, 3))
    moved = transform(motions, points)
    assert moved.shape == (4, 5, 3)
    expected = _square(motions[:, 0])[2] @ np.append(points[3], 1.0)
    np.testing.assert_allclose(moved[2, 3], expected[:3], atol=1e-9)


def test_best_fit_recovers_a_motion() -> None:
    motion = _motions(5, 1)[0]
    points = np.random.default_rng(6).standard_normal((7, 3)) * 300.0
    np.testing.assert_allclose(best_fit(points, transform(motion, points)), motion, atol=1e-9)
