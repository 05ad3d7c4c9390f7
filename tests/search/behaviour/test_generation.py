"""Generated motion follows the automaton and is the most probable one for its labels."""

import itertools

import numpy as np
import pytest
from scipy.optimize import minimize
from toy_behaviour import recordings, toy_model

from studio.foundations.errors import BehaviourError
from studio.search.behaviour.automaton_learning import ContextTest, learn_automaton
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.generation import generate, likeliest_motion, walk
from studio.search.behaviour.model import BehaviourModel


@pytest.fixture(scope="module")
def model() -> BehaviourModel:
    return toy_model()


def test_only_possible_transitions_are_taken(model: BehaviourModel) -> None:
    _, states = generate(np.random.default_rng(5), model, 400)
    labels = model.automaton.last_symbols[states]
    for (before, after), label in zip(itertools.pairwise(states), labels[1:], strict=True):
        assert model.automaton.probabilities[before, label] > 0.0
        assert model.automaton.next_state[before, label] == after
    assert len(set(labels)) >= 4


def test_paths_visit_clusters_as_often_as_the_training(model: BehaviourModel) -> None:
    # The two waves never follow each other: a path stays in the one it starts in.
    slow = np.concatenate(model.making.labels[::2])
    own = np.unique(slow)
    start = int(np.flatnonzero(np.isin(model.automaton.last_symbols, own) & (model.automaton.start > 0.0))[0])
    taken = walk(np.random.default_rng(0), model.automaton, 20_000, start=start)
    states, labels = taken.states, taken.labels
    assert taken.begins.sum() == 1
    visits = np.bincount(labels, minlength=model.clusters) / 20_000
    usual = np.bincount(slow, minlength=model.clusters) / len(slow)
    assert np.abs(visits - usual).max() < 0.03
    assert set(labels) == set(own)
    assert (model.automaton.start[states] > 0.0).all()


def test_motion_is_the_most_probable_one_for_its_labels() -> None:
    rng = np.random.default_rng(1)
    factors = rng.standard_normal((3, 4, 4))
    dynamics = GaussianMixture(
        np.full(3, 1 / 3), rng.standard_normal((3, 4)), factors @ factors.transpose(0, 2, 1) + 0.2 * np.eye(4)
    )
    labels = np.array([0, 0, 2, 1, 1, 2])

    def surprise(flat: np.ndarray) -> float:
        values = flat.reshape(6, 2)
        changes = np.diff(values, axis=0)
        features = np.hstack([values, np.concatenate([changes[:1], changes])])
        return -dynamics.log_densities(features)[np.arange(6), labels].sum()

    found = likeliest_motion(dynamics, labels)
    best = minimize(surprise, np.zeros(12), method="BFGS", options={"gtol": 1e-8})
    np.testing.assert_allclose(found.ravel(), best.x, atol=1e-4)


def test_motion_is_smooth_and_near_the_training(model: BehaviourModel) -> None:
    poses, _ = generate(np.random.default_rng(6), model, 400)
    frames = np.concatenate(recordings())
    nearest = np.linalg.norm(poses[:, None] - frames, axis=2).min(axis=1)
    assert nearest.max() < 0.35
    speeds = np.linalg.norm(np.diff(poses, axis=0), axis=1)
    usual = np.concatenate([np.linalg.norm(np.diff(poses, axis=0), axis=1) for poses in recordings()])
    assert 0.5 * usual.mean() < speeds.mean() < 1.5 * usual.mean()
    assert speeds.max() < 1.5 * usual.max()


def test_a_path_begins_in_the_chosen_state_with_its_label(model: BehaviourModel) -> None:
    labels = model.automaton.last_symbols
    assert set(labels) == {-1, *range(model.clusters)}
    for state in np.flatnonzero(labels >= 0):
        begun = walk(np.random.default_rng(0), model.automaton, 1, start=int(state))
        assert (begun.states[0], begun.labels[0]) == (state, labels[state])


def test_a_chosen_start_and_seeds(model: BehaviourModel) -> None:
    runs = [generate(np.random.default_rng(seed), model, 80, start=3) for seed in (7, 7, 8)]
    assert all(states[0] == 3 for _, states in runs)
    np.testing.assert_array_equal(runs[0][0], runs[1][0])
    assert not np.array_equal(runs[0][1], runs[2][1])
    _, states = generate(np.random.default_rng(0), model, 10, start=0)
    assert model.automaton.last_symbols[states[0]] >= 0


@pytest.mark.parametrize("rate", [0.4, 2.0])
def test_at_another_rate_the_motion_takes_as_long(model: BehaviourModel, rate: float) -> None:
    other = model.at_rate(model.fps / rate)
    taken = walk(np.random.default_rng(3), other.automaton, 1000, other.steps_per_frame, start=2)
    changes = np.count_nonzero(np.diff(taken.states))
    if rate < 1.0:
        assert changes <= 400
    assert len(taken.labels) == 1000
    poses, _ = generate(np.random.default_rng(3), other, 300)
    per_second = np.linalg.norm(np.diff(poses, axis=0), axis=1).mean() * other.fps
    usual = np.mean([np.linalg.norm(np.diff(poses, axis=0), axis=1).mean() for poses in recordings()])
    assert 0.4 < per_second / (usual * model.fps) < 1.6


def test_a_path_that_ends_restarts() -> None:
    labels = np.array([0] * 5 + [1] * 5 + [2] * 20)
    automaton = learn_automaton([labels] * 4, 3, ContextTest(3, 0.1, 0.0))
    taken = walk(np.random.default_rng(2), automaton, 500)
    np.testing.assert_array_equal(automaton.last_symbols[taken.states], taken.labels)
    cuts = np.flatnonzero(taken.begins)
    assert len(cuts) > 10
    for frame in cuts[1:]:
        before = taken.states[frame - 1]
        assert automaton.contexts[before][-1] == 2
        assert automaton.probabilities[before, 2] == 1.0
    assert (0, 1) in set(itertools.pairwise(taken.labels.tolist()))
    within = np.flatnonzero(~taken.begins)
    assert {(int(taken.labels[at - 1]), int(taken.labels[at])) for at in within} <= {
        (0, 0),
        (0, 1),
        (1, 1),
        (1, 2),
        (2, 2),
    }


def test_the_shortest_motion_and_the_last_state_are_allowed(model: BehaviourModel) -> None:
    poses, states = generate(np.random.default_rng(0), model, 2, start=model.states - 1)
    assert poses.shape == (2, 4)
    assert states[0] == model.states - 1


def test_a_single_frame_is_its_clusters_mean(model: BehaviourModel) -> None:
    found = likeliest_motion(model.dynamics, np.array([2]))
    np.testing.assert_array_equal(found, model.dynamics.means[2:3, :4])


def test_refusals(model: BehaviourModel) -> None:
    with pytest.raises(BehaviourError, match="no state -1"):
        generate(np.random.default_rng(0), model, 10, start=-1)
    with pytest.raises(BehaviourError, match=f"no state {model.states}"):
        generate(np.random.default_rng(0), model, 10, start=model.states)
    with pytest.raises(BehaviourError, match="1 frames"):
        generate(np.random.default_rng(0), model, 1)
    with pytest.raises(BehaviourError, match="no state 9999"):
        generate(np.random.default_rng(0), model, 10, start=9999)
