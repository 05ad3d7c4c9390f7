"""A run's results on disk, written frame by frame and readable at any moment by any process.

One SQLite file in WAL mode per run (`results.sqlite`): readers and the writer never wait for each other, and
a frame with all its layers arrives in one transaction or not at all, also when the writer is killed. Layers
and frames are compressed blobs (see `results_codec`); data for lists and timelines is in separate
columns. Neither side holds more than one frame in memory.
"""

import contextlib
import json
import math
import sqlite3
import threading
from collections.abc import Generator, Iterable, Mapping
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError, SessionError
from studio.foundations.foreign_files import MANIFEST_NAME, check_file
from studio.foundations.knobs import Value
from studio.search.trackers.tracker import FrameResult, LayerRecord
from studio.sessions.atomic_files import unwritable
from studio.sessions.process_lock import ProcessLock
from studio.sessions.results_codec import (
    FRAME,
    GIVEN_UP,
    PARTIAL,
    SETTINGS,
    pack,
    pack_layer,
    pack_result,
    sums_text,
)
from studio.sessions.results_reader import (
    FILE_NAME,
    SCHEMA_VERSION,
    UNREADABLE,
    ResultsReader,
    check_version,
    time_from,
)
from studio.sessions.session_databases import check_tables, open_database
from studio.sessions.work_under_way import check_there, one_at_a_time

__all__ = ["FILE_NAME", "ResultsReader", "ResultsWriter", "is_being_written"]

LOCK_NAME = "results.lock"
RESULTS = "The results in"
SCHEMA = """
CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS settings (
    version INTEGER PRIMARY KEY, frame INTEGER NOT NULL, layer INTEGER NOT NULL, "values" TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS frames (
    frame INTEGER PRIMARY KEY, log_weight REAL NOT NULL, milliseconds REAL NOT NULL, evaluations INTEGER NOT
    NULL, layers INTEGER NOT NULL, settings_version INTEGER NOT NULL, pose BLOB NOT NULL, blob BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS layers (
    frame INTEGER NOT NULL, layer INTEGER NOT NULL, blob BLOB NOT NULL, UNIQUE (frame, layer));
CREATE TABLE IF NOT EXISTS partial (
    id INTEGER PRIMARY KEY CHECK (id = 1), frame INTEGER NOT NULL, next_layer INTEGER NOT NULL, blob BLOB NOT
    NULL);
CREATE TABLE IF NOT EXISTS tracking (
    frame INTEGER PRIMARY KEY, state TEXT NOT NULL, overlap REAL, doubts INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS partial_layers (layer INTEGER PRIMARY KEY, blob BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS arrivals (frame INTEGER PRIMARY KEY, arrived REAL NOT NULL, ready REAL NOT NULL);
CREATE TABLE IF NOT EXISTS checksums (
    what TEXT NOT NULL, number INTEGER NOT NULL, sums TEXT NOT NULL, PRIMARY KEY (what, number));
"""
_NOTE_VERSION = f"INSERT OR REPLACE INTO meta VALUES ('schema', '{SCHEMA_VERSION}')"
_REWRITTEN = (
    "INSERT OR REPLACE INTO meta SELECT 'rewritten', 1 + COALESCE((SELECT CAST(value AS INTEGER) FROM meta WHERE key ="
    " 'rewritten'), 0)"
)
"""Counts how often anything but a new last frame was stored: readers then read all again, else only what is new."""
_REWRITTEN_FROM = (
    f"{_REWRITTEN} WHERE EXISTS (SELECT 1 FROM frames WHERE frame >= ?)"
    " OR EXISTS (SELECT 1 FROM checksums WHERE what = ? AND number >= ?)"
)
_SUMS = "INSERT OR REPLACE INTO checksums VALUES (?, ?, ?)"


def is_being_written(run_folder: Path) -> bool:
    """Whether some living process has this run open for tracking."""
    return ProcessLock.is_held(run_folder / LOCK_NAME)


def create_store(run_folder: Path) -> None:
    """Make the empty store of a new run. Raises SessionError."""
    path = run_folder / FILE_NAME
    try:
        with contextlib.closing(open_database(path)) as connection:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.executescript(SCHEMA)
            connection.execute(_NOTE_VERSION)
    except sqlite3.DatabaseError as error:
        raise unwritable(RESULTS, path, error) from None


