"""Functions in processes, and trials through any executor: order, losses, what is left behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from pathlib import Path

import pytest
from toy_experiments import toy

from studio.foundations.errors import FootageError
from studio.foundations.progress import report
from studio.garden.reproduction.plan import each_once, plan
from studio.operations.jobs.process_executor import ProcessExecutor, ProcessLostError, nearest
from studio.operations.jobs.trials import TrialResult, run_jobs, run_trial
from studio.results.comparison.trials import Scale, TrialJob

PATIENCE = 120.0


def identifier() -> int:
    return os.getpid()


def refuse(message: str) -> None:
    raise FootageError(message, "Give another.")


def die_unless(place: Path) -> str:
    """Dies the first time."""
    if not place.exists():
        place.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "came back"


def speak(words: int) -> str:
    for number in range(words):
        report("step", number)
    return os.environ.get("TOY", "")


def unpicklable() -> Callable[[], None]:
    return lambda: None


def sleep_in(place: Path) -> None:
    place.write_text(str(os.getpid()))
    time.sleep(PATIENCE)


@pytest.fixture
def one() -> Iterator[ProcessExecutor]:
    with ProcessExecutor(1) as made:
        yield made


def test_a_process_stays_with_what_is_near_its_last_task() -> None:
    waiting = ["walk", "run", "walk", "box"]
    assert nearest(waiting, "run", ["walk"]) == 1
    assert nearest(waiting, "stand", ["walk", "run"]) == 3
    assert nearest(waiting, "", []) == 0
    assert nearest(waiting[:1], "run", ["walk"]) == 0


@pytest.mark.slow
def test_results_errors_and_what_cannot_travel(one: ProcessExecutor) -> None:
    here = one.submit(identifier)
    assert here.result(PATIENCE) not in (0, os.getpid())
    refused = one.submit(refuse, "The clip ends.").exception(PATIENCE)
    assert isinstance(refused, FootageError)
    assert (refused.message, refused.hint) == ("The clip ends.", "Give another.")
    assert "cannot be pickled" in str(one.submit(unpicklable).exception(PATIENCE))
    assert one.submit(identifier).result(PATIENCE) == here.result(), "the process lives through all of it"
    with pytest.raises(Exception, match="pickle"):
        one.submit(lambda: None)


@pytest.mark.slow
def test_a_lost_process_fails_its_own_task_and_is_said(one: ProcessExecutor, tmp_path: Path) -> None:
    before = one.submit(identifier)
    lost, after = one.submit(die_unless, tmp_path / "died"), one.submit(identifier)
    problem = lost.exception(PATIENCE)
    assert isinstance(problem, ProcessLostError)
    assert problem.message == "The process that ran it ended by signal 9, SIGKILL."
    assert after.result(PATIENCE) != before.result(PATIENCE)


SCRIPT = """
from studio.operations.jobs.process_executor import ProcessExecutor

with ProcessExecutor(1) as one:
    problem = one.submit(abs, -1).exception()
