"""Tempered sequential Monte Carlo against posteriors that are known in closed form or by quadrature."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm
from toy_problems import Bowl, toy_space

from studio.search.trackers.catalogue import TRACKERS, knobs_for_evaluations
from studio.search.trackers.frame_loop import search_frame
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import TemperedSettings
from studio.search.trackers.tracker import FilterState, FrameResult, LayerRecord, ParticleSet, SearchSpace
from studio.sessions.results_codec import pack_layer, unpack_layer

TRACKER = TRACKERS["tempered"]


class Likelihood(Bowl):
    """log w as a function."""

    def __init__(self, log_weight: Callable[[np.ndarray], np.ndarray]) -> None:
        super().__init__(np.zeros(1))
        self.log_weight = log_weight

    def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
        return self.log_weight(poses)


def free_space(count: int, sigma: float = 0.5) -> SearchSpace:
    """Without limits."""
    unlimited = np.full(count, np.inf)
    return dataclasses.replace(toy_space(count, sigma=sigma), lower=-unlimited, upper=unlimited)


def searched(
    problem: Bowl, space: SearchSpace, last: ParticleSet | None, seed: int, **knobs: object
) -> tuple[FrameResult, list[LayerRecord]]:
    """One frame."""
    settings = TemperedSettings(**{"likelihood_scale": 1.0, "diffusion_scale": 1.0, **knobs})
    records: list[LayerRecord] = []
    result = search_frame(
        TRACKER,
        problem,
        FilterState(last),
        space,
        seed=seed,
        frame=0,
        settings_source=lambda: (1, settings),
        on_layer=records.append,
    )
    return result, records


def at(pose: np.ndarray) -> ParticleSet:
    """One particle."""
    return ParticleSet(pose[None], np.zeros(1))


KINDS = {
    "all": {},
    "steps": {"crossover": 0.0, "limb_moves": 0.0},
    "walks": {"crossover": 0.0, "limb_moves": 1.0},
    "exchanges and steps": {"crossover": 0.6, "limb_moves": 0.0},
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_normal_posterior_has_its_mean_covariance_and_evidence(kind: str) -> None:
    count, sigma = 4, 0.5
    rng = np.random.default_rng(3)
    square = rng.normal(size=(count, count))
    precision, centre = 20.0 * (square @ square.T / count + 0.1 * np.eye(count)), rng.normal(size=count) * 0.3
    bowl = Likelihood(
        lambda poses: -0.5 * np.einsum("ni,ij,nj->n", poses - centre, precision, poses - centre)
    )
    covariance = np.linalg.inv(precision + np.eye(count) / sigma**2)
    mean = covariance @ precision @ centre
    beyond = centre @ precision @ centre - mean @ np.linalg.solve(covariance, mean)
    log_evidence = 0.5 * np.linalg.slogdet(covariance)[1] - count * np.log(sigma) - 0.5 * beyond
    clouds, evidences = [], []
    for seed in range(4):
        start = at(np.zeros(count))
        result, records = searched(
            bowl, free_space(count), start, seed, layers=60, particles=600, **KINDS[kind]
        )
        assert result.carried.particles is not None
        clouds.append(result.carried.particles.poses)
        evidences.append(records[-1].log_evidence)
    poses = np.concatenate(clouds)
    assert np.allclose(poses.mean(axis=0), mean, atol=0.15 * np.sqrt(np.diag(covariance)).min())
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    assert np.allclose(root @ np.cov(poses.T) @ root.T, np.eye(count), atol=0.17)
    assert np.mean(evidences) == pytest.approx(log_evidence, abs=0.15)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_limits_several_last_particles_and_the_scale_count(scale: float) -> None:
    """One parameter, by quadrature: two particles of unequal weight, one at a limit, and a likelihood of two maxima."""
    space = dataclasses.replace(
        toy_space(1, sigma=0.4), lower=np.array([-0.5]), upper=np.array([1.5]), limb=np.zeros(1, np.int64)
    )
    last = ParticleSet(np.array([[-0.5], [0.9]]), np.log([0.3, 0.7]))
    x = np.linspace(-0.5, 1.5, 20001)[:, None]

    def log_weight(poses: np.ndarray) -> np.ndarray:
        return np.logaddexp(-(((poses[:, 0] + 0.2) / 0.1) ** 2), -(((poses[:, 0] - 1.3) / 0.2) ** 2))

    prior = np.zeros(len(x))
    for weight, middle in ((0.3, -0.5), (0.7, 0.9)):
        prior += weight * truncnorm((-0.5 - middle) / 0.4, (1.5 - middle) / 0.4, middle, 0.4).pdf(x[:, 0])
    density = prior * np.exp(scale * log_weight(x))
    evidence = np.trapezoid(density, x[:, 0])
    shares = np.cumsum(density) / density.sum()
    clouds, evidences = [], []
    for seed in range(5):
        result, records = searched(
            Likelihood(log_weight), space, last, seed, layers=40, particles=400, likelihood_scale=scale
        )
        assert result.carried.particles is not None
        clouds.append(np.interp(result.carried.particles.poses[:, 0], x[:, 0], shares))
        evidences.append(records[-1].log_evidence)
    # A set's members share ancestors, so that a test for independent ones is only half as strict.
    assert kstest(np.concatenate(clouds), "uniform").statistic < 0.05
    assert np.mean(evidences) == pytest.approx(np.log(evidence), abs=0.04)


def test_the_prior_is_a_density_and_draws_from_itself() -> None:
    space = dataclasses.replace(
        toy_space(2, sigma=0.3),
        sigma=np.array([0.3, 0.0]),
        lower=np.array([0.0, -1.0]),
        upper=np.array([0.5, 1.0]),
    )
    last = ParticleSet(np.array([[0.1, 0.2], [0.5, -0.4]]), np.log([0.25, 0.75]))
    prior = FramePrior.of_frame(FilterState(last), space, scale=1.0, dynamics="none", bounded=True)
    drawn = prior.draw(RandomNumbers(1, 0, 0), 4000)
    assert set(drawn[:, 1]) == {0.2, -0.4}
    x = np.linspace(0.0, 0.5, 2001)
    density = np.exp(prior.log_density(np.stack([x, np.zeros(len(x))], axis=1)))
    shares = np.cumsum(density) / density.sum()
    assert kstest(np.interp(drawn[:, 0], x, shares), "uniform").pvalue > 0.01
    own = sum(
        weight * norm(middle, 0.3).pdf(x) / (norm(middle, 0.3).cdf(0.5) - norm(middle, 0.3).cdf(0.0))
        for weight, middle in ((0.25, 0.1), (0.75, 0.5))
    )
    assert np.allclose(density / density[0], own / own[0])
    assert np.isneginf(prior.log_density(np.array([[0.51, 0.0], [0.2, -1.1]]))).all()


def test_a_uniform_prior_between_the_limits() -> None:
    space = toy_space(2, limit=2.0)
    result, records = searched(
        Likelihood(lambda poses: -0.5 * np.sum((poses / 0.3) ** 2, axis=1)),
        space,
        None,
        0,
        layers=40,
        particles=500,
    )
    assert records[0].poses.std() == pytest.approx(4.0 / np.sqrt(12.0), rel=0.1)
    assert result.carried.particles is not None
    assert result.carried.particles.poses.std(axis=0) == pytest.approx(0.3, rel=0.15)
    assert records[-1].log_evidence == pytest.approx(np.log(2.0 * np.pi * 0.09 / 16.0), abs=0.2)


def test_the_record_says_ladder_acceptance_and_evidence_and_is_kept() -> None:
    _, records = searched(
        Bowl(np.zeros(6), 0.2), free_space(6), at(np.full(6, 0.4)), 0, layers=30, particles=100
    )
    tempers = [record.temper for record in records]
    assert (tempers[0], tempers[-1]) == (0.0, 1.0)
    assert np.all(np.diff(tempers) >= 0.0)
    assert np.allclose(np.diff(tempers), [record.beta for record in records[:-1]])
    rising = [record for record in records[:-1] if record.temper + record.beta < 1.0]
    assert [record.alpha_reached for record in rising] == pytest.approx([0.5] * len(rising))
    assert np.isnan(records[0].acceptance)
    assert all(0.0 < record.acceptance < 1.0 for record in records[1:])
    assert len({record.log_evidence for record in records if record.temper == 1.0}) == 1
    again = unpack_layer(pack_layer(records[5]))
    for name in ("temper", "acceptance", "log_evidence"):
        assert getattr(again, name) == getattr(records[5], name)


def test_a_ladder_that_is_too_short_ends_with_weights() -> None:
    _, records = searched(
        Bowl(np.zeros(6), 0.02), free_space(6), at(np.full(6, 0.4)), 0, layers=4, particles=200
    )
    last = records[-1]
    assert last.temper + last.beta == pytest.approx(1.0)
    assert last.beta > 0.0
    assert last.alpha_reached < 0.5


def test_only_poses_that_the_body_can_take_are_in_the_sample() -> None:
    class Half(Bowl):
        def feasible(self, poses: np.ndarray, limbs_apart: bool = False) -> np.ndarray:
            return poses[:, 0] + poses[:, 1] <= 0.0

    result, _ = searched(
        Half(np.full(4, 0.3), 0.3), free_space(4), at(np.zeros(4)), 0, layers=12, particles=150
    )
    assert result.carried.particles is not None
    poses = result.carried.particles.poses
    assert np.all(poses[:, 0] + poses[:, 1] <= 0.0)


def test_evaluations_are_parted_into_layers_and_particles() -> None:
    assert knobs_for_evaluations("tempered", 5000) == {"layers": 16, "particles": 312}
