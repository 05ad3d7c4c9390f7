"""Principal components, and clusters taken back to the full space."""

import numpy as np
import pytest

from studio.search.behaviour.reduction import fit_reduction, full_clusters


@pytest.fixture
def features() -> np.ndarray:
    """Features of 3 angles in radians, 3 small derivatives, four hidden dimensions."""
    rng = np.random.default_rng(0)
    hidden = rng.standard_normal((500, 4)) * [1.0, 0.7, 0.4, 0.2]
    return hidden @ rng.standard_normal((4, 6)) * [1, 1, 1, 0.05, 0.05, 0.05] + 3.0


def test_components_are_those_of_the_singular_values(features: np.ndarray) -> None:
    reduction = fit_reduction(features, 2)
    scaled = (features - features.mean(axis=0)) / reduction.scale
    _, values, rows = np.linalg.svd(scaled, full_matrices=False)
    np.testing.assert_allclose(abs((reduction.loadings * rows[:2]).sum(axis=1)), 1.0)
    assert reduction.kept == pytest.approx((values[:2] ** 2).sum() / (values**2).sum())
    reduced = reduction.reduced(features)
    np.testing.assert_allclose(np.cov(reduced.T, bias=True), np.diag(values[:2] ** 2) / 500, atol=1e-10)


def test_angles_and_derivatives_count_alike(features: np.ndarray) -> None:
    reduction = fit_reduction(features, 0)
    reduced = reduction.reduced(features)
    assert reduced.shape == features.shape
    assert reduction.kept == 1.0
    assert reduced[:, :3].var(axis=0).sum() == pytest.approx(3.0)
    assert reduced[:, 3:].var(axis=0).sum() == pytest.approx(3.0)


def test_constant_features_are_no_trouble() -> None:
    reduction = fit_reduction(np.full((50, 6), 2.0), 3)
    assert np.isfinite(reduction.reduced(np.full((4, 6), 2.0))).all()


def test_clusters_in_the_full_space_have_their_frames_moments() -> None:
    rng = np.random.default_rng(1)
    spread = rng.standard_normal((2, 6, 6))
    parts = [rng.standard_normal((5000, 6)) @ spread[number] + 5.0 * number for number in range(2)]
    shares = np.repeat(np.eye(2), 5000, axis=0)
    mixture = full_clusters(np.concatenate(parts), shares, np.zeros(6))
    np.testing.assert_allclose(mixture.weights, 0.5)
    for number, part in enumerate(parts):
        np.testing.assert_allclose(mixture.means[number], part.mean(axis=0))
        wanted = np.cov(part.T, bias=True)
        assert np.abs(mixture.covariances[number] - wanted).max() < 0.01 * np.abs(wanted).max()


def test_a_cluster_with_fewer_frames_than_features_has_a_covariance_of_full_rank() -> None:
    rng = np.random.default_rng(2)
    features = rng.standard_normal((304, 6))
    shares = np.zeros((304, 2))
    shares[:300, 0], shares[300:, 1] = 1.0, 1.0
    small = full_clusters(features, shares, np.full(6, 1e-9)).covariances[1]
    assert np.linalg.eigvalsh(small).min() > 0.1
    own = np.cov(features[300:].T, bias=True)
    pooled = (300 * np.cov(features[:300].T, bias=True) + 4 * own) / 304
    np.testing.assert_allclose(small, (4 * own + 6 * pooled) / 10, atol=1e-6)


def test_the_largest_entry_of_every_component_is_positive(features: np.ndarray) -> None:
    for count in (1, 2, 5):
        rows = fit_reduction(features, count).loadings
        assert rows.shape == (count, 6)
        assert (rows[np.arange(count), np.abs(rows).argmax(axis=1)] > 0.0).all()
        np.testing.assert_allclose(rows @ rows.T, np.eye(count), atol=1e-12)


@pytest.mark.parametrize("count", [0, 6, 7])
def test_as_many_components_as_features_turn_nothing(features: np.ndarray, count: int) -> None:
    reduction = fit_reduction(features, count)
    np.testing.assert_array_equal(reduction.loadings, np.eye(6))
    np.testing.assert_allclose(reduction.reduced(features).mean(axis=0), 0.0, atol=1e-12)


def test_frames_count_by_their_shares_in_a_cluster() -> None:
    rng = np.random.default_rng(3)
    features, floor = rng.standard_normal((40, 2)), np.array([0.2, 0.3])
    shares = rng.dirichlet([1.0, 2.0, 3.0], size=40)
    mixture = full_clusters(features, shares, floor)
    spreads = []
    for number in range(3):
        mean = np.average(features, axis=0, weights=shares[:, number])
        np.testing.assert_allclose(mixture.means[number], mean)
        away = features - mean
        spreads.append(np.einsum("n,ni,nj->ij", shares[:, number], away, away))
    strength = shares.sum(axis=0)
    np.testing.assert_allclose(mixture.weights, strength / 40)
    for number in range(3):
        # Two frames of the clusters' common covariance are added, as there are two features.
        wanted = (spreads[number] + 2 * sum(spreads) / 40) / (strength[number] + 2) + np.diag(floor)
        np.testing.assert_allclose(mixture.covariances[number], wanted)
