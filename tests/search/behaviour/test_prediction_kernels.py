"""The kernels of prediction against SciPy's densities and sums written out."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.prediction_kernels import choose_arcs, rooted_noise, squared_distance

FIRST, SYMBOLS = np.array([0, 4, 5, 8]), np.array([2, 0, 4, 1, 3, 1, 4, 3])
PROBABILITIES = np.array([0.4, 0.3, 0.2, 0.1, 1.0, 0.5, 0.25, 0.25])


@pytest.fixture(scope="module")
def mixture() -> GaussianMixture:
    """Five wide clusters in three dimensions, near each other."""
    rng = np.random.default_rng(5)
    factors = rng.standard_normal((5, 3, 3))
    covariances = factors @ factors.transpose(0, 2, 1) + np.eye(3)
    return GaussianMixture(np.full(5, 0.2), rng.standard_normal((5, 3)), covariances)


@pytest.mark.parametrize("state", range(3))
@pytest.mark.parametrize("free", [False, True])
def test_luck_spread_evenly_takes_each_transition_by_its_share(
    mixture: GaussianMixture, state: int, free: bool
) -> None:
    point, luck = np.array([0.3, -0.4, 0.8]), (np.arange(400) + 0.5) / 400
    own = slice(FIRST[state], FIRST[state + 1])
    weights = PROBABILITIES[own].copy()
    if not free:
        for place, label in enumerate(SYMBOLS[own]):
            weights[place] *= multivariate_normal(mixture.means[label], mixture.covariances[label]).pdf(point)
    wanted = SYMBOLS[own][np.searchsorted(np.cumsum(weights / weights.sum()), luck)]
    chosen = choose_arcs(
        np.repeat(point[None], 400, axis=0), np.full(400, state), luck, np.full(400, free),
        FIRST, SYMBOLS, np.log(PROBABILITIES),
        mixture.means, mixture.whiteners, mixture.log_scales,
    )  # fmt: skip
    np.testing.assert_array_equal(chosen, wanted)


def test_the_most_luck_there_is_takes_a_transition_of_the_own_state() -> None:
    # What is left after all weights but the last may be that weight, or above it, by rounding.
    rng = np.random.default_rng(0)
    parts = [rng.dirichlet(np.ones(2 + state % 5)) for state in range(500)]
    owner = np.repeat(np.arange(500), [len(part) for part in parts])
    first = np.searchsorted(owner, np.arange(501))
    none = np.zeros((1, 1))
    chosen = choose_arcs(
        np.zeros((500, 1)), np.arange(500), np.full(500, np.nextafter(1.0, 0.0)), np.ones(500, dtype=bool),
        first, np.arange(len(owner)), np.log(np.concatenate(parts)), none, none[None], none[0],
    )  # fmt: skip
    np.testing.assert_array_equal(chosen, first[1:] - 1)


def test_distances_and_noise_are_those_of_matrices(mixture: GaussianMixture) -> None:
    rng = np.random.default_rng(1)
    point = rng.standard_normal(3)
    for mean, covariance, whitener in zip(mixture.means, mixture.covariances, mixture.whiteners, strict=True):
        wanted = (point - mean) @ np.linalg.inv(covariance) @ (point - mean)
        assert squared_distance(point, mean, whitener) == pytest.approx(wanted)
    roots, normals, labels = (
        rng.standard_normal((5, 3, 3)),
        rng.standard_normal((4, 3)),
        np.array([4, 0, 0, 2]),
    )
    wanted = [roots[label] @ normal for label, normal in zip(labels, normals, strict=True)]
    np.testing.assert_allclose(rooted_noise(roots, labels, normals), wanted)
