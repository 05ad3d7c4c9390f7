"""Rebuilds a broken results store from all frames that can still be read."""

import contextlib
import os
import sqlite3
from pathlib import Path
from typing import Any

from studio.foundations.errors import RunError, SessionError
from studio.sessions.atomic_files import unwritable
from studio.sessions.process_lock import ProcessLock
from studio.sessions.results_codec import FRAME, GIVEN_UP
from studio.sessions.results_reader import FILE_NAME, UNREADABLE
from studio.sessions.results_store import LOCK_NAME, SCHEMA
from studio.sessions.session_databases import check_tables, open_database

WHOLE = ("meta", "settings")
OF_A_FRAME = ("frames", "layers", "tracking", "arrivals")
BROKEN = ".broken"


def faults_of_database(run_folder: Path) -> list[str]:
    """SQLite's report on a damaged store file; empty if it is intact, also where the disk cannot be written."""
    path = run_folder / FILE_NAME
    if not path.exists():
        return []
    try:
        # Where nothing can be written nobody writes, and SQLite can make no shared memory to read with.
        mode = "ro" if os.access(run_folder, os.W_OK) else "immutable"
        with contextlib.closing(open_database(path, mode)) as connection:
            check_tables(connection, path)
            faults = [str(row[0]) for row in connection.execute("PRAGMA integrity_check(20)")]
    except UNREADABLE as error:
        return [str(error)]
    return [] if faults == ["ok"] else faults


def salvage(run_folder: Path, first: int, last: int) -> list[int]:
    """Put a new store with all that can be read in the broken one's place; returns the frames that are lost.

    first, last : frames of the run, half open. Lost are those between frames that are found; they count as damaged, so
    that they are tracked again. The broken store stays beside it. Raises RunError while the run is tracked,
    SessionError.
    """
    lock = ProcessLock.take(run_folder / LOCK_NAME)
    if lock is None:
        raise RunError(f"Run '{run_folder.name}' is being tracked.", "Stop it first.")
    path = run_folder / FILE_NAME
    made = path.with_name(".partial-" + FILE_NAME)
    made.unlink(missing_ok=True)
    try:
        with (
            contextlib.closing(open_database(path)) as broken,
            contextlib.closing(open_database(made)) as whole,
        ):
            with contextlib.suppress(*UNREADABLE):
                check_tables(broken, path)
            whole.executescript(SCHEMA)
            whole.execute("BEGIN")
            lost = _copy(broken, whole, first, last)
            whole.execute("COMMIT")
        for ending in ("-wal", "-shm"):
            path.with_name(path.name + ending).unlink(missing_ok=True)
        os.replace(path, path.with_name(path.name + BROKEN))
        os.replace(made, path)
    except sqlite3.DatabaseError as error:
        raise unwritable("The results in", path, error) from None
    except OSError as error:
        raise SessionError(
            f"'{path}' cannot be rebuilt ({error.strerror}).", "Check the folder's permissions."
        ) from None
    finally:
        lock.free()
        made.unlink(missing_ok=True)
    return lost


def _copy(broken: sqlite3.Connection, whole: sqlite3.Connection, first: int, last: int) -> list[int]:
    for table in WHOLE:
        _insert(whole, table, _rows(broken, f"SELECT * FROM {table}") or [])
    sums = _rows(broken, "SELECT * FROM checksums WHERE what = 'settings'")
    _insert(whole, "checksums", sums or [])
    copied: list[int] = []
    for frame in range(first, last):
        by_table = {
            table: _rows(broken, f"SELECT * FROM {table} WHERE frame = {frame}") for table in OF_A_FRAME
        }
        of_it = _rows(broken, f"SELECT * FROM checksums WHERE what = '{FRAME}' AND number = {frame}")
        if any(rows is None for rows in (*by_table.values(), of_it)):
            _insert(whole, "checksums", [(FRAME, frame, GIVEN_UP)])
        else:
            for table, rows in by_table.items():
                _insert(whole, table, rows or [])
            _insert(whole, "checksums", of_it or [])
        if by_table["frames"] or of_it:
            copied.append(frame)
    lost: list[int] = []
    for frame in range(first, last):
        row = whole.execute("SELECT 1 FROM frames WHERE frame = ?", (frame,)).fetchone()
        if row is None and copied and frame < max(copied):
            _insert(whole, "checksums", [(FRAME, frame, GIVEN_UP)])
            lost.append(frame)
    whole.execute(
        "DELETE FROM checksums WHERE what = ? AND number > ? AND sums = ?",
        (FRAME, max(copied, default=first - 1), GIVEN_UP),
    )
    return lost


def _rows(connection: sqlite3.Connection, sql: str) -> list[tuple[Any, ...]] | None:
    """The rows, None where they cannot be read."""
    try:
        return connection.execute(sql).fetchall()
    except UNREADABLE as error:
        return [] if "no such table" in str(error) else None


def _insert(connection: sqlite3.Connection, table: str, rows: list[tuple[Any, ...]]) -> None:
    for row in rows:
        with contextlib.suppress(sqlite3.DatabaseError):
            connection.execute(f"INSERT OR REPLACE INTO {table} VALUES ({', '.join('?' * len(row))})", row)
