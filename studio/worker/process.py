"""The tracking process: commands in, events out, one layer between them.

It is started with `spawn`, so it shares nothing with the server but two pipes. Commands come through one,
which also says (by its end) that the server is gone; events leave through the other from a thread of their
own, newest first to win, so that a slow server never holds up the search. The same thread sends a heartbeat
when there is nothing else to say.
"""

import contextlib
import dataclasses
import logging
import queue
import signal
import threading
import time
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection

from studio.worker.commands import Command
from studio.worker.events import Event, LayerFinished, LogLine
from studio.worker.tracking_job import TrackingJob
from studio.worker.watchers import Subscription

HEARTBEAT_SECONDS = 1.0
WAIT_SECONDS = 0.5

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """The process lives. at : `time.monotonic()`."""

    at: float


def run_process(inbox: Connection, outbox: Connection) -> None:
    """The process's whole life: until a Stop, or until the server is gone."""
    # Ctrl-C in the terminal reaches both processes; the server decides what becomes of this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
