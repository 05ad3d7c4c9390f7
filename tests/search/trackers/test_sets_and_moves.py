"""What filters make of a set: moments, estimates, records; and the tempered filter's ladder and moves one by one."""

import math

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from toy_problems import Bowl, HalfBowl, toy_space

from studio.foundations.errors import RunError
from studio.search.trackers import tempered
from studio.search.trackers.annealing import Annealed
from studio.search.trackers.counted_numbers import OF_CUTS, OF_KINDS, OF_MOVES
from studio.search.trackers.frame_loop import SearchState
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.layer_record import layer_record, search_notes
from studio.search.trackers.particle_kernels import root_of
from studio.search.trackers.particles import (
    CAME_FROM,
    WeightError,
    checked_values,
    constrain_first,
    estimate,
    first_set,
    heaviest,
    predict,
    uniform_poses,
    unweighted,
    weigh,
    weighted_mean,
    weighted_variance,
)
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.settings import AnnealedSettings, TemperedSettings
from studio.search.trackers.tracker import FilterState, LayerRecord, ParticleSet, SearchSpace

Array = np.ndarray
NUMBERS = RandomNumbers(5, 2, 3)
WHOLE, ONE_LIMB, EXCHANGE = 0, 1, 2


def weighted_set(seed: int = 0, count: int = 9, size: int = 4) -> ParticleSet:
    rng = np.random.default_rng(seed)
    weights = rng.random(count)
    return ParticleSet(
        rng.normal(3.0, 2.0, (count, size)), np.log(weights / weights.sum()), rng.normal(size=count)
    )


def test_mean_and_variance_are_those_by_the_weights() -> None:
    particles = weighted_set()
    weights = np.exp(particles.log_weights)
    mean = np.average(particles.poses, axis=0, weights=weights)
    np.testing.assert_allclose(weighted_mean(particles), mean)
    covariance = np.cov(particles.poses.T, aweights=weights, bias=True)
    np.testing.assert_allclose(weighted_variance(particles), np.diag(covariance))
    equal = unweighted(particles.poses)
    np.testing.assert_allclose(weighted_variance(equal), particles.poses.var(axis=0))
    assert np.exp(equal.log_weights).sum() == pytest.approx(1.0)


def test_the_heaviest_is_the_likeliest_of_those_that_weigh_most() -> None:
    log_weights = np.log([0.1, 0.3, 0.3, 0.3])
    particles = ParticleSet(np.arange(8.0).reshape(4, 2), log_weights, np.array([9.0, 1.0, 4.0, 2.0]))
    assert heaviest(particles) == 2
    mode, mean = estimate(particles, "mode"), estimate(particles, "mean")
    assert mode.pose.tolist() == mode.mode.tolist() == mean.mode.tolist() == [4.0, 5.0]
    np.testing.assert_allclose(mean.pose, [0.3 * (2.0 + 4.0 + 6.0), 0.1 + 0.3 * (3.0 + 5.0 + 7.0)])
    assert mode.log_weight == mean.log_weight == 4.0


def test_a_set_is_predicted_by_the_last_movement_of_the_reported_pose() -> None:
    poses, now, before = np.arange(4.0).reshape(2, 2), np.array([3.0, 5.0]), np.array([1.0, 9.0])
    moving = FilterState(None, now, before)
    np.testing.assert_array_equal(predict(poses, moving, "constant_velocity"), poses + np.array([2.0, -4.0]))
    for state, dynamics in (
        (moving, "none"),
        (FilterState(None, now), "constant_velocity"),
        (FilterState(None, None, before), "constant_velocity"),
    ):
        assert predict(poses, state, dynamics) is poses


def test_a_uniform_set_is_that_of_shares_between_the_limits() -> None:
    space = toy_space(3, limit=2.0)
    found = uniform_poses(NUMBERS, 50, space)
    np.testing.assert_allclose(found, -2.0 + 4.0 * NUMBERS.shares(50, 3))
    for lower, upper in ((-np.inf, 2.0), (-2.0, np.inf)):
        space.lower[1], space.upper[1] = lower, upper
        with pytest.raises(RunError, match="'x1' has none"):
            uniform_poses(NUMBERS, 5, space)


