"""Functions run in processes of their own, one at a time in each: the local form of `concurrent.futures.Executor`.

Unlike `ProcessPoolExecutor`, a process that dies costs its own task only, tasks that are alike can stay with one
process, and a shutdown that cancels ends what is running, too.
"""

import multiprocessing
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Hashable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, ParamSpec, TypeVar

from studio.foundations.errors import RunError
from studio.foundations.progress import heard_by

P = ParamSpec("P")
T = TypeVar("T")

# Libraries read these when they are loaded, so they are set while a process is started.
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
PATIENCE = 5.0
"""How long a process that hung up may take to end, s."""
UNGUARDED = 76
"""Exit code of a process that would have started processes while it was being started itself."""


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
        self._process: BaseProcess | None = None
        self._pipe: Connection | None = None
        self._starting = threading.Lock()

    def run(self, content: bytes, unwanted: Callable[[], bool]) -> object:
        """What a task returns. Raises what it raises, ProcessLostError, RunError where no process can run it."""
        with self._starting:
            if unwanted():
                raise ProcessLostError("The task was cancelled.")
            pipe = self._pipe or self._start()
        try:
            pipe.send_bytes(content)
            while True:
                kind, answer = pipe.recv()
                if kind != "report":
                    break
                self._on_report(*answer)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._death() from None
        if kind == "raised":
            raise answer
        return answer

    def kill(self) -> None:
        """End the process at once, if there is one."""
        with self._starting:
            if self._process is not None:
                self._process.kill()

    def end(self) -> None:
        """The same, and wait for its end."""
        with self._starting:
            if self._process is not None and self._pipe is not None:
                self._process.kill()
                self._process.join()
                self._pipe.close()
            self._pipe = self._process = None

    def _start(self) -> Connection:
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            # A process that another one's script started: it runs that script, which starts processes, from its
            # beginning.
            os._exit(UNGUARDED)
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=_run_tasks, args=(theirs, self._niceness), name="studio-task", daemon=True
        )
        # Only the process itself may hold the other end: then the pipe ends when the process does.
        with theirs, _environment(self._environment):
            process.start()
        self._process, self._pipe = process, ours
        return ours

    def _death(self) -> RunError:
        """That the process ended, and how."""
        assert self._process is not None
        self._process.join(PATIENCE)
        code = self._process.exitcode
        self.end()
        if code == UNGUARDED:
            return RunError(
                "Its process runs this script again from the beginning, as Python's do.",
                "Put what the script does under \"if __name__ == '__main__':\".",
            )
        return ProcessLostError(f"The process that ran it {ending(code)}.")


def ending(exit_code: int | None) -> str:
    """How a process ended, as the end of a sentence: "ended by signal 9, SIGKILL"."""
    if exit_code is not None and exit_code < 0:
        return f"ended by signal {-exit_code}, {signal.Signals(-exit_code).name}"
    return f"ended with exit code {exit_code}"


_starting = threading.Lock()


@contextmanager
def _environment(values: Mapping[str, str]) -> Generator[None]:
    """Environment variables for a process that is being started, one at a time."""
    with _starting:
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


# ------------------------------------------------------------------ in the process


def _run_tasks(pipe: Connection, niceness: int) -> None:
    """The process's whole life: tasks in, what they report and what comes of them out, until the other end is gone."""

    def report(*words: object) -> None:
        with suppress(OSError):
            pipe.send(("report", words))

    # Ctrl-C in the terminal reaches all processes; the one that started them decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if niceness and hasattr(os, "nice"):
        os.nice(niceness)
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()
    with suppress(EOFError, OSError), heard_by(report):
        while True:
            pipe.send_bytes(answered(pipe.recv_bytes()))


def answered(content: bytes) -> bytes:
    """Run a pickled (function, arguments, options); ("returned", result) or ("raised", exception), pickled."""
    try:
        function, arguments, options = pickle.loads(content)
        answer = ("returned", function(*arguments, **options))
    except Exception as problem:
        problem.add_note(traceback.format_exc())
        answer = ("raised", problem)
    try:
        return pickle.dumps(answer)
    except Exception as problem:
        what = f"What came of it cannot be pickled: {problem!r}; {answer[1]!r:.200}"
        return pickle.dumps(("raised", RuntimeError(what)))


def _end_with_parent() -> None:
    """The result is of no use once the process that submitted the task was killed."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
