"""Gaussian mixtures against scipy's densities."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from studio.search.behaviour.gaussian_mixture import GaussianMixture


@pytest.fixture
def mixture() -> GaussianMixture:
    rng = np.random.default_rng(3)
    factors = rng.standard_normal((4, 5, 5))
    covariances = factors @ factors.transpose(0, 2, 1) + 0.1 * np.eye(5)
    return GaussianMixture(np.array([0.1, 0.2, 0.3, 0.4]), rng.standard_normal((4, 5)), covariances)


def oracle(mixture: GaussianMixture, points: np.ndarray) -> np.ndarray:
    pairs = zip(mixture.means, mixture.covariances, strict=True)
    return np.stack([multivariate_normal(mean, cov).logpdf(points) for mean, cov in pairs], axis=1)


def test_densities_are_scipys(mixture: GaussianMixture) -> None:
    points = 2.0 * np.random.default_rng(0).standard_normal((50, 5))
    wanted = oracle(mixture, points)
    np.testing.assert_allclose(mixture.log_densities(points), wanted, rtol=1e-10)
    mixed = np.exp(wanted) @ mixture.weights
    assert mixture.log_likelihood(points) == pytest.approx(np.log(mixed).sum(), rel=1e-12)
    shares = np.exp(wanted) * mixture.weights / mixed[:, None]
    np.testing.assert_allclose(mixture.responsibilities(points), shares, atol=1e-12)
    np.testing.assert_array_equal(mixture.labels(points), shares.argmax(axis=1))


def test_far_points_have_finite_densities_and_shares(mixture: GaussianMixture) -> None:
    far = np.full((1, 5), 1e4)
    assert np.isfinite(mixture.log_densities(far)).all()
    assert mixture.responsibilities(far).sum() == pytest.approx(1.0)


def test_roots_are_symmetric_and_square_to_the_covariances(mixture: GaussianMixture) -> None:
    roots = mixture.roots
    np.testing.assert_allclose(roots, roots.transpose(0, 2, 1), atol=1e-12)
    np.testing.assert_allclose(roots @ roots, mixture.covariances, atol=1e-10)
    assert (np.linalg.eigvalsh(roots) > 0.0).all()


def test_mapped_mixture_has_the_densities_of_the_mapped_points(mixture: GaussianMixture) -> None:
    matrix = np.random.default_rng(1).standard_normal((5, 5))
    offset = np.arange(5.0)
    points = np.random.default_rng(2).standard_normal((9, 5))
    mapped = mixture.mapped(matrix, offset)
    wanted = mixture.log_densities(points) - np.log(abs(np.linalg.det(matrix)))
    np.testing.assert_allclose(mapped.log_densities(points @ matrix.T + offset), wanted, rtol=1e-8)


def test_chosen_components_keep_their_ratio(mixture: GaussianMixture) -> None:
    part = mixture.chosen(np.array([1, 3]))
    np.testing.assert_allclose(part.weights, [1 / 3, 2 / 3])
    np.testing.assert_array_equal(part.means, mixture.means[[1, 3]])


def test_variances_are_those_of_all_components_together(mixture: GaussianMixture) -> None:
    # E x² - (E x)² of the mixture.
    squares = np.diagonal(mixture.covariances, axis1=1, axis2=2) + mixture.means**2
    wanted = mixture.weights @ squares - (mixture.weights @ mixture.means) ** 2
    np.testing.assert_allclose(mixture.variances, wanted)
    assert mixture.size == 4


def test_a_covariance_that_is_flat_but_for_rounding_has_a_root() -> None:
    flat = np.array([[[1.0, 1.0], [1.0, 1.0 - 1e-15]]])
    root = GaussianMixture(np.ones(1), np.zeros((1, 2)), flat).roots[0]
    np.testing.assert_allclose(root, np.full((2, 2), 0.5**0.5), atol=1e-7)


def test_a_component_without_weight_is_no_points_label(mixture: GaussianMixture) -> None:
    none = GaussianMixture(np.array([0.0, 0.3, 0.3, 0.4]), mixture.means, mixture.covariances)
    assert none.labels(mixture.means[:1])[0] != 0
    assert none.responsibilities(mixture.means)[0, 0] == 0.0