def test_impossible_poses_have_no_weight_unless_none_is_possible_or_constraints_are_ignored() -> None:
    poses = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 2.0]])
    for rules, at, barred in (("reject", poses, [1]), ("ignore", poses, []), ("reject", poses[1:2], [])):
        raw, eligible = weigh(HalfBowl(np.zeros(2)), at, AnnealedSettings(constraints=rules))
        np.testing.assert_allclose(raw, -(at**2).sum(axis=1))
        assert np.flatnonzero(np.isneginf(eligible)).tolist() == barred
        kept = np.delete(np.arange(len(at)), barred)
        np.testing.assert_array_equal(eligible[kept], raw[kept])


def test_values_that_are_no_finite_number_for_each_pose_are_refused() -> None:
    assert checked_values(np.array([1, 2]), 2).dtype == np.float64
    for values in (np.array([1.0, np.nan]), np.array([-np.inf, 1.0]), np.ones(3), np.ones((2, 1))):
        with pytest.raises(WeightError):
            checked_values(values, 2)


def test_a_frames_first_set_is_spread_by_sigma_and_keeps_where_it_came_from_to_be_drawn_again() -> None:
    space, predicted = toy_space(3, limit=1.0, sigma=0.5), np.linspace(-1.2, 1.2, 21).reshape(7, 3)
    spread = predicted + 2.0 * 0.5 * NUMBERS.normals(7, 3)
    assert (np.abs(spread) > 1.0).any()
    for rules, poses in (("redraw", spread), ("reject", spread), ("clamp", np.clip(spread, -1.0, 1.0))):
        found = first_set(NUMBERS, predicted, space, AnnealedSettings(constraints=rules, diffusion_scale=2.0))
        np.testing.assert_allclose(found.poses, poses)
        assert list(found.extra) == ([CAME_FROM] if rules == "redraw" else [])


def test_first_poses_that_are_impossible_are_drawn_again_from_where_they_came() -> None:
    space = toy_space(2, limit=9.0, sigma=0.5)
    rules = AnnealedSettings(constraints="redraw", diffusion_scale=1.0)
    predicted, last = np.array([[0.0, 1.0]] * 12), RandomNumbers(5, 2, 7, search=1)
    first = first_set(last.beginning, predicted, space, rules)
    wrong = first.poses[:, 0] > 0.0
    assert 0 < wrong.sum() < 12
    found = constrain_first(last, first, HalfBowl(np.zeros(2)), space, rules)
    assert (found.poses[:, 0] <= 0.0).all()
    np.testing.assert_array_equal(found.poses[~wrong], first.poses[~wrong])
    assert found.extra == {}
    other = ParticleSet(first.poses, first.log_weights, extra={"kept": predicted})
    assert constrain_first(last, other, HalfBowl(np.zeros(2)), space, rules) is other


def test_a_search_that_has_not_begun_has_done_nothing() -> None:
    begun = SearchState()
    assert (begun.layers_done, begun.layer_count, begun.evaluations, begun.settings_version) == (0, 0, 0, 0)
    assert begun.milliseconds == 0.0


def test_a_root_is_the_lower_one_of_cholesky_and_leaves_out_what_does_not_vary_of_its_own() -> None:
    rng = np.random.default_rng(0)
    correlations = np.corrcoef(rng.normal(size=(5, 40)))
    np.testing.assert_allclose(root_of(correlations), np.linalg.cholesky(correlations), atol=1e-12)
    drawn = rng.normal(size=(5, 40))
    drawn[2], drawn[4] = 0.0, drawn[0] - drawn[1]
    covariance = drawn @ drawn.T / 40.0
    root = root_of(covariance)
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-9)
    np.testing.assert_array_equal(np.triu(root, 1), 0.0)
    assert root[2].tolist() == root[:, 2].tolist() == root[:, 4].tolist() == [0.0] * 5
    # The least pivot that counts is a thousand-millionth.
    assert root_of(np.diag([0.9e-9, 1.1e-9])).tolist() == [[0.0, 0.0], [0.0, pytest.approx(np.sqrt(1.1e-9))]]


# ------------------------------------------------------------------ records


