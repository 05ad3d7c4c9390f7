"""Reading a run's results while they are written, from any thread of any process (see `results_store`)."""

import json
import math
import sqlite3
import threading
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.errors import NotFoundError, SessionError
from studio.sessions.results_codec import unpack, unpack_layer, unpack_result
from studio.settings import SettingsEntry
from studio.tracking.tracker import TRACKED, FrameResult, LayerRecord

Array = NDArray[np.float64]
FILE_NAME = "results.sqlite"
UNWATCHED = (TRACKED, None, 0)
"""State, overlap and doubts of a frame that was stored before a loss could be noticed."""


@dataclass(frozen=True, slots=True, eq=False)
class PartialFrame:
    """Where the search stopped inside a frame. next_layer : the one to be done next. state : named arrays."""

    frame: int
    next_layer: int
    state: dict[str, Array]


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """What a timeline shows of K finished frames: all (K,). layers, evaluations, settings_version : int. tracking : how
    each frame went, of `tracking.tracker.TRACKING_STATES`. overlaps : NaN where unknown. doubts : int.
    """

    frames: NDArray[np.int64]
    log_weights: Array
    milliseconds: Array
    evaluations: NDArray[np.int64]
    layers: NDArray[np.int64]
    settings_versions: NDArray[np.int64]
    tracking: tuple[str, ...]
    overlaps: Array
    doubts: NDArray[np.int64]


