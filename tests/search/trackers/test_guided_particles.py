"""Particles moved by a behaviour model: their states, movements and expectations."""

import dataclasses

import numpy as np
import pytest
from toy_problems import toy_space
from turning_behaviour import CLUSTERS, DWELL, PERIOD, ROOT, guided_space, toy_model, turning_poses

from studio.search.behaviour.root_motion import RootFrame, RootMotion, gaussians_of
from studio.search.trackers.guided_particles import (
    STATES,
    VELOCITY,
    GuidedParticles,
    draw_near,
    followed,
    foresee,
    propagated,
    spread_over_clusters,
    walkers_from,
)
from studio.search.trackers.settings import BehaviourSettings
from studio.search.trackers.tracker import FilterState, ParticleSet, SearchSpace

SPACE = guided_space()
MODEL = toy_model()
COUNT = 4000


def guided(frame: int = 12, free: bool = False) -> GuidedParticles:
    """Particles that have followed the truth up to a frame."""
    poses = turning_poses(9, frame + 1)
    labels = MODEL.labels(poses)
    states = np.full(COUNT, MODEL.automaton.state_after(labels))
    velocity = np.tile((poses[-1] - poses[-2])[ROOT:], (COUNT, 1))
    return GuidedParticles(np.tile(poses[-1], (COUNT, 1)), states, velocity, np.full(COUNT, free))


def walking_space() -> SearchSpace:
    """A space whose model includes the root motion of `turning_poses`."""
    frame = RootFrame(np.arange(ROOT), np.zeros(ROOT, dtype=bool), -1, np.array([], dtype=np.int64))
    poses = turning_poses(9, 8 * PERIOD)
    root = RootMotion(frame, gaussians_of(frame.changes(poses), np.eye(CLUSTERS)[MODEL.labels(poses)]))
    return dataclasses.replace(SPACE, behaviour=dataclasses.replace(MODEL, root=root))


def test_the_root_gets_noise_and_the_angles_the_models_movement() -> None:
    past = guided()
    rules = BehaviourSettings(attenuation=0.0, global_scale=0.5)
    moved = propagated(np.random.default_rng(0), past, SPACE, rules, SPACE.sigma)
    root = moved.poses[:, :ROOT] - past.poses[:, :ROOT]
    assert np.allclose(root.mean(axis=0), 0.0, atol=5 * 0.15 / np.sqrt(COUNT))
    assert np.allclose(root.std(axis=0), 0.15, rtol=0.05)
    # λ = 0: a particle that stays in its cluster keeps its velocity exactly (Eq. 4).
    before = MODEL.automaton.last_symbols[past.states]
    stayed = MODEL.automaton.last_symbols[moved.states] == before
    assert stayed.sum() > 100
    assert np.allclose(moved.poses[stayed, ROOT:], past.poses[stayed, ROOT:] + past.velocity[stayed])
    assert np.allclose(moved.velocity[stayed], past.velocity[stayed])


@pytest.mark.parametrize(("prediction", "wanted"), [("learnt", 0.05), ("noise", 0.0)])
def test_the_root_moves_as_learnt_or_by_noise_alone(prediction: str, wanted: float) -> None:
    past = guided()
    past = dataclasses.replace(past, free=np.arange(COUNT) % 2 == 0)
    rules = BehaviourSettings(root_prediction=prediction, global_scale=0.5)
    moved = propagated(np.random.default_rng(5), past, walking_space(), rules, SPACE.sigma)
    led, free = (moved.poses[rows, :ROOT] - past.poses[rows, :ROOT] for rows in (~past.free, past.free))
    assert np.allclose(led.mean(axis=0), [wanted, 0.0, 0.0], atol=5 * 0.3 / np.sqrt(COUNT / 2))
    # The learnt motion has almost no spread here; noise of σ0 is added as before.
    assert np.allclose(led.std(axis=0), 0.15, rtol=0.06)
    # Free particles are moved without the model, their root included.
    assert np.allclose(free.mean(axis=0), 0.0, atol=5 * 0.3 / np.sqrt(COUNT / 2))
    assert np.allclose(free.std(axis=0), 0.3, rtol=0.06)


