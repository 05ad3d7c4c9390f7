"""What a guided set keeps of its past, how states follow movement, and how model-free particles are compared."""

import dataclasses

import numpy as np
import pytest
from toy_problems import Bowl
from turning_behaviour import CLUSTERS, FPS, ROOT, guided_space, toy_model, turning_poses

from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.trackers import online_learning
from studio.search.trackers.guided_particles import (
    STATES,
    VELOCITY,
    GuidedParticles,
    _labels_of,
    _movement_given_angles,
    followed,
    foresee,
    is_guided,
    propagated,
    spread_over_clusters,
    walkers_from,
)
from studio.search.trackers.guided_start import (
    CAME_FROM_STATES,
    CAME_FROM_VELOCITY,
    _packed,
    arrived,
    constrain_set,
    descended,
    guided_set,
    without_past,
)
from studio.search.trackers.guided_swarm import (
    BEFORE,
    BEFORE_STATE,
    LEADER_STATE,
    LEADER_VELOCITY,
    handed_on,
    leader_arrived,
    predicted_starts,
)
from studio.search.trackers.model_free import BEATEN, FREE, chosen_free, compare_kinds, share_in, share_of
from studio.search.trackers.particles import CAME_FROM
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import BehaviourSettings
from studio.search.trackers.tracker import FilterState, ParticleSet

Array = np.ndarray
SPACE, MODEL = guided_space(), toy_model()
REDRAW = BehaviourSettings(constraints="redraw", model_free_share=0.25, diffusion_scale=1.0)


def numbers() -> RandomNumbers:
    """Those of a layer, none drawn yet."""
    return RandomNumbers(3, 1, 0)


def past_of(count: int, frame: int = 12) -> tuple[FilterState, Array]:
    """What a frame left of particles that followed the truth, and their states."""
    poses = turning_poses(9, frame + 1)
    states = np.full(count, MODEL.automaton.state_after(MODEL.labels(poses)))
    movement = np.tile((poses[-1] - poses[-2])[ROOT:], (count, 1))
    particles = ParticleSet(
        np.tile(poses[-1], (count, 1)),
        np.full(count, -np.log(count)),
        extra={STATES: states, VELOCITY: movement},
    )
    return FilterState(particles, poses[-1], poses[-2]), states


class Forbidding(Bowl):
    """Only poses whose first parameter is that of the last frame, to the last digit, are possible, if any is."""

    def __init__(self, kept: float) -> None:
        super().__init__(np.zeros(9))
        self.kept = kept

    def feasible(self, poses: Array, limbs_apart: bool = False) -> Array:
        return poses[:, 0] == self.kept


def test_a_particle_for_which_nothing_is_possible_stays_with_its_state_and_at_rest() -> None:
    previous, states = past_of(20)
    first = guided_set(numbers(), previous, np.arange(20), SPACE, REDRAW)
    assert first.extra[FREE].sum() == 5
    start = previous.particles.poses
    found = constrain_set(numbers(), first, Forbidding(start[0, 0]), SPACE, REDRAW)
    np.testing.assert_array_equal(found.poses, start)
    np.testing.assert_array_equal(found.extra[STATES], states)
    assert not found.extra[VELOCITY].any()
    np.testing.assert_array_equal(found.extra[CAME_FROM_VELOCITY], previous.particles.extra[VELOCITY])
    free = constrain_set(numbers(), first, Bowl(np.zeros(9)), SPACE, REDRAW)
    np.testing.assert_array_equal(free.poses, first.poses)
    np.testing.assert_array_equal(free.extra[STATES], first.extra[STATES])
    np.testing.assert_array_equal(free.extra[VELOCITY], first.extra[VELOCITY])


class OneAtATime(Bowl):
    """Impossible where the first parameter went down."""

    def __init__(self, start: float) -> None:
        super().__init__(np.zeros(9))
        self.start = start

    def feasible(self, poses: Array, limbs_apart: bool = False) -> Array:
        return poses[:, 0] >= self.start


