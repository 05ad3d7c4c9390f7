"""Trials in parallel processes: as many as there are cores, each on one core.

A process keeps the footage that it has looked at, so jobs on the same footage go to the same process while there
are others for the rest. A process that dies is replaced; a job that was in hand then is tried once more.
"""

import multiprocessing
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path

from studio.comparison.footage_shelf import MOST_BYTES
from studio.comparison.trials import TrialJob
from studio.worker.owned_process import ending
from studio.worker.trial_process import TrialResult, run_trials

# Libraries read these when they are loaded, so they are set while a process is started.
ONE_CORE = {
    name: "1"
    for name in (
        "NUMBA_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    )
}
DEATHS_ALLOWED = 1
MEMORY_SHARE = 0.5
CHECK_SECONDS = 0.2
# How long a process that hung up may take to end, s.
PATIENCE = 5.0


def cores() -> int:
    """How many processes can run at once on this machine, as far as this one may use it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_jobs(
    jobs: Sequence[TrialJob],
    footage_folder: Path,
    on_result: Callable[[TrialJob, TrialResult], None],
    processes: int | None = None,
    checkpoint: Callable[[], None] = lambda: None,
) -> None:
    """Run all jobs, those that must be alone at the end. on_result : called here, as each is done. checkpoint : called
    here, several times a second.

    Leaves no process behind, whatever is raised (KeyboardInterrupt, or what `on_result` and `checkpoint` raise).
    """
    shared = [job for job in jobs if not job.alone]
    alone = [job for job in jobs if job.alone]
    count = max(1, processes or cores())
    _run(shared, footage_folder, on_result, count, checkpoint, one_core=True)
    _run(alone, footage_folder, on_result, 1, checkpoint, one_core=False)


def _run(
    jobs: list[TrialJob],
    footage_folder: Path,
    on_result: Callable[[TrialJob, TrialResult], None],
    count: int,
    checkpoint: Callable[[], None],
    *,
    one_core: bool,
) -> None:
    waiting, deaths = list(jobs), dict[str, int]()
    count = min(count, len(jobs))
    seats = [_Seat(footage_folder, _shelf_bytes(count), one_core) for _ in range(count)]
    try:
        while waiting or any(seat.job for seat in seats):
            for seat in seats:
                if waiting and seat.job is None:
                    others = [other.footage for other in seats if other is not seat]
                    seat.give(waiting.pop(next_job(waiting, seat.footage, others)))
            checkpoint()
            for seat in ready(seats):
                job, result = seat.take()
                if result is None:
                    deaths[job.key] = deaths.get(job.key, 0) + 1
                    if deaths[job.key] <= DEATHS_ALLOWED:
                        waiting.insert(0, job)
                        continue
                    result = TrialResult(job.key, None, f"The process that ran it {seat.last_ending}.", 0.0)
                on_result(job, result)
    finally:
        for seat in seats:
            seat.close()


def next_job(waiting: Sequence[TrialJob], footage: tuple[str, ...], others: Sequence[tuple[str, ...]]) -> int:
    """Which job a process takes next: one on the footage that it has, else on footage that no other has, else the
    first.
    """
    same = (index for index, job in enumerate(waiting) if job.footage == footage)
    free = (index for index, job in enumerate(waiting) if job.footage not in others)
    return next(same, next(free, 0))


class _Seat:
    """A place for one process: started with the first job, and again when it died."""

    def __init__(self, footage_folder: Path, shelf_bytes: int, one_core: bool) -> None:
        self.job: TrialJob | None = None
        self.footage: tuple[str, ...] = ()
        self.last_ending = ""
        self._arguments = (str(footage_folder), shelf_bytes)
        self._environment = ONE_CORE if one_core else {}
        self._process: BaseProcess | None = None
        self.pipe: Connection | None = None

    def give(self, job: TrialJob) -> None:
        """Set the process to work."""
        self.job, self.footage = job, job.footage
        try:
            if self.pipe is None:
                self._start()
            assert self.pipe is not None
            self.pipe.send((job.key, pickle.dumps(job)))
        except (BrokenPipeError, ConnectionResetError):
            # It is found dead when its answer is taken.
            return

    def take(self) -> tuple[TrialJob, TrialResult | None]:
        """The job in hand and its result; None where the process died of it."""
        assert self.job is not None
        assert self.pipe is not None
        job, self.job = self.job, None
        try:
            return job, self.pipe.recv()
        except (EOFError, OSError, pickle.UnpicklingError):
            self._died()
            return job, None

    def close(self) -> None:
        """End the process at once."""
        if self._process is not None:
            self._process.kill()
        self._forget()

    def _died(self) -> None:
        """Learn how the process ended."""
        assert self._process is not None
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        code = self._process.exitcode
        self.last_ending = ending(code) if code is not None and code < 0 else f"ended with {ending(code)}"
        self._forget()

    def _forget(self) -> None:
        if self.pipe is not None:
            self.pipe.close()
            self.pipe = None
        if self._process is not None:
            self._process.join()
            self._process = None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=run_trials, args=(theirs, *self._arguments), name="studio-trials", daemon=True
        )
        with _environment(self._environment):
            process.start()
        self._process = process
        # Only the process itself may hold this end: then the pipe ends when the process does.
        theirs.close()
        self.pipe = ours


def ready(seats: Sequence[_Seat]) -> list[_Seat]:
    """The seats whose process has answered or died, as soon as there is one; none after a moment without."""
    pipes = {seat.pipe: seat for seat in seats if seat.job is not None and seat.pipe is not None}
    return [pipes[pipe] for pipe in wait(list(pipes), CHECK_SECONDS)]  # pyright: ignore[reportArgumentType]


def _shelf_bytes(count: int) -> int:
    """How much evidence each of so many processes may keep: half of the memory among them, at most."""
    if not hasattr(os, "sysconf") or count < 1:
        return MOST_BYTES
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min(MOST_BYTES, int(memory * MEMORY_SHARE / count))


@contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Environment variables for a process that is being started."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