def test_a_record_says_what_the_weighted_set_is() -> None:
    particles, annealed = weighted_set(), Annealed(0.7, 0.4, np.zeros(9))
    kept, spread = np.full(4, 2.0), np.full(4, 3.0)
    found = layer_record(5, particles, annealed, 0.45, resampled=kept, diffused=spread, free=0.2)
    best = heaviest(particles)
    assert (found.layer, found.beta, found.alpha_wanted, found.alpha_reached) == (5, 0.7, 0.45, 0.4)
    np.testing.assert_allclose(found.variance_weighed, particles.poses.var(axis=0))
    assert found.variance_resampled is kept
    assert found.variance_diffused is spread
    np.testing.assert_array_equal(found.best, particles.poses[best])
    assert found.best_log_weight == particles.raw_log_weights[best]
    np.testing.assert_allclose(found.mean, weighted_mean(particles))
    assert found.poses is particles.poses
    assert found.log_weights is particles.raw_log_weights
    assert (found.model_free_share, found.parents.shape) == (0.2, (2, 0))


def noted(
    poses: Array, log_weights: Array, alpha: float, rows: Array | None = None, layer: int = 0
) -> LayerRecord:
    zeros = np.zeros(poses.shape[1])
    return LayerRecord(
        layer=layer, alpha_reached=alpha, variance_weighed=zeros, variance_resampled=zeros, variance_diffused=zeros,
        best=poses[0], best_log_weight=0.0, mean=zeros, poses=poses, log_weights=log_weights,
        rows=np.zeros(0, np.int64) if rows is None else rows,
    )  # fmt: skip


def test_notes_tell_of_equal_weights_of_one_that_holds_all_and_of_one_pose() -> None:
    apart, alike, rising = np.arange(8.0).reshape(4, 2), np.ones((4, 2)), np.arange(4.0)
    usual, equal = noted(apart, rising, 0.5), noted(apart, np.ones(4), 1.0)
    assert search_notes([usual, usual]) == ()
    (note,) = search_notes([usual, noted(apart, np.ones(4), 1.0, layer=2), equal])
    assert "layers 3, 1" in note
    assert "equal" in note
    (note,) = search_notes([noted(alike, np.ones(4), 1.0)])
    assert "one pose in layer 1" in note
    # Fewer than one and a half of four particles are effective.
    assert search_notes([noted(apart, rising, 1.49 / 4.0)]) != ()
    assert search_notes([noted(apart, rising, 1.51 / 4.0)]) == ()
    assert search_notes([noted(apart, rising, math.nan)]) == ()
    # Of a set of 100, of which four are recorded.
    rows = np.array([0, 33, 66, 99])
    assert search_notes([noted(apart, rising, 1.49 / 100.0, rows)]) != ()
    assert search_notes([noted(apart, rising, 1.51 / 100.0, rows)]) == ()
    assert search_notes([noted(apart[:1], np.ones(1), 1.0)]) == ()
    assert search_notes([noted(apart[:2], rising[:2], 0.5)]) != ()


# ------------------------------------------------------------------ the ladder


def ladder(
    temper: float = 0.2, evidence: float = -3.0, step: float = 0.4, walk: float = 0.5
) -> "tempered._Ladder":
    return tempered._Ladder(temper, evidence, step, walk)


def test_a_ladder_climbs_by_the_exponent_and_adds_the_mean_weight_to_the_evidence() -> None:
    eligible = np.array([-2.0, -np.inf, 0.5, 1.0])
    found = tempered._climb(ladder(), 0.3, eligible)
    assert found.temper == pytest.approx(0.5)
    assert found.log_evidence == pytest.approx(-3.0 + np.log(np.mean(np.exp(0.3 * eligible))))
    assert tempered._climb(ladder(), 0.0, eligible) == ladder()


@pytest.mark.parametrize(
    ("steps", "walks", "step", "walk"),
    [
        (0.25, 0.25, 0.4, 0.5),
        (0.375, 0.2, 0.6, 0.4),
        (0.05, 0.05, 0.2, 0.25),
        (0.9, 0.9, 0.8, 1.0),
        (np.nan, np.nan, 0.4, 0.5),
    ],
)
def test_steps_grow_and_shrink_by_the_share_taken_beside_a_quarter(
    steps: float, walks: float, step: float, walk: float
) -> None:
    moved = tempered._Moved(*[np.zeros(1)] * 4, 0.5, steps, walks)
    found = tempered._adapt_steps(ladder(), moved)
    assert (found.step, found.walk) == pytest.approx((step, walk))
    assert tempered._adapt_steps(ladder(step=0.8), moved).step <= 1.0
    assert (found.temper, found.log_evidence) == (0.2, -3.0)