def test_impossible_particles_are_moved_again_and_have_states_of_the_automaton() -> None:
    previous, _ = past_of(40)
    first = guided_set(numbers(), previous, np.arange(40), SPACE, REDRAW)
    start = float(previous.particles.poses[0, 0])
    found = constrain_set(numbers(), first, OneAtATime(start), SPACE, REDRAW)
    assert (found.poses[:, 0] >= start).all()
    good = first.poses[:, 0] >= start
    assert 5 < good.sum() < 35
    np.testing.assert_array_equal(found.poses[good], first.poses[good])
    np.testing.assert_array_equal(found.extra[STATES][good], first.extra[STATES][good])
    assert (found.extra[STATES] >= 0).all()
    assert (found.extra[STATES] < MODEL.states).all()
    ignored = dataclasses.replace(REDRAW, constraints="reject")
    assert constrain_set(numbers(), first, OneAtATime(start), SPACE, ignored) is first


def test_a_guided_set_keeps_what_it_came_from_and_movements_that_pass_a_limit_are_zero() -> None:
    previous, states = past_of(30)
    first = guided_set(numbers(), previous, np.arange(29, -1, -1), SPACE, REDRAW)
    np.testing.assert_array_equal(first.extra[CAME_FROM], previous.particles.poses)
    np.testing.assert_array_equal(first.extra[CAME_FROM_STATES], states)
    assert BEATEN not in first.extra
    previous.particles.extra[BEATEN] = np.array([0.6])
    assert guided_set(numbers(), previous, np.arange(30), SPACE, REDRAW).extra[BEATEN][0] == 0.6
    high = first.poses[:, ROOT].max() - 1e-6
    narrow = dataclasses.replace(SPACE, upper=np.where(np.arange(9) == ROOT, high, SPACE.upper))
    clamped = guided_set(
        numbers(),
        past_of(30)[0],
        np.arange(29, -1, -1),
        narrow,
        dataclasses.replace(REDRAW, constraints="clamp"),
    )
    beyond = first.poses[:, ROOT] > high
    assert beyond.any()
    np.testing.assert_array_equal(clamped.poses[:, ROOT], np.minimum(first.poses[:, ROOT], high))
    np.testing.assert_array_equal(
        clamped.extra[VELOCITY][:, 0], np.where(beyond, 0.0, first.extra[VELOCITY][:, 0])
    )
    np.testing.assert_array_equal(clamped.extra[VELOCITY][:, 1:], first.extra[VELOCITY][:, 1:])


def test_in_a_runs_first_frame_there_is_noise_alone() -> None:
    previous, _ = past_of(25)
    begun = FilterState(ParticleSet(previous.particles.poses, previous.particles.log_weights))
    found = guided_set(
        numbers(), begun, np.arange(25), SPACE, dataclasses.replace(REDRAW, constraints="ignore")
    )
    np.testing.assert_allclose(found.poses, begun.particles.poses + SPACE.sigma * numbers().normals(25, 9))
    assert set(found.extra) == {STATES, VELOCITY}
    assert set(constrain_set(numbers(), found, Bowl(np.zeros(9)), SPACE, REDRAW).extra) == {STATES, VELOCITY}


def test_arrays_of_a_set_descend_from_first_parents_and_end_without_their_past() -> None:
    extra = {
        STATES: np.arange(3), VELOCITY: np.arange(6.0).reshape(3, 2), CAME_FROM: np.arange(9.0).reshape(3, 3),
        CAME_FROM_STATES: np.arange(3) + 5, CAME_FROM_VELOCITY: np.ones((3, 2)), FREE: np.ones(3, bool),
        BEATEN: np.array([0.4]),
    }  # fmt: skip
    found = descended(extra, np.array([2, 2, 0]))
    assert set(found) == set(extra) - {FREE}
    assert found[STATES].tolist() == [2, 2, 0]
    assert found[CAME_FROM][:, 0].tolist() == [6.0, 6.0, 0.0]
    assert found[BEATEN] is extra[BEATEN]
    assert set(without_past(extra)) == {STATES, VELOCITY, FREE, BEATEN}
    packed = _packed(GuidedParticles(extra[CAME_FROM], extra[STATES], extra[VELOCITY], extra[FREE]))
    np.testing.assert_array_equal(packed.velocities, [[0.0, 1.0, 1.0], [2.0, 3.0, 2.0], [4.0, 5.0, 3.0]])