def test_the_root_moves_as_many_steps_as_the_space_has() -> None:
    past, rules = guided(), BehaviourSettings(global_scale=0.0)
    space = dataclasses.replace(walking_space(), steps=3)
    moved = propagated(np.random.default_rng(6), past, space, rules, SPACE.sigma)
    assert np.allclose(moved.poses[:, :ROOT] - past.poses[:, :ROOT], [0.15, 0.0, 0.0], atol=1e-4)


def test_learnt_root_motion_is_spread_by_its_knob() -> None:
    def spread(times: float) -> np.ndarray:
        past, rules = guided(), BehaviourSettings(global_scale=0.0, root_spread=times)
        moved = propagated(np.random.default_rng(7), past, walking_space(), rules, SPACE.sigma)
        return (moved.poses[:, :ROOT] - past.poses[:, :ROOT]).std(axis=0)

    assert (spread(1.0) > 0.0).all()
    assert spread(3.0) == pytest.approx(3.0 * spread(1.0), rel=1e-6)


def test_noise_of_those_that_stay_has_the_clusters_covariance_times_lambda_squared() -> None:
    past = guided()
    moved = propagated(np.random.default_rng(1), past, SPACE, BehaviourSettings(attenuation=0.5), SPACE.sigma)
    label = int(MODEL.automaton.last_symbols[past.states[0]])
    stayed = MODEL.automaton.last_symbols[moved.states] == label
    change = moved.velocity[stayed] - past.velocity[stayed]
    further = moved.poses[stayed, ROOT:] - past.poses[stayed, ROOT:] - moved.velocity[stayed]
    measured = np.cov(np.hstack([further, change]).T) / 0.25
    wanted = MODEL.dynamics.covariances[label]
    assert np.abs(measured - wanted).max() < 6.0 / np.sqrt(stayed.sum()) * np.diag(wanted).max()


def test_a_free_particle_is_spread_by_sigma_in_every_parameter_and_follows_the_automaton() -> None:
    past = guided(free=True)
    moved = propagated(np.random.default_rng(2), past, SPACE, BehaviourSettings(), SPACE.sigma)
    change = moved.poses - past.poses
    assert np.allclose(change.std(axis=0), 0.3, rtol=0.06)
    assert np.array_equal(moved.velocity, past.velocity)
    features = np.hstack([moved.poses[:, ROOT:], moved.velocity])
    distances = MODEL.mixture.log_joint(features)
    by_hand = [
        MODEL.automaton.next_state[state, label]
        for state, label in zip(past.states, distances.argmax(axis=1), strict=True)
    ]
    assert moved.states.tolist() == by_hand


def test_recomputed_states_are_those_of_reading_the_recording() -> None:
    poses = turning_poses(9, 3 * PERIOD)
    states = MODEL.automaton.states_along(MODEL.labels(poses))
    changes = np.diff(poses[:, ROOT:], axis=0)
    found = followed(np.random.default_rng(0), MODEL, states[1:-1], poses[1:, ROOT:], changes)
    assert found.tolist() == states[2:].tolist()


@pytest.mark.parametrize(("fps", "steps"), [(30.0, 2.0), (120.0, 0.5)])
def test_at_another_rate_a_symbol_is_taken_as_often_as_frames_last(fps: float, steps: float) -> None:
    model = MODEL.at_rate(fps)
    label = 1
    start = MODEL.automaton.state_after([0])
    angles = np.tile(MODEL.dynamics.means[label, :6], (COUNT, 1))
    velocity = np.tile(model.dynamics.means[label, 6:], (COUNT, 1))
    found = followed(np.random.default_rng(0), model, np.full(COUNT, start), angles, velocity)
    moved = (found != start).mean()
    assert moved == pytest.approx(min(steps, 1.0), abs=0.05)
    if steps == 2.0:
        assert set(found) == {MODEL.automaton.state_after([0, label, label])}


