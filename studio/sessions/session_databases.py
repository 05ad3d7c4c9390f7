"""Databases of a session, which may come from anyone: opened only where they are what the studio makes.

A file that is a pipe or a device, or that a link leads out of the session, is refused before SQLite touches it
(`foreign_files`). Of what a file declares, only ordinary tables and their indexes are accepted: a view can be
an endless query, and a trigger runs with each write. A value is at most `LARGEST_VALUE` bytes, and a query that does
not end is interrupted.
"""

import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from studio.foundations.errors import SessionError
from studio.foundations.foreign_files import check_file

LARGEST_VALUE = 256 << 20
STEPS_AT_ONCE = 1_000_000
MOST_STEPS = 1000
"""So many times `STEPS_AT_ONCE` instructions of SQLite's machine (about ten seconds) may one query take; the longest of
a store with a hundred thousand frames takes a tenth.
"""
REMEDY = "Delete the run, or restore its folder from a copy."


class SessionDatabase(sqlite3.Connection):
    """A connection whose queries end."""

    def __init__(self, *arguments: Any, **named: Any) -> None:  # noqa: ANN401 - as of sqlite3
        super().__init__(*arguments, **named)
        self.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_VALUE)
        self.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 1)
        self._steps = 0
        self.set_progress_handler(self._is_too_long, STEPS_AT_ONCE)

    def execute(self, *arguments: Any) -> sqlite3.Cursor:  # noqa: ANN401 - as of sqlite3
        """As of `sqlite3.Connection`; interrupted after `MOST_STEPS`."""
        self._steps = 0
        return super().execute(*arguments)

    def _is_too_long(self) -> bool:
        self._steps += 1
        return self._steps > MOST_STEPS


def open_database(
    path: Path, mode: str = "rwc", *, patience: float = 5.0, shared: bool = False
) -> SessionDatabase:
    """A connection to a file of a session, without transactions of its own.

    mode : of SQLite's addresses: "ro", "rw", "rwc" (made if missing), "immutable" for a read-only folder.
    patience : seconds to wait for others.
    shared : among threads.

    Raises SessionError for a file that is no store of a session, sqlite3.DatabaseError for a damaged one.
    """
    for beside in ("", "-journal", "-wal", "-shm"):
        check_file(path.with_name(path.name + beside), SessionError)
    way = "immutable=1" if mode == "immutable" else f"mode={mode}"
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?{way}",
        uri=True,
        timeout=patience,
        isolation_level=None,
        check_same_thread=not shared,
        factory=SessionDatabase,
    )
    try:
        # No function that a stored schema calls may reach beyond the database.
        connection.execute("PRAGMA trusted_schema = OFF")
    except BaseException:
        connection.close()
        raise
    return connection


def check_tables(connection: sqlite3.Connection, path: Path, schema: str = "main") -> None:
    """Raise SessionError where a database declares anything but ordinary tables and indexes."""
    rows: Iterable[tuple[Any, ...]] = connection.execute(
        f"SELECT type, name, COALESCE(sql, '') FROM {schema}.sqlite_master"
    )
    for kind, name, text in rows:
        plain = kind == "table" and " ".join(str(text).upper().split()).startswith("CREATE TABLE")
        if not plain and not (kind == "index" and (not text or str(name).startswith("sqlite_"))):
            raise SessionError(
                f"'{path.name}' holds {_article(str(kind))} '{str(name)[:40]}', which no store of the studio has.",
                REMEDY,
            )
        if kind == "table" and any(
            column[6] for column in connection.execute(f"PRAGMA {schema}.table_xinfo({_quoted(str(name))})")
        ):
            raise SessionError(f"'{path.name}' computes columns of '{str(name)[:40]}'.", REMEDY)


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _article(kind: str) -> str:
    return {"view": "a view", "trigger": "a trigger", "index": "an index"}.get(kind, "an unusual table")
