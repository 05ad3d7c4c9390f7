"""Functions run in processes of their own, one at a time in each: the local form of `concurrent.futures.Executor`.

Unlike `ProcessPoolExecutor`, a process that dies costs its own task only, tasks that are alike can stay with one
process, and a shutdown that cancels ends what is running, too.
"""

import os
import pickle
import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, ParamSpec, TypeVar

from studio.foundations.children import UNGUARDED, Child, EndedError, serve_tasks
from studio.foundations.errors import RunError

P = ParamSpec("P")
T = TypeVar("T")

ONE_CORE: Mapping[str, str] = dict.fromkeys(
    (
        "NUMBA_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    ),
    "1",
)


class ProcessLostError(RunError):
    """The process that ran a task ended before the task did."""


def cores() -> int:
    """How many processes can run at once on this machine, as far as this one may use it."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class ProcessExecutor(Executor):
    """Up to `count` processes, started when there is work and again after one died. Functions, arguments and results
    are pickled.

    environment : variables of the processes. near : of a task's function and arguments; a process takes the tasks with
    the value of its last one first, then those with a value that no other process has. on_report : hears, in
    another thread, what tasks `progress.report`. niceness : of the processes.
    """

    def __init__(
        self,
        count: int | None = None,
        *,
        environment: Mapping[str, str] | None = None,
        near: Callable[..., Hashable] = lambda *_: None,
        on_report: Callable[..., None] = lambda *_: None,
        niceness: int = 0,
    ) -> None:
        self._count = max(1, count or cores())
        self._environment, self._near, self._on_report = dict(environment or {}), near, on_report
        self._niceness = niceness
        self._changed = threading.Condition()
        self._waiting: list[_Task] = []
        self._closed = self._killed = False
        self._seats: list[_Seat] = []
        self._idle = 0

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run `fn(*args, **kwargs)` in a process; the future raises what it raised, ProcessLostError if that died.

        Raises RuntimeError after a shutdown, what pickle raises for what cannot be pickled.
        """
        task = _Task(Future(), pickle.dumps((fn, args, kwargs)), self._near(fn, *args))
        with self._changed:
            if self._closed:
                raise RuntimeError("The executor is shut down.")
            self._waiting.append(task)
            if self._idle < len(self._waiting) and len(self._seats) < self._count:
                seat = _Seat(self._environment, self._on_report, self._niceness)
                self._seats.append(seat)
                seat.thread = threading.Thread(
                    target=self._work, args=(seat,), name="process-seat", daemon=True
                )
                seat.thread.start()
            self._changed.notify()
        return task.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks. cancel_futures : cancel those that wait and end the processes of those that run."""
        with self._changed:
            self._closed = True
            if cancel_futures:
                self._killed = True
                for task in self._waiting:
                    task.future.cancel()
                for seat in self._seats:
                    seat.kill()
            self._changed.notify_all()
        if wait:
            for seat in self._seats:
                seat.thread.join()

    def _work(self, seat: "_Seat") -> None:
        """A seat's thread: task after task, until there will be no more."""
        try:
            while (task := self._next(seat)) is not None:
                if not task.future.set_running_or_notify_cancel():
                    continue
                try:
                    task.future.set_result(seat.run(task.content, lambda: self._killed))
                except BaseException as problem:
                    task.future.set_exception(problem)
        finally:
            seat.end()

    def _next(self, seat: "_Seat") -> "_Task | None":
        with self._changed:
            self._idle += 1
            self._changed.wait_for(lambda: self._waiting or self._closed)
            self._idle -= 1
            if not self._waiting or self._killed:
                return None
            others = [other.near for other in self._seats if other is not seat]
            task = self._waiting.pop(nearest([each.near for each in self._waiting], seat.near, others))
            seat.near = task.near
            return task


def nearest(waiting: Sequence[Hashable], own: Hashable, others: Sequence[Hashable]) -> int:
    """Which task a process takes: one near its last, else one that is near no other process's, else the first."""
    same = (at for at, near in enumerate(waiting) if near == own)
    free = (at for at, near in enumerate(waiting) if near not in others)
    return next(same, next(free, 0))


@dataclass(frozen=True, slots=True)
class _Task:
    future: Future[Any]
    content: bytes
    near: Hashable


class _Seat:
    """A place for one process: started with the first task, and again after it died."""

    def __init__(self, environment: Mapping[str, str], on_report: Callable[..., None], niceness: int) -> None:
        self.near: Hashable = None
        self.thread = threading.Thread()
        self._environment, self._on_report, self._niceness = environment, on_report, niceness
        self._child: Child | None = None
        self._starting = threading.Lock()

    def run(self, content: bytes, unwanted: Callable[[], bool]) -> object:
        """What a task returns. Raises what it raises, ProcessLostError, RunError where no process can run it."""
        with self._starting:
            if unwanted():
                raise ProcessLostError("The task was cancelled.")
            child = self._child = self._child or self._start()
        try:
            kind, answer = child.answer(content, self._on_report)
        except EndedError:
            how, code = child.death(), child.exit_code
            self.end()
            if code == UNGUARDED:
                raise RunError(
                    "Its process runs this script again from the beginning, as Python's do.",
                    "Put what the script does under \"if __name__ == '__main__':\".",
                ) from None
            raise ProcessLostError(f"The process that ran it {how}.") from None
        if kind == "raised":
            raise answer
        return answer

    def kill(self) -> None:
        """End the process at once, if there is one."""
        with self._starting:
            if self._child is not None:
                self._child.kill()

    def end(self) -> None:
        """The same, and wait for its end."""
        with self._starting:
            if self._child is not None:
                self._child.end()
            self._child = None

    def _start(self) -> Child:
        return Child(
            _run_tasks,
            self._niceness,
            name="studio-task",
            environment=self._environment,
            knows_script=True,
        )


def _run_tasks(inbox: Connection, outbox: Connection, niceness: int) -> None:
    """The process's whole life."""
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    serve_tasks(inbox, outbox)
