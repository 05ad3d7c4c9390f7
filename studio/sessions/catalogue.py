"""An index of the workspace's sessions and runs, so that lists need not open every file.

`.catalogue.sqlite` holds one row for each manifest and record, stamped with the file's time and size; reading
it first compares stamps and reads again only what changed. Manifests and records are the truth: a catalogue
that is missing, damaged or of another version is made anew from them, and nothing is kept in it alone. Where
it cannot be written (a workspace on a read-only disk) the index lives in memory.
"""

import sqlite3
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from studio.errors import StudioError
from studio.sessions import manifest as manifests
from studio.sessions import run_record as records
from studio.sessions.manifest import SessionManifest, read_manifest
from studio.sessions.names import is_name
from studio.sessions.run_record import RunRecord, read_run_record
from studio.typed_decoding import decode_json

FILE_NAME = ".catalogue.sqlite"
VERSION = 1
SCHEMA = """
CREATE TABLE IF NOT EXISTS sessions (
    name TEXT PRIMARY KEY, stamp TEXT NOT NULL, content BLOB NOT NULL, problem TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS runs (
    session TEXT NOT NULL, name TEXT NOT NULL, stamp TEXT NOT NULL, content BLOB NOT NULL, problem TEXT NOT
    NULL, PRIMARY KEY (session, name));
"""


@dataclass(frozen=True, slots=True)
class SessionEntry:
    """A session in the index. manifest : None where it cannot be read; then `problem` says why."""

    name: str
    manifest: SessionManifest | None
    problem: str


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run in the index. record : None where it cannot be read; then `problem` says why."""

    session: str
    name: str
    record: RunRecord | None
    problem: str


class Catalogue:
    """The index of one workspace folder. Each call opens the file anew, so any thread or process may call."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.path = root / FILE_NAME

    def read(self) -> tuple[tuple[SessionEntry, ...], tuple[RunEntry, ...]]:
        """All sessions by name, and all runs by session and time of making, as the folders are now."""
        if not self.root.is_dir():
            return (), ()
        try:
            return self._read(_open(self.path))
        except sqlite3.OperationalError:
            return self._read(_open(None))
        except (sqlite3.DatabaseError, msgspec.DecodeError):
            self.forget()
            return self._read(_open(self.path))

    def forget(self) -> None:
        """Delete the index; nothing is lost, the next call makes it anew."""
        for ending in ("", "-wal", "-shm"):
            self.path.with_name(self.path.name + ending).unlink(missing_ok=True)

    def _read(self, connection: sqlite3.Connection) -> tuple[tuple[SessionEntry, ...], tuple[RunEntry, ...]]:
        try:
            connection.execute("BEGIN IMMEDIATE")
            _refresh(connection, self.root)
            connection.execute("COMMIT")
            return _sessions(connection), _runs(connection)
        finally:
            connection.close()


def _open(path: Path | None) -> sqlite3.Connection:
    """The catalogue at `path` (None: in memory), emptied if it is of another version."""
    connection = sqlite3.connect(path or ":memory:", timeout=10.0, isolation_level=None)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        if connection.execute("PRAGMA user_version").fetchone()[0] != VERSION:
            connection.executescript("DROP TABLE IF EXISTS sessions; DROP TABLE IF EXISTS runs;")
            connection.execute(f"PRAGMA user_version = {VERSION}")
        connection.executescript(SCHEMA)
    except sqlite3.DatabaseError:
        connection.close()
        raise
    return connection


def _refresh(connection: sqlite3.Connection, root: Path) -> None:
    """Make the rows agree with the folders."""
    known = {row[0]: row[1] for row in connection.execute("SELECT name, stamp FROM sessions")}
    known_runs = {
        (row[0], row[1]): row[2] for row in connection.execute("SELECT session, name, stamp FROM runs")
    }
    found: set[str] = set()
    found_runs: set[tuple[str, str]] = set()
    for folder in _named_folders(root, manifests.FILE_NAME):
        found.add(folder.name)
        stamp = _stamp(folder / manifests.FILE_NAME)
        if known.get(folder.name) != stamp:
            row = (folder.name, stamp, *_content(folder, read_manifest))
            connection.execute("INSERT OR REPLACE INTO sessions VALUES (?, ?, ?, ?)", row)
        for run in _named_folders(folder / "runs", records.FILE_NAME):
            found_runs.add((folder.name, run.name))
            stamp = _stamp(run / records.FILE_NAME)
            if known_runs.get((folder.name, run.name)) != stamp:
                row = (folder.name, run.name, stamp, *_content(run, read_run_record))
                connection.execute("INSERT OR REPLACE INTO runs VALUES (?, ?, ?, ?, ?)", row)
    gone = [(name,) for name in known.keys() - found]
    connection.executemany("DELETE FROM sessions WHERE name = ?", gone)
    connection.executemany(
        "DELETE FROM runs WHERE session = ? AND name = ?", list(known_runs.keys() - found_runs)
    )


def _named_folders(parent: Path, marker: str) -> Iterator[Path]:
    """The folders in `parent` that have a lawful name and hold the file `marker`; links out of it are left
    aside."""
    if not parent.is_dir():
        return
    for folder in sorted(parent.iterdir()):
        if is_name(folder.name) and (folder / marker).is_file() and _stays_inside(folder, parent):
            yield folder


def _stays_inside(folder: Path, parent: Path) -> bool:
    return not folder.is_symlink() or folder.resolve().is_relative_to(parent.resolve())


def _stamp(path: Path) -> str:
    status = path.stat()
    return f"{status.st_mtime_ns} {status.st_size} {status.st_ino}"


def _content(folder: Path, read: Callable[[Path], msgspec.Struct]) -> tuple[bytes, str]:
    """The folder's record as bytes and "", or nothing and what is wrong with it."""
    try:
        return msgspec.json.encode(read(folder)), ""
    except StudioError as error:
        return b"", str(error)


def _sessions(connection: sqlite3.Connection) -> tuple[SessionEntry, ...]:
    rows = connection.execute("SELECT name, content, problem FROM sessions ORDER BY name").fetchall()
    return tuple(
        SessionEntry(name, decode_json(content, SessionManifest) if content else None, problem)
        for name, content, problem in rows
    )


def _runs(connection: sqlite3.Connection) -> tuple[RunEntry, ...]:
    rows = connection.execute("SELECT session, name, content, problem FROM runs").fetchall()
    entries = [
        RunEntry(session, name, decode_json(content, RunRecord) if content else None, problem)
        for session, name, content, problem in rows
    ]
    return tuple(
        sorted(entries, key=lambda run: (run.session, run.record.created if run.record else "", run.name))
    )