class ResultsReader:
    """What a run's store holds now. Every call sees the newest finished transaction; a missing store reads as
    empty.

    All methods may be called from any thread. Damaged stores raise SessionError, missing entries
    NotFoundError.
    """

    def __init__(self, run_folder: Path) -> None:
        self._folder = run_folder
        self._lock = threading.Lock()
        self._connection: sqlite3.Connection | None = None

    def __enter__(self) -> "ResultsReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; the next call opens it again."""
        with self._lock:
            if self._connection is not None:
                self._connection.close()
                self._connection = None

    def frames(self) -> list[int]:
        """The finished frames, ascending."""
        return [row[0] for row in self._query("SELECT frame FROM frames ORDER BY frame")]

    def result(self, frame: int) -> FrameResult:
        """The result of a finished frame."""
        return unpack_result(
            self._one("SELECT blob FROM frames WHERE frame = ?", (frame,), f"frame {frame}")[0]
        )

    def layers(self, frame: int) -> list[LayerRecord]:
        """The layers of a frame in the order they ran; of the unfinished frame those that are done."""
        rows = self._query(
            "SELECT blob, layer FROM layers WHERE frame = ?1 UNION ALL "
            "SELECT blob, layer FROM partial_layers WHERE (SELECT frame FROM partial) = ?1 ORDER BY layer",
            (frame,),
        )
        if not rows:
            raise self._missing(f"layers of frame {frame}")
        return [unpack_layer(row[0]) for row in rows]

    def layer(self, frame: int, layer: int) -> LayerRecord:
        """One layer of a frame, finished or not."""
        row = self._one(
            "SELECT blob FROM layers WHERE frame = ?1 AND layer = ?2 UNION ALL "
            "SELECT blob FROM partial_layers WHERE (SELECT frame FROM partial) = ?1 AND layer = ?2 LIMIT 1",
            (frame, layer),
            f"layer {layer} of frame {frame}",
        )
        return unpack_layer(row[0])

    def poses(self) -> tuple[NDArray[np.int64], Array]:
        """The finished frames (K,) and their estimates (K, D), radians and mm."""
        rows = self._query("SELECT frame, pose FROM frames ORDER BY frame")
        frames = np.array([row[0] for row in rows], dtype=np.int64)
        if not rows:
            return frames, np.zeros((0, 0))
        return frames, np.stack([np.frombuffer(row[1], dtype="<f8") for row in rows]).astype(np.float64)

    def timeline(self) -> Timeline:
        """Weight, time and effort of every finished frame."""
        rows = self._query(
            "SELECT frame, log_weight, milliseconds, evaluations, layers, settings_version "
            "FROM frames ORDER BY frame"
        )
        columns = list(zip(*rows, strict=True)) if rows else [[]] * 6
        whole = [np.array(columns[index], dtype=np.int64) for index in (0, 3, 4, 5)]
        real = [np.array(columns[index], dtype=np.float64) for index in (1, 2)]
        known = self._tracking()
        told = [known.get(int(frame), UNWATCHED) for frame in whole[0]]
        return Timeline(
            *(whole[0], real[0], real[1], whole[1], whole[2], whole[3]),
            tracking=tuple(entry[0] for entry in told),
            overlaps=np.array([math.nan if entry[1] is None else entry[1] for entry in told]),
            doubts=np.array([entry[2] for entry in told], dtype=np.int64),
        )

    def _tracking(self) -> dict[int, tuple[str, float | None, int]]:
        """How each frame went; nothing in stores older than that table."""
        if not self._has_table("tracking"):
            return {}
        return {row[0]: row[1:] for row in self._query("SELECT frame, state, overlap, doubts FROM tracking")}

    def _has_table(self, name: str) -> bool:
        """Whether the store has a table; older ones have fewer."""
        rows = self._query(f"SELECT name FROM sqlite_master WHERE type = 'table' AND name = '{name}'")
        return bool(rows)

    def settings_history(self) -> list[SettingsEntry]:
        """Every version of the settings that was in use, oldest first."""
        rows = self._query('SELECT version, frame, layer, "values" FROM settings ORDER BY version')
        return [
            SettingsEntry(version, frame, layer, json.loads(text)) for version, frame, layer, text in rows
        ]

    def partial(self) -> PartialFrame | None:
        """Where the search stopped inside a frame, if it did."""
        rows = self._query("SELECT frame, next_layer, blob FROM partial")
        if not rows:
            return None
        frame, next_layer, blob = rows[0]
        return PartialFrame(frame, next_layer, unpack(blob))

    def done(self) -> int:
        """How many frames are finished."""
        rows = self._query("SELECT COUNT(*) FROM frames")
        return rows[0][0] if rows else 0

    def last_before(self, frame: int) -> int | None:
        """The last finished frame before one; None where there is none."""
        rows = self._query("SELECT MAX(frame) FROM frames WHERE frame < ?", (frame,))
        return rows[0][0] if rows else None

    def arrivals(self) -> tuple[NDArray[np.int64], Array]:
        """Of a live run the finished frames (K,) that came on a clock, and when (K, 2) their pictures had come and
        their poses were ready, seconds; nothing of other runs.
        """
        if not self._has_table("arrivals"):
            return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        rows = self._query("SELECT frame, arrived, ready FROM arrivals ORDER BY frame")
        frames = np.array([row[0] for row in rows], dtype=np.int64)
        return frames, np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 2)

    def ended(self) -> str:
        """ "cancelled" if a person ended the run, "finished" if a live one is over, else ""."""
        rows = self._query("SELECT value FROM meta WHERE key = 'ended'")
        return rows[0][0] if rows else ""

    def _one(self, sql: str, values: tuple[int, ...], what: str) -> tuple[bytes]:
        rows = self._query(sql, values)
        if not rows:
            raise self._missing(what)
        return rows[0]

    def _missing(self, what: str) -> NotFoundError:
        return NotFoundError(
            f"Run '{self._folder.name}' has no {what}.",
            "Track further, or choose a frame that has been tracked.",
        )

    def _query(self, sql: str, values: tuple[int, ...] = ()) -> list[tuple]:
        with self._lock:
            try:
                if self._connection is None:
                    if not (self._folder / FILE_NAME).exists():
                        return []
                    self._connection = _open_to_read(self._folder / FILE_NAME)
                return self._connection.execute(sql, values).fetchall()
            except sqlite3.DatabaseError as error:
                raise SessionError(
                    f"The results in '{self._folder / FILE_NAME}' cannot be read ({error}).",
                    "Put back a copy of the file, or start the run again.",
                ) from None


def _open_to_read(path: Path) -> sqlite3.Connection:
    """A connection that changes nothing; a store in a folder that cannot be written is read as it stands."""
    address = path.resolve().as_uri()
    try:
        connection = sqlite3.connect(
            f"{address}?mode=rw", uri=True, timeout=10.0, isolation_level=None, check_same_thread=False
        )
        connection.execute("PRAGMA query_only = ON")
        connection.execute("SELECT 1 FROM sqlite_master LIMIT 1").fetchall()
    except sqlite3.OperationalError:
        connection = sqlite3.connect(
            f"{address}?immutable=1", uri=True, timeout=10.0, isolation_level=None, check_same_thread=False
        )
    return connection
