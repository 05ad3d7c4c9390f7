"""β is the root of D(β) = α N: closed forms, invariances, and sets that are hard for the search."""

import numpy as np
import pytest
from scipy.special import log_softmax, logsumexp

from studio.search.trackers.annealing import anneal, normalised, survival_rate


@pytest.mark.parametrize("wanted", [0.15, 0.3, 0.5, 0.8, 0.95])
def test_two_levels_have_a_closed_form(wanted: float) -> None:
    # n at log w = 0, m at -1, q = exp(-β): (n + m q)² = α N (n + m q²), a quadratic in q.
    n, m = 10, 90
    total = n + m
    roots = np.roots([m * m - wanted * total * m, 2 * n * m, n * n - wanted * total * n])
    q = float(roots[(roots > 0) & (roots < 1)][0])
    found = anneal(np.concatenate([np.zeros(n), -np.ones(m)]), wanted)
    assert found.beta == pytest.approx(-np.log(q), rel=1e-8)
    assert found.survival == pytest.approx(wanted, rel=1e-9)


def test_gaussian_cloud_has_a_closed_form() -> None:
    # Standard normal x, log w = -x²/2: α = E[w^β]² / E[w^2β] = √(1 + 2β) / (1 + β), here by fine quadrature.
    x = np.linspace(-9, 9, 20001)
    cloud = np.exp(-0.5 * x * x)
    log_weights = -0.5 * x * x
    beta = 3.0
    wanted = np.sqrt(1 + 2 * beta) / (1 + beta)
    rate = (np.sum(cloud * np.exp(beta * log_weights)) ** 2) / (
        np.sum(cloud * np.exp(2 * beta * log_weights)) * np.sum(cloud)
    )
    assert rate == pytest.approx(wanted, rel=1e-6)
    drawn = np.random.default_rng(0).standard_normal(200000)
    assert anneal(-0.5 * drawn**2, wanted).beta == pytest.approx(beta, rel=0.03)


def test_normalised_weights_equal_a_softmax() -> None:
    log_weights = np.random.default_rng(2).normal(size=50) * 30 - 500
    assert np.allclose(normalised(log_weights, 0.7), log_softmax(0.7 * log_weights), atol=1e-12)
    rate = survival_rate(normalised(log_weights, 0.7))
    expected = np.exp(2 * logsumexp(0.7 * log_weights) - logsumexp(1.4 * log_weights)) / 50
    assert rate == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_scale_and_offset_do_not_matter(seed: int) -> None:
    log_weights = np.random.default_rng(seed).normal(size=200)
    plain = anneal(log_weights, 0.4)
    for factor in (1e-6, 1e-3, 1e3, 1e6):
        scaled = anneal(factor * log_weights, 0.4)
        assert scaled.beta * factor == pytest.approx(plain.beta, rel=1e-6)
    assert anneal(log_weights - 1e4, 0.4).beta == pytest.approx(plain.beta, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-250, 1e-12, 1.0, 1e12, 1e250])
@pytest.mark.parametrize("wanted", [0.05, 0.5, 0.97])
def test_rate_is_met_over_huge_ranges(scale: float, wanted: float) -> None:
    rng = np.random.default_rng(8)
    for shape in (rng.normal(size=100), rng.standard_cauchy(size=100), -(rng.random(100) ** 20)):
        found = anneal(shape * scale, wanted)
        assert found.survival == pytest.approx(wanted, rel=1e-5)
        assert np.exp(found.log_weights).sum() == pytest.approx(1.0)


def test_equal_weights_all_survive() -> None:
    found = anneal(np.full(40, -3.2), 0.5)
    assert found.survival == pytest.approx(1.0)
    assert np.allclose(np.exp(found.log_weights), 1 / 40)
    assert np.isfinite(found.beta)


def test_one_particle_survives() -> None:
    found = anneal(np.array([-7.0]), 0.5)
    assert found.survival == 1.0
    assert found.log_weights == pytest.approx([0.0])


def test_more_best_ones_than_may_survive() -> None:
    log_weights = np.concatenate([np.zeros(60), -np.random.default_rng(1).random(40) - 0.5])
    found = anneal(log_weights, 0.5)
    assert found.survival == pytest.approx(0.6, abs=1e-6)
    assert np.isfinite(found.beta)


def test_fewer_than_one_survivor_wanted() -> None:
    found = anneal(np.array([0.0, -1.0, -2.0]), 0.1)
    assert found.survival == pytest.approx(1 / 3, rel=1e-9)
    assert np.exp(found.log_weights[0]) == pytest.approx(1.0)


def test_particles_that_cannot_survive_have_no_weight_but_count() -> None:
    log_weights = np.random.default_rng(3).normal(size=100)
    barred = log_weights.copy()
    barred[::2] = -np.inf
    found = anneal(barred, 0.3)
    assert np.all(np.exp(found.log_weights[::2]) == 0.0)
    assert found.survival == pytest.approx(0.3, rel=1e-9)
    # 30 of 100 effective particles are 60 % of the 50 that may survive.
    assert found.beta == pytest.approx(anneal(log_weights[1::2], 0.6).beta, rel=1e-9)


def test_higher_rates_need_smaller_exponents() -> None:
    log_weights = np.random.default_rng(4).normal(size=300)
    betas = [anneal(log_weights, wanted).beta for wanted in np.linspace(0.05, 0.95, 19)]
    assert np.all(np.diff(betas) < 0)
