"""Comparisons worked at to the end, broken off, gone on with."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest
from sample_walk import copy_of_walk

from studio.foundations.errors import SettingsError
from studio.operations.comparison_folders import new_comparison, place_of
from studio.operations.jobs.comparison_run import done_before, run_comparison
from studio.results.comparison.candidates import Lineup
from studio.results.comparison.kept_comparison import KeptComparison
from studio.results.comparison.plan import Plan, conclude, plan_comparison
from studio.sessions.session import Session


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


@pytest.mark.slow
def test_it_is_broken_off_and_goes_on_with_what_is_missing(walk: Session, kept: KeptComparison) -> None:
    steps: list[tuple[str, int, int]] = []

    def after_two(step: str, done: int, total: int) -> None:
        steps.append((step, done, total))
        if done == 2:
            raise Broken

    with pytest.raises(Broken):
        run_comparison(kept, walk, after_two, conclude, processes=1)
    assert steps == [("", 0, 4), ("annealed, seed 0", 1, 4), ("condensation, seed 0", 2, 4)]
    assert kept.status() == "interrupted"
    assert done_before(kept, kept.plan(walk)) == 2

    steps.clear()
    comparison = run_comparison(kept, walk, lambda *step: steps.append(step), conclude, processes=1)
    assert [step[1] for step in steps] == [2, 3, 4]
    assert kept.status() == "done"
    assert [result.tracker for result in comparison.trackers] == ["annealed", "condensation"]
    assert all(len(result.seeds) == 2 and result.evaluations == 60 for result in comparison.trackers)

    # Broken off or not, in processes or in threads, the same comes out.
    whole = new_comparison(place_of(walk), small(walk))
    with ThreadPoolExecutor(2) as threads:
        again = run_comparison(whole, walk, lambda *_: None, conclude, executor=threads)
    timeless = [
        [replace(seed, seconds=0.0) for result in found.trackers for seed in result.seeds]
        for found in (comparison, again)
    ]
    assert timeless[0] == timeless[1]


@pytest.mark.slow
def test_a_trial_that_fails_ends_it_with_the_reason(walk: Session) -> None:
    plan = small(walk)
    wrong = replace(plan.candidates[0], changes={**plan.candidates[0].changes, "survivor": 1})
    kept = new_comparison(place_of(walk), replace(plan, candidates=(wrong,)))
    with pytest.raises(SettingsError, match=r"no setting 'survivor' with tracker 'annealed'"):
        run_comparison(kept, walk, lambda *_: None, conclude, processes=1)
    assert not kept.is_running()


def test_seeds_that_a_card_searches_side_by_side_have_outcomes_of_their_own(walk: Session) -> None:
    """Without a card `auto` is the processor, which searches a frame of all seeds at a time: the same comes out."""
    plan = small(walk, seeds=3)
    on_card = [
        replace(one, changes={**one.changes, "device": "auto"}) if one.name == "annealed" else one
        for one in plan.candidates
    ]
    jobs, found = list[str](), []
    with ThreadPoolExecutor(1) as threads:
        for candidates in (tuple(on_card), plan.candidates):
            steps: list[tuple[str, int, int]] = []
            kept = new_comparison(place_of(walk), replace(plan, candidates=candidates))
            done = run_comparison(
                kept,
                walk,
                lambda *step, steps=steps: steps.append(step),
                conclude,
                processes=1,
                executor=threads,
            )
            jobs.append(" ".join(step[0] for step in steps))
            found.append([[replace(seed, seconds=0.0) for seed in one.seeds] for one in done.trackers])
            assert done_before(kept, kept.plan(walk)) == 6
            assert [step[1] for step in steps] == list(range(7))
    assert found[0] == found[1]
    assert jobs[0].startswith(" annealed, seed 0 annealed, seed 1 annealed, seed 2 condensation, seed 0")
    assert jobs[1].startswith(" annealed, seed 0 condensation, seed 0")