def copy_frames(source: Path, into: Path, last: int | None = None) -> None:
    """Copy the frames before `last` (None: all) of a run's store into an empty one, with all their layers and the
    settings that they were tracked with. source, into : the runs' folders.
    """
    end = last if last is not None else 2**62
    connection = open_database(into / FILE_NAME, patience=30.0)
    try:
        check_file(source / FILE_NAME, SessionError)
        connection.execute("ATTACH DATABASE ? AS old", (str((source / FILE_NAME).resolve()),))
        check_tables(connection, source / FILE_NAME, "old")
        known = {
            row[0] for row in connection.execute("SELECT name FROM old.sqlite_master WHERE type = 'table'")
        }
        connection.execute("BEGIN IMMEDIATE")
        for table in ("settings", "frames", "layers", "tracking", "arrivals"):
            if table in known:
                connection.execute(
                    f"INSERT INTO main.{table} SELECT * FROM old.{table} WHERE frame < ?", (end,)
                )
        if "checksums" in known:
            connection.execute(
                "INSERT INTO main.checksums SELECT what, number, sums FROM old.checksums WHERE "
                "(what = ? AND number < ?) OR (what = ? AND number IN (SELECT version FROM main.settings))",
                (FRAME, end, SETTINGS),
            )
        connection.execute("COMMIT")
    except UNREADABLE as error:
        raise SessionError(
            f"The results in '{source / FILE_NAME}' cannot be copied ({error}).",
            "Check the free disk space, or track the run again.",
        ) from None
    finally:
        connection.close()


def _alone(run_folder: Path) -> ProcessLock:
    """The lock of a run's store, taken while the run is not being moved. Raises RunError, NotFoundError."""
    session = run_folder.parent.parent
    if not (session / MANIFEST_NAME).is_file():
        lock = ProcessLock.take(run_folder / LOCK_NAME)
    else:
        with one_at_a_time(session):
            check_there(session, run_folder.name)
            lock = ProcessLock.take(run_folder / LOCK_NAME)
    if lock is None:
        raise RunError(
            f"Run '{run_folder.name}' is being tracked by another process.",
            "Stop it there first, or start a new run.",
        )
    return lock