def test_near_a_pose_states_are_of_the_clusters_that_it_lies_in() -> None:
    for frame in (5, 15, 25, 35):
        pose = turning_poses(9, 1, frame)
        states, velocity = draw_near(np.random.default_rng(frame), np.tile(pose, (500, 1)), SPACE)
        labels = MODEL.automaton.last_symbols[states]
        assert (labels == frame // DWELL).mean() > 0.9
        true = (turning_poses(9, 2, frame - 1)[1] - turning_poses(9, 2, frame - 1)[0])[ROOT:]
        assert np.abs(velocity.mean(axis=0) - true).max() < 0.03
        assert np.isfinite(velocity).all()


def test_far_from_all_clusters_movements_stay_bounded() -> None:
    far = np.tile(turning_poses(9, 1), (50, 1)) + 100.0
    _, velocity = draw_near(np.random.default_rng(0), far, SPACE)
    # Eight standard deviations of the widest movement, not a hundred radians of extrapolation.
    assert np.abs(velocity).max() < 2.0


def test_recovery_spreads_over_all_clusters_as_often_as_they_were_seen() -> None:
    root = np.arange(9.0)
    spread = spread_over_clusters(np.random.default_rng(4), SPACE, COUNT, root, 0.1 * SPACE.sigma)
    labels = MODEL.automaton.last_symbols[spread.extra[STATES]]
    shares = np.bincount(labels, minlength=CLUSTERS) / COUNT
    assert np.allclose(shares, 1.0 / CLUSTERS, atol=0.04)
    assert np.allclose(spread.poses[:, :ROOT].mean(axis=0), root[:ROOT], atol=0.01)
    for label in range(CLUSTERS):
        rows = labels == label
        assert np.abs(spread.poses[rows, ROOT:].mean(axis=0) - MODEL.poses_only.means[label]).max() < 0.08
    assert np.all((spread.poses >= SPACE.lower) & (spread.poses <= SPACE.upper))
    assert spread.extra[VELOCITY].shape == (COUNT, 6)


def test_the_model_may_be_added_during_a_run() -> None:
    poses = turning_poses(9, 14)
    last = ParticleSet(np.tile(poses[13], (200, 1)), np.full(200, -np.log(200)))
    carried = FilterState(last, poses[13], poses[12])
    found = walkers_from(np.random.default_rng(0), carried, np.arange(200), np.zeros(200, dtype=bool), SPACE)
    assert np.allclose(found.velocity, (poses[13] - poses[12])[ROOT:])
    assert (MODEL.automaton.last_symbols[found.states] == 13 // DWELL).mean() > 0.95


def test_expected_are_the_clusters_that_hold_enough_particles_at_the_mean_root() -> None:
    states = np.array([MODEL.automaton.state_after([label]) for label in [2] * 60 + [0] * 37 + [1] * 3])
    poses = np.random.default_rng(0).normal(size=(100, 9))
    particles = ParticleSet(poses, np.zeros(100), extra={STATES: states, VELOCITY: np.zeros((100, 6))})
    places = foresee(particles, SPACE, support=0.05, most=4)
    assert np.allclose(places[:, ROOT:], MODEL.poses_only.means[[2, 0]])
    assert np.allclose(places[:, :ROOT], poses[:, :ROOT].mean(axis=0))
    assert len(foresee(particles, SPACE, support=0.0, most=2)) == 2
    assert np.allclose(foresee(particles, SPACE, support=0.9)[0, ROOT:], MODEL.poses_only.means[2])
    plain = dataclasses.replace(particles, extra={})
    assert np.allclose(foresee(plain, SPACE), poses.mean(axis=0))
    assert np.allclose(foresee(particles, toy_space(9)), poses.mean(axis=0))