def test_at_a_frames_end_states_follow_by_the_movement_from_where_a_particle_came() -> None:
    poses = turning_poses(9, 15)
    state = MODEL.automaton.state_after(MODEL.labels(poses[:13]))
    extra = {
        CAME_FROM: np.tile(poses[12], (4, 1)), CAME_FROM_STATES: np.full(4, state), STATES: np.zeros(4, np.int64),
        CAME_FROM_VELOCITY: np.zeros((4, 6)), VELOCITY: np.zeros((4, 6)),
    }  # fmt: skip
    for steps, frame in ((1, 13), (2, 14)):
        space = dataclasses.replace(SPACE, steps=steps)
        found = arrived(np.random.default_rng(0), np.tile(poses[frame], (4, 1)), extra, space)
        movement = (poses[frame] - poses[12])[ROOT:] / steps
        np.testing.assert_allclose(found[VELOCITY], np.tile(movement, (4, 1)))
        label = int(MODEL.mixture.labels(np.concatenate([poses[frame, ROOT:], movement])[None])[0])
        expected = state
        for _ in range(steps):
            expected = MODEL.automaton.next_state[expected, label]
        assert found[STATES].tolist() == [expected] * 4
        assert set(found) == {STATES, VELOCITY}


def test_states_step_as_often_as_the_automaton_does_in_so_many_frames() -> None:
    """At a third of the rate one frame has three steps; at twice the rate half of the particles make one."""
    poses = turning_poses(9, 14)
    angles, velocity = (
        np.tile(poses[-1, ROOT:], (4000, 1)),
        np.tile((poses[-1] - poses[-2])[ROOT:], (4000, 1)),
    )
    start = np.full(4000, MODEL.automaton.state_after(MODEL.labels(poses)[:3]))
    label = int(MODEL.labels(poses)[-1])
    path = [int(start[0])]
    for _ in range(4):
        path.append(int(MODEL.automaton.next_state[path[-1], label]))
    assert path[0] != path[1]
    rng = np.random.default_rng(0)
    assert set(followed(rng, MODEL, start, angles, velocity, 3)) == {path[3]}
    third = MODEL.at_rate(FPS / 3.0)
    assert set(followed(rng, third, start, angles, 3.0 * velocity)) == {path[3]}
    double = MODEL.at_rate(2.0 * FPS)
    found = followed(rng, double, start, angles, 0.5 * velocity)
    assert np.isin(found, path[:2]).all()
    assert np.mean(found == path[1]) == pytest.approx(0.5, abs=0.04)


def test_particles_without_a_model_keep_their_movement_and_have_all_of_the_noise() -> None:
    previous, states = past_of(2000)
    free = np.arange(2000) % 2 == 0
    past = walkers_from(np.random.default_rng(0), previous, np.arange(2000), free, SPACE)
    rules = dataclasses.replace(REDRAW, global_scale=0.3)
    found = propagated(np.random.default_rng(1), past, SPACE, rules, SPACE.sigma)
    noise = np.random.default_rng(1).standard_normal((2000, 9)) * SPACE.sigma
    np.testing.assert_allclose(found.poses[free], past.poses[free] + noise[free])
    np.testing.assert_allclose(
        found.poses[~free, :ROOT], past.poses[~free, :ROOT] + 0.3 * noise[~free, :ROOT]
    )
    np.testing.assert_array_equal(found.velocity[free], past.velocity[free])
    assert (found.velocity[~free] != past.velocity[~free]).any(axis=1).mean() > 0.5
    labels = MODEL.mixture.labels(np.concatenate([found.poses[free, ROOT:], past.velocity[free]], axis=1))
    np.testing.assert_array_equal(found.states[free], MODEL.automaton.next_state[states[free], labels])


