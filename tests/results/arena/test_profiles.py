"""Runtime profiles against cases that are worked out by hand, and against a count of every pair."""

import itertools

import numpy as np
import pytest

from studio.results.arena.profiles import Trial, profile, profiles, running_time

SHARES = (0.5, 0.1)


def trial(
    *steps: tuple[int, float], seed: int = 0, problem: str = "p", racer: str = "r", ended: int = 1000
) -> Trial:
    """Steps (evaluations, gap) of a way of 10 nats."""
    counts, gaps = zip(*steps, strict=True) if steps else ((), ())
    return Trial(problem, racer, seed, ended, counts, gaps, 10.0)


NEAR = trial((1, 8.0), (10, 4.0), (100, 0.5))
FAR = trial((5, 9.0), (20, 5.0), seed=1)


def test_a_runtime_is_when_a_target_was_first_reached() -> None:
    assert [NEAR.runtime(share) for share in (0.8, 0.5, 0.4, 0.39, 0.05, 0.04)] == [
        1,
        10,
        10,
        100,
        100,
        np.inf,
    ]
    assert FAR.runtime(0.5) == 20
    assert trial().runtime(0.9) == np.inf
    assert (NEAR.share_left, trial().share_left) == (0.05, np.inf)


def test_the_profile_counts_pairs_of_target_and_seed() -> None:
    counted = profile("r", [NEAR, FAR], np.array([1.0, 9.0, 10.0, 20.0, 99.0, 100.0]), SHARES)
    assert counted.share.tolist() == [0.0, 0.0, 0.25, 0.5, 0.5, 0.75]


def test_each_problem_counts_alike_however_often_it_was_run() -> None:
    other = [trial((1, 0.0), problem="q", seed=seed) for seed in range(5)]
    counted = profile("r", [NEAR, *other], np.array([1.0]), SHARES)
    assert counted.share.tolist() == [0.5]


def test_the_profile_is_that_of_a_count_of_all_pairs() -> None:
    rng = np.random.default_rng(3)
    trials = [
        trial(*zip(np.cumsum(rng.integers(1, 50, 8)).tolist(), sorted(rng.uniform(0, 10, 8))[::-1], strict=True),
              seed=seed, problem=problem)
        for seed, problem in itertools.product(range(4), "abc")
    ]  # fmt: skip
    counts, shares = np.array([1.0, 30.0, 80.0, 150.0, 400.0]), (0.8, 0.5, 0.3, 0.1, 0.02)
    wanted = [
        np.mean([
            any(at <= count and gap <= share * one.way for at, gap in zip(one.reached, one.gaps, strict=True))
            for one in trials for share in shares
        ])
        for count in counts
    ]  # fmt: skip
    counted = profile("r", trials, counts, shares)
    assert counted.share == pytest.approx(np.array(wanted))
    assert np.all((counted.low <= counted.share) & (counted.share <= counted.high))


def test_the_expected_running_time_is_all_evaluations_over_the_successes() -> None:
    half, tenth = running_time([NEAR, FAR], 0.5), running_time([NEAR, FAR], 0.1)
    assert (half.expected, half.reached, half.trials) == (15.0, 2, 2)
    assert (tenth.expected, tenth.reached) == (1100.0, 1)
    never = running_time([FAR, FAR], 0.1)
    assert (never.expected, never.low, never.high, never.reached) == (np.inf, np.inf, np.inf, 0)


def test_bands_are_those_of_seeds_drawn_again() -> None:
    # Of two seeds drawn twice: both the first, both the second, or one of each.
    band = profile("r", [NEAR, FAR], np.array([10.0, 100.0]), SHARES)
    assert band.low.tolist() == [0.0, 0.5]
    assert band.high.tolist() == [0.5, 1.0]
    time = running_time([NEAR, FAR], 0.5)
    assert (time.low, time.high) == (10.0, 20.0)
    assert running_time([NEAR, FAR], 0.1).high == np.inf
    alone = profile("r", [NEAR], np.array([10.0]), SHARES)
    assert alone.low == alone.high == alone.share


def test_racers_keep_the_order_in_which_they_ran_and_the_budget_is_the_last_count() -> None:
    every = profiles([NEAR, trial((1, 0.0), racer="z"), trial((1, 0.0), racer="a")], 1000)
    assert [one.racer for one in every] == ["r", "z", "a"]
    assert (every[0].evaluations[0], every[0].evaluations[-1]) == (1.0, 1000.0)
