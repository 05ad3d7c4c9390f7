"""Prediction against closed forms: Eq. 3's choice, Eq. 4's moments, resampling, and other frame rates."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from toy_behaviour import FPS, toy_model

from studio.foundations.errors import BehaviourError
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.prediction import propagate, start_states, states_at
from studio.search.behaviour.prediction_kernels import choose_arcs

MANY = 40_000
LAMBDA = 0.4


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    return toy_model()


def crossroads(model: BehaviourModel) -> tuple[int, np.ndarray]:
    """A state with several transitions, and features between the clusters they lead to."""
    ways = (model.automaton.predictions > 0.0).sum(axis=1)
    ways[model.automaton.last_symbols < 0] = 0
    state = int(np.argmax(ways))
    labels = np.flatnonzero(model.automaton.predictions[state])
    return state, model.dynamics.means[labels].mean(axis=0)


def repeated(state: int, features: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    whole = np.repeat(features[None], count, axis=0)
    return np.full(count, state), whole[:, :4], whole[:, 4:]


def equation_3(model: BehaviourModel, state: int, features: np.ndarray) -> np.ndarray:
    """(K,) probabilities of the next cluster."""
    point = model.reduction.reduced(features[None])[0]
    parts = zip(model.mixture.means, model.mixture.covariances, strict=True)
    density = np.array([multivariate_normal(mean, covariance).pdf(point) for mean, covariance in parts])
    weights = density * model.automaton.predictions[state]
    return weights / weights.sum()


def test_transitions_are_chosen_by_equation_3(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    wanted = equation_3(model, state, features)
    assert np.sort(wanted)[-2] > 0.02, "the choice is open"
    moved = propagate(
        np.random.default_rng(0), model, *repeated(state, features, MANY), LAMBDA, automaton_share=0.0
    )
    chosen = np.bincount(model.automaton.last_symbols[moved.states], minlength=model.clusters) / MANY
    np.testing.assert_allclose(chosen, wanted, atol=4.0 * np.sqrt(0.25 / MANY))
    label = model.automaton.last_symbols[state]
    np.testing.assert_array_equal(moved.jumped, model.automaton.last_symbols[moved.states] != label)
    nexts = model.automaton.next_state[state]
    assert set(moved.states) <= {int(nexts[cluster]) for cluster in np.flatnonzero(wanted)}


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_a_share_follows_the_automaton_alone(model: BehaviourModel, share: float) -> None:
    state, features = crossroads(model)
    start = repeated(state, features, MANY)
    moved = propagate(np.random.default_rng(0), model, *start, LAMBDA, automaton_share=share)
    chosen = np.bincount(model.automaton.last_symbols[moved.states], minlength=model.clusters) / MANY
    gamma = model.automaton.predictions[state]
    wanted = share * gamma + (1.0 - share) * equation_3(model, state, features)
    np.testing.assert_allclose(chosen, wanted, atol=4.0 * np.sqrt(0.25 / MANY))


def test_far_from_every_cluster_the_choice_is_still_made(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    moved = propagate(np.random.default_rng(0), model, *repeated(state, features + 300.0, 10), LAMBDA)
    assert np.isfinite(moved.values).all()
    assert (model.automaton.predictions[state, model.automaton.last_symbols[moved.states]] > 0.0).all()


def test_staying_moves_by_equation_4(model: BehaviourModel) -> None:
    cluster = int(np.argmax(model.dynamics.weights))
    own = np.flatnonzero(model.automaton.last_symbols == cluster)
    state = int(own[np.argmax(model.automaton.probabilities[own, cluster])])
    features = model.dynamics.means[cluster]
    moved = propagate(np.random.default_rng(1), model, *repeated(state, features, MANY), LAMBDA)
    stayed = ~moved.jumped
    assert stayed.mean() > 0.5
    count = int(stayed.sum())
    values, velocities = moved.values[stayed], moved.velocities[stayed]
    covariance = model.dynamics.covariances[cluster]
    xx, xv, vv = covariance[:4, :4], covariance[:4, 4:], covariance[4:, 4:]
    # ẋ' = ẋ + λ dẋ and x' = x + ẋ + λ (dẋ + dx): moments in closed form.
    whole = LAMBDA**2 * np.block([[xx + xv + xv.T + vv, xv + vv], [xv.T + vv, vv]])
    found = np.cov(np.hstack([values, velocities]).T)
    scale = np.sqrt(np.diag(whole))
    assert np.abs((found - whole) / np.outer(scale, scale)).max() < 6.0 / np.sqrt(count)
    mean = np.concatenate([features[:4] + features[4:], features[4:]])
    away = (np.hstack([values, velocities]).mean(axis=0) - mean) / scale
    assert np.abs(away).max() < 5.0 / np.sqrt(count)


def test_without_noise_a_particle_keeps_its_velocity(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    moved = propagate(np.random.default_rng(1), model, *repeated(state, features, 500), 0.0)
    stayed = ~moved.jumped
    assert stayed.any()
    np.testing.assert_allclose(
        moved.values[stayed], np.repeat([features[:4] + features[4:]], stayed.sum(), 0)
    )
    np.testing.assert_allclose(moved.velocities[stayed], np.repeat([features[4:]], stayed.sum(), 0))


@pytest.mark.parametrize("entering", ["resample", "blend"])
def test_entering_samples_from_the_cluster(model: BehaviourModel, entering: str) -> None:
    state, features = crossroads(model)
    moved = propagate(np.random.default_rng(2), model, *repeated(state, features, MANY), LAMBDA, entering)
    entered = np.flatnonzero(moved.jumped)
    labels = model.automaton.last_symbols[moved.states[entered]]
    cluster = int(np.bincount(labels).argmax())
    found = np.hstack([moved.values, moved.velocities])[entered[labels == cluster]]
    mean, covariance = model.dynamics.means[cluster], model.dynamics.covariances[cluster]
    if entering == "blend":
        onward = np.concatenate([features[:4] + features[4:], features[4:]])
        inverse = np.linalg.inv(covariance)
        product = np.linalg.inv(inverse + inverse / LAMBDA**2)
        mean = product @ (inverse @ mean + inverse @ onward / LAMBDA**2)
        covariance = product
    scale = np.sqrt(np.diag(covariance))
    assert len(found) > 1000
    assert np.abs((found.mean(axis=0) - mean) / scale).max() < 5.0 / np.sqrt(len(found))
    assert np.abs((np.cov(found.T) - covariance) / np.outer(scale, scale)).max() < 6.0 / np.sqrt(len(found))


def test_start_states_are_spread_over_the_clusters(model: BehaviourModel) -> None:
    start = start_states(np.random.default_rng(3), model, MANY)
    shares = np.bincount(start.states, minlength=model.states) / MANY
    np.testing.assert_allclose(shares, model.automaton.start, atol=0.01)
    cluster = int(np.argmax(model.dynamics.weights))
    own = model.automaton.last_symbols[start.states] == cluster
    scale = np.sqrt(np.diag(model.dynamics.covariances[cluster]))
    away = (start.values[own].mean(axis=0) - model.dynamics.means[cluster, :4]) / scale[:4]
    assert np.abs(away).max() < 5.0 / np.sqrt(own.sum())


def test_every_start_is_sampled_from_its_states_own_cluster(model: BehaviourModel) -> None:
    start = start_states(np.random.default_rng(3), model, MANY)
    labels = model.automaton.last_symbols[start.states]
    found = np.hstack([start.values, start.velocities])
    assert set(labels) == set(range(model.clusters))
    for cluster in range(model.clusters):
        own = found[labels == cluster]
        scale = np.sqrt(np.diag(model.dynamics.covariances[cluster]))
        away = (own.mean(axis=0) - model.dynamics.means[cluster]) / scale
        assert np.abs(away).max() < 5.0 / np.sqrt(len(own))
        assert np.abs(own.std(axis=0) / scale - 1.0).max() < 5.0 / np.sqrt(len(own))
    assert start.jumped.all()


def test_starts_without_memory_are_spread_by_the_clusters_weights(model: BehaviourModel) -> None:
    forgetful = model.with_automaton(dataclasses.replace(model.making.settings, memory=0))
    start = start_states(np.random.default_rng(3), forgetful, MANY)
    found = np.hstack([start.values, start.velocities])
    weights, means = model.dynamics.weights, model.dynamics.means
    between = (means - weights @ means).T * weights @ (means - weights @ means)
    whole = between + np.einsum("k,kij->ij", weights, model.dynamics.covariances)
    scale = np.sqrt(np.diag(whole))
    assert np.abs((found.mean(axis=0) - weights @ means) / scale).max() < 5.0 / np.sqrt(MANY)
    assert np.abs((np.cov(found.T) - whole) / np.outer(scale, scale)).max() < 10.0 / np.sqrt(MANY)


def test_a_particle_has_jumped_where_its_cluster_is_another(model: BehaviourModel) -> None:
    labels = model.automaton.last_symbols
    states = np.repeat(np.flatnonzero(labels >= 0), 20)
    features = model.dynamics.means[labels[states]]
    start = states, features[:, :4], features[:, 4:]
    moved = propagate(np.random.default_rng(0), model, *start, 0.0, automaton_share=1.0)
    np.testing.assert_array_equal(moved.jumped, labels[moved.states] != labels[states])
    assert set(labels[states[moved.jumped]]) == set(range(model.clusters))
    stayed = ~moved.jumped
    wanted = np.hstack([features[:, :4] + features[:, 4:], features[:, 4:]])[stayed]
    np.testing.assert_allclose(np.hstack([moved.values, moved.velocities])[stayed], wanted)
    # Before there is a history the likeliest cluster is where a particle is.
    nowhere = np.zeros(model.clusters, dtype=np.int64)
    means = model.dynamics.means
    moved = propagate(
        np.random.default_rng(0), model, nowhere, means[:, :4], means[:, 4:], 0.0, automaton_share=1.0
    )
    before = model.mixture.labels(model.reduction.reduced(means))
    np.testing.assert_array_equal(moved.jumped, labels[moved.states] != before)


@pytest.mark.parametrize("known", [True, False])
def test_states_of_known_poses(model: BehaviourModel, known: bool) -> None:
    features = model.dynamics.means[2]
    values, velocities = np.repeat(features[None, :4], 2000, 0), np.repeat(features[None, 4:], 2000, 0)
    states = states_at(np.random.default_rng(4), model, values, velocities if known else None)
    found = np.bincount(model.automaton.last_symbols[states], minlength=model.clusters)
    if known:
        assert found.argmax() == 2
        space, point = model.mixture, model.reduction.reduced(features[None])[0]
    else:
        space, point = model.poses_only, features[:4]
    parts = zip(space.means, space.covariances, strict=True)
    density = np.array([multivariate_normal(mean, covariance).pdf(point) for mean, covariance in parts])
    joint = model.automaton.start * density[model.automaton.last_symbols]
    wanted = np.zeros(model.clusters)
    np.add.at(wanted, model.automaton.last_symbols, joint / joint.sum())
    np.testing.assert_allclose(found / 2000, wanted, atol=0.05)


def test_same_seed_same_particles(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    runs = [
        propagate(np.random.default_rng(seed), model, *repeated(state, features, 60), 0.3)
        for seed in (7, 7, 8)
    ]
    np.testing.assert_array_equal(runs[0].values, runs[1].values)
    np.testing.assert_array_equal(runs[0].states, runs[1].states)
    assert not np.array_equal(runs[0].values, runs[2].values)


def test_at_another_rate_the_automaton_steps_as_often_a_second(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    fast = model.at_rate(4.0 * FPS)
    scaled = np.concatenate([features[:4], features[4:] / 4.0])
    wanted = 1.0 - equation_3(model, state, features)[model.automaton.last_symbols[state]]
    moved = propagate(
        np.random.default_rng(8), fast, *repeated(state, scaled, MANY), 0.0, automaton_share=0.0
    )
    assert moved.jumped.mean() == pytest.approx(wanted / 4.0, abs=0.01)
    slow = model.at_rate(0.5 * FPS)
    scaled = np.concatenate([features[:4], features[4:] * 2.0])
    moved = propagate(np.random.default_rng(8), slow, *repeated(state, scaled, 2000), 0.0)
    reachable = {int(model.automaton.next_state[model.automaton.next_state[state, one], other])
                 for one in range(model.clusters) for other in range(model.clusters)}  # fmt: skip
    assert set(moved.states) <= reachable


def test_without_memory_clusters_come_from_the_likelihood(model: BehaviourModel) -> None:
    settings = dataclasses.replace(model.making.settings, memory=0)
    forgetful = model.with_automaton(settings)
    assert forgetful.states == 1
    start = start_states(np.random.default_rng(0), forgetful, 200)
    assert not start.states.any()
    features = np.repeat(model.dynamics.means[1][None], 2000, axis=0)
    moved = propagate(
        np.random.default_rng(0),
        forgetful,
        np.zeros(2000, int),
        features[:, :4],
        features[:, 4:],
        0.1,
        automaton_share=0.0,
    )
    wanted = equation_3(forgetful, 0, features[0])
    assert 1.0 - moved.jumped.mean() == pytest.approx(wanted[1], abs=0.05)
    states = states_at(np.random.default_rng(0), forgetful, features[:, :4])
    assert not states.any()


def test_bad_particles_are_refused(model: BehaviourModel) -> None:
    state, features = crossroads(model)
    states, values, velocities = repeated(state, features, 5)
    rng = np.random.default_rng(0)
    with pytest.raises(BehaviourError, match="do not fit 5 states"):
        propagate(rng, model, states, values[:, :3], velocities, 0.1)
    with pytest.raises(BehaviourError, match="'hop'"):
        propagate(rng, model, states, values, velocities, 0.1, "hop")


def test_the_choice_is_open_however_unlikely_all_are() -> None:
    """Weights e⁻²⁰⁰⁰ of two transitions, one three times the other."""
    luck, none = np.linspace(0.0, 0.99, 100), np.zeros(2)
    states, free = np.zeros(100, dtype=np.int64), np.ones(100, dtype=bool)
    arcs = (np.array([0, 2]), np.array([5, 3]), np.array([-2000.0, -2000.0 + np.log(3.0)]))
    chosen = choose_arcs(
        np.zeros((100, 1)), states, luck, free, *arcs, none[:, None], none[:, None, None], none
    )
    np.testing.assert_array_equal(chosen, np.where(luck < 0.25 - 1e-9, 5, 3))