def test_a_model_added_during_a_run_takes_the_movement_of_the_reported_pose() -> None:
    previous, _ = past_of(10)
    plain = dataclasses.replace(previous, particles=dataclasses.replace(previous.particles, extra={}))
    two = dataclasses.replace(SPACE, steps=2)
    found = walkers_from(np.random.default_rng(0), plain, np.array([1, 1, 3]), np.zeros(3, bool), two)
    movement = (previous.estimate - previous.previous_estimate)[ROOT:] / 2.0
    np.testing.assert_allclose(found.velocity, np.tile(movement, (3, 1)))
    assert found.poses.shape == (3, 9)
    for state in (
        dataclasses.replace(plain, previous_estimate=None),
        dataclasses.replace(plain, estimate=None),
    ):
        drawn = walkers_from(np.random.default_rng(0), state, np.array([0, 1]), np.zeros(2, bool), SPACE)
        assert np.abs(drawn.velocity).max() > 0.0
    assert is_guided(SPACE, "behaviour")
    assert not is_guided(SPACE, "noise")
    assert not is_guided(dataclasses.replace(SPACE, behaviour=None), "behaviour")


def test_a_movement_given_angles_is_the_regression_but_far_outside_no_farther_than_at_its_edge() -> None:
    rng = np.random.default_rng(0)
    square = rng.normal(size=(4, 4))
    covariance, mean = square @ square.T + 0.1 * np.eye(4), rng.normal(size=4)
    mixture = GaussianMixture(np.ones(1), mean[None], covariance[None])
    slope = covariance[2:, :2] @ np.linalg.inv(covariance[:2, :2])
    rest = covariance[2:, 2:] - slope @ covariance[:2, 2:]
    root = np.linalg.cholesky(covariance[:2, :2])
    way = np.array([0.6, 0.8])
    edge = np.sqrt(2.0) + 3.0
    for far, used in ((0.5, 0.5), (edge - 0.01, edge - 0.01), (50.0, edge)):
        angles = (mean[:2] + far * root @ way)[None]
        found = _movement_given_angles(mixture, 0, angles, np.zeros((1, 2)))
        np.testing.assert_allclose(found[0], mean[2:] + slope @ (used * root @ way), rtol=1e-9)
        spread = [
            _movement_given_angles(mixture, 0, angles, noise[None])[0] - found[0] for noise in np.eye(2)
        ]
        np.testing.assert_allclose(np.transpose(spread) @ spread, rest, atol=1e-9)
    np.testing.assert_allclose(
        _movement_given_angles(mixture, 0, mean[None, :2], np.zeros((1, 2)))[0], mean[2:]
    )


def test_clusters_that_hold_enough_particles_are_foreseen_the_fullest_first() -> None:
    symbols = MODEL.automaton.last_symbols
    of_cluster = [int(np.flatnonzero(symbols == label)[0]) for label in range(CLUSTERS)]
    counts = (10, 50, 4, 36)
    states = np.concatenate([np.full(count, state) for count, state in zip(counts, of_cluster, strict=True)])
    poses = np.zeros((100, 9))
    poses[:, 0] = np.arange(100)
    particles = ParticleSet(poses, np.zeros(100), extra={STATES: states, VELOCITY: np.zeros((100, 6))})
    means = MODEL.poses_only.means
    for support, most, chosen in (
        (0.05, 4, [1, 3, 0]),
        (0.04, 4, [1, 3, 0, 2]),
        (0.05, 2, [1, 3]),
        (0.9, 4, [1]),
        (0.0, 9, [1, 3, 0, 2]),
    ):
        found = foresee(particles, SPACE, support, most)
        np.testing.assert_allclose(
            found[:, ROOT:], np.clip(means[chosen], SPACE.lower[ROOT:], SPACE.upper[ROOT:])
        )
        np.testing.assert_allclose(found[:, 0], np.clip(49.5, SPACE.lower[0], SPACE.upper[0]))
    np.testing.assert_array_equal(_labels_of(MODEL, particles), symbols[states])
    bare = dataclasses.replace(particles, extra={})
    assert foresee(bare, SPACE)[:, 0].tolist() == [49.5]