def test_the_exponent_rises_until_the_share_survives_and_not_beyond_the_scale() -> None:
    eligible, knobs = -np.arange(40.0), TemperedSettings(likelihood_scale=0.5, survival=0.5)
    free, wanted = tempered._raise_exponent(eligible, 0.1, knobs, is_last=False)
    assert (free.survival, wanted) == (pytest.approx(0.5), 0.5)
    assert 0.0 < free.beta < 0.4
    for temper, is_last, beta in ((0.49, False, 0.01), (0.1, True, 0.4), (0.5, False, 0.0), (0.7, True, 0.0)):
        ended, wanted = tempered._raise_exponent(eligible, temper, knobs, is_last=is_last)
        assert ended.beta == pytest.approx(beta)
        assert math.isnan(wanted)


# ------------------------------------------------------------------ moves


def prior_of(space: SearchSpace) -> FramePrior:
    last = FilterState(ParticleSet(np.zeros((1, len(space.names))), np.zeros(1)))
    return FramePrior.of_frame(last, space, scale=1.0, dynamics="none", bounded=True)


def proposal(
    count: int = 60, size: int = 6, share: float = 0.5, limbs: float = 0.4
) -> tuple[ParticleSet, Array, ParticleSet]:
    """Moves proposed for survivors, these survivors, and the weighted set that they were drawn from."""
    space, particles = toy_space(size), weighted_set(3, count, size)
    survivors = tempered._Moved(
        particles.poses[::-1].copy(), np.arange(count), np.arange(count) + 0.5, np.ones(count)
    )
    knobs = TemperedSettings(crossover=share, limb_moves=limbs)
    return (
        tempered._propose_moves(NUMBERS, survivors, particles, ladder(), space, knobs),
        survivors.poses,
        particles,
    )


def test_each_survivor_has_one_of_three_moves_by_chance() -> None:
    made, poses, _ = proposal()
    kind, partner = made.extra[tempered.KIND], made.extra[tempered.PARTNER]
    shares = NUMBERS.shares(60, 3, OF_KINDS)
    paired = np.argsort(shares[:, 0])[:30]
    np.testing.assert_array_equal(np.sort(np.flatnonzero(kind == EXCHANGE)), np.sort(paired))
    alone = np.setdiff1d(np.arange(60), paired)
    np.testing.assert_array_equal(kind[alone], np.where(shares[alone, 1] < 0.4, ONE_LIMB, WHOLE))
    np.testing.assert_array_equal(partner[alone], alone)
    np.testing.assert_array_equal(partner[paired[0::2]], paired[1::2])
    np.testing.assert_array_equal(partner[partner], np.arange(60))
    np.testing.assert_array_equal(made.extra[tempered.BEFORE], poses)
    assert made.extra[tempered.BEFORE_RAW].tolist() == list(range(60))
    assert made.extra[tempered.LADDER].tolist() == [0.2, -3.0, 0.4, 0.5]
    for share, pairs in ((0.0, 0), (1.0, 60), (0.05, 2), (0.04, 2), (0.03, 0)):
        assert (proposal(share=share)[0].extra[tempered.KIND] == EXCHANGE).sum() == pairs


def test_pairs_exchange_the_limbs_between_the_same_cuts() -> None:
    made, poses, _ = proposal(size=12)
    kind, partner = made.extra[tempered.KIND], made.extra[tempered.PARTNER]
    limb, cuts = toy_space(12).limb + 1, NUMBERS.shares(60, 2, OF_CUTS)
    order = np.argsort(NUMBERS.shares(60, 3, OF_KINDS)[:, 0])
    exchanged = 0
    for one in order[:30:2]:
        low, high = np.sort(1 + np.floor(cuts[one] * 4))
        taken = (limb > low) & (limb <= high)
        exchanged += taken.any()
        for first in (one, partner[one]):
            expected = np.where(taken, poses[partner[first]], poses[first])
            np.testing.assert_array_equal(made.poses[first], expected)
    assert exchanged > 5
    assert (made.extra[tempered.BACK][kind == EXCHANGE] == 0.0).all()