print(type(problem).__name__, problem)
"""


@pytest.mark.slow
def test_a_script_that_its_processes_would_run_again_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    ended = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=PATIENCE
    )
    assert "RunError Its process runs this script again" in ended.stdout
    assert "if __name__ == '__main__':" in ended.stdout


def test_a_process_that_cannot_be_started_is_waited_for_by_no_task(
    one: ProcessExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise BlockingIOError("Resource temporarily unavailable")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    for _ in range(2):
        assert isinstance(one.submit(identifier).exception(PATIENCE), BlockingIOError)


@pytest.mark.slow
def test_a_task_tells_what_it_does_and_has_the_environment() -> None:
    heard: list[tuple[object, ...]] = []
    with ProcessExecutor(1, environment={"TOY": "1"}, on_report=lambda *words: heard.append(words)) as one:
        assert one.submit(speak, 3).result(PATIENCE) == "1"
    assert heard == [("step", 0), ("step", 1), ("step", 2)]
    assert "TOY" not in os.environ
    assert speak(3) == "", "elsewhere nobody hears"


@pytest.mark.slow
def test_a_shutdown_that_cancels_ends_what_runs_and_what_waits(tmp_path: Path) -> None:
    one = ProcessExecutor(1)
    running, waiting = one.submit(sleep_in, tmp_path / "pid"), one.submit(identifier)
    while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
        assert not running.done()
    one.shutdown(cancel_futures=True)
    assert isinstance(running.exception(PATIENCE), ProcessLostError)
    assert waiting.cancelled()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
    with pytest.raises(RuntimeError):
        one.submit(identifier)


@pytest.mark.slow
def test_a_waiting_task_can_be_cancelled_alone(one: ProcessExecutor) -> None:
    first, second, third = (one.submit(identifier) for _ in range(3))
    if second.cancel():
        assert second.cancelled()
    wait([first, third], PATIENCE)
    assert first.result() == third.result()


# ------------------------------------------------------------------ trials


def jobs_of(log: Path, *, alone: bool = False, **deeds: str) -> list[TrialJob]:
    return list(each_once([plan(toy("toy", log, alone=alone, **deeds), Scale((0, 1, 2)))]).values())


def run_with(jobs: list[TrialJob], folder: Path, executor: Executor | None) -> dict[str, TrialResult]:
    found: dict[str, TrialResult] = {}

    def on_result(job: TrialJob, result: TrialResult) -> None:
        assert threading.current_thread() is threading.main_thread()
        found[job.label] = result

    run_jobs(jobs, folder, on_result, 2, executor=executor)
    return found


class Remote(Executor):
    """As a cluster's client is used: it hands out futures, notes who was submitted, and must not be shut down."""

    def __init__(self) -> None:
        self.labels: list[str] = []
        self._threads = ThreadPoolExecutor(2)

    def submit(self, fn: Callable, /, *args: object, **kwargs: object) -> Future:
        self.labels += [job.label for job in args if isinstance(job, TrialJob)]
        return self._threads.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        raise AssertionError("it is not ours to end")


EXECUTORS: dict[str, Callable[[], Executor | None]] = {
    "of its own": lambda: None,
    "threads": lambda: ThreadPoolExecutor(2),
    "processes": lambda: ProcessExecutor(2),
    "the standard's processes": lambda: ProcessPoolExecutor(2),
    "a client's": Remote,
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "alone"), [*((name, False) for name in EXECUTORS), ("a client's", True)])
def test_any_executor_gives_the_same_outcomes(tmp_path: Path, name: str, alone: bool) -> None:
    jobs = jobs_of(tmp_path / "log", alone=alone, seed1="refuse")
    wanted = {job.label: run_trial(job, str(tmp_path), 0) for job in jobs}
    used = EXECUTORS[name]()
    found = run_with(jobs, tmp_path, used)
    if isinstance(used, Remote):
        assert used.labels == [job.label for job in jobs]
    elif used is not None:
        used.shutdown()
    assert len(found) == 6
    for label, result in found.items():
        assert result.failure == wanted[label].failure
        if result.measured is not None:
            assert result.measured["error"] == wanted[label].measured["error"]  # pyright: ignore[reportOptionalSubscript]
    assert {label for label, result in found.items() if result.failure} == {"plain, seed 1", "clever, seed 1"}


@pytest.mark.slow
def test_a_lost_process_fails_only_its_trial_after_a_second_try(tmp_path: Path) -> None:
    found = run_with(jobs_of(tmp_path / "log", seed1="die"), tmp_path, None)
    assert [label for label, result in found.items() if result.failure] == ["plain, seed 1"]
    assert found["plain, seed 1"].failure == "The process that ran it ended by signal 9, SIGKILL."
    lines = (tmp_path / "log").read_text().splitlines()
    assert sum(line.endswith("plain 1") for line in lines) == 2


def test_a_pool_that_breaks_whole_is_said_of_each_trial(tmp_path: Path) -> None:
    """The standard's pool is of no more use after one death; nothing waits for ever."""
    with ProcessPoolExecutor(1) as pool:
        found = run_with(jobs_of(tmp_path / "log", seed1="die"), tmp_path, pool)
    assert len(found) == 6
    assert "terminated abruptly" in found["plain, seed 1"].failure


def test_what_ends_the_caller_cancels_what_waits(tmp_path: Path) -> None:
    class EnoughError(Exception):
        pass

    def enough(_job: TrialJob, _result: TrialResult) -> None:
        raise EnoughError

    gate = tmp_path / "log.gate"
    with ThreadPoolExecutor(1) as threads:
        try:
            jobs = jobs_of(tmp_path / "log", seed1="wait")
            with pytest.raises(EnoughError):
                run_jobs(jobs, tmp_path, enough, executor=threads)
        finally:
            gate.touch()
    assert len((tmp_path / "log").read_text().splitlines()) < len(jobs)
