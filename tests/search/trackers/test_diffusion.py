"""Noise has the covariance that Eq. 13 and 18 give it; shrinking keeps the variance."""

import numpy as np
import pytest
from scipy import stats

from studio.search.trackers.diffusion import noise_about, planned_sigma, proportional_noise, shrunk_noise
from studio.search.trackers.particle_kernels import moments
from studio.search.trackers.random_numbers import RandomNumbers

COUNT = 40000
# Standard error of a variance of n normal numbers, relative: √(2/n); four of them.
RELATIVE = 4 * np.sqrt(2 / COUNT)
COVARIANCE = np.array([[400.0, 0.9 * 20 * 0.01, 0.0], [0.9 * 20 * 0.01, 1e-4, 0.0], [0.0, 0.0, 4.0]])


def sample(seed: int = 0) -> np.ndarray:
    """(COUNT, 3) millimetres beside radians, strongly correlated, whitened so that COVARIANCE holds
    exactly.
    """
    normal = np.random.default_rng(seed).standard_normal((COUNT, 3))
    normal -= normal.mean(axis=0)
    normal = normal @ np.linalg.inv(np.linalg.cholesky(np.cov(normal.T, bias=True))).T
    return normal @ np.linalg.cholesky(COVARIANCE).T + np.array([1000.0, 0.5, -3.0])


def correlation(poses: np.ndarray) -> float:
    """Between the first two parameters."""
    return float(np.corrcoef(poses[:, 0], poses[:, 1])[0, 1])


def test_plan_of_equation_13() -> None:
    sigma = np.array([10.0, 0.1])
    assert np.allclose(planned_sigma(sigma, (0.5, 0.5, 0.25, 0.09), "variance"), sigma * 0.25)
    assert np.allclose(planned_sigma(sigma, (0.5, 0.5, 0.25, 0.09), "deviation"), sigma * 0.0625)
    # As the product is printed, α_M … α_{m-1}: the next layer's rate counts, too.
    assert np.allclose(planned_sigma(sigma, (0.5, 0.5, 0.25, 0.09), "printed"), sigma * 0.075)


def test_plain_noise_is_gaussian_of_sigma() -> None:
    sigma = np.array([10.0, 0.1, 0.0])
    noise = noise_about(np.ones((COUNT, 3)), sigma).draw(RandomNumbers(1, 0, 0)) - 1.0
    for column, width in ((0, 10.0), (1, 0.1)):
        assert stats.kstest(noise[:, column] / width, "norm").pvalue > 1e-3
    assert np.all(noise[:, 2] == 0.0)
    assert abs(correlation(noise)) < 4 / np.sqrt(COUNT)


@pytest.mark.parametrize("fraction", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_shrinking_keeps_mean_and_variance(fraction: float, covariance: str) -> None:
    poses = sample()
    spread = shrunk_noise(poses, moments(poses), fraction, covariance).draw(RandomNumbers(2, 0, 0))
    assert np.allclose(spread.var(axis=0), poses.var(axis=0), rtol=2 * RELATIVE)
    standard_error = np.sqrt(np.diag(COVARIANCE) / COUNT)
    assert np.all(np.abs(spread.mean(axis=0) - poses.mean(axis=0)) < 4 * standard_error)
    kept = 0.9 if covariance == "full" else 0.9 * (1 - fraction**2)
    assert correlation(spread) == pytest.approx(kept, abs=4 / np.sqrt(COUNT))


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_the_papers_form_adds_variance(covariance: str) -> None:
    poses = sample()
    spread = proportional_noise(poses, moments(poses), 0.25, covariance).draw(RandomNumbers(3, 0, 0))
    assert np.allclose(spread.var(axis=0), 1.25 * poses.var(axis=0), rtol=2 * RELATIVE)
    kept = 0.9 if covariance == "full" else 0.9 / 1.25
    assert correlation(spread) == pytest.approx(kept, abs=4 / np.sqrt(COUNT))


def test_without_selection_only_the_papers_form_grows() -> None:
    start = np.random.default_rng(4).standard_normal((2000, 5))
    shrunk = added = start
    for layer in range(10):
        numbers = RandomNumbers(5, 0, layer)
        shrunk = shrunk_noise(shrunk, moments(shrunk), 0.4, "diagonal").draw(numbers)
        added = proportional_noise(added, moments(added), 0.16, "diagonal").draw(numbers)
    assert np.allclose(shrunk.var(axis=0), start.var(axis=0), rtol=0.3)
    assert np.all(added.var(axis=0) > 3.0 * start.var(axis=0))


def test_fewer_particles_than_parameters_stay_in_their_plane() -> None:
    poses = np.random.default_rng(6).standard_normal((3, 8)) * np.array([1000.0, 1, 1, 1, 0.01, 1, 1, 1])
    spread = shrunk_noise(poses, moments(poses), 0.4, "full").draw(RandomNumbers(7, 0, 0))
    centred, moved = poses - poses.mean(axis=0), spread - poses.mean(axis=0)
    residual = moved - moved @ np.linalg.pinv(centred) @ centred
    assert np.abs(residual / poses.std(axis=0)).max() < 1e-6


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_a_point_stays_a_point(covariance: str) -> None:
    one = np.full((4, 3), 2.5)
    assert np.allclose(shrunk_noise(one, moments(one), 0.4, covariance).draw(RandomNumbers(0, 0, 0)), one)
    assert np.allclose(
        proportional_noise(one, moments(one), 0.4, covariance).draw(RandomNumbers(0, 0, 0)), one
    )


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_some_rows_may_be_drawn_again(covariance: str) -> None:
    poses = sample()[:200]
    spread = shrunk_noise(poses, moments(poses), 0.4, covariance)
    # Of a particle that is drawn again, every run's numbers are others.
    drawn = np.concatenate(
        [
            spread.draw_again(RandomNumbers(seed, 0, 0), np.repeat(row, 1), 1)
            for row in (7, 3)
            for seed in range(20000)
        ]
    )
    assert np.allclose(drawn[:20000].mean(axis=0), spread.centres[7], atol=4 * 0.4 * poses.std(axis=0) / 141)
    assert np.allclose(drawn[20000:].std(axis=0), 0.4 * poses.std(axis=0), rtol=0.03)
