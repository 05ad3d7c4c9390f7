"""Noise has the covariance that Eq. 13 and 18 give it; shrinking keeps what was gained; limits hold."""

import numpy as np
import pytest
from scipy import stats

from studio.tracking.diffusion import (
    diffuse,
    diffuse_proportionally,
    diffuse_shrunk,
    planned_sigma,
    within_limits,
)
from studio.tracking.tracker import SearchSpace

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
    assert np.allclose(planned_sigma(sigma, (0.5, 0.5, 0.25), "variance"), sigma * 0.25)
    assert np.allclose(planned_sigma(sigma, (0.5, 0.5, 0.25), "deviation"), sigma * 0.0625)


def test_plain_noise_is_gaussian_of_sigma() -> None:
    sigma = np.array([10.0, 0.1, 0.0])
    noise = diffuse(np.random.default_rng(1), np.ones((COUNT, 3)), sigma) - 1.0
    for column, width in ((0, 10.0), (1, 0.1)):
        assert stats.kstest(noise[:, column] / width, "norm").pvalue > 1e-3
    assert np.all(noise[:, 2] == 0.0)
    assert abs(correlation(noise)) < 4 / np.sqrt(COUNT)


@pytest.mark.parametrize("fraction", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_shrinking_keeps_mean_and_variance(fraction: float, covariance: str) -> None:
    poses = sample()
    spread = diffuse_shrunk(np.random.default_rng(2), poses, fraction, covariance)
    assert np.allclose(spread.var(axis=0), poses.var(axis=0), rtol=2 * RELATIVE)
    standard_error = np.sqrt(np.diag(COVARIANCE) / COUNT)
    assert np.all(np.abs(spread.mean(axis=0) - poses.mean(axis=0)) < 4 * standard_error)
    kept = 0.9 if covariance == "full" else 0.9 * (1 - fraction**2)
    assert correlation(spread) == pytest.approx(kept, abs=4 / np.sqrt(COUNT))


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_the_papers_form_adds_variance(covariance: str) -> None:
    poses = sample()
    spread = diffuse_proportionally(np.random.default_rng(3), poses, 0.25, covariance)
    assert np.allclose(spread.var(axis=0), 1.25 * poses.var(axis=0), rtol=2 * RELATIVE)
    kept = 0.9 if covariance == "full" else 0.9 / 1.25
    assert correlation(spread) == pytest.approx(kept, abs=4 / np.sqrt(COUNT))


def test_without_selection_only_the_papers_form_grows() -> None:
    start = np.random.default_rng(4).standard_normal((2000, 5))
    shrunk = added = start
    rng = np.random.default_rng(5)
    for _ in range(10):
        shrunk = diffuse_shrunk(rng, shrunk, 0.4, "diagonal")
        added = diffuse_proportionally(rng, added, 0.16, "diagonal")
    assert np.allclose(shrunk.var(axis=0), start.var(axis=0), rtol=0.3)
    assert np.all(added.var(axis=0) > 3.0 * start.var(axis=0))


def test_fewer_particles_than_parameters_stay_in_their_plane() -> None:
    poses = np.random.default_rng(6).standard_normal((3, 8)) * np.array([1000.0, 1, 1, 1, 0.01, 1, 1, 1])
    spread = diffuse_shrunk(np.random.default_rng(7), poses, 0.4, "full")
    centred, moved = poses - poses.mean(axis=0), spread - poses.mean(axis=0)
    residual = moved - moved @ np.linalg.pinv(centred) @ centred
    assert np.abs(residual / poses.std(axis=0)).max() < 1e-6


@pytest.mark.parametrize("covariance", ["diagonal", "full"])
def test_a_point_stays_a_point(covariance: str) -> None:
    one = np.full((4, 3), 2.5)
    assert np.allclose(diffuse_shrunk(np.random.default_rng(0), one, 0.4, covariance), one)
    assert np.allclose(diffuse_proportionally(np.random.default_rng(0), one, 0.4, covariance), one)


def test_limits() -> None:
    space = SearchSpace(
        ("a", "b"),
        np.array([-1.0, -np.inf]),
        np.array([1.0, np.inf]),
        np.ones(2),
        np.zeros(2, dtype=np.int64),
    )
    poses = np.array([[-1.25, 1e9], [0.5, -1e9], [1.5, 0.0], [9.0, 0.0]])
    assert np.array_equal(within_limits(poses, space, "clamp")[:, 0], [-1.0, 0.5, 1.0, 1.0])
    assert np.array_equal(within_limits(poses, space, "reflect")[:, 0], [-0.75, 0.5, 0.5, -1.0])
    for limits in ("clamp", "reflect", "ignore"):
        assert np.array_equal(within_limits(poses, space, limits)[:, 1], poses[:, 1])
    assert np.array_equal(within_limits(poses, space, "ignore"), poses)
