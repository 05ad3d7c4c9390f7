"""Sweeps worked at to the end: runs that are kept, broken off, gone on with, the same whatever happened."""

import importlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from sample_walk import copy_of_walk
from tracked_runs import finish, poses_of

from studio.operations.comparison_folders import new_comparison, place_of, runs_of
from studio.operations.jobs import comparison_run, swept_runs
from studio.operations.jobs.comparison_run import done_before, run_comparison
from studio.operations.jobs.swept_runs import measure_run, measure_runs
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.sweep import conclude_sweep, plan_sweep, sweep_document, sweep_trials
from studio.runs.new_run import prepare_run
from studio.search.likelihood.devices import DEVICE_MODULE
from studio.sessions.provenance import note
from studio.sessions.session import Session

GRID = {"survival": [0.2, 0.5]}


class Broken(Exception):
    """What ends a sweep in this test."""


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return copy_of_walk(tmp_path_factory.mktemp("workspace") / "walk")


@pytest.mark.slow
def test_runs_are_kept_and_a_broken_sweep_goes_on(walk: Session) -> None:
    plan = plan_sweep(walk, GRID, range(2), knobs={"layers": 2, "particles": 20}, last=3, fit_shape=False)
    kept = new_comparison(place_of(walk, sweep=True), plan)
    steps: list[tuple[int, int]] = []

    def after_one(_: str, done: int, total: int) -> None:
        steps.append((done, total))
        if done == 1:
            raise Broken

    with ThreadPoolExecutor(1) as threads, pytest.raises(Broken):
        run_comparison(kept, walk, after_one, conclude_sweep, executor=threads)
    with ThreadPoolExecutor(1) as threads:
        assert 1 <= done_before(kept, plan) < 4
        sweep = run_comparison(kept, walk, lambda *_: None, conclude_sweep, executor=threads)
    assert steps == [(0, 4), (1, 4)]
    assert [run.run for run in sweep.runs] == [
        "sweep-1-p1-s0",
        "sweep-1-p2-s0",
        "sweep-1-p1-s1",
        "sweep-1-p2-s1",
    ]
    for found in sweep.runs:
        run = walk.run(found.run)
        assert run.summary().status == "finished"
        assert found.frames == [0, 1, 2]
        assert found.error is not None
        assert 0.0 < found.error < 40.0
        assert found.worst_frame == int(np.argmax(found.per_frame))
        assert found.evaluations == 40
        with run.results() as results:
            assert len(results.layers(1)) == 2
            taken = results.time_taken()
            assert taken.frames == 3
            assert taken.seconds >= results.timeline().milliseconds.sum() / 1000.0
    assert walk.run("sweep-1-p2-s1").record.settings["survival"] == 0.5
    assert kept.status() == "done"
    assert kept.result() == sweep_document(sweep)
    # The same run made by hand.
    alone = prepare_run(
        walk,
        knobs={"layers": 2, "particles": 20, "survival": 0.5},
        seed=1,
        last=3,
        fit_shape=False,
        name="by-hand",
    )
    np.testing.assert_array_equal(finish(walk, alone), poses_of(walk.run("sweep-1-p2-s1")))


def test_a_run_of_another_request_is_neither_taken_nor_overwritten(walk: Session) -> None:
    plan = plan_sweep(walk, GRID, range(1), knobs={"layers": 1, "particles": 10}, last=2, fit_shape=False)
    prepare_run(walk, knobs={"layers": 3}, last=2, fit_shape=False, name="mine-p1-s0")
    cache = FootageCache(walk.path.parent)
    trial = {**sweep_trials(plan)[0].arguments, "run": "mine-p1-s0"}
    try:
        first = measure_run(trial, cache)
        again = measure_run(trial, cache)
    finally:
        cache.close()
    assert first["run"] == again["run"] == "mine-p1-s0-2"
    assert walk.run("mine-p1-s0").summary().done == 0
    assert {**first, "milliseconds": 0} == {**again, "milliseconds": 0}


