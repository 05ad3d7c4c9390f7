"""Trials as tasks of Dask's workers on this machine: the same results, losses, cancelling, and what can be missing."""

import gc
import importlib.util
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from functools import partial
from pathlib import Path

import dask
import pytest
from distributed import Client, LocalCluster
from toy_experiments import toy
from waiting import until

from studio.foundations.errors import FootageError, RunError, StudioError
from studio.foundations.progress import report
from studio.garden.reproduction.plan import each_once, plan
from studio.operations.jobs import cluster
from studio.operations.jobs.cluster import VARIABLE, ClusterExecutor, chosen_executor
from studio.operations.jobs.process_executor import ProcessLostError
from studio.operations.jobs.trials import TrialResult, run_jobs, run_trial
from studio.results.comparison.trials import Scale, TrialJob

PATIENCE = 120.0


def two_workers() -> LocalCluster:
    """A scheduler with two workers, each a process that a nanny starts again."""
    return LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Of a scheduler with two workers that nobody kills."""
    with two_workers() as made:
        yield made.scheduler_address


@pytest.fixture
def doomed() -> Iterator[str]:
    """Of one whose workers are killed; a task is given up after two."""
    with dask.config.set({"distributed.scheduler.allowed-failures": 1}), two_workers() as made:
        yield made.scheduler_address


def identifier() -> int:
    return os.getpid()


def refuse(message: str) -> None:
    raise FootageError(message, "Give another.")


def unpicklable() -> Callable[[], None]:
    return lambda: None


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def speak(words: int) -> int:
    for number in range(words):
        report("step", number)
    return words


def go_on_reporting(place: Path) -> None:
    """Until the report raises."""
    (place / "begun").touch()
    try:
        while True:
            report("still here", 0, 0)
            time.sleep(0.05)
    finally:
        (place / "ended").touch()


def jobs_of(log: Path, seeds: int, **deeds: str) -> list[TrialJob]:
    return list(each_once([plan(toy("toy", log, **deeds), Scale(tuple(range(seeds))))]).values())


def measured(
    jobs: list[TrialJob], folder: Path, run: Callable[..., None] = run_jobs
) -> dict[str, tuple[object, str]]:
    found: dict[str, tuple[object, str]] = {}

    def on_result(job: TrialJob, result: TrialResult) -> None:
        values = {**(result.measured or {}), "threads": ""}
        found[job.label] = (repr(values), result.failure)

    run(jobs, folder, on_result)
    return found


def serially(jobs: list[TrialJob], folder: Path, on_result: Callable[..., None]) -> None:
    for job in jobs:
        on_result(job, run_trial(job, str(folder), 1))


@pytest.mark.slow
def test_results_errors_reports_and_what_cannot_travel(address: str, tmp_path: Path) -> None:
    heard: list[tuple[object, ...]] = []
    with ClusterExecutor(address, tmp_path, lambda *words: heard.append(words)) as executor:
        assert executor.in_words == f"The cluster at {address}: 2 workers, 2 trials at once."
        assert executor.submit(identifier).result(PATIENCE) != os.getpid()
        refused = executor.submit(refuse, "The clip ends.").exception(PATIENCE)
        assert isinstance(refused, FootageError)
        assert (refused.message, refused.hint) == ("The clip ends.", "Give another.")
        assert "cannot be pickled" in str(executor.submit(unpicklable).exception(PATIENCE))
        assert executor.submit(speak, 3).result(PATIENCE) == 3
        until(lambda: len(heard) == 3)
        with pytest.raises(Exception, match="pickle"):
            executor.submit(lambda: None)
    assert heard == [("step", 0), ("step", 1), ("step", 2)]
    assert not list(tmp_path.iterdir())
    with pytest.raises(RuntimeError):
        executor.submit(identifier)


@pytest.mark.slow
def test_24_trials_with_a_worker_killed_are_those_of_a_serial_run(doomed: str, tmp_path: Path) -> None:
    wanted = measured(jobs_of(tmp_path / "serial", 12), tmp_path, serially)
    with ClusterExecutor(doomed, tmp_path) as executor:
        jobs = jobs_of(tmp_path / "log", 12, seed5="die once")
        found = measured(jobs, tmp_path, partial(run_jobs, executor=executor))
    assert len(found) == 24
    assert found == wanted
    lines = (tmp_path / "log").read_text().splitlines()
    by = [line.split()[0] for line in lines if line.endswith("plain 5")]
    assert len(by) == 2, "it was begun, lost with its worker, and given to another"
    assert by[0] != by[1]


# It waits for Dask's nannies to start both workers again, which now and then take minutes beside other tests.
@pytest.mark.slow
def test_what_loses_workers_again_and_again_is_said(doomed: str, tmp_path: Path) -> None:
    with ClusterExecutor(doomed, tmp_path) as executor:
        lost = executor.submit(die).exception(PATIENCE)
        assert isinstance(lost, ProcessLostError)
        assert "It lost 2 workers one after another, the last one was tcp://" in lost.message
        assert executor.submit(speak, 2).result(PATIENCE) == 2


def test_a_shutdown_that_cancels_ends_what_reports_and_what_waits(address: str, tmp_path: Path) -> None:
    places = [tmp_path / name for name in "ab"]
    for place in places:
        place.mkdir()
    executor = ClusterExecutor(address, tmp_path)
    running = [executor.submit(go_on_reporting, place) for place in places]
    waiting = executor.submit((tmp_path / "never").touch)
    until(lambda: all((place / "begun").exists() for place in places))
    executor.shutdown(cancel_futures=True)
    wait([*running, waiting], PATIENCE)
    assert all(future.cancelled() for future in (*running, waiting))
    until(lambda: all((place / "ended").exists() for place in places))
    with ClusterExecutor(address, tmp_path) as again:
        assert again.submit(speak, 1).result(PATIENCE) == 1
    assert not (tmp_path / "never").exists()


def test_what_ends_the_caller_cancels_what_waits(address: str, tmp_path: Path) -> None:
    class EnoughError(Exception):
        pass

    def enough(_job: TrialJob, _result: TrialResult) -> None:
        raise EnoughError

    gate = tmp_path / "log.gate"
    try:
        jobs = jobs_of(tmp_path / "log", 6, seed1="wait")
        with pytest.raises(EnoughError), chosen_executor(address, tmp_path) as executor:
            run_jobs(jobs, tmp_path, enough, executor=executor)
    finally:
        gate.touch()
    assert len((tmp_path / "log").read_text().splitlines()) < len(jobs)


def test_a_folder_that_workers_do_not_see(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = cluster._marked

    def unseen(folder: Path | str) -> cluster._Marker:
        marker = made(folder)
        marker.remove()
        return marker

    monkeypatch.setattr(cluster, "_marked", unseen)
    with pytest.raises(
        RunError, match=r"A worker on .* does not see the folder .* as this machine does"
    ) as no:
        ClusterExecutor(address, tmp_path)
    assert "Mount one file system" in no.value.hint
    assert not list(tmp_path.iterdir())


def test_a_worker_that_comes_later_without_the_folder_ends_the_work(address: str, tmp_path: Path) -> None:
    with ClusterExecutor(address, tmp_path) as executor:
        executor._withdraw()
        with pytest.raises(RunError, match="does not see the folder"):
            run_jobs(jobs_of(tmp_path / "log", 1), tmp_path, lambda *_: None, executor=executor)


def test_other_versions_are_named(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "_software", lambda: {**software, "numpy": "1.0"})
    with pytest.raises(RunError, match=r"A worker on .* has numpy .*, this machine has 1\.0\.") as no:
        ClusterExecutor(address, tmp_path)
    assert "same versions" in no.value.hint
    assert not list(tmp_path.iterdir())


software = cluster._software()


def test_nobody_answers(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"scheduler at 'tcp://127\.0\.0\.1:9' does not answer") as no:
        ClusterExecutor("tcp://127.0.0.1:9", tmp_path, patience=0.5)
    assert "dask scheduler" in no.value.hint
    with pytest.raises(RunError, match=r"scheduler at 'nowhere://x' does not answer"):
        ClusterExecutor("nowhere://x", tmp_path, patience=0.5)
    # A client that never came up would close itself whenever it is collected, and hang where another one starts then.
    assert not [one for one in gc.get_objects() if type(one) is Client and one.status != "closed"]


def test_the_scheduler_goes_away(tmp_path: Path) -> None:
    own = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0")
    try:
        executor = ClusterExecutor(own.scheduler_address, tmp_path, patience=2.0)
        begun = executor.submit(go_on_reporting, tmp_path)
        until((tmp_path / "begun").exists)
        own.sync(own.scheduler.close)  # at once: closing the cluster waits for the task
        lost = begun.exception(PATIENCE)
    finally:
        threading.Thread(target=own.close, daemon=True).start()
    executor.shutdown(cancel_futures=True)
    assert isinstance(lost, RunError)
    assert "is gone" in lost.message


def test_the_extra_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "distributed" else known(name)
    )
    with pytest.raises(RunError, match="not installed") as no:
        ClusterExecutor("tcp://127.0.0.1:9", tmp_path)
    assert 'pip install "capture-studio[cluster]"' in no.value.hint


def test_the_variable_chooses_and_nothing_chooses_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with chosen_executor("", tmp_path) as executor:
        assert executor is None
    monkeypatch.setenv(VARIABLE, "nowhere://x")
    with pytest.raises(StudioError, match="'nowhere://x'"), chosen_executor("", tmp_path):
        pass
