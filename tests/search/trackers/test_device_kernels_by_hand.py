"""Single kernels of filters and swarms on a card, in Numba's simulator, beside closed forms and plain sums."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simulated_kernels as made
from scipy.optimize import brentq
from simulated_card import found_simulated

from studio.search.trackers.counted_numbers import as_normals, as_share, random_words

OF_RUN, OF_PARENTS, OF_CUTS, OF_NOISE, OF_TRIES = 0, 1, 2, 16, 1 << 16


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the kernels make of small arrays."""
    return found_simulated(Path(made.__file__), tmp_path_factory)


def words_of(run: int, particle: int, place: int) -> tuple[int, ...]:
    return random_words(*made.KEYS[run], np.uint64(particle), np.uint64(place))


def shares_of(run: int, particle: int, place: int) -> list[float]:
    return [as_share(word) for word in words_of(run, particle, place)]


def noise_of(run: int, particle: int, size: int) -> np.ndarray:
    fours = [words_of(run, particle, OF_NOISE + d) for d in range(0, size, 4)]
    pairs = [as_normals(*four[k : k + 2]) for four in fours for k in (0, 2)]
    return np.ravel(pairs)[:size].astype(np.float64)


def alone(values: np.ndarray, run: int) -> np.ndarray:
    """One run's particles, rows."""
    return np.split(values, made.RUNS, axis=1)[run].T.astype(np.float64)


def survival(beta: float, logs: np.ndarray) -> float:
    weights = np.exp(beta * (logs - logs.max()))
    return weights.sum() ** 2 / (len(logs) * (weights**2).sum())


def test_two_particles_are_annealed_until_one_weighs_half_the_other(simulated: dict[str, Any]) -> None:
    """(1 + q)² / 2 (1 + q²) is 0.9 where q is a half, so that β is log 2 over what the log-weights differ by."""
    found = simulated["annealed"]["two particles"]
    for run, apart in enumerate((3.0, 0.5)):
        beta, alpha, most, total, best = found["annealed"][run]
        assert beta == pytest.approx(np.log(2.0) / apart, rel=1e-6)
        assert (alpha, total) == (pytest.approx(0.9, rel=1e-6), pytest.approx(1.5, rel=1e-6))
        assert (most, best) == ((0.0, -5.0)[run], 0)
    np.testing.assert_allclose(found["cumulated"], [1.0, 1.5] * 2, rtol=1e-6)


def test_an_exponent_that_is_given_is_taken_and_one_that_is_found_is_at_most_what_it_may_be(
    simulated: dict[str, Any],
) -> None:
    """The heaviest is the first of equals, whichever threads have them; what is given may be any."""
    logs, _ = made.ANNEALED["given, and at most"]
    found = simulated["annealed"]["given, and at most"]
    for run, (beta, best) in enumerate(((0.5, 1), (0.25, 3))):
        own = np.array(logs[run])
        weights = np.exp(beta * (own - own.max()))
        expected = beta, survival(beta, own), -1.0, weights.sum(), best
        np.testing.assert_allclose(found["annealed"][run], expected, rtol=1e-6)
        np.testing.assert_allclose(found["cumulated"][7 * run : 7 * run + 7], np.cumsum(weights), rtol=1e-6)


def test_equal_weights_leave_the_exponent_at_one_or_at_what_it_may_be(simulated: dict[str, Any]) -> None:
    found = simulated["annealed"]["equal"]
    np.testing.assert_array_equal(found["annealed"], [[1.0, 1.0, -4.0, 3.0, 0], [0.5, 1.0, 2.0, 3.0, 0]])
    np.testing.assert_array_equal(found["cumulated"], [1.0, 2.0, 3.0] * 2)


@pytest.mark.parametrize("run", range(made.RUNS))
def test_weights_of_any_spread_are_annealed_to_the_share_that_is_wanted(
    simulated: dict[str, Any], run: int
) -> None:
    logs, rules = made.ANNEALED["narrow and wide"]
    own, wanted = np.array(logs[run]), rules[run][0]
    expected = np.exp(brentq(lambda at: survival(np.exp(at), own) - wanted, -20.0, 20.0, xtol=1e-12))
    beta, alpha, most, _, best = simulated["annealed"]["narrow and wide"]["annealed"][run]
    assert beta == pytest.approx(expected, rel=1e-5)
    assert alpha == pytest.approx(wanted, rel=1e-5)
    assert (most, best) == (own.max(), np.argmax(own))


