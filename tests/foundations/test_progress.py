"""How much longer work takes: nothing is said before it is known to a factor of two (clocks are simulated)."""

import random
from collections.abc import Callable, Sequence

import pytest

from studio.foundations.progress import TimeLeft, left_in_words

Draw = Callable[[random.Random, int, int], float]
"""Seconds of part i of n."""


def estimates(parts: Sequence[float], at_once: int = 1) -> list[tuple[float, float]]:
    """(estimate, truth) wherever there is an estimate before the end, of work whose parts take so many seconds.

    at_once : parts between two reports.
    """
    now = 0.0
    left, found = TimeLeft(lambda: now), list[tuple[float, float]]()
    left.after("work", 0, len(parts))
    for done in range(1, len(parts)):
        now += parts[done - 1]
        if done % at_once == 0 and (left_now := left.after("work", done, len(parts))) is not None:
            found.append((left_now, sum(parts[done:])))
    return found


def factors(draw: Draw, count: int, seeds: int = 20) -> tuple[list[float], int]:
    """By what factor each estimate is off, and how many of the works had one at all."""
    works = [[draw(random.Random(seed), i, count) for i in range(count)] for seed in range(seeds)]
    found = [estimates(parts) for parts in works]
    return [max(a / b, b / a) for each in found for a, b in each], sum(1 for each in found if each)


@pytest.mark.parametrize("count", [20, 100, 600])
@pytest.mark.parametrize("at_once", [1, 2])
def test_constant_work_is_known_after_a_twentieth(count: int, at_once: int) -> None:
    found = estimates([2.0] * count, at_once)
    assert [left_now for left_now, _ in found] == pytest.approx([truth for _, truth in found])
    assert len(found) >= (0.9 * count - 10) / at_once


def test_one_frame_of_six_hundred_foretells_nothing() -> None:
    """The first takes 211 s, as it compiles: it once said "126704 s left" of five minutes."""
    found = estimates([211.0] + [0.5] * 599)
    assert all(left_now == pytest.approx(truth) for left_now, truth in found)
    assert len(found) > 500


def jittery(rng: random.Random, _i: int, _n: int) -> float:
    return max(0.05, rng.gauss(1.0, 0.3))


def wild(rng: random.Random, _i: int, _n: int) -> float:
    return rng.expovariate(1.0) + 0.01


def slowing(rng: random.Random, i: int, _n: int) -> float:
    """Part i takes i times as long as the first, as where all that was done before is looked at again."""
    return (1.0 + i) * max(0.1, rng.gauss(1.0, 0.1))


def drifting(rng: random.Random, i: int, n: int) -> float:
    return (1.0 + 2.0 * i / n) * max(0.1, rng.gauss(1.0, 0.2))


def quickening(rng: random.Random, i: int, n: int) -> float:
    return (3.0 - 2.0 * i / n) * max(0.1, rng.gauss(1.0, 0.2))


@pytest.mark.parametrize("draw", [jittery, wild, slowing, drifting, quickening])
@pytest.mark.parametrize("count", [100, 600])
def test_what_is_said_holds_to_a_factor_of_two(draw: Draw, count: int) -> None:
    found, left_now = factors(draw, count)
    assert left_now == 20, "it must be said at some time"
    wrong = sum(factor > 2.0 for factor in found) / len(found)
    # Two standard errors: one in twenty may be off, and none is absurd.
    assert wrong <= 0.05
    assert max(found) < 6.0


def test_work_that_slows_down_is_not_foretold_from_its_quick_beginning() -> None:
    first = estimates([1.0 + i for i in range(600)])[0]
    assert first[0] / first[1] == pytest.approx(1.0, abs=0.5)
    naive = 599 * 1.0
    assert naive < 0.01 * sum(1.0 + i for i in range(600)), "which a mean over the first would have said"


def test_each_step_is_measured_by_itself_and_words_beside_the_count_are_no_new_step() -> None:
    now = 0.0
    left = TimeLeft(lambda: now)

    def after(step: str, done: int, total: int, seconds: float) -> float | None:
        nonlocal now
        now += seconds
        return left.after(step, done, total)

    assert after("reading", 0, 10, 1.0) is None
    found = [after(f"picture {done}", done, 10, 3.0) for done in range(1, 11)]
    assert found == [None] * 4 + [pytest.approx(3.0 * (10 - done)) for done in range(5, 11)]
    assert after("solving", 0, 10, 3.0) is None
    assert after("solving", 1, 10, 50.0) is None
    assert after("writing", 3, 0, 1.0) is None


def test_a_step_may_begin_where_some_of_it_was_done_before() -> None:
    now = 0.0
    left = TimeLeft(lambda: now)
    found = []
    for done in range(50, 100):
        found.append(left.after("trials", done, 100))
        now += 7.0
    assert found[:5] == [None] * 5
    assert found[5:] == pytest.approx([7.0 * (100 - done) for done in range(55, 100)])


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (None, ""),
        (float("nan"), ""),
        (0.0, ""),
        (12.0, "about 12 s left"),
        (600.0, "about 10 min left"),
        (9000.0, "about 2.5 h left"),
    ],
)
def test_the_time_left_in_words(seconds: float | None, words: str) -> None:
    assert left_in_words(seconds) == words
