"""Runs native parsers on unchecked files in a separate process, which may crash, hang or request any memory.

Only files that this process has read completely are read again by the server or the tracking process. One process
serves one file after another (a second one starts if two threads need it at once), and ends when it is unused.
"""

import contextlib
import os
import pickle
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TypeVar

from studio.foundations.children import Child, EndedError, SilentError, serve_tasks
from studio.foundations.errors import StudioError
from studio.foundations.progress import report

Result = TypeVar("Result")
OnFrame = Callable[[int, int], None]

SECONDS_OF_SILENCE = 30.0
"""So long a reader may take for a frame, or for a file without frames."""
MEMORY_BYTES = 8 << 30
IDLE_SECONDS = 20.0
REMEDY = "The file is damaged, or made to do harm: copy or export it again."
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
    task = pickle.dumps((function, (path, *([] if on_frame is None else [report])), options))
    child, is_free = _CHILDREN.take(), False
    try:
        kind, value = child.answer(task, on_frame or silent, SECONDS_OF_SILENCE)
        is_free = True
    except EndedError:
        raise wrong(f"'{path.name}' cannot be read: its reader crashed.", REMEDY) from None
    except SilentError:
        patience = f"{SECONDS_OF_SILENCE:g} s"
        raise wrong(f"'{path.name}' cannot be read: its reader took more than {patience}.", REMEDY) from None
    finally:
        if is_free:
            _CHILDREN.give_back(child)
        else:
            child.end()
    if kind == "returned":
        return value
    if isinstance(value, StudioError):
        raise value
    reason = " ".join(str(value).split())[:200] or type(value).__name__
    raise wrong(f"'{path.name}' cannot be read ({reason}).", REMEDY)


def silent(done: int, total: int) -> None:
    """Progress without a callback; it still shows that the reader is alive."""
    return


class _Children:
    """The processes that wait for a file."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._idle: list[Child] = []
        self._timer: threading.Timer | None = None

    def take(self) -> Child:
        with self._lock:
            while self._idle:
                child = self._idle.pop()
                if child.exit_code is None:
                    return child
                child.end()
        return Child(
            serve, name="studio-reader", environment={INSIDE: "1", "OPENBLAS_NUM_THREADS": "1"}, quiet=True
        )

    def give_back(self, child: Child) -> None:
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
            child.end()


_CHILDREN = _Children()


def serve(inbox: Connection, outbox: Connection) -> None:
    """The main function of the process: reads files until the pipe is closed."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource  # noqa: PLC0415 - not on every system

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    serve_tasks(inbox, outbox)
