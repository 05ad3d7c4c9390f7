"""The filter's steps against closed forms: start set, narrowing of the cloud, reported pose."""

import dataclasses

import numpy as np
import pytest
from scipy import stats
from toy_problems import Bowl, HalfBowl, toy_space

from studio.foundations.errors import RunError
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import FilterState, ParticleSet, SearchSpace

FILTER = AnnealedParticleFilter()
SPACE = toy_space(6)
STILL = dataclasses.replace(SPACE, sigma=np.zeros(6))


def carried_set(count: int = 40) -> ParticleSet:
    """A weighted set whose particle 3 is by far the best."""
    rng = np.random.default_rng(0)
    log_weights = np.log(rng.random(count))
    log_weights[3] = 2.0
    return ParticleSet(
        rng.normal(size=(count, 6)), log_weights - np.log(np.exp(log_weights).sum()), log_weights
    )


def begun(space: SearchSpace, previous: FilterState, **changes: object) -> np.ndarray:
    """The poses with which a frame begins."""
    settings = AnnealedSettings(**({"particles": 40} | changes))  # pyright: ignore[reportArgumentType]
    return FILTER.begin_frame(RandomNumbers.of_beginning(1, 1), previous, space, settings).poses


def test_equation_9_carries_every_particle_once() -> None:
    last = carried_set()
    assert np.array_equal(begun(STILL, FilterState(last)), last.poses)
    moved = begun(SPACE, FilterState(last), diffusion_scale=2.0) - last.poses
    assert stats.kstest(moved.ravel() / 0.6, "norm").pvalue > 1e-3


def test_resampled_and_mode_are_carried_by_weight() -> None:
    last = carried_set()
    many = begun(STILL, FilterState(last), carry="resampled", particles=4000)
    third = np.all(many == last.poses[3], axis=1).sum()
    assert abs(third - 4000 * np.exp(last.log_weights[3])) <= 1
    assert np.all(begun(STILL, FilterState(last), carry="mode") == last.poses[3])


@pytest.mark.parametrize("particles", [1, 17, 40, 95])
def test_another_number_of_particles_is_taken_evenly(particles: int) -> None:
    last = carried_set()
    poses = begun(STILL, FilterState(last), particles=particles)
    assert poses.shape == (particles, 6)
    counts = [np.all(poses == pose, axis=1).sum() for pose in last.poses]
    assert max(counts) - min(counts) <= 1


def test_constant_velocity_moves_the_cloud_by_the_last_movement() -> None:
    last, step = carried_set(), np.linspace(-0.1, 0.1, 6)
    previous = FilterState(last, estimate=np.ones(6) + step, previous_estimate=np.ones(6))
    assert np.allclose(begun(STILL, previous, dynamics="constant_velocity"), last.poses + step)
    assert np.array_equal(begun(STILL, previous), last.poses)
    assert np.array_equal(begun(STILL, FilterState(last), dynamics="constant_velocity"), last.poses)


def test_a_start_without_a_pose_is_uniform() -> None:
    poses = begun(SPACE, FilterState(None), particles=2000)
    assert stats.kstest((poses.ravel() + 5.0) / 10.0, "uniform").pvalue > 1e-3


def test_a_start_without_a_pose_needs_limits() -> None:
    open_space = dataclasses.replace(SPACE, upper=np.array([5, 5, np.inf, 5, 5, 5.0]))
    with pytest.raises(RunError, match="'x2'"):
        begun(open_space, FilterState(None))


@pytest.mark.parametrize("alpha", [0.3, 0.5, 0.8])
def test_variance_falls_as_for_a_gaussian(alpha: float) -> None:
    # Cloud of variance s², w^β = exp(-β x²): with b = 2 β s², α = √(1 + 2b) / (1 + b) fixes b, and the
    # survivors' variance is s² / (1 + b); shrinking keeps it. So every layer narrows by the same factor.
    space = toy_space(1, limit=np.inf, sigma=1.0)
    settings = AnnealedSettings(layers=5, particles=40000, survival=alpha, crossover=0.0)
    b = (1 - alpha**2 + np.sqrt(1 - alpha**2)) / alpha**2
    previous = FilterState(ParticleSet(np.zeros((1, 1)), np.zeros(1)))
    particles = FILTER.begin_frame(RandomNumbers.of_beginning(0, 0), previous, space, settings)
    for layer in range(5):
        particles, record = FILTER.step_layer(
            RandomNumbers(0, 0, layer), particles, layer, Bowl(np.zeros(1)), space, settings
        )
        narrowed = (1 + b) ** -(layer + 1)
        assert record.variance_resampled[0] == pytest.approx(narrowed, rel=0.1)
        assert record.variance_weighed[0] == pytest.approx(narrowed * (1 + b), rel=0.1)
        assert record.beta == pytest.approx(b / 2 * (1 + b) ** layer, rel=0.1)


