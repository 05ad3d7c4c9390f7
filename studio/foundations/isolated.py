"""Runs native parsers on unchecked files in a separate process, which may crash, hang or request any memory.

Only files that this process has read completely are read again by the server or the tracking process. One process
serves one file after another (a second one starts if two threads need it at once), and ends when it is unused.
"""

import contextlib
import importlib
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, ParamSpec, TypeVar

from studio.foundations.errors import StudioError

P = ParamSpec("P")
Result = TypeVar("Result")
OnFrame = Callable[[int, int], None]

SECONDS_OF_SILENCE = 30.0
"""So long a reader may take for a frame, or for a file without frames."""
MEMORY_BYTES = 8 << 30
IDLE_SECONDS = 20.0
REMEDY = "The file is damaged, or made to do harm: copy or export it again."
COMMAND = "from studio.foundations.isolated import serve; serve()"
INSIDE = "STUDIO_ISOLATED"


def isolated(
    wrong: type[StudioError],
    function: Callable[..., Result],
    path: Path,
    on_frame: OnFrame | None = None,
    **options: object,
) -> Result:
    """`function(path, on_frame, **options)` (without on_frame where that is None) in a process of its own.

    function : of a module, by its name; what it returns and raises can be pickled. on_frame : called here; may raise to
    stop. Raises `wrong` naming the file whose reader crashed or hung, and what the function raises.
    """
    if os.environ.get(INSIDE):
        return function(path, *([] if on_frame is None else [on_frame]), **options)
    child = _CHILDREN.take()
    try:
        child.send((function.__module__, function.__qualname__, path, on_frame is not None, options))
        while True:
            kind, value = child.hear(SECONDS_OF_SILENCE)
            if kind == "frame" and on_frame is not None:
                on_frame(*value)
            elif kind == "result":
                _CHILDREN.give_back(child)
                return value
            elif kind == "raised":
                _CHILDREN.give_back(child)
                if isinstance(value, StudioError):
                    raise value
                reason = " ".join(str(value).split())[:200] or type(value).__name__
                raise wrong(f"'{path.name}' cannot be read ({reason}).", REMEDY)
    except _Ended as ended:
        child.kill()
        raise wrong(f"'{path.name}' cannot be read: its reader {ended}.", REMEDY) from None
    except BaseException:
        if child.busy:
            child.kill()
        raise


def silent(done: int, total: int) -> None:
    """Progress without a callback; it still shows that the reader is alive."""
    return


class _Ended(Exception):
    """How the process ended, or that it does not answer, as text."""


class _Child:
    """The process from outside."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", COMMAND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={
                **os.environ,
                INSIDE: "1",
                "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
                "OPENBLAS_NUM_THREADS": "1",
            },
        )
        self.busy = False
        self._heard: queue.SimpleQueue[tuple[str, Any] | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, name="isolated reader", daemon=True).start()

    @property
    def lives(self) -> bool:
        return self._process.poll() is None

    def send(self, question: object) -> None:
        assert self._process.stdin is not None
        self.busy = True
        try:
            pickle.dump(question, self._process.stdin)
            self._process.stdin.flush()
        except OSError:
            raise _Ended("crashed") from None

    def hear(self, patience: float) -> tuple[str, Any]:
        try:
            reply = self._heard.get(timeout=patience)
        except queue.Empty:
            raise _Ended(f"took more than {patience:g} s") from None
        if reply is None:
            raise _Ended("crashed")
        self.busy = reply[0] == "frame"
        return reply

    def kill(self) -> None:
        with contextlib.suppress(OSError):
            self._process.kill()
        self._process.wait()
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()

    def _listen(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        with stream:
            while True:
                try:
                    self._heard.put(pickle.load(stream))
                except Exception:
                    self._heard.put(None)
                    return


class _Children:
    """The processes that wait for a file."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[_Child] = []
        self._timer: threading.Timer | None = None

    def take(self) -> _Child:
        with self._lock:
            while self._idle:
                child = self._idle.pop()
                if child.lives:
                    return child
                child.kill()
        return _Child()

    def give_back(self, child: _Child) -> None:
        with self._lock:
            self._idle.append(child)
            if self._timer is not None:
                self._timer.cancel()
            self._timer = threading.Timer(IDLE_SECONDS, self.end)
            self._timer.daemon = True
            self._timer.start()

    def end(self) -> None:
        with self._lock:
            ending, self._idle = self._idle, []
        for child in ending:
            child.kill()


_CHILDREN = _Children()


def serve() -> None:
    """The main function of the process: reads files until the pipe is closed."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource  # noqa: PLC0415 - not on every system

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    # Ctrl-C in the terminal reaches both processes; the parent decides about this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries that print must not write into the pipe.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            module, name, path, with_frames, options = pickle.load(sys.stdin.buffer)
        except (EOFError, OSError):
            return
        function = getattr(importlib.import_module(module), name)
        callbacks = [_progress(answers)] if with_frames else []
        try:
            answer = ("result", function(path, *callbacks, **options))
        except Exception as problem:
            answer = ("raised", problem)
        try:
            content = pickle.dumps(answer)
        except Exception as problem:
            content = pickle.dumps(("raised", RuntimeError(str(problem))))
        answers.write(content)
        answers.flush()


def _progress(answers: BinaryIO) -> OnFrame:
    def report(done: int, total: int) -> None:
        pickle.dump(("frame", (done, total)), answers)
        answers.flush()

    return report
