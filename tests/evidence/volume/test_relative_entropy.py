"""Relative entropy: against integrals, a Monte-Carlo estimate and a plain twin of the kernel."""

import math

import numpy as np
import pytest
from divergences import gaussian_divergence, kept_divergence
from posed_hulls import near
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from studio.body.catalogue import load_body
from studio.evidence.volume.blob_model import BlobMixture, cone_blobs
from studio.evidence.volume.relative_entropy import DivergenceOfPoses

Array = np.ndarray


def random_covariances(rng: np.random.Generator, count: int, size: int = 3) -> Array:
    root = rng.normal(size=(count, size, size))
    return root @ root.transpose(0, 2, 1) + 0.3 * np.eye(size)


def mixture(means: Array, covariances: Array, weights: Array) -> BlobMixture:
    unknown = np.full((len(means), 3), np.nan)
    return BlobMixture(means, covariances, unknown, unknown, weights)


def printed(mean_f: Array, covariance_f: Array, mean_g: Array, covariance_g: Array) -> float:
    """Eq. 10 as printed."""
    inverse = np.linalg.inv(covariance_f)
    apart = mean_g - mean_f
    logs = math.log(np.linalg.det(covariance_f) / np.linalg.det(covariance_g))
    return 0.5 * (logs - len(mean_f) + np.trace(inverse @ covariance_g) + apart @ inverse @ apart)


@pytest.mark.parametrize(("mean_f", "sd_f", "mean_g", "sd_g"), [(0, 1, 1, 2), (3, 2, -1, 0.7), (5, 1, 5, 1)])
def test_one_dimension_is_the_integral(mean_f: float, sd_f: float, mean_g: float, sd_g: float) -> None:
    f, g = norm(mean_f, sd_f), norm(mean_g, sd_g)
    wanted = quad(lambda x: f.pdf(x) * (f.logpdf(x) - g.logpdf(x)), mean_f - 12 * sd_f, mean_f + 12 * sd_f)[0]
    found = gaussian_divergence(
        np.array([mean_f]), np.array([[sd_f**2]]), np.array([mean_g]), np.array([[sd_g**2]])
    )
    assert float(found) == pytest.approx(wanted, abs=1e-9)


def test_one_dimension_by_hand() -> None:
    found = gaussian_divergence(np.array([0.0]), np.array([[1.0]]), np.array([1.0]), np.array([[4.0]]))
    assert float(found) == pytest.approx(math.log(2.0) + 2.0 / 8.0 - 0.5)


@pytest.mark.parametrize("seed", range(4))
def test_kl_equals_a_monte_carlo_estimate_and_eq_10_as_printed_is_the_other_way_round(seed: int) -> None:
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(2, 3))
    covariances = random_covariances(rng, 2)
    f, g = (multivariate_normal(means[k], covariances[k]) for k in (0, 1))
    draws = f.rvs(400_000, random_state=rng)
    logs = f.logpdf(draws) - g.logpdf(draws)
    estimate, error = logs.mean(), logs.std() / math.sqrt(len(logs))
    arguments = means[0], covariances[0], means[1], covariances[1]
    assert float(gaussian_divergence(*arguments)) == pytest.approx(estimate, abs=5 * error)
    assert abs(printed(*arguments) - estimate) > 20 * error
    turned = gaussian_divergence(means[1], covariances[1], means[0], covariances[0])
    assert printed(*arguments) == pytest.approx(float(turned))


def test_of_mixtures_that_do_not_overlap_eq_9_is_the_true_divergence() -> None:
    rng = np.random.default_rng(7)
    places = 60.0 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    alpha, beta = rng.dirichlet(np.full(4, 5.0)), rng.dirichlet(np.full(4, 5.0))
    model = mixture(places, random_covariances(rng, 4), alpha)
    image = mixture(places + rng.normal(size=(4, 3)), random_covariances(rng, 4), beta)
    rows = rng.choice(4, 300_000, p=alpha)
    roots = np.linalg.cholesky(model.covariances)
    draws = model.means[rows] + np.einsum("nij,nj->ni", roots[rows], rng.normal(size=(len(rows), 3)))

    def log_density(of: BlobMixture) -> Array:
        parts = [
            np.log(w) + multivariate_normal(m, c).logpdf(draws)
            for m, c, w in zip(of.means, of.covariances, of.weights, strict=True)
        ]
        return np.logaddexp.reduce(parts, axis=0)

    logs = log_density(model) - log_density(image)
    error = logs.std() / math.sqrt(len(logs))
    assert kept_divergence(model, image) == pytest.approx(logs.mean(), abs=5 * error)


@pytest.mark.parametrize("name", ["human25", "human31", "dog", "planar_arm4"])
def test_the_kernel_is_eq_9_of_the_poses_mixtures(name: str) -> None:
    body = load_body(name)
    rng = np.random.default_rng(9)
    poses = np.stack([near(body, body.neutral, seed) for seed in range(6)])
    model = cone_blobs(body)
    count = len(model.limb)
    image = mixture(
        model.mixture(body, body.neutral).means[0] + 20 * rng.normal(size=(count, 3)),
        900 * random_covariances(rng, count),
        rng.dirichlet(np.full(count, 3.0)),
    )
    of_poses = model.mixture(body, poses)
    wanted = [kept_divergence(of_poses.at(n), image) for n in range(len(poses))]
    np.testing.assert_allclose(DivergenceOfPoses.against(body, model, image)(poses), wanted, rtol=1e-9)
    assert min(wanted) > 0.0


def test_some_blobs_alone_are_a_mixture_of_their_own() -> None:
    body = load_body("human25")
    model = cone_blobs(body)
    own = model.mixture(body, body.neutral).at(0)
    chosen = np.array([0, 3, 4])
    only = DivergenceOfPoses.against(body, model, own, chosen)
    assert only(body.neutral[None])[0] == pytest.approx(0.0, abs=1e-9)
    head = [entry.name for entry in body.parameters].index("head_turn")
    leg = [entry.name for entry in body.parameters].index("left_knee")
    bent = body.neutral.copy()
    bent[leg] += 1.0
    assert only(bent[None])[0] == pytest.approx(0.0, abs=1e-9)
    assert DivergenceOfPoses.against(body, model, own)(bent[None])[0] > 0.1
    turned = body.neutral.copy()
    turned[head] += 1.0
    assert only(turned[None])[0] == pytest.approx(0.0, abs=1e-9)
