"""One life of the tracking process, as seen from the server: started, spoken to, listened to, ended."""

import contextlib
import logging
import multiprocessing
import pickle
import signal
import threading
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Protocol

from studio.errors import RunError
from studio.worker.commands import Command, Stop
from studio.worker.events import Event
from studio.worker.process import Heartbeat, run_process

SILENT_SECONDS = 20.0
"""A process sends a heartbeat every second; after this long without one it is said to be silent."""

LOST_HINT = "Resume: the run goes on from its last finished frame with the same result."

logger = logging.getLogger(__name__)


class Listener(Protocol):
    """Who hears of a process; called from a thread of the process's own."""

    def heard(self, process: "OwnedProcess", event: Event) -> None:
        """An event came."""
        ...

    def silent(self, process: "OwnedProcess", silent: bool) -> None:
        """Nothing has come for long, or something came again."""
        ...

    def ended(self, process: "OwnedProcess") -> None:
        """The process is gone; `exit_code` says how."""
        ...


@dataclass(frozen=True, slots=True)
class _Ends:
    inbox: Connection
    outbox: Connection


class OwnedProcess:
    """Starts the process at once."""

    def __init__(self, listener: Listener) -> None:
        context = multiprocessing.get_context("spawn")
        inbox_end, inbox = context.Pipe(duplex=False)
        outbox, outbox_end = context.Pipe(duplex=False)
        self._listener = listener
        self._pipes = _Ends(inbox, outbox)
        self._sending = threading.Lock()
        self._process = context.Process(
            target=run_process, args=(inbox_end, outbox_end), name="studio-tracking", daemon=True
        )
        self._process.start()
        # Only the process itself may hold these ends: then a pipe ends when the process does.
        inbox_end.close()
        outbox_end.close()
        self._thread = threading.Thread(target=self._listen, name="tracking-events", daemon=True)
        self._thread.start()

    @property
    def identifier(self) -> int | None:
        """The process's id, None once it is gone."""
        return self._process.pid if self._process.is_alive() else None

    @property
    def exit_code(self) -> int | None:
        """How it ended (0: as it was asked to; negative: by a signal), None while it lives."""
        return self._process.exitcode

    def send(self, command: Command) -> None:
        """Post a command. Raises RunError if the process is gone."""
        try:
            with self._sending:
                self._pipes.inbox.send(command)
        except (BrokenPipeError, OSError):
            raise RunError("The tracking process has died.", LOST_HINT) from None

    def end(self, patience: float) -> None:
        """Ask the process to end (patience > 0: and wait so many seconds), then make it."""
        if patience > 0.0:
            with contextlib.suppress(RunError):
                self.send(Stop())
            self._process.join(patience)
        if self._process.is_alive():
            self._process.kill()
        self._process.join()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._pipes.inbox.close()

    def _listen(self) -> None:
        """Take everything that the process says, until it ends."""
        outbox, silent = self._pipes.outbox, False
        while True:
            try:
                if not outbox.poll(SILENT_SECONDS):
                    if not silent:
                        silent = True
                        self._listener.silent(self, True)
                    continue
                message = outbox.recv()
            except (EOFError, OSError, pickle.UnpicklingError):
                break
            try:
                if silent:
                    silent = False
                    self._listener.silent(self, False)
                if not isinstance(message, Heartbeat):
                    self._listener.heard(self, message)
            except Exception:
                # One event that cannot be passed on must not make its owner deaf.
                logger.exception("An event of the tracking process could not be passed on.")
        outbox.close()
        self._process.join()
        self._listener.ended(self)


def ending(exit_code: int | None) -> str:
    """How a process ended, in words."""
    if exit_code is not None and exit_code < 0:
        return f"ended by signal {-exit_code}, {signal.Signals(-exit_code).name}"
    return f"exit code {exit_code}"
