"""Online learning: what is added to the model, and that interruptions of the run do not change it."""

import dataclasses

import numpy as np
import pytest
from turning_behaviour import CLUSTERS, PERIOD, ROOT, toy_model, turning_poses

from studio.search.trackers.guided_particles import STATES
from studio.search.trackers.guided_swarm import LEADER_STATE
from studio.search.trackers.online_learning import (
    SOURCE,
    OnlineLearner,
    novel,
    stretches,
    translated,
    updated_model,
    well_tracked,
)
from studio.search.trackers.tracker import FilterState, ParticleSet

MODEL = toy_model()
# The toy's 12 features have 90 parameters a cluster: a movement must last a while to be one.
FRAMES = 400


def nodding(frames: int, seed: int = 0) -> np.ndarray:
    """(F, 9) a movement that the model does not know: two angles together, about a pose of its own."""
    rng = np.random.default_rng(seed)
    poses = np.zeros((frames, 9))
    poses[:, [3, 5]] = 2.0 + 0.4 * np.sin(2.0 * np.pi * np.arange(frames) / 30.0)[:, None]
    return poses + 0.01 * rng.standard_normal(poses.shape)


def test_frames_far_below_the_median_are_not_well_tracked() -> None:
    weights = np.random.default_rng(0).normal(size=200)
    weights[[20, 21, 150]] = -30.0
    unknown = np.full(200, np.nan)
    good = well_tracked(weights, unknown, 0.75)
    assert not good[[20, 21, 150]].any()
    assert good.mean() > 0.97
    assert well_tracked(np.zeros(10), unknown[:10]).all()


def test_frames_that_the_pictures_deny_are_not_well_tracked() -> None:
    """A run that is off throughout looks well tracked beside itself: the overlap with the masks is absolute."""
    weights, overlaps = np.zeros(10), np.array([0.9] * 4 + [0.6] * 5 + [np.nan])
    assert well_tracked(weights, overlaps, 0.75).tolist() == [True] * 4 + [False] * 5 + [True]
    assert well_tracked(weights, overlaps, 0.0).all()


def test_a_run_that_the_pictures_deny_teaches_nothing() -> None:
    poses = lessons(FRAMES)

    def tracked(overlap: float):
        return lambda count: (poses[:count], np.zeros(count), np.full(count, overlap))

    learner = OnlineLearner(MODEL, 100, seed=7, overlap=0.75)
    assert learner.model_in(FRAMES - 50, tracked(0.6)) is MODEL
    taught = OnlineLearner(MODEL, 100, seed=7, overlap=0.75).model_in(FRAMES - 50, tracked(0.8))
    assert taught.clusters > CLUSTERS


def test_stretches_are_cut_where_tracking_was_bad_and_smoothed() -> None:
    poses = np.tile(turning_poses(9, 1), (100, 1))
    jitter = poses + 0.02 * np.random.default_rng(0).standard_normal(poses.shape)
    weights = np.zeros(100)
    weights[[30, 31, 40]] = -50.0
    good = well_tracked(weights + 1e-3 * np.sin(np.arange(100)), np.full(100, np.nan))
    found = stretches(jitter, good, MODEL)
    # 32 … 39 is too short to show movement.
    assert [len(one) for one in found] == [30, 59]
    rough = np.abs(np.diff(jitter[41:, ROOT:], axis=0) - np.diff(poses[41:, ROOT:], axis=0)).mean()
    smooth = np.abs(np.diff(found[1][:, ROOT:], axis=0) - np.diff(poses[41:, ROOT:], axis=0)).mean()
    assert smooth < 0.15 * rough


def test_stretches_are_read_at_the_rate_that_the_model_was_learnt_at() -> None:
    faster = MODEL.at_rate(120.0)
    poses = turning_poses(9, 120)
    twice = np.column_stack([np.interp(np.arange(0, 119.1, 0.5), np.arange(120), one) for one in poses.T])
    (found,) = stretches(twice, np.ones(len(twice), dtype=bool), faster)
    assert len(found) == 120
    assert np.abs(found[10:-10] - poses[10:-10]).max() < 0.15


def test_only_unexplained_frames_are_new() -> None:
    known, strange = turning_poses(9, 200), nodding(200)
    # The first frame has no movement of its own.
    assert not novel(MODEL, MODEL.space.features(known))[1:].any()
    assert novel(MODEL, MODEL.space.features(strange)).all()


