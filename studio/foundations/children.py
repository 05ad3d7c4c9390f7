"""Processes that this one starts: begun, asked, ended, and what a death means.

Ours, because loky fails every task when one process dies, and pebble's processes cannot be started in a process of its
own and go on in the midst of a task when their parent was killed; neither brings a task's reports back.

A child shares nothing with this process but pipes, which end when either of both does: a child whose parent is gone
ends, and a parent hears of a child's death at once.
"""

import contextlib
import multiprocessing
import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from multiprocessing import spawn
from multiprocessing.connection import Connection
from typing import Any

from studio.foundations.progress import heard_by

UNGUARDED = 76
"""Exit code of a process that would have started processes while it was being started itself."""
HARD_END_SECONDS = 5.0
"""How long a process that hung up may take to end."""


class EndedError(Exception):
    """A child is gone, or its pipe is: there will be no answer."""


class SilentError(Exception):
    """A child has said nothing for as long as it may."""


class Child:
    """A process that runs `function(inbox, outbox, *arguments)` and ends when that returns.

    function : of a module, by its name. inbox gives it what is sent to `inbox` here; what it sends to outbox comes from
    `outbox` here; whatever can be pickled.
    name : in lists of processes. environment : variables that it has besides this one's; libraries read theirs when
    they are loaded. knows_script : what this process's script defines is there, because the script is imported.
    quiet : nothing that it prints is seen. finishes : when its parent is gone it sees the end of its inbox, instead of
    being ended in the midst of what it does.
    """

    def __init__(
        self,
        function: Callable[..., None],
        *arguments: object,
        name: str,
        environment: Mapping[str, str] | None = None,
        knows_script: bool = False,
        quiet: bool = False,
        finishes: bool = False,
    ) -> None:
        if knows_script and getattr(multiprocessing.current_process(), "_inheriting", False):
            # This process is being started by its parent's script, which it imports, and which starts processes.
            os._exit(UNGUARDED)
        theirs_in, self.inbox = multiprocessing.Pipe(duplex=False)
        self.outbox, theirs_out = multiprocessing.Pipe(duplex=False)
        # What is written nowhere ends with this process.
        parent, self._presence = multiprocessing.Pipe(duplex=False)
        ends = [one.fileno() for one in (theirs_in, theirs_out, parent)]
        output = subprocess.DEVNULL if quiet else None
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import live; live(*{ends})"
        # Only the child may hold its ends: then a pipe ends when the process does.
        with theirs_in, theirs_out, parent:
            self._process = subprocess.Popen(
                [sys.executable, "-c", code, name],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                pass_fds=ends,
                env={**os.environ, **(environment or {})},
            )
        self._heard = select.poll()
        self._heard.register(self.outbox, select.POLLIN)
        with contextlib.suppress(EndedError):
            self.send((_script() if knows_script else {}, finishes))
            self.send((function, arguments))

    @property
    def identifier(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """How it ended (0: of itself; negative: by a signal), None while it lives."""
        return self._process.poll()

    def send(self, message: object) -> None:
        """Raises EndedError, what pickle raises for what cannot be pickled."""
        try:
            self.inbox.send(message)
        except OSError:
            raise EndedError from None

    def answer(
        self,
        task: bytes,
        on_report: Callable[..., None] = lambda *_: None,
        patience: float | None = None,
    ) -> tuple[str, Any]:
        """What a pickled (function, arguments, options) comes to in a child that runs `serve_tasks`: "returned" and the
        result, or "raised" and the exception.

        on_report : hears what the task reports. patience : how long it may report nothing, in seconds. Raises
        EndedError, SilentError, what on_report raises.
        """
        try:
            self.inbox.send_bytes(task)
            while True:
                # A tenth of the time that the connection's own poll takes.
                if patience is not None and not self._heard.poll(1000.0 * patience):
                    raise SilentError
                kind, value = self.outbox.recv()
                if kind != "report":
                    return kind, value
                on_report(*value)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise EndedError from None

    def wait(self, patience: float | None = None) -> None:
        """Until it has ended, so many seconds at most."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(patience)

    def kill(self) -> None:
        """End it at once; others may still wait for what it says."""
        self._process.kill()

    def end(self, patience: float | None = 0.0) -> None:
        """Give it so many seconds (None: as many as it takes) to end of itself, then end it; its pipes are closed."""
        self.wait(patience)
        self.kill()
        self.wait()
        for one in (self.inbox, self.outbox, self._presence):
            one.close()

    def death(self) -> str:
        """How it ended, as the end of a sentence: "ended by signal 9, SIGKILL"."""
        self.wait(HARD_END_SECONDS)
        code = self.exit_code
        if code is not None and code < 0:
            return f"ended by signal {-code}, {signal.Signals(-code).name}"
        return f"ended with exit code {code}"


def _script() -> dict[str, Any]:
    """By what the script of this process is found; as multiprocessing tells its processes."""
    known = spawn.get_preparation_data("studio")
    del known["authkey"]
    return known


# ------------------------------------------------------------------ in the child


def live(inbox_end: int, outbox_end: int, parent_end: int) -> None:
    """The whole life of a child."""
    # Ctrl-C in the terminal reaches all processes; the one that started this one decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    inbox, outbox = Connection(inbox_end, writable=False), Connection(outbox_end, readable=False)
    with contextlib.suppress(EOFError):
        script, finishes = inbox.recv()
        if not finishes:
            watch = threading.Thread(
                target=_end_with_parent, args=(parent_end,), name="parent-watch", daemon=True
            )
            watch.start()
        if script:
            process: Any = multiprocessing.current_process()
            process._inheriting = True
            spawn.prepare(script)
            del process._inheriting
        function, arguments = inbox.recv()
        function(inbox, outbox, *arguments)


def _end_with_parent(parent_end: int) -> None:
    """What is done is of no use once the process that wanted it is gone."""
    os.read(parent_end, 1)
    os._exit(1)


def serve_tasks(inbox: Connection, outbox: Connection) -> None:
    """Tasks in, what they report and what comes of them out, until the other end is gone."""

    def report(*words: object) -> None:
        with contextlib.suppress(OSError):
            outbox.send(("report", words))

    with contextlib.suppress(EOFError, OSError), heard_by(report):
        while True:
            outbox.send_bytes(answered(inbox.recv_bytes()))


def answered(task: bytes) -> bytes:
    """Run a pickled (function, arguments, options); ("returned", result) or ("raised", exception), pickled."""
    try:
        function, arguments, options = pickle.loads(task)
        answer = ("returned", function(*arguments, **options))
    except Exception as problem:
        problem.add_note(traceback.format_exc())
        answer = ("raised", problem)
    try:
        return pickle.dumps(answer)
    except Exception as problem:
        what = f"What came of it cannot be pickled: {problem!r}; {answer[1]!r:.200}"
        return pickle.dumps(("raised", RuntimeError(what)))