@pytest.mark.parametrize("run", range(made.RUNS))
def test_moments_are_those_of_plain_sums_far_from_zero(simulated: dict[str, Any], run: int) -> None:
    poses, found = alone(made.POSES, run), simulated["moments"][:, run]
    np.testing.assert_allclose(found[4], poses.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(found[5], poses.var(axis=0), rtol=1e-10)
    weights = made.SHARES.reshape(made.RUNS, -1)[run]
    mean = np.average(poses, axis=0, weights=weights)
    np.testing.assert_allclose(found[2], mean, rtol=1e-14)
    np.testing.assert_allclose(found[3], np.average((poses - mean) ** 2, axis=0, weights=weights), rtol=1e-10)
    assert np.isnan(found[[0, 1, 6, 7]]).all(), "other rows are left as they are"


@pytest.mark.parametrize("run", range(made.RUNS))
def test_directions_that_do_not_vary_by_themselves_have_no_noise(simulated: dict[str, Any], run: int) -> None:
    """One is the sum of two others, one the same in all particles."""
    lower, root = (both[run] for both in simulated["correlations"])
    expected = np.zeros((4, 4))
    expected[:3, :3] = np.corrcoef(alone(made.DEPENDENT, run)[:, :3].T)
    np.testing.assert_allclose(lower, np.tril(expected), atol=1e-12)
    half = np.tril(root)
    np.testing.assert_allclose(half @ half.T, expected, atol=1e-7)
    assert half[2, 2] == half[3, 3] == 0.0


@pytest.mark.parametrize("systematic", [True, False])
@pytest.mark.parametrize("run", range(made.RUNS))
def test_survivors_are_drawn_by_weight_and_children_are_of_two(
    simulated: dict[str, Any], run: int, systematic: bool
) -> None:
    """In the first run all are children of two, in the second none is."""
    weights = made.SHARES.reshape(made.RUNS, -1)[run]
    marks = np.cumsum(weights) / weights.sum()
    poses, (drawn, parents) = alone(made.POSES, run), simulated["survivors"][systematic]
    ours, theirs = alone(drawn, run), alone(parents, run)
    common, crossed = shares_of(run, 0, OF_RUN)[0], 0
    for n in range(made.COUNT):
        own, cuts = shares_of(run, n, OF_PARENTS), shares_of(run, n, OF_CUTS)
        share = (n + common) / made.COUNT if systematic else own[0]
        first, second = (int(np.argmax(marks > mark)) for mark in (share, own[1]))
        ends = sorted(1 + int(3 * cut) for cut in cuts[:2]) if run == 0 else (0, 0)
        taken = (ends[0] < made.PLACE) & (ends[1] >= made.PLACE)
        crossed += taken.any()
        np.testing.assert_array_equal(ours[n], np.where(taken, poses[second], poses[first]))
        assert theirs[n].tolist() == [first, second if taken.any() else -1]
        assert weights[first] > 0.0
    assert crossed > 0 if run == 0 else crossed == 0


@pytest.mark.parametrize("systematic", [True, False])
@pytest.mark.parametrize("run", range(made.RUNS))
def test_a_frame_begins_with_all_in_turn_or_by_weight_or_with_the_heaviest(
    simulated: dict[str, Any], run: int, systematic: bool
) -> None:
    last, marks = alone(made.LAST, run), made.LAST_CUMULATED.reshape(made.RUNS, -1)[run]
    common = shares_of(run, 0, OF_RUN)[0]
    shares = [
        (n + common) / made.AFTER if systematic else shares_of(run, n, OF_PARENTS)[0]
        for n in range(made.AFTER)
    ]
    sources = (
        [0, 0, 1, 1, 2],
        [int(np.argmax(marks > share * marks[-1])) for share in shares],
        [(2, 1)[run]] * 5,
    )
    for how, source in enumerate(sources):
        found = alone(simulated["carried"][how, systematic], run)
        np.testing.assert_allclose(found, last[source] + made.SHIFT[run], atol=2e-6)


@pytest.mark.parametrize("name", made.SPREADS)
@pytest.mark.parametrize("run", range(made.RUNS))
def test_noise_has_the_deviations_and_the_correlations_that_it_is_given(
    simulated: dict[str, Any], run: int, name: str
) -> None:
    kept, scale, of_sample, correlated = made.SPREADS[name]
    centres, found = alone(made.CENTRES, run), alone(simulated["spread"][name], run)
    mean, variance = made.MOMENTS[4:6, run]
    deviation = np.sqrt(variance) if of_sample else made.SIGMA[run]
    for n in range(made.SPREAD_COUNT):
        noise = noise_of(run, n, made.SPREAD_SIZE)
        noise = made.ROOT[run] @ noise if correlated else noise
        expected = kept * centres[n] + (1.0 - kept) * mean + scale * deviation * noise
        np.testing.assert_allclose(found[n], np.clip(expected, *made.LIMITS), atol=3e-6)


def test_every_third_row_and_the_heaviest_go_to_the_host(simulated: dict[str, Any]) -> None:
    rows, values = simulated["rows"]
    for run, best in enumerate((5, 1)):
        wanted = [0, 3, 6, best]
        np.testing.assert_array_equal(rows[run], alone(made.POSES, run)[wanted])
        weights = made.SHARES.reshape(made.RUNS, -1)[run][wanted]
        np.testing.assert_array_equal(values[:, run], [weights, 100.0 + weights])


@pytest.mark.parametrize(
    ("name", "velocities"),
    [
        ("freely", made.VELOCITIES),
        ("slowed", 0.25 * made.VELOCITIES),
        ("fast", np.clip(made.VELOCITIES, -0.2, 0.2)),
    ],
)
def test_without_pull_a_particle_flies_on_at_most_two_sigma_far(
    simulated: dict[str, Any], name: str, velocities: np.ndarray
) -> None:
    after, moved = simulated["flown"][name]
    np.testing.assert_allclose(moved, velocities, rtol=1e-6)
    np.testing.assert_allclose(after, made.PLACES + velocities, atol=1e-6)


def test_what_passes_a_limit_stays_on_it_without_velocity(simulated: dict[str, Any]) -> None:
    after, moved = simulated["flown"]["against limits"]
    free = made.PLACES + made.VELOCITIES
    low, high = (limit[:, None] for limit in made.CLOSED)
    beyond = (free < low) | (free > high)
    assert beyond[:, : made.FLYING].any()
    assert not beyond.all()
    np.testing.assert_allclose(after, np.clip(free, low, high), atol=1e-6)
    np.testing.assert_allclose(moved, np.where(beyond, 0.0, made.VELOCITIES), atol=1e-6)


def test_at_its_best_and_the_leaders_place_a_particle_is_pulled_nowhere(simulated: dict[str, Any]) -> None:
    """χ of c1 + c2 = 4.1 is 0.7298 (Clerc & Kennedy 2002), whatever the random numbers."""
    after, moved = simulated["flown"]["about the best"]
    np.testing.assert_allclose(moved, 0.72984379 * made.VELOCITIES, rtol=1e-6)
    np.testing.assert_allclose(after, made.PLACES[:, :1] + moved, atol=1e-6)


@pytest.mark.parametrize("run", range(made.RUNS))
def test_both_pulls_are_by_shares_of_their_own(simulated: dict[str, Any], run: int) -> None:
    after, moved = (alone(one, run) for one in simulated["flown"]["pulled"])
    away = alone(made.AWAY - made.PLACES, run)
    for n, d in np.ndindex(made.FLYING, made.FLIGHT):
        shares = shares_of(run, n, OF_TRIES + d // 2 * 2)[2 * (d % 2) :][:2]
        assert moved[n, d] == pytest.approx(0.5 * 1.5 * sum(shares) * away[n, d], rel=1e-5)
    np.testing.assert_allclose(after, alone(made.PLACES, run) + moved, rtol=1e-5)


def test_only_where_all_are_stranded_the_first_steps_are_taken(simulated: dict[str, Any]) -> None:
    """Steps are redrawn, but without pull they are the same again: all of a run lie beyond a limit, or all but one."""
    after, moved = simulated["flown"]["beyond"]
    steps = np.abs(made.VELOCITIES)
    np.testing.assert_allclose(alone(after, 0), alone(made.OUTSIDE + steps, 0), atol=1e-6)
    np.testing.assert_allclose(alone(moved, 0), alone(steps, 0), atol=1e-6)
    inside = alone(made.OUTSIDE + steps, 1)[4, 0] <= 1.0
    for n in range(made.FLYING):
        flies = n == 4 and inside
        expected = alone(steps, 1)[n] if flies else np.zeros(made.FLIGHT)
        np.testing.assert_allclose(alone(moved, 1)[n], expected, atol=1e-6)
        np.testing.assert_allclose(alone(after, 1)[n], alone(made.OUTSIDE, 1)[n] + expected, atol=1e-6)


def test_a_possible_pose_is_better_than_any_other_and_equals_change_nothing(
    simulated: dict[str, Any],
) -> None:
    found = simulated["bests"]
    bests, reached = found["bests"], found["reached"]
    # First run: 1 beats 0.5; 5 no more than equals 5; 5, possible, beats 6, which was not; 5 beats 4.
    better = np.array([[0, 1, 0, 1, 0, 1], [0, 1, 0, 0, 0, 0]], dtype=bool)
    np.testing.assert_array_equal(bests, np.where(better.ravel(), found["places"], -5.0))
    np.testing.assert_array_equal(reached[0], np.where(better, made.VALUES, made.REACHED).ravel())
    possible = made.REACHED_POSSIBLE.copy()
    possible[0, 3] = 1.0
    np.testing.assert_array_equal(reached[1], possible.ravel())
    # The first of three whose best is 5 leads, but its place was not kept from this weighing; none of the second run
    # comes up to what stands.
    np.testing.assert_array_equal(found["leaders"], np.tile([-5.0, -6.0], (made.FLIGHT, 1)))
    np.testing.assert_array_equal(found["standing"][:, :2], [[5.0, 1.0], [-1.0, 0.0]])
    # Of this weighing: the first of the possible fives; -3, though none is possible.
    np.testing.assert_array_equal(found["standing"][:, [2, 4]], [[5.0, 2], [-3.0, 1]])