def test_steps_and_walks_are_noise_with_the_weighted_sets_covariance() -> None:
    made, poses, particles = proposal()
    kind, weights = made.extra[tempered.KIND], np.exp(particles.log_weights)
    mean = weights @ particles.poses
    covariance = np.cov(particles.poses.T, aweights=weights, bias=True)
    deviation = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(deviation, deviation))
    noise = (NUMBERS.normals(60, 6) @ root.T) * deviation
    stepped = mean + np.sqrt(1.0 - 0.4**2) * (poses - mean) + 0.4 * noise
    np.testing.assert_allclose(made.poses[kind == WHOLE], stepped[kind == WHOLE], rtol=1e-6)
    limbs = np.floor(2.0 * NUMBERS.shares(60, 3, OF_KINDS)[:, 2])
    one = toy_space(6).limb == limbs[:, None]
    walked = poses + one * noise * 2.38 * 0.5 / np.sqrt(3.0)
    np.testing.assert_allclose(made.poses[kind == ONE_LIMB], walked[kind == ONE_LIMB], rtol=1e-6)
    # A step is likelier than the one back as its end is by the normal density.
    normal = multivariate_normal(mean, covariance)
    back = np.where(kind == WHOLE, normal.logpdf(made.poses) - normal.logpdf(poses), 0.0)
    np.testing.assert_allclose(made.extra[tempered.BACK], back, atol=1e-6)


@pytest.mark.parametrize("value", [4.0, 0.1, -1.7])
def test_directions_without_noise_stay_and_have_no_part_in_a_density(value: float) -> None:
    """A weighted mean of equal numbers is another number by rounding, of most."""
    particles = weighted_set(1, 40, 3)
    particles.poses[:, 1] = value
    normal = tempered._normal_of(particles)
    assert (normal.draw(NUMBERS)[:, 1] == value).all()
    assert normal.deviation[1] == 0.0
    weights = np.exp(particles.log_weights)
    covariance = np.cov(particles.poses[:, [0, 2]].T, aweights=weights, bias=True)
    own = multivariate_normal(weights @ particles.poses[:, [0, 2]], covariance).logpdf(
        particles.poses[:, [0, 2]]
    )
    found = tempered._log_normal(particles.poses, normal)
    np.testing.assert_allclose(found - found[0], own - own[0], atol=1e-6)
    nudged = particles.poses.copy()
    nudged[::2, 1] = np.nextafter(value, np.inf)
    np.testing.assert_allclose(tempered._log_normal(nudged, normal), found, atol=1e-12)


@pytest.mark.parametrize("temper", [0.3, 1.0])
def test_moves_are_taken_as_metropolis_and_hastings_say(temper: float) -> None:
    """Pairs both or neither, by the sum of what they gain and the smaller of both their numbers."""
    space = toy_space(2, limit=2.0, sigma=0.8)
    rng, prior, count = np.random.default_rng(2), prior_of(space), 200
    before, proposed = rng.uniform(-1.5, 1.5, (2, count, 2))
    proposed[::9] = 3.0
    bowl, knobs = Bowl(np.array([0.5, -0.2]), 0.6), TemperedSettings(constraints="reject")
    kind = np.where(np.arange(count) < 60, EXCHANGE, np.arange(count) % 2)
    partner = np.arange(count)
    partner[:60] = partner[:60].reshape(-1, 2)[:, ::-1].ravel()
    back = np.where(kind == WHOLE, rng.normal(size=count), 0.0)
    raw = bowl.log_likelihood(before)
    extra = {
        tempered.BEFORE: before,
        tempered.BEFORE_RAW: raw,
        tempered.BEFORE_ELIGIBLE: raw,
        tempered.BEFORE_PRIOR: prior.log_density(before),
        tempered.KIND: kind,
        tempered.PARTNER: partner,
        tempered.BACK: back,
    }
    found = tempered._take_moves(NUMBERS, unweighted(proposed, extra), bowl, temper, prior, knobs)
    shares = NUMBERS.shares(count, 1, OF_MOVES)[:, 0]

    def gain(n: int) -> float:
        likelier = temper * (bowl.log_likelihood(proposed[n : n + 1]) - raw[n])[0]
        return likelier + (prior.log_density(proposed) - prior.log_density(before))[n] - back[n]

    taken = np.zeros(count, bool)
    for n in range(count):
        if kind[n] == EXCHANGE:
            taken[n] = np.log(min(shares[n], shares[partner[n]])) < gain(n) + gain(int(partner[n]))
        else:
            taken[n] = np.log(shares[n]) < gain(n)
    assert 20 < taken.sum() < count - 20
    np.testing.assert_array_equal(found.poses, np.where(taken[:, None], proposed, before))
    np.testing.assert_allclose(found.raw, bowl.log_likelihood(found.poses))
    np.testing.assert_allclose(found.eligible, found.raw)
    np.testing.assert_allclose(found.prior, prior.log_density(found.poses))
    assert found.taken == taken.mean()
    assert found.of_steps == taken[kind == WHOLE].mean()
    assert found.of_walks == taken[kind == ONE_LIMB].mean()