@pytest.mark.slow
def test_a_run_of_another_sweep_of_the_same_name_is_left_to_it(walk: Session) -> None:
    plan = plan_sweep(walk, GRID, range(1), knobs={"layers": 1, "particles": 10}, last=2, fit_shape=False)
    trial = {**sweep_trials(plan)[0].arguments, "run": "twice-p1-s0"}
    cache = FootageCache(walk.path.parent)
    try:
        found = [measure_run({**trial, "note": one}, cache)["run"] for one in ("one", "two", "one", "two")]
    finally:
        cache.close()
    assert found == ["twice-p1-s0", "twice-p1-s0-2"] * 2
    assert walk.run("twice-p1-s0").record.notes[0] == "one"


def test_a_doubted_calibration_is_tracked_despite_it(walk: Session) -> None:
    doubt = "Cameras A and B seem to be exchanged."
    note(walk, "background", "in doubt", good=False, stops=(doubt,))
    plan = plan_sweep(
        walk, GRID, range(1), knobs={"layers": 1, "particles": 10}, last=2, fit_shape=False, allow_inconsistent=True
    )  # fmt: skip
    kept = new_comparison(place_of(walk, "doubted"), plan)
    with ThreadPoolExecutor(1) as threads:
        sweep = run_comparison(kept, walk, lambda *_: None, conclude_sweep, executor=threads)
    assert [run.name for run in runs_of(walk, kept).values()] == [one.run for one in sweep.runs]
    assert f"Tracked despite: {doubt}" in walk.run(sweep.runs[0].run).record.notes


@pytest.mark.parametrize(
    ("knobs", "sizes"),
    [
        ({"device": "gpu"}, [2, 2, 2, 2]),
        ({"device": "gpu", "refine_frames": False}, [4, 4]),
        ({"device": "gpu", "refine_frames": False, "particles": 100_000}, [2, 2, 2, 2]),
        ({"device": "gpu", "limbs_apart": True}, [1] * 8),
        ({"device": "auto"}, [1] * 8),
        ({}, [1] * 8),
    ],
)
def test_runs_that_a_card_can_search_side_by_side_are_tracked_together(
    walk: Session, knobs: dict[str, object], sizes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that differ by seed and rate, not by the likelihood's edge samples; without a card `auto` shares nothing.
    What the processor refines is shared among its two processes.
    """
    monkeypatch.setattr(importlib.import_module(DEVICE_MODULE), "missing", lambda: "no card here")
    plan = plan_sweep(
        walk,
        {**GRID, "edge_samples": [32, 64]},
        range(2),
        knobs=knobs,
        last=2,
        fit_shape=False,
        allow_inconsistent=True,
    )
    kept = new_comparison(place_of(walk), plan)
    work = comparison_run._Work.of(plan)
    jobs = [comparison_run._job(kept, work, key) for key in work.trials]
    groups = comparison_run._side_by_side(walk, jobs, 2)
    assert [len(group) for group in groups] == sizes
    for group in groups:
        assert len({job.arguments["changes"]["edge_samples"] for job in group}) == 1
        assert comparison_run._as_one(group).measure is (measure_run if len(group) == 1 else measure_runs)
    assert sorted(job.key for group in groups for job in group) == sorted(work.trials)


@pytest.mark.parametrize("fails", [False, True])
def test_runs_tracked_together_are_measured_as_alone(
    walk: Session, fails: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where they cannot be, and are tracked one by one."""

    def too_much(*_: object) -> None:
        raise MemoryError

    if fails:
        monkeypatch.setattr(swept_runs, "track_together", too_much)
    knobs = {"layers": 1, "particles": 10, "refine_frames": False}
    plan = plan_sweep(walk, GRID, range(1), knobs=knobs, last=2, fit_shape=False, allow_inconsistent=True)
    trials = [trial.arguments for trial in sweep_trials(plan)]
    cache = FootageCache(walk.path.parent)
    try:
        named = [{**one, "run": f"together-{fails}-{number}"} for number, one in enumerate(trials)]
        together = measure_runs({"trials": named}, cache)["measured"]
        for number, (one, found) in enumerate(zip(trials, together, strict=True)):
            alone = measure_run({**one, "run": f"alone-{fails}-{number}"}, cache)
            assert {**found, "milliseconds": 0, "run": ""} == {**alone, "milliseconds": 0, "run": ""}
            assert found["run"] == f"together-{fails}-{number}"
            np.testing.assert_array_equal(poses_of(walk.run(found["run"])), poses_of(walk.run(alone["run"])))
    finally:
        cache.close()
