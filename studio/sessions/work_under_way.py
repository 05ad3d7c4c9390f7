"""Work in a session, announced to all processes: meanwhile the session is neither renamed nor deleted.

Beside a session, in `.studio/under-way`, each piece of work holds the lock of a file whose name says what it is; the
system frees it when its process dies. To begin work, to move a session or a run, and to change a record that was read
before, a process takes a turn (`one_at_a_time`), in which no other process does any of these.
"""

import contextlib
import itertools
import os
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.foundations.foreign_files import MANIFEST_NAME
from studio.sessions.process_lock import ProcessLock
from studio.sessions.run_record import FILE_NAME as RECORD_NAME

STATE_NAME = ".studio"
"""Folder beside sessions for what servers and other processes keep."""
FOLDER, TURN, ENDING, BETWEEN = "under-way", "turn.lock", ".lock", ","
PATIENCE = 20.0
"""Seconds to wait for one's turn; who has it needs milliseconds."""
_numbers = itertools.count()
_mine = threading.local()


class Work(NamedTuple):
    """session, run : names ("" for no run of its own). verb : what is done. process : its number."""

    session: str
    run: str
    verb: str
    process: str

    def in_words(self) -> str:
        of = f"run '{self.run}'" if self.run else "it"
        return f"'{self.verb}' works on {of} (process {self.process})"


@contextmanager
def one_at_a_time(session: Path) -> Generator[None]:
    """Keep all other processes and threads out, for all sessions in the folder of this one.

    Where nothing can be written nothing is changed either, and no other is waited for. Raises RunError where another
    one stays inside.
    """
    folder = session.parent / STATE_NAME / FOLDER
    held: set[Path] = _mine.__dict__.setdefault("held", set())
    if folder in held:
        yield
        return
    lock = None
    with contextlib.suppress(OSError, SessionError):
        folder.mkdir(parents=True, exist_ok=True)
        lock = ProcessLock.take(folder / TURN, PATIENCE)
        if lock is None:
            raise RunError(
                f"Another process has kept the sessions beside '{session.name}' to itself for {PATIENCE:.0f} s.",
                "End it, and do this again.",
            )
    held.add(folder)
    try:
        yield
    finally:
        held.discard(folder)
        if lock is not None:
            lock.free()


@contextmanager
def working_on(session: Path, verb: str, run: str = "") -> Generator[None]:
    """Keep a session (or one run of it) in its place inside, whatever other processes do.

    verb : what is done, for others to read.

    Raises NotFoundError where it no longer exists.
    """
    with one_at_a_time(session):
        check_there(session, run)
        lock = _begin(session, verb, run)
    own: set[Path] = _mine.__dict__.setdefault("work", set())
    if lock is not None:
        own.add(lock.path)
    try:
        yield
    finally:
        if lock is not None:
            own.discard(lock.path)
            lock.end()


class _Held(NamedTuple):
    path: Path
    lock: ProcessLock

    def end(self) -> None:
        self.lock.free()
        with contextlib.suppress(OSError):
            self.path.unlink()


def _begin(session: Path, verb: str, run: str) -> _Held | None:
    words = (session.name, run, verb, str(os.getpid()), str(next(_numbers)))
    path = session.parent / STATE_NAME / FOLDER / f"{BETWEEN.join(words)}{ENDING}"
    try:
        lock = ProcessLock.take(path)
    except SessionError:
        return None
    return None if lock is None else _Held(path, lock)


@contextmanager
def moving(session: Path, run: str = "") -> Generator[None]:
    """Rename or delete a session (or one run of it) inside: no work on it is under way, and none begins.

    Raises RunError naming the work, NotFoundError where it no longer exists.
    """
    with one_at_a_time(session):
        check_there(session, run)
        for work in under_way(session):
            if not run or work.run in ("", run):
                raise RunError(
                    f"Session '{session.name}' stays as it is while {work.in_words()}.",
                    "Wait for it, or end it.",
                )
        yield


def check_there(session: Path, run: str = "") -> None:
    """Raise NotFoundError where a session, or a run of it, no longer exists."""
    if not (session / MANIFEST_NAME).is_file():
        raise gone(f"Session '{session.name}'")
    if run and not (session / "runs" / run / RECORD_NAME).is_file():
        raise gone(f"Run '{run}' of session '{session.name}'")


def gone(what: str) -> NotFoundError:
    """The error for something that was there a moment ago. what : begins the sentence."""
    return NotFoundError(f"{what} was renamed or deleted meanwhile.", "Do it again under its new name.")


def check_alone(session: Path) -> None:
    """Raise RunError where anything but this thread's own work goes on in a session: it may be reading the footage."""
    for work in work_of_others(session):
        raise RunError(
            f"Session '{session.name}' keeps its footage while {work.in_words()}.",
            "Wait for it, or end it.",
        )


def work_of_others(session: Path) -> Iterator[Work]:
    """The work in a session but this thread's own."""
    own: set[Path] = _mine.__dict__.get("work", set())
    return (work for path, work in _at_work(session) if path not in own)


def under_way(session: Path) -> Iterator[Work]:
    """The work in a session, of all processes. Work that ended without saying so is removed."""
    return (work for _, work in _at_work(session))


def _at_work(session: Path) -> Iterator[tuple[Path, Work]]:
    folder = session.parent / STATE_NAME / FOLDER
    for path in sorted(folder.glob(f"{session.name}{BETWEEN}*{ENDING}")):
        if ProcessLock.is_held(path):
            yield path, Work(*path.name.split(BETWEEN)[:4])
        else:
            with contextlib.suppress(OSError):
                path.unlink()
