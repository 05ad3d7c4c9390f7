"""The tracking process: commands in, events out, one layer between them; and its other end, in the server.

Commands come through one pipe, which also says (by its end) that the server is gone; events leave through the other
from a thread of their own, where a newer one of the same key takes the place of one that still waits, so that a slow
server never holds up the search. The same thread sends a heartbeat when there is nothing else to say.
"""

import contextlib
import dataclasses
import logging
import pickle
import queue
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from studio.foundations.children import Child, EndedError
from studio.foundations.errors import RunError
from studio.operations.jobs.commands import Command, Stop
from studio.operations.jobs.events import Event, LayerFinished, LogLine
from studio.operations.jobs.tracking_job import TrackingJob
from studio.operations.jobs.watchers import Subscription

HEARTBEAT_SECONDS = 1.0
WAIT_SECONDS = 0.5
SILENT_SECONDS = 20.0
"""A process sends a heartbeat every second; after this long without one it is said to be silent."""
STARTING_SECONDS = 120.0
"""How long its first one may take: on a busy machine the imports alone take longer than SILENT_SECONDS."""
LOST_HINT = "Resume: the run continues after its last finished frame with the same result."

logger = logging.getLogger(__name__)


class ProcessDiedError(RunError):
    """The tracking process is gone, and with it all that it had open."""


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """The process lives. at : `time.monotonic()`."""

    at: float


def run_process(inbox: Connection, outbox: Connection) -> None:
    """The process's whole life: until a Stop, or until the server is gone."""
    events = Subscription[Event]()
    sender = threading.Thread(target=_send_all, args=(events, outbox), name="events-out", daemon=True)
    sender.start()
    job = TrackingJob(lambda event: events.put(event, event.key))
    try:
        _loop(job, inbox)
    except Exception:
        events.put(LogLine("", "", "error", time.time(), traceback.format_exc()))
        raise
    finally:
        job.close()
        events.close()
        sender.join(timeout=5.0)


def _loop(job: TrackingJob, inbox: Connection) -> None:
    """Serve every command that waits, then do a layer if there is one to do.

    While a run is watched at a pace, the time that is left of its last layer is spent listening.
    """
    while not job.stopped:
        try:
            while inbox.poll(job.rest if job.busy else WAIT_SECONDS):
                command: Command = inbox.recv()
                job.serve(command)
                if job.stopped:
                    return
        except (EOFError, OSError):
            logger.info("The server is gone; the tracking process ends.")
            return
        if job.busy:
            job.advance()


def _send_all(events: Subscription[Event], outbox: Connection) -> None:
    """Send events as they come, and heartbeats between them, until the stream is closed and empty."""
    with contextlib.suppress(BrokenPipeError, OSError):
        while True:
            try:
                event = events.get(timeout=HEARTBEAT_SECONDS)
            except queue.Empty:
                if events.closed:
                    return
                outbox.send(Heartbeat(time.monotonic()))
                continue
            if isinstance(event, LayerFinished):
                event = dataclasses.replace(event, left_at=time.monotonic())
            outbox.send(event)


# ------------------------------------------------------------------ in the server


class OwnedProcess:
    """One life of the process, as seen from the server: it starts at once.

    on_event(self, event), on_silence(self, whether it is silent) and on_end(self) are called from a thread of its own.
    """

    def __init__(
        self,
        on_event: "Callable[[OwnedProcess, Event], None]",
        on_silence: "Callable[[OwnedProcess, bool], None]",
        on_end: "Callable[[OwnedProcess], None]",
    ) -> None:
        self._on_event, self._on_silence, self._on_end = on_event, on_silence, on_end
        self._sending = threading.Lock()
        self._child = Child(run_process, name="studio-tracking", knows_script=True, finishes=True)
        self._thread = threading.Thread(target=self._listen, name="tracking-events", daemon=True)
        self._thread.start()

    @property
    def identifier(self) -> int | None:
        """The process's id, None once it is gone."""
        return self._child.identifier if self._child.exit_code is None else None

    @property
    def exit_code(self) -> int | None:
        """How it ended (0: as it was requested to; negative: by a signal), None while it lives."""
        return self._child.exit_code

    def death(self) -> str:
        """How it ended, as the end of a sentence."""
        return self._child.death()

    def send(self, command: Command) -> None:
        """Post a command. Raises ProcessDiedError."""
        try:
            with self._sending:
                self._child.send(command)
        except EndedError:
            raise ProcessDiedError("The tracking process has died.", LOST_HINT) from None

    def end(self, patience: float) -> None:
        """Ask the process to end (patience > 0: and wait so many seconds), then make it."""
        if patience > 0.0:
            with contextlib.suppress(RunError):
                self.send(Stop())
            self._child.wait(patience)
        self._child.kill()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        with self._sending:
            self._child.end()

    def _listen(self) -> None:
        """Take everything that the process says, until it ends."""
        outbox, silent, patience = self._child.outbox, False, STARTING_SECONDS
        while True:
            try:
                if not outbox.poll(patience):
                    if not silent:
                        silent = True
                        self._on_silence(self, True)
                    continue
                message, patience = outbox.recv(), SILENT_SECONDS
            except (EOFError, OSError, pickle.UnpicklingError):
                break
            try:
                if silent:
                    silent = False
                    self._on_silence(self, False)
                if not isinstance(message, Heartbeat):
                    self._on_event(self, message)
            except Exception:
                # One event that cannot be passed on must not make its owner deaf.
                logger.exception("An event of the tracking process could not be passed on.")
        self._child.wait()
        self._on_end(self)