def test_where_a_body_can_take_no_pose_all_moves_may_be_taken() -> None:
    space = toy_space(2)
    prior, problem = prior_of(space), HalfBowl(np.ones(2))
    before, proposed = np.full((6, 2), 0.1), np.full((6, 2), 1.0)
    for start, moves, possible in ((before, proposed, 1.0), (-before, proposed, 0.0)):
        raw = problem.log_likelihood(start)
        extra = {
            tempered.BEFORE: start,
            tempered.BEFORE_RAW: raw,
            tempered.BEFORE_ELIGIBLE: raw,
            tempered.BEFORE_PRIOR: np.full(6, -1e9),
            tempered.KIND: np.zeros(6, np.int64),
            tempered.PARTNER: np.arange(6),
            tempered.BACK: np.zeros(6),
        }
        found = tempered._take_moves(
            NUMBERS, unweighted(moves, extra), problem, 1.0, prior, TemperedSettings(constraints="reject")
        )
        assert found.taken == possible
        assert math.isnan(found.of_walks)


# ------------------------------------------------------------------ the prior


def test_a_prior_moves_on_scales_and_clips_what_the_last_frame_left() -> None:
    space = toy_space(2, limit=1.0, sigma=0.5)
    last = ParticleSet(np.array([[0.2, 0.9], [-0.4, 0.1]]), np.log([0.4, 0.6]))
    state = FilterState(last, np.array([0.5, 0.5]), np.array([0.3, 0.1]))
    for bounded, clipped in ((True, 1.0), (False, 1.3)):
        prior = FramePrior.of_frame(state, space, scale=3.0, dynamics="constant_velocity", bounded=bounded)
        np.testing.assert_allclose(prior.centres, [[0.4, clipped], [-0.2, 0.5]])
        np.testing.assert_allclose(prior.deviation, 1.5)
        kept = FramePrior.of_arrays(prior.arrays, space, bounded=bounded)
        poses = np.array([[0.3, 0.3], [0.9, -0.9], [1.5, 0.0]])
        np.testing.assert_array_equal(kept.log_density(poses), prior.log_density(poses))
        assert np.isneginf(prior.log_density(poses)).tolist() == [False, False, bounded]


def test_an_unbounded_prior_is_a_mixture_of_normals_and_far_ones_add_nothing() -> None:
    space = toy_space(3, limit=0.1, sigma=0.5)
    rng = np.random.default_rng(0)
    last = ParticleSet(rng.normal(0.0, 6.0, (20, 3)), np.log(np.full(20, 1.0 / 20.0)))
    prior = FramePrior.of_frame(FilterState(last), space, scale=2.0, dynamics="none", bounded=False)
    poses = rng.normal(0.0, 6.0, (40, 3))
    own = np.log(sum(multivariate_normal(centre, np.eye(3)).pdf(poses) for centre in last.poses))
    found = prior.log_density(poses)
    np.testing.assert_allclose(found - found[0], own - own[0], atol=1e-9)
    uniform = FramePrior.of_frame(FilterState(None), space, scale=1.0, dynamics="none", bounded=True)
    assert uniform.log_density(np.array([[0.1, 0.0, -0.1], [0.11, 0.0, 0.0]])).tolist() == [0.0, -np.inf]
