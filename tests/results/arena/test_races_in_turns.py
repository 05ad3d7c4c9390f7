"""Races whose poses are weighed together: each as it is alone, in fewer weighings, and what goes wrong."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from toy_arena import ToyArena

import studio
from studio.foundations.arrays import Array
from studio.operations.jobs.trials import TrialResult
from studio.results.arena import racing
from studio.results.arena.problem import Problem
from studio.results.arena.racing import measure_race, measure_races, planned
from studio.results.arena.turns import LeftOffError, Weigh, race_in_turns
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.kept_trials import plain


def doubling(start: float, steps: int, met: list[float]) -> Callable[[Weigh], None]:
    """A race whose every pose is the weight of the one before."""

    def race(weigh: Weigh) -> None:
        value = start
        for _ in range(steps):
            value = float(weigh(np.full((2, 1), value))[1])
            met.append(value)

    return race


def test_each_race_is_given_its_own_weights_and_may_end_earlier() -> None:
    sizes, met = list[int](), [list[float](), list[float](), list[float]()]

    def weigh(poses: Array) -> Array:
        sizes.append(len(poses))
        return 2.0 * poses[:, 0]

    starts = (1.0, 10.0, 100.0)
    race_in_turns(
        [doubling(start, steps, own) for start, steps, own in zip(starts, (3, 1, 0), met, strict=True)], weigh
    )
    assert met == [[2.0, 4.0, 8.0], [20.0], []]
    assert sizes == [4, 2, 2]


def test_a_race_that_fails_ends_all() -> None:
    ended = list[type[BaseException]]()

    def stubborn(weigh: Weigh) -> None:
        try:
            while True:
                weigh(np.zeros((1, 1)))
        except BaseException as error:
            ended.append(type(error))
            raise

    def failing(weigh: Weigh) -> None:
        weigh(np.zeros((1, 1)))
        raise ValueError("of its own")

    with pytest.raises(ValueError, match="of its own"):
        race_in_turns([stubborn, failing], lambda poses: poses[:, 0])
    with pytest.raises(MemoryError):
        race_in_turns([stubborn, stubborn], too_much)
    assert ended == [LeftOffError] * 3


def too_much(poses: Array) -> Array:
    raise MemoryError


@pytest.mark.parametrize("racer", ["annealed", "swarm", "random-search"])
def test_seeds_raced_together_are_those_raced_alone_in_fewer_weighings(
    arena: ToyArena, racer: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    trials = planned([arena.whole], [racer], 330, range(4), str(arena.file))
    cache, calls, weighed = FootageCache(arena.file.parent), list[int](), Problem.weigh_alone

    def counted(self: Problem, poses: Array) -> Array:
        calls.append(len(poses))
        return weighed(self, poses)

    monkeypatch.setattr(Problem, "weigh_alone", counted)
    alone = [measure_race(trial.arguments, cache) for trial in trials]
    apart, calls[:] = list(calls), []
    together = measure_races({"trials": [trial.arguments for trial in trials]}, cache)["measured"]
    for one, other in zip(together, alone, strict=True):
        times = {name: 0.0 for name in one if name.startswith("seconds")}
        assert one | times == other | times
        assert one["evaluations"] == 330
    # Poses of the start, one a race, are weighed apart.
    assert sum(calls) == sum(apart)
    assert len(calls) - 4 <= (len(apart) - 4) / 4 + 1


def test_seeds_of_a_race_on_a_card_are_shared_among_processes_and_kept_one_by_one(
    arena: ToyArena, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here `auto` is the processor, which the race is told is a card."""
    groups = list[int]()
    together = racing.measure_races

    def noted(arguments, cache):
        groups.append(len(arguments["trials"]))
        return together(arguments, cache)

    monkeypatch.setattr(racing, "is_processor", lambda chosen: chosen == "cpu")
    monkeypatch.setattr("studio.operations.arena.measure_races", noted)
    monkeypatch.setattr("studio.operations.arena.run_jobs", here)
    given = {"racers": ("random-search",), "problems": (arena.whole.name,), "seeds": 4, "evaluations": 250}
    given |= {"file": arena.file, "out": tmp_path, "processes": 2, "progress": False}
    apart = studio.arena.race(**given)
    assert not groups
    shared = studio.arena.race(device="auto", **given)
    assert groups == [2, 2]
    assert [one.gaps for one in shared.trials] == [one.gaps for one in apart.trials]
    assert studio.arena.race(device="auto", **given).kept == 4


def here(jobs, folder, on_result, processes, checkpoint) -> None:
    """Trials in this process."""
    cache = FootageCache(str(folder))
    for job in jobs:
        on_result(job, TrialResult(job.key, plain(job.measure(job.arguments, cache)), "", 1.0))