def test_a_recovery_is_spread_about_a_root_and_over_all_clusters() -> None:
    root, sigma = np.arange(9.0) * 0.1, np.where(np.arange(9) < ROOT, 0.2, 0.0)
    found = spread_over_clusters(np.random.default_rng(0), SPACE, 3000, root, sigma)
    np.testing.assert_allclose(found.poses[:, :ROOT].mean(axis=0), root[:ROOT], atol=0.02)
    np.testing.assert_allclose(found.poses[:, :ROOT].std(axis=0), 0.2, rtol=0.05)
    labels = MODEL.automaton.last_symbols[found.extra[STATES]]
    for label in range(CLUSTERS):
        own = found.poses[labels == label, ROOT:]
        np.testing.assert_allclose(own.mean(axis=0), MODEL.poses_only.means[label], atol=0.1)
    assert (found.poses <= SPACE.upper).all()


# ------------------------------------------------------------------ model-free shares


def test_the_share_grows_from_a_half_to_three_quarters() -> None:
    for beaten, share in ((0.2, 0.1), (0.5, 0.1), (0.6, 0.1 + 0.8 * 0.4), (0.75, 0.9), (1.0, 0.9)):
        assert share_of(0.1, True, {BEATEN: np.array([beaten])}) == pytest.approx(share)
    sure = {BEATEN: np.array([1.0])}
    assert share_of(0.95, True, sure) == 0.95
    assert (share_of(0.1, False, sure), share_of(0.1, True, {}), share_of(0.0, True, sure)) == (0.1, 0.1, 0.0)


def test_free_particles_are_any_and_one_at_least_unless_there_are_none() -> None:
    order = np.random.default_rng(0).permutation(40)
    for share, count in ((0.25, 10), (0.01, 1), (1.0, 40), (0.0, 0)):
        rng = np.random.default_rng(0)
        found = chosen_free(rng, 40, share)
        assert set(np.flatnonzero(found)) == set(order[:count])
        assert rng.random() == _after_permutation()
    assert share_in({FREE: np.array([True, False, False, True])}) == 0.5
    assert np.isnan(share_in({}))


def _after_permutation() -> float:
    rng = np.random.default_rng(0)
    rng.permutation(40)
    return rng.random()


def test_kinds_are_compared_by_mean_weights_with_which_a_tenth_survives_and_smoothed() -> None:
    free = np.arange(100) < 30
    # Two levels: ten of all weigh most; with a tenth surviving nothing else does.
    log_weights = np.where(np.arange(100) % 10 == 0, 0.0, -1.0)
    of_free, of_guided = 3.0 / 30.0, 7.0 / 70.0
    now = of_free / (of_free + of_guided)
    found = compare_kinds({FREE: free}, log_weights)
    assert found[BEATEN][0] == pytest.approx(0.25 * now, rel=1e-3)
    again = compare_kinds({FREE: free, BEATEN: np.array([0.8])}, np.where(np.arange(100) < 10, 0.0, -1.0))
    assert again[BEATEN][0] == pytest.approx(0.75 * 0.8 + 0.25, rel=1e-3)
    for alike in (np.ones(4, bool), np.zeros(4, bool)):
        extra = {FREE: alike}
        assert compare_kinds(extra, np.arange(4.0)) is extra
    assert compare_kinds({}, np.zeros(2)) == {}


# ------------------------------------------------------------------ swarms


def test_a_swarms_starts_are_predicted_from_its_leaders_past_and_handed_on() -> None:
    previous, states = past_of(3)
    extra = {
        LEADER_STATE: states[:1],
        LEADER_VELOCITY: previous.particles.extra[VELOCITY][:1],
        BEATEN: np.array([0.3]),
    }
    carried = dataclasses.replace(previous, particles=dataclasses.replace(previous.particles, extra=extra))
    poses, arrays = predicted_starts(np.random.default_rng(0), carried, previous.estimate, 40, SPACE, REDRAW)
    assert poses.shape == (40, 9)
    assert arrays[FREE].sum() == 10
    np.testing.assert_array_equal(arrays[BEFORE], previous.estimate[None])
    assert arrays[BEFORE_STATE].tolist() == states[:1].tolist()
    assert arrays[BEATEN][0] == 0.3
    # Without noise: what the model does not cover stays, and free particles stay altogether.
    np.testing.assert_array_equal(poses[:, :ROOT], np.tile(previous.estimate[:ROOT], (40, 1)))
    np.testing.assert_array_equal(poses[arrays[FREE]], np.tile(previous.estimate, (10, 1)))
    assert set(handed_on(arrays)) == {BEFORE, BEFORE_STATE, BEATEN}
    assert handed_on({STATES: states}) == {}