def test_a_lesson_appends_clusters_that_explain_new_frames() -> None:
    poses = nodding(FRAMES)
    after = updated_model(MODEL, MODEL, poses, np.ones(FRAMES, dtype=bool), np.random.default_rng(1))
    assert after.clusters > CLUSTERS
    assert np.array_equal(after.dynamics.means[:CLUSTERS], MODEL.dynamics.means)
    assert np.array_equal(after.dynamics.covariances[:CLUSTERS], MODEL.dynamics.covariances)
    assert after.mixture.weights.sum() == pytest.approx(1.0)
    (again,) = stretches(nodding(100, 5), np.ones(100, dtype=bool), MODEL)
    assert novel(MODEL, MODEL.space.features(again)).mean() == 1.0
    assert novel(after, MODEL.space.features(again)).mean() < 0.1
    labels = after.labels(again)
    assert np.all(labels >= CLUSTERS)
    assert after.prototypes.poses.shape == (after.clusters, 9)
    assert np.all(after.prototypes.poses[CLUSTERS:, 3] > 1.0)
    # The automaton has the order of known and of new clusters.
    assert after.automaton.symbols == after.clusters
    assert after.entropy([turning_poses(9, 200)]) == pytest.approx(
        MODEL.entropy([turning_poses(9, 200)]), abs=0.1
    )
    assert after.entropy([again]) < 1.0
    assert after.making.frames == MODEL.making.frames + FRAMES
    assert after.making.sources[-1] == SOURCE


def test_a_lesson_of_known_movement_adds_its_order_only() -> None:
    """Turning the other way round: known poses in a new order."""
    labels = MODEL.labels(turning_poses(9, 300))
    assert set(np.unique(labels)) == set(range(CLUSTERS))
    after = updated_model(
        MODEL, MODEL, turning_poses(9, 300), np.ones(300, dtype=bool), np.random.default_rng(1)
    )
    assert after.clusters == CLUSTERS
    assert after.making.frames == MODEL.making.frames + 300


def test_without_well_tracked_frames_nothing_is_learnt() -> None:
    assert updated_model(MODEL, MODEL, nodding(4), np.ones(4, dtype=bool), np.random.default_rng(0)) is MODEL


def lessons(frames: int) -> np.ndarray:
    """A run that turns, then nods."""
    return np.concatenate([turning_poses(9, 2 * PERIOD), nodding(frames - 2 * PERIOD)])


def test_lessons_are_the_same_wherever_a_run_is_resumed() -> None:
    poses, counts = lessons(FRAMES), []

    def tracked(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        counts.append(count)
        return poses[:count], np.zeros(count), np.full(count, np.nan)

    going_on = OnlineLearner(MODEL, 100, seed=7)
    models = [going_on.model_in(number, tracked) for number in range(0, FRAMES, 50)]
    assert counts == [100, 200, 300]
    assert models[0] is models[1] is MODEL
    taken_up = OnlineLearner(MODEL, 100, seed=7).model_in(FRAMES - 50, tracked)
    assert np.array_equal(taken_up.dynamics.means, models[-1].dynamics.means)
    assert taken_up.automaton.contexts == models[-1].automaton.contexts
    assert models[-1].clusters > CLUSTERS
    sizes = [model.clusters for model in models]
    assert sizes == sorted(sizes)


@pytest.mark.parametrize("name", [STATES, LEADER_STATE])
def test_states_stand_for_the_same_histories_in_the_next_automaton(name: str) -> None:
    after = updated_model(
        MODEL, MODEL, nodding(FRAMES), np.ones(FRAMES, dtype=bool), np.random.default_rng(1)
    )
    states = np.arange(MODEL.states)
    particles = ParticleSet(np.zeros((len(states), 9)), np.zeros(len(states)), extra={name: states})
    carried = translated(FilterState(particles), MODEL.automaton, after.automaton)
    found = carried.particles.extra[name]
    for before, now in zip(states, found, strict=True):
        history, context = MODEL.automaton.contexts[before], after.automaton.contexts[now]
        assert history[len(history) - len(context) :] == context
    plain = FilterState(dataclasses.replace(particles, extra={}))
    assert translated(plain, MODEL.automaton, after.automaton).particles is not None
    assert translated(FilterState(None), MODEL.automaton, after.automaton).particles is None


def test_only_at_a_lesson_are_states_translated() -> None:
    learner = OnlineLearner(MODEL, 100, seed=7)
    poses = lessons(FRAMES)

    def tracked(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return poses[:count], np.zeros(count), np.full(count, np.nan)

    states = np.full(3, learner.model_in(299, tracked).automaton.state_after([0, 0, 1]))
    carried = FilterState(ParticleSet(np.zeros((3, 9)), np.zeros(3), extra={STATES: states}))

    assert learner.carried_into(99, carried, tracked) is carried
    assert learner.carried_into(0, carried, tracked) is carried
    moved = learner.carried_into(300, carried, tracked)
    model = learner.model_in(300, tracked)
    assert np.all(model.automaton.last_symbols[moved.particles.extra[STATES].astype(int)] == 1)