class ResultsWriter:
    """The one writer of a run's store; a second one, in this process or another, is refused with RunError.

    Threads take turns, a transaction each. Close it (or use it as a context) to free the run for others.
    """

    def __init__(self, run_folder: Path) -> None:
        self._lock = lock = _alone(run_folder)
        self._path = run_folder / FILE_NAME
        self._one_at_a_time, self._within = threading.RLock(), False
        try:
            self._connection = self._open()
        except BaseException:
            lock.free()
            raise

    def _open(self) -> sqlite3.Connection:
        """A connection to the store, its tables made where they are missing. Raises SessionError."""
        try:
            connection = open_database(self._path, patience=30.0, shared=True)
            try:
                check_tables(connection, self._path)
                check_version(connection, self._path)
                connection.execute("PRAGMA journal_mode = WAL")
                connection.execute("PRAGMA synchronous = NORMAL")
                connection.executescript(SCHEMA)
                # From now on a reader must support this version.
                connection.execute(_NOTE_VERSION)
            except BaseException:
                connection.close()
                raise
        except UNREADABLE as error:
            raise unwritable(RESULTS, self._path, error) from None
        return connection

    def __enter__(self) -> "ResultsWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the store and free the run for other writers."""
        self._connection.close()
        self._lock.free()

    def write_frame(
        self,
        result: FrameResult,
        layers: Iterable[LayerRecord],
        particles: int | None = None,
        *,
        came: tuple[float, float] | None = None,
    ) -> None:
        """Store a finished frame with all its layers in one transaction; the unfinished frame's state goes.

        particles : number recorded of each layer's set (None: all); the set at the end of the frame is
        in `result.carried` and always whole. came : of a live run's frame, when its pictures had come and when its
        pose was ready, seconds of one clock.
        """
        statements: list[tuple[str, tuple[object, ...]]] = [
            (_REWRITTEN_FROM, (result.frame, FRAME, result.frame)),
            ("DELETE FROM layers WHERE frame = ?", (result.frame,)),
            ("DELETE FROM tracking WHERE frame = ?", (result.frame,)),
            ("DELETE FROM arrivals WHERE frame = ?", (result.frame,)),
        ]
        if came is not None:
            statements.append(("INSERT INTO arrivals VALUES (?, ?, ?)", (result.frame, *came)))
        overlap = float(result.overlap) if math.isfinite(result.overlap) else None
        how = (result.tracking, overlap, int(result.doubts))
        statements.append(("INSERT INTO tracking VALUES (?, ?, ?, ?)", (result.frame, *how)))
        packed = [(record.layer, pack_layer(record, particles)) for record in layers]
        for layer, blob in packed:
            statements.append(("INSERT INTO layers VALUES (?, ?, ?)", (result.frame, layer, blob)))
        row = (
            int(result.frame),
            float(result.estimate.log_weight),
            float(result.milliseconds),
            int(result.evaluations),
            int(result.layers),
            int(result.settings_version),
            np.ascontiguousarray(result.estimate.pose, dtype="<f8").tobytes(),
        )
        blob = pack_result(result)
        statements.append(("INSERT OR REPLACE INTO frames VALUES (?, ?, ?, ?, ?, ?, ?, ?)", (*row, blob)))
        times = (None, None) if came is None else (float(came[0]), float(came[1]))
        sums = sums_text((*row, *how, *times), {"result": blob}, dict(packed))
        statements.append((_SUMS, (FRAME, result.frame, sums)))
        self._transaction([*statements, *_FORGET_PARTIAL])

    def write_partial(
        self, frame: int, next_layer: int, state: Mapping[str, Array], layers: Iterable[LayerRecord]
    ) -> None:
        """Store where the search stopped inside a frame: its state (named arrays, whole) and its layers so far."""
        statements: list[tuple[str, tuple[object, ...]]] = list(_FORGET_PARTIAL)
        blob = pack(dict(state))
        statements.append(("INSERT INTO partial VALUES (1, ?, ?, ?)", (frame, next_layer, blob)))
        packed = {record.layer: pack_layer(record) for record in layers}
        for row in packed.items():
            statements.append(("INSERT INTO partial_layers VALUES (?, ?)", row))
        sums = sums_text((int(frame), int(next_layer)), {"state": blob}, packed)
        statements.append((_SUMS, (PARTIAL, 0, sums)))
        self._transaction(statements)

    def give_up(self, frame: int) -> None:
        """Mark a frame as damaged, so that it is tracked again; for frames without checksums, or lost ones."""
        self._transaction([(_REWRITTEN, ()), (_SUMS, (FRAME, frame, GIVEN_UP))])

    def forget_partial(self) -> None:
        """Drop where the search stopped inside a frame."""
        self._transaction([*_FORGET_PARTIAL])

    def forget_from(self, frame: int) -> None:
        """Drop the results of `frame` and all later ones, and the settings that were first used in them.

        At least one entry of the settings' history is kept.
        """
        self._transaction(
            [
                (_REWRITTEN, ()),
                ("DELETE FROM frames WHERE frame >= ?", (frame,)),
                ("DELETE FROM layers WHERE frame >= ?", (frame,)),
                ("DELETE FROM tracking WHERE frame >= ?", (frame,)),
                ("DELETE FROM arrivals WHERE frame >= ?", (frame,)),
                ("DELETE FROM checksums WHERE what = ? AND number >= ?", (FRAME, frame)),
                (
                    "DELETE FROM settings WHERE frame >= ? AND version > (SELECT MIN(version) FROM settings)",
                    (frame,),
                ),
                (
                    "DELETE FROM checksums WHERE what = ? AND number NOT IN (SELECT version FROM settings)",
                    (SETTINGS,),
                ),
                ("DELETE FROM meta WHERE key = 'ended'", ()),
                *_FORGET_PARTIAL,
            ]
        )

    def write_settings(self, version: int, frame: int, layer: int, values: Mapping[str, Value]) -> None:
        """Note that settings `version` are in use since (frame, layer)."""
        row = (int(version), int(frame), int(layer), json.dumps(dict(values)))
        self._transaction(
            [
                ("INSERT OR REPLACE INTO settings VALUES (?, ?, ?, ?)", row),
                (_SUMS, (SETTINGS, version, sums_text(row, {}, {}))),
            ]
        )

    def add_time(self, seconds: float, frames: int, threads: int) -> None:
        """Add what tracking so many frames took, all included, to the run's (`ResultsReader.time_taken`). threads : of
        the process, which count for the whole run.
        """
        with self.together():
            row = self._connection.execute("SELECT value FROM meta WHERE key = 'time'").fetchone()
            before = time_from(row[0]) if row else None
            if before is not None:
                seconds, frames = seconds + before.seconds, frames + before.frames
            text = json.dumps({"seconds": round(seconds, 3), "frames": frames, "threads": threads})
            self._connection.execute("INSERT OR REPLACE INTO meta VALUES ('time', ?)", (text,))

    def mark_ended(self, how: str) -> None:
        """Note that the user cancelled the run (`how`: "cancelled"), that a live one is over ("finished"), or with ""
        that it is resumed.
        """
        if how:
            self._transaction([("INSERT OR REPLACE INTO meta VALUES ('ended', ?)", (how,))])
        else:
            self._transaction([("DELETE FROM meta WHERE key = 'ended'", ())])

    @contextlib.contextmanager
    def together(self) -> Generator[None]:
        """All that is written inside arrives in one transaction, or nothing of it. Raises SessionError."""
        with self._one_at_a_time:
            if self._within:
                yield
                return
            self._within = True
            try:
                with self._begun():
                    yield
            except sqlite3.DatabaseError as error:
                raise unwritable(RESULTS, self._path, error) from None
            finally:
                self._within = False

    @contextlib.contextmanager
    def _begun(self) -> Generator[None]:
        """A transaction. Raises the first error, and leaves none open."""
        if self._connection.in_transaction:
            # An earlier one could not even be rolled back: closing does that.
            self._connection.close()
            self._connection = self._open()
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self._connection.execute("COMMIT")
        except BaseException:
            # On a full or broken disk SQLite has rolled back already.
            if self._connection.in_transaction:
                with contextlib.suppress(sqlite3.Error):
                    self._connection.execute("ROLLBACK")
            raise

    def _transaction(self, statements: list[tuple[str, tuple[object, ...]]]) -> None:
        with self.together():
            for sql, values in statements:
                self._connection.execute(sql, values)


_FORGET_PARTIAL: tuple[tuple[str, tuple[object, ...]], ...] = (
    ("DELETE FROM partial", ()),
    ("DELETE FROM partial_layers", ()),
    ("DELETE FROM checksums WHERE what = 'partial'", ()),
)