def test_a_leaders_state_follows_from_the_last_leaders() -> None:
    previous, states = past_of(1)
    leader, two = turning_poses(9, 15)[14], dataclasses.replace(SPACE, steps=2)
    extra = {
        BEFORE: previous.estimate[None],
        BEFORE_STATE: states,
        STATES: states,
        VELOCITY: np.ones((1, 6)),
        "kept": states,
    }
    found = leader_arrived(np.random.default_rng(0), leader, extra, two)
    assert set(found) == {"kept", LEADER_STATE, LEADER_VELOCITY}
    movement = (leader - previous.estimate)[None, ROOT:] / 2.0
    np.testing.assert_allclose(found[LEADER_VELOCITY], movement)
    expected = followed(np.random.default_rng(0), MODEL, states, leader[None, ROOT:], movement, 2)
    np.testing.assert_array_equal(found[LEADER_STATE], expected)
    first = leader_arrived(np.random.default_rng(0), leader, {"kept": states}, SPACE)
    assert set(first) == {"kept", LEADER_STATE, LEADER_VELOCITY}


# ------------------------------------------------------------------ lessons


def test_a_frame_is_well_tracked_from_three_deviations_below_the_median_on() -> None:
    weights = np.array(
        [-1.0, 0.0, 1.0, 2.0, 3.0, 1.0 - 3.0 * 1.4826 + 0.01, 1.0 - 3.0 * 1.4826 - 0.01, 1.0, 1.0]
    )
    overlaps = np.full(9, 0.5)
    # The median is 1, the median distance from it 1.
    assert np.flatnonzero(~online_learning.well_tracked(weights, overlaps, 0.5)).tolist() == [6]
    assert not online_learning.well_tracked(weights, overlaps, 0.51).any()


def test_the_shortest_stretch_is_three_tenths_of_a_second() -> None:
    poses, good = turning_poses(9, 60), np.zeros(60, bool)
    good[:17], good[20:38] = True, True
    assert [len(one) for one in online_learning.stretches(poses, good, MODEL)] == [18]


def test_a_frame_is_new_beyond_six_variances_of_every_cluster() -> None:
    """Along a way out of a cluster; a deviation is the mean over the features."""
    dynamics, way = MODEL.dynamics, np.linalg.cholesky(MODEL.dynamics.covariances[2]) @ np.ones(12)
    features = dynamics.means[2] + np.linspace(0.0, 4.0, 400)[:, None] * way
    away = features[:, None] - dynamics.means
    squared = np.einsum("nki,kij,nkj->nk", away, np.linalg.inv(dynamics.covariances), away) / 12.0
    least = squared.min(axis=1)
    assert ((least > 5.5) & (least < 6.0)).any()
    assert ((least > 6.0) & (least < 6.5)).any()
    np.testing.assert_array_equal(online_learning.novel(MODEL, features), least > 6.0)


def test_both_mixtures_components_are_joined_by_their_share() -> None:
    joined = online_learning._joined(MODEL.dynamics, MODEL.dynamics, 0.2)
    np.testing.assert_allclose(
        joined.weights, np.concatenate([0.8 * MODEL.dynamics.weights, 0.2 * MODEL.dynamics.weights])
    )
    np.testing.assert_array_equal(joined.means, np.concatenate([MODEL.dynamics.means] * 2))
    np.testing.assert_array_equal(joined.covariances, np.concatenate([MODEL.dynamics.covariances] * 2))


def test_poses_are_taken_between_frames_to_the_rate_that_was_learnt_at() -> None:
    slower = MODEL.at_rate(FPS / 2.0)
    poses = turning_poses(9, 11)
    found = online_learning._at_learnt_rate(poses, slower)
    expected = [np.interp(np.arange(21) / 2.0, np.arange(11), column) for column in poses.T]
    np.testing.assert_allclose(found, np.transpose(expected))
    assert online_learning._at_learnt_rate(poses, MODEL) is poses
