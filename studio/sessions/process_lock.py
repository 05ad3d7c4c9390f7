"""A lock on a folder that the system frees when its process dies, on every system alike."""

import sqlite3
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from studio.sessions.atomic_files import unwritable
from studio.sessions.session_databases import open_database

WAIT = 0.2
"""Seconds between two looks whether a lock is free."""
HELD = frozenset((sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED))


@dataclass(frozen=True, slots=True)
class ProcessLock:
    """Held as an exclusive transaction on an empty database in the folder."""

    connection: sqlite3.Connection

    @staticmethod
    def take(path: Path, patience: float = 0.0) -> "ProcessLock | None":
        """Acquire the lock of the file `path` (created if missing); None while another holds it, after so many seconds.

        It needs no room on the disk but for the file's name. Raises SessionError where the file cannot be made or
        written.
        """
        # Nothing is ever written, so nothing has to be undone from a file.
        return _begin(path, patience, "PRAGMA journal_mode = MEMORY", "BEGIN EXCLUSIVE")

    @staticmethod
    def share(path: Path, patience: float = 0.0) -> "ProcessLock | None":
        """Keep others from taking the lock of the file `path` (created if missing), which many may do at once; None
        while another holds it, after so many seconds. Raises SessionError.
        """
        return _begin(path, patience, "BEGIN", "SELECT 1 FROM sqlite_master")

    @staticmethod
    def is_held(path: Path) -> bool:
        """Whether another holds the lock. Looking takes nothing, writes nothing and needs no permission to write."""
        if not path.exists():
            return False
        try:
            connection = open_database(path, "ro", patience=0.0)
        except sqlite3.DatabaseError:
            return False
        try:
            connection.execute("SELECT 1 FROM sqlite_master").fetchall()
        except sqlite3.DatabaseError as error:
            return _is_held(error)
        finally:
            connection.close()
        return False

    def free(self) -> None:
        self.connection.close()


@contextmanager
def alone(path: Path, waiting: Callable[[], None] = lambda: None) -> Generator[None]:
    """While no other process has the lock of the file `path`; waits for it as long as that takes.

    waiting : called before each pause, and may raise to end it. Raises SessionError as `ProcessLock.take`.
    """
    while (held := ProcessLock.take(path)) is None:
        waiting()
        time.sleep(WAIT)
    try:
        yield
    finally:
        held.free()


def _begin(path: Path, patience: float, *statements: str) -> ProcessLock | None:
    """The lock once statements were executed; None while another holds it."""
    connection = None
    try:
        connection = open_database(path, patience=patience, shared=True)
        for statement in statements:
            connection.execute(statement).fetchall()
    except sqlite3.DatabaseError as error:
        if connection is not None:
            connection.close()
        if _is_held(error):
            return None
        raise unwritable("The lock", path, error) from None
    return ProcessLock(connection)


def _is_held(error: sqlite3.DatabaseError) -> bool:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in HELD