def test_plain_filter_adds_the_noise_of_equation_13() -> None:
    settings = AnnealedSettings(particles=20000, adaptive_diffusion=False, crossover=0.0, survival=0.4)
    particles = ParticleSet(np.zeros((20000, 6)), np.full(20000, -np.log(20000)))
    for layer in range(3):
        _, record = FILTER.step_layer(
            RandomNumbers(0, 0, layer), particles, layer, Bowl(np.zeros(6)), SPACE, settings
        )
        assert np.allclose(record.variance_diffused, 0.09 * 0.4 ** (layer + 1), rtol=0.06)


def test_rates_of_each_layer_are_met() -> None:
    settings = AnnealedSettings(layers=4, survival_per_layer="0.7, 0.5, 0.3")
    particles = FILTER.begin_frame(
        RandomNumbers.of_beginning(0, 0), FilterState(carried_set()), SPACE, settings
    )
    reached = []
    for layer in range(4):
        particles, record = FILTER.step_layer(
            RandomNumbers(0, 0, layer), particles, layer, Bowl(np.ones(6)), SPACE, settings
        )
        reached.append((record.alpha_wanted, record.alpha_reached))
    assert [wanted for wanted, _ in reached] == [0.7, 0.5, 0.3, 0.3]
    assert all(rate == pytest.approx(wanted, rel=1e-6) for wanted, rate in reached)


def test_last_layer_returns_the_weighted_set_and_estimates() -> None:
    settings = AnnealedSettings(layers=1, particles=300, survival=0.3)
    particles = FILTER.begin_frame(
        RandomNumbers.of_beginning(4, 0), FilterState(carried_set()), SPACE, settings
    )
    problem = Bowl(np.full(6, 0.5))
    weighted, record = FILTER.step_layer(RandomNumbers(4, 0, 0), particles, 0, problem, SPACE, settings)
    assert np.array_equal(weighted.poses, particles.poses)
    assert np.array_equal(weighted.raw_log_weights, problem.log_likelihood(particles.poses))
    by_hand = np.exp(record.beta * weighted.raw_log_weights)
    mean = np.average(particles.poses, axis=0, weights=by_hand)
    variance = np.average((particles.poses - mean) ** 2, axis=0, weights=by_hand)
    assert np.allclose(record.mean, mean)
    assert np.allclose(record.variance_diffused, variance)
    assert np.allclose(record.variance_resampled, variance)
    reported = FILTER.end_frame(weighted, SPACE, settings)
    best = particles.poses[np.argmax(by_hand)]
    assert np.allclose(reported.pose, mean)
    assert np.array_equal(reported.mode, best)
    assert reported.log_weight == pytest.approx(problem.log_likelihood(best[None])[0])
    mode = FILTER.end_frame(weighted, SPACE, dataclasses.replace(settings, estimate="mode"))
    assert np.array_equal(mode.pose, best)


def test_impossible_poses_do_not_survive() -> None:
    settings = AnnealedSettings(layers=6, particles=400)
    particles = FILTER.begin_frame(
        RandomNumbers.of_beginning(0, 0), FilterState(carried_set()), SPACE, settings
    )
    problem = HalfBowl(np.ones(6))
    poses = particles.poses
    for layer in range(6):
        poses = particles.poses
        particles, record = FILTER.step_layer(
            RandomNumbers(0, 0, layer), particles, layer, problem, SPACE, settings
        )
        assert record.best[0] <= 0.0
    assert np.exp(particles.log_weights[poses[:, 0] > 0.0]).sum() == 0.0
    assert FILTER.end_frame(particles, SPACE, settings).pose[0] <= 0.0


def test_a_weight_that_is_not_finite_is_an_error() -> None:
    class Broken(Bowl):
        def log_likelihood(self, poses: np.ndarray, stage: int = 0) -> np.ndarray:
            return np.full(len(poses), np.nan)

    settings = AnnealedSettings()
    particles = FILTER.begin_frame(
        RandomNumbers.of_beginning(0, 0), FilterState(carried_set()), SPACE, settings
    )
    with pytest.raises(RunError, match="nan"):
        FILTER.step_layer(RandomNumbers(0, 0, 0), particles, 0, Broken(np.zeros(6)), SPACE, settings)


def test_one_particle_goes_through_all_layers() -> None:
    settings = AnnealedSettings(particles=1, layers=3)
    particles = FILTER.begin_frame(
        RandomNumbers.of_beginning(0, 0), FilterState(carried_set()), SPACE, settings
    )
    start = particles.poses.copy()
    for layer in range(3):
        particles, record = FILTER.step_layer(
            RandomNumbers(0, 0, layer), particles, layer, Bowl(np.zeros(6)), SPACE, settings
        )
        assert record.alpha_reached == 1.0
    assert np.allclose(particles.poses, start)
