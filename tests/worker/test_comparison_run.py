"""Comparisons worked at in processes of their own: to the end, broken off, gone on with; one at a time."""

import threading
from collections.abc import Callable
from dataclasses import replace

import pytest
from sample_walk import copy_of_walk

from studio.comparison.candidates import Lineup
from studio.comparison.folders import new_comparison, place_of
from studio.comparison.kept_comparison import KeptComparison
from studio.comparison.plan import Plan, plan_comparison
from studio.errors import RunError
from studio.sessions.session import Session
from studio.worker.comparison_desk import ComparisonDesk, ComparisonState
from studio.worker.comparison_run import done_before, run_comparison


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The bundled walk where it can be written to."""
    return copy_of_walk(tmp_path_factory.mktemp("workspace") / "walk")


def small(walk: Session, seeds: int = 2) -> Plan:
    return plan_comparison(walk, Lineup(("annealed", "condensation"), "", 60, 3), range(seeds), last=3)


@pytest.fixture
def kept(walk: Session) -> KeptComparison:
    return new_comparison(place_of(walk), small(walk))


class Broken(Exception):
    """What ends a comparison in these tests."""


def test_it_is_broken_off_and_goes_on_with_what_is_missing(walk: Session, kept: KeptComparison) -> None:
    told: list[tuple[str, int, int]] = []

    def after_two(step: str, done: int, total: int) -> None:
        told.append((step, done, total))
        if done == 2:
            raise Broken

    with pytest.raises(Broken):
        run_comparison(kept, walk, after_two, processes=1)
    assert told == [("", 0, 4), ("annealed, seed 0", 1, 4), ("condensation, seed 0", 2, 4)]
    assert kept.status() == "interrupted"
    assert done_before(kept, kept.plan(walk)) == 2

    told.clear()
    comparison = run_comparison(kept, walk, lambda *step: told.append(step), processes=1)
    assert [step[1] for step in told] == [2, 3, 4]
    assert kept.status() == "finished"
    assert [result.tracker for result in comparison.trackers] == ["annealed", "condensation"]
    assert all(len(result.seeds) == 2 and result.evaluations == 60 for result in comparison.trackers)

    # Broken off or not, the same comes out.
    whole = new_comparison(place_of(walk), small(walk))
    again = run_comparison(whole, walk, lambda *_: None, processes=2)
    timeless = [
        [replace(seed, seconds=0.0) for result in found.trackers for seed in result.seeds]
        for found in (comparison, again)
    ]
    assert timeless[0] == timeless[1]


def test_a_trial_that_fails_ends_it_with_the_reason(walk: Session) -> None:
    plan = small(walk)
    wrong = replace(plan.entrants[0], changes={**plan.entrants[0].changes, "survivor": 1})
    kept = new_comparison(place_of(walk), replace(plan, entrants=(wrong,)))
    with pytest.raises(RunError, match=r"annealed, seed 0 could not be tracked.*survivor"):
        run_comparison(kept, walk, lambda *_: None, processes=1)
    assert not kept.is_running()


class Watched:
    """A desk that is listened to."""

    def __init__(self) -> None:
        self.states: list[ComparisonState] = []
        self._changed = threading.Condition()
        self.desk = ComparisonDesk(self._hear, processes=1)

    def _hear(self, state: ComparisonState) -> None:
        with self._changed:
            self.states.append(state)
            self._changed.notify_all()

    def until(self, condition: Callable[[ComparisonState], bool]) -> ComparisonState:
        """Wait for a state."""
        with self._changed:
            assert self._changed.wait_for(lambda: any(map(condition, self.states)), 120.0), self.states
            return next(filter(condition, self.states))


@pytest.fixture
def watched() -> Watched:
    return Watched()


def test_the_desk_works_in_the_background_and_estimates(
    walk: Session, kept: KeptComparison, watched: Watched
) -> None:
    watched.desk.start(kept, walk)
    middle = watched.until(lambda state: state.done == 2)
    assert middle.seconds_left is not None
    assert middle.seconds_left > 0
    watched.until(lambda state: state.state == "finished")
    assert kept.result() is not None
    watched.desk.close()


def test_one_at_a_time_and_cancelled_at_once(walk: Session, watched: Watched) -> None:
    first, second = (new_comparison(place_of(walk), small(walk, 50)) for _ in range(2))
    watched.desk.start(first, walk)
    with pytest.raises(RunError, match=f"'{first.name}' of 'walk' is running"):
        watched.desk.start(second, walk)
    watched.until(lambda state: state.total > 0)
    assert not watched.desk.cancel("walk", second.name)
    assert watched.desk.cancel("walk", first.name)
    watched.until(lambda state: state.state == "cancelled")
    watched.desk.close()
    assert first.status() == "cancelled"
    assert not watched.desk.is_busy()


def test_a_desk_that_closes_leaves_it_to_go_on(walk: Session, watched: Watched) -> None:
    kept = new_comparison(place_of(walk), small(walk, 50))
    watched.desk.start(kept, walk)
    watched.until(lambda state: state.done > 0)
    watched.desk.close()
    assert not watched.desk.is_busy()
    assert kept.status() == "interrupted"
    assert done_before(kept, kept.plan(walk)) >= 1


def test_what_fails_is_said(walk: Session, watched: Watched) -> None:
    plan = small(walk)
    wrong = replace(plan.entrants[0], changes={"survivor": 1})
    kept = new_comparison(place_of(walk), replace(plan, entrants=(wrong,)))
    watched.desk.start(kept, walk)
    state = watched.until(lambda state: state.state == "failed")
    assert "survivor" in state.message
    assert state.hint
    watched.desk.close()
    assert kept.status() == "failed"
    assert "survivor" in kept.record().problem
