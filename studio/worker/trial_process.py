"""A process that runs trials: one at a time, on one core, with the evidence of its footage kept between them."""

import os
import pickle
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection, wait
from pathlib import Path

from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.kept_trials import plain
from studio.comparison.trials import Plain, TrialJob, failure_in_words


@dataclass(frozen=True, slots=True)
class TrialResult:
    """measured : plain values, None where it failed; failure : why, then."""

    key: str
    measured: dict[str, Plain] | None
    failure: str
    seconds: float


def run_trials(inbox: Connection, footage_folder: str, shelf_bytes: int) -> None:
    """The process's whole life: jobs in, results out, until the other end is gone."""
    # Ctrl-C in the terminal reaches all processes; the one that asks for the trials decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="parent-watch", daemon=True).start()
    shelf = FootageShelf(Path(footage_folder), shelf_bytes)
    try:
        with suppress(EOFError, OSError):
            while True:
                key, content = inbox.recv()
                inbox.send(_result(key, content, shelf))
    finally:
        shelf.close()


def _result(key: str, content: bytes, shelf: FootageShelf) -> TrialResult:
    """Run one job; whatever goes wrong becomes words."""
    began = time.perf_counter()
    measured, failure = None, ""
    try:
        job: TrialJob = pickle.loads(content)
        measured = plain(job.measure(job.arguments, shelf))
    except Exception as error:
        failure = failure_in_words(error)
    return TrialResult(key, measured, failure, time.perf_counter() - began)


def _end_with_parent() -> None:
    """A trial whose asker was killed is of no use to anybody."""
    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)
