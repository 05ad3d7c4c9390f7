"""Reading a run's results while they are written, from any thread of any process (see `results_store`)."""

import bisect
import math
import sqlite3
import threading
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar

import numpy as np
from msgspec import DecodeError

from studio.foundations.arrays import Array, Indices
from studio.foundations.errors import DamagedError, NotFoundError, SessionError
from studio.foundations.typed_decoding import decode_json
from studio.search.settings import SettingsEntry
from studio.search.trackers.tracker import TRACKED, TRACKING_STATES, FrameResult, LayerRecord
from studio.sessions.manifest import MOST_FRAMES
from studio.sessions.results_codec import (
    FRAME,
    GIVEN_UP,
    PARTIAL,
    SETTINGS,
    VERIFIED,
    CheckedStore,
    Sums,
    unpack,
    unpack_layer,
    unpack_result,
)
from studio.sessions.session_databases import check_tables, open_database

FILE_NAME = "results.sqlite"
UNREADABLE = (sqlite3.DatabaseError, UnicodeDecodeError)
"""What reading a damaged store raises: SQLite quotes damaged names, which Python cannot decode."""
SCHEMA_VERSION = 2
"""Stores of version 1 hold npz archives, which `results_codec.unpack` reads too, and may lack later tables; writing to
one converts it to this version.
"""
Unpacked = TypeVar("Unpacked")
Row = tuple[Any, ...]
"""As SQLite gives it."""
LATER_TABLES = (("tracking", ("state", "overlap", "doubts")), ("arrivals", ("arrived", "ready")))
UNWATCHED = (TRACKED, None, 0)
"""State, overlap and doubts of a frame that was stored before a loss could be noticed."""
ROWS = "SELECT frames.frame, log_weight, milliseconds, evaluations, layers, settings_version, pose"
NUMBERS, RESULT, LOST = "its numbers", "its result", "all of it"
"""The damaged parts of a frame as text; of layers: "layer 3"."""
LARGEST_COUNT = 2**53
READ_TOGETHER = 8
"""Frames whose blobs are read at once to be checked: so many queries less."""


@dataclass(frozen=True, slots=True, eq=False)
class PartialFrame:
    """Where the search stopped inside a frame. next_layer : the one to be done next. state : named arrays."""

    frame: int
    next_layer: int
    state: dict[str, Array]


@dataclass(frozen=True, slots=True)
class TimeTaken:
    """Seconds that tracking so many frames took, all included, in a process of so many threads."""

    seconds: float
    frames: int
    threads: int


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """Columns of K finished frames for a timeline, all (K,). layers, evaluations, settings_version : int. tracking :
    states of `search.trackers.tracker.TRACKING_STATES`. overlaps : NaN where unknown. doubts : int.
    """

    frames: Indices
    log_weights: Array
    milliseconds: Array
    evaluations: Indices
    layers: Indices
    settings_versions: Indices
    tracking: tuple[str, ...]
    overlaps: Array
    doubts: Indices


@dataclass(frozen=True, slots=True, eq=False)
class _Stand:
    """What a reader knows of its store at a moment. stored : the store's version; while it is the same, nothing is read
    again. rewritten : while it is the same, frames were only added after `last` (-1: there was none). of : whether
    blobs were checked, and what was known of them. rows : of the intact frames. damaged : the damaged parts of the
    others, as text. due : the checksums, as text, of frames that are not checked yet.
    """

    stored: object
    rewritten: object
    of: tuple[bool, CheckedStore, dict[int, tuple[int, str]]] | None
    last: int
    rows: list[Row]
    damaged: dict[int, str]
    due: dict[int, str]


_NOTHING = _Stand(None, None, None, -1, [], {}, {})


class ResultsReader:
    """Reads a run's store. Every call sees the newest finished transaction; a missing store reads as empty.

    All methods may be called from any thread. Damaged stores raise SessionError, missing entries
    NotFoundError.

    settle : called before each reading; it waits for what is still to be stored, and may raise.
    """

    def __init__(self, run_folder: Path, settle: Callable[[], None] | None = None) -> None:
        self._folder, self._settle = run_folder, settle
        self._lock = threading.RLock()
        self._within = False
        self._connection: sqlite3.Connection | None = None
        self._known = _NOTHING

    def __enter__(self) -> "ResultsReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; the next call opens it again."""
        with self._lock:
            if self._connection is not None:
                self._connection.close()
                self._connection = None
            self._known = _NOTHING

    def frames(self, *, blobs: bool = True) -> list[int]:
        """The finished frames that are whole, ascending. blobs : as `damaged`."""
        return [row[0] for row in self._state(blobs).rows]

    def damaged(self, *, blobs: bool = True) -> dict[int, str]:
        """The damaged finished frames, and the damaged parts of each as text.

        blobs : also check results and layers that this process has not yet found intact; else only the numbers, and
        what this process found before is left out, too. Frames without checksums (of older stores) count as intact.
        """
        return self._state(blobs).damaged

    def is_checked(self) -> bool:
        """Whether this process found every finished frame intact, or knows all damage."""
        due, known = self._state(False).due, VERIFIED.of(self._folder)
        return all(known.holds(frame, text) for frame, text in due.items())

    def is_whole(self, frame: int) -> bool:
        """Whether a frame is finished and intact; nothing of other frames is read."""
        with self._snapshot():
            text, rows = self._sums(FRAME, frame).get(frame), self._rows(frame)
            if text is None or not rows:
                return bool(rows) and text is None
            known = VERIFIED.of(self._folder)
            return not (_damage(known, frame, text, rows[0]) or self._damaged_blobs(frame, text))

    def unchecked(self) -> list[int]:
        """The finished frames that have no checksums: they were stored before there were any."""
        sums = self._sums(FRAME)
        return [row[0] for row in self._rows() if row[0] not in sums]

    def check_all_again(self) -> None:
        """Forget what was read, also what was found intact."""
        VERIFIED.forget(self._folder)
        self._known = _NOTHING

    def check_again(self, frame: int) -> str:
        """The parts of a frame without checksums that cannot be unpacked, as text; "" if all can."""
        try:
            self.result(frame)
            self.layers(frame)
        except NotFoundError as error:
            return RESULT if isinstance(error, DamagedError) else ""
        except SessionError:
            return RESULT
        return ""

    def stored_poses(self) -> dict[int, Array]:
        """The pose (D,) of every finished frame whose numbers are intact, even if other parts are damaged."""
        sums = self._sums(FRAME)
        return {
            row[0]: np.frombuffer(row[6], dtype="<f8")
            for row in self._rows()
            if not _impossible([row], ()) and (row[0] not in sums or Sums(sums[row[0]]).row_fits(row))
        }

    def partial_is_damaged(self) -> bool:
        """Whether the stored state of an unfinished frame is damaged."""
        return bool(self._query("SELECT 1 FROM partial")) and self.partial() is None

    def result(self, frame: int) -> FrameResult:
        """The result of a finished frame. Raises DamagedError if it is damaged."""
        with self._snapshot():
            text = self._sums(FRAME, frame).get(frame)
            rows = self._query("SELECT blob FROM frames WHERE frame = ?", (frame,))
        if not rows and text is None:
            raise self._missing(f"frame {frame}")
        if not rows or (text is not None and not Sums(text).fits("result", rows[0][0])):
            raise self._is_damaged(frame, RESULT if rows else LOST)
        return self._unpacked(frame, RESULT, unpack_result, rows[0][0])

    def layers(self, frame: int) -> list[LayerRecord]:
        """The layers of a frame in the order they ran; of an unfinished one those done. Raises DamagedError."""
        blobs = self._layer_blobs(frame)
        if not blobs:
            raise self._missing(f"layers of frame {frame}")
        return [self._layer(frame, layer, blob) for layer, blob in blobs.items()]

    def layer(self, frame: int, layer: int) -> LayerRecord:
        """One layer of a frame, finished or not. Raises DamagedError as `layers`."""
        blobs = self._layer_blobs(frame)
        if layer not in blobs:
            raise self._missing(f"layer {layer + 1} of frame {frame}")
        return self._layer(frame, layer, blobs[layer])

    def poses(self, between: tuple[int, int] | None = None, *, blobs: bool = True) -> tuple[Indices, Array]:
        """The finished frames (K,) that are whole and their estimates (K, D), radians and mm. between : of these alone,
        both included. blobs : as `damaged`.
        """
        rows = self._state(blobs).rows
        if between is not None:
            first, after = (
                bisect.bisect_left(rows, end, key=itemgetter(0)) for end in (between[0], between[1] + 1)
            )
            rows = rows[first:after]
        frames = np.array([row[0] for row in rows], dtype=np.int64)
        if not rows:
            return frames, np.zeros((0, 0))
        return frames, np.stack([np.frombuffer(row[6], dtype="<f8") for row in rows]).astype(np.float64)

    def timeline(self, *, blobs: bool = True) -> Timeline:
        """Weight, time and effort of every finished frame that is whole. blobs : as `damaged`."""
        rows = self._state(blobs).rows
        columns = list(zip(*rows, strict=True)) if rows else [()] * 12
        whole = [np.array(columns[index], dtype=np.int64) for index in (0, 3, 4, 5)]
        real = [np.array(columns[index], dtype=np.float64) for index in (1, 2)]
        went = [row[7:10] if row[7] is not None else UNWATCHED for row in rows]
        return Timeline(
            *(whole[0], real[0], real[1], whole[1], whole[2], whole[3]),
            tracking=tuple(entry[0] for entry in went),
            overlaps=np.array([math.nan if entry[1] is None else entry[1] for entry in went]),
            doubts=np.array([entry[2] for entry in went], dtype=np.int64),
        )

    # ------------------------------------------------------------------ integrity

    def _state(self, blobs: bool) -> _Stand:
        """The intact frames and the damage of the others, kept until the store changes or more is known of it. While a
        run goes on, only the frames that are new are read.
        """
        with VERIFIED.reading(self._folder) if blobs else nullcontext():
            known = VERIFIED.of(self._folder)
            before = self._known
            same = before.of == (blobs, known, known.damage())
            if same and before.stored == self._query("PRAGMA data_version"):
                return before
            with self._snapshot():
                # Asked within: of what is written meanwhile the next call would think that it is no new frame.
                stored = self._query("PRAGMA data_version")
                rewritten = self._query("SELECT value FROM meta WHERE key = 'rewritten'")
                if not same or before.rewritten != rewritten:
                    before = _NOTHING
                sums, rows = self._sums(FRAME, after=before.last), self._rows(after=before.last)
                if not (sums or rows) and before is not _NOTHING:
                    # Something else was written, which is rare.
                    before, sums, rows = _NOTHING, self._sums(FRAME), self._rows()
                impossible = _impossible(rows, before.rows)
                if impossible or not rows:
                    rows = [row for row in rows if _is_frame(row[0])]
                    sums = {frame: text for frame, text in sums.items() if _is_frame(frame)}
                by_frame = {row[0]: row for row in rows}
                parts = {
                    frame: _damage(known, frame, text, by_frame.get(frame)) for frame, text in sums.items()
                } | impossible
                # What was found damaged is checked again: it may have been mended.
                due = {
                    frame: text
                    for frame, text in sums.items()
                    if not parts[frame] and not known.holds(frame, text)
                }
                wrong = self._check_blobs(known, due) if blobs else _known_damage(known, due)
            damaged = {frame: part for frame, part in sorted((parts | wrong).items()) if part}
            self._known = _Stand(
                stored,
                rewritten,
                (blobs, known, known.damage()),
                last=max((before.last, *sums, *by_frame)),
                rows=[*before.rows, *(row for frame, row in by_frame.items() if frame not in damaged)],
                damaged=before.damaged | damaged,
                due=before.due | {frame: text for frame, text in due.items() if frame not in wrong},
            )
            return self._known

    def _check_blobs(self, known: CheckedStore, due: Mapping[int, str]) -> dict[int, str]:
        """The damaged blobs of some frames, as text; "" of those that are intact. Some frames are read at a time."""
        parts: dict[int, str] = {}
        for _, group in groupby(sorted(due), key=lambda frame: frame // READ_TOGETHER):
            frames = list(group)
            between = (frames[0], frames[-1])
            try:
                results = dict(
                    self._query("SELECT frame, blob FROM frames WHERE frame BETWEEN ? AND ?", between)
                )
                stored = self._query(
                    "SELECT frame, layer, blob FROM layers WHERE frame BETWEEN ? AND ?", between
                )
            except SessionError:
                parts |= {frame: self._damaged_blobs(frame, due[frame]) for frame in frames}
                continue
            layers: dict[int, dict[int, bytes]] = {}
            for frame, layer, blob in stored:
                layers.setdefault(frame, {})[layer] = blob
            for frame in frames:
                parts[frame] = _damaged_parts(Sums(due[frame]), results.get(frame), layers.get(frame, {}))
        for frame, part in parts.items():
            if part:
                known.add_damage(frame, due[frame], part)
            else:
                known.add(frame, due[frame])
        return parts

    def _rows(self, frame: int | None = None, after: int = -1) -> list[Row]:
        """Numbers and pose of finished frames after one, or of one alone; columns missing in older stores are NULL."""
        columns, joined = ROWS, ""
        for table, names in LATER_TABLES:
            known = self._has_table(table)
            columns += "".join(f", {name if known else 'NULL'}" for name in names)
            joined += f" LEFT JOIN {table} USING (frame)" if known else ""
        condition = f"> {int(after)}" if frame is None else f"= {int(frame)}"
        return self._query(
            f"{columns} FROM frames{joined} WHERE frames.frame {condition} ORDER BY frames.frame"
        )

    def _sums(self, what: str, number: int | None = None, after: int = -1) -> dict[int, str]:
        """The stored checksums with a number above `after`, or of this one; none in older stores."""
        if not self._has_table("checksums"):
            return {}
        condition = f"> {int(after)}" if number is None else f"= {int(number)}"
        return dict(
            self._query(f"SELECT number, sums FROM checksums WHERE what = '{what}' AND number {condition}")
        )

    def _damaged_blobs(self, frame: int, text: str) -> str:
        """The blobs of a frame that do not match their checksums, as text; "" if all do."""
        try:
            blob = self._query("SELECT blob FROM frames WHERE frame = ?", (frame,))
            layers = dict(self._query("SELECT layer, blob FROM layers WHERE frame = ?", (frame,)))
        except SessionError:
            return LOST
        return _damaged_parts(Sums(text), blob[0][0] if blob else None, layers)

    def _layer_blobs(self, frame: int) -> dict[int, bytes]:
        """The intact layers of a frame. Raises DamagedError."""
        with self._snapshot():
            rows = self._query("SELECT layer, blob FROM layers WHERE frame = ? ORDER BY layer", (frame,))
            text = self._sums(FRAME, frame).get(frame)
            if not rows and text is None:
                of_it = "WHERE (SELECT frame FROM partial) = ? ORDER BY layer"
                rows = self._query(f"SELECT layer, blob FROM partial_layers {of_it}", (frame,))
                text = self._sums(PARTIAL).get(0)
        blobs = dict(rows)
        wrong = Sums(text).wrong_layers(blobs) if text is not None and blobs else []
        if wrong:
            raise self._is_damaged(frame, _layers_in_words(wrong))
        return blobs

    def _layer(self, frame: int, layer: int, blob: bytes) -> LayerRecord:
        return self._unpacked(frame, f"layer {layer + 1}", unpack_layer, blob)

    def _unpacked(self, frame: int, part: str, unpack: Callable[[bytes], Unpacked], blob: bytes) -> Unpacked:
        try:
            return unpack(blob)
        except Exception:
            raise self._is_damaged(frame, part) from None

    def _is_damaged(self, frame: int, part: str) -> DamagedError:
        if frame not in VERIFIED.of(self._folder).damage():
            VERIFIED.forget(self._folder)
        self._known = _NOTHING
        checked = frame in self._sums(FRAME)
        return DamagedError(
            f"Frame {frame} of run '{self._folder.name}' is damaged on the disk ({part}).",
            "Resume the run: the frame is tracked again."
            if checked
            else "Repair it with 'studio verify --repair'.",
        )

    def _has_table(self, name: str) -> bool:
        """Whether the store has a table; older ones have fewer."""
        return bool(self._query(f"SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = '{name}'"))

    def settings_history(self) -> list[SettingsEntry]:
        """Every version of the settings that was in use, oldest first. Raises SessionError if one is damaged."""
        rows = self._query('SELECT version, frame, layer, "values" FROM settings ORDER BY version')
        wrong = self.damaged_settings()
        if wrong:
            raise self._damaged_version(wrong[0])
        history: list[SettingsEntry] = []
        for version, frame, layer, text in rows:
            try:
                history.append(
                    SettingsEntry(version, frame, layer, decode_json(text.encode(), dict[str, Any]))
                )
            except (DecodeError, AttributeError):  # stores without checksums; a damaged text may be a number
                raise self._damaged_version(version) from None
        return history

    def _damaged_version(self, version: int) -> SessionError:
        return SessionError(
            f"Version {version} of the settings of run '{self._folder.name}' is damaged on the disk.",
            "Repair the run with 'studio verify --repair', or start it again.",
        )

    def damaged_settings(self) -> list[int]:
        """The versions of the settings that are lost or damaged."""
        with self._snapshot():
            entries = self._query('SELECT version, frame, layer, "values" FROM settings')
            sums = self._sums(SETTINGS)
        rows = {row[0]: row for row in entries}
        return sorted(
            version
            for version, text in sums.items()
            if version not in rows or not Sums(text).row_fits(rows[version])
        )

    def partial(self) -> PartialFrame | None:
        """The state of an unfinished frame, if there is one and it is intact."""
        with self._snapshot():
            rows = self._query("SELECT frame, next_layer, blob FROM partial")
            layers = dict(self._query("SELECT layer, blob FROM partial_layers"))
            text = self._sums(PARTIAL).get(0)
        if not rows:
            return None
        frame, next_layer, blob = rows[0]
        sums = Sums(text) if text is not None else None
        whole = sums is None or (sums.row_fits((frame, next_layer)) and sums.fits("state", blob))
        if not whole or (sums is not None and sums.wrong_layers(layers)):
            return None
        try:
            return PartialFrame(frame, next_layer, unpack(blob))
        except SessionError:
            return None

    def done(self) -> int:
        """How many frames are finished."""
        return len(self.frames())

    def last_before(self, frame: int) -> int | None:
        """The last finished frame before one; None where there is none."""
        rows = self._query("SELECT MAX(frame) FROM frames WHERE frame < ?", (frame,))
        return rows[0][0] if rows else None

    def arrivals(self) -> tuple[Indices, Array]:
        """The finished frames (K,) of a live run, and the times (K, 2) of their pictures and poses, s; else empty."""
        if not self._has_table("arrivals"):
            return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        rows = self._query("SELECT frame, arrived, ready FROM arrivals ORDER BY frame")
        frames = np.array([row[0] for row in rows], dtype=np.int64)
        return frames, np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 2)

    def ended(self) -> str:
        """ "cancelled" if a person ended the run, "finished" if a live one is over, else ""."""
        rows = self._query("SELECT value FROM meta WHERE key = 'ended'")
        return rows[0][0] if rows else ""

    def time_taken(self) -> TimeTaken | None:
        """What tracking took; None for a run that is live, copied, being tracked or of an older studio."""
        rows = self._query("SELECT value FROM meta WHERE key = 'time'")
        return time_from(rows[0][0]) if rows else None

    def _missing(self, what: str) -> NotFoundError:
        return NotFoundError(
            f"Run '{self._folder.name}' has no {what}.",
            "Track further, or choose a frame that has been tracked.",
        )

    @contextmanager
    def _snapshot(self) -> Generator[None]:
        """Everything that is read inside is of one moment, even if a writer continues."""
        with self._lock:
            opened = not self._within and (self._connection is not None or bool(self._query("SELECT 1")))
            if not opened:
                yield
                return
            self._query("BEGIN")
            self._within = True
            try:
                yield
            finally:
                self._within = False
                with suppress(SessionError):
                    self._query("ROLLBACK")

    def _query(self, sql: str, values: tuple[int, ...] = ()) -> list[Row]:
        with self._lock:
            if self._settle is not None and not self._within:
                self._settle()
            try:
                if self._connection is None:
                    if not (self._folder / FILE_NAME).exists():
                        return []
                    self._connection = _open_to_read(self._folder / FILE_NAME)
                return self._connection.execute(sql, values).fetchall()
            except UNREADABLE as error:
                raise SessionError(
                    f"The results in '{self._folder / FILE_NAME}' cannot be read ({error}).",
                    "Put back a copy of the file, or start the run again.",
                ) from None


def _is_frame(value: object) -> bool:
    return isinstance(value, int) and 0 <= value < MOST_FRAMES


def _impossible(rows: Sequence[Row], known: Sequence[Row]) -> dict[int, str]:
    """`NUMBERS` for the frames whose values are not of their columns' types, or whose poses are not finite or not of
    the others' length: SQLite keeps whatever a column is given. known : rows that were found possible before.
    """
    if not rows or _are_plain(rows, known):
        return {}
    # Bytes that are no numbers are no length that others could be measured by, however many rows have it.
    sizes = Counter(len(row[6]) for row in rows if isinstance(row[6], bytes) and len(row[6]) % 8 == 0)
    size = len(known[0][6]) if known else max(sizes, key=lambda one: sizes[one], default=0)
    wrong = {
        row[0]: NUMBERS
        for row in rows
        if _is_frame(row[0]) and not (_are_numbers(row) and len(row[6]) == size)
    }
    whole = [row for row in rows if _is_frame(row[0]) and row[0] not in wrong]
    if size % 8 or not size or not whole:
        return wrong | {row[0]: NUMBERS for row in whole}
    poses = np.frombuffer(b"".join(row[6] for row in whole), "<f8").reshape(len(whole), -1)
    unlike = np.flatnonzero(~np.isfinite(poses).all(axis=1))
    return wrong | {whole[int(index)][0]: NUMBERS for index in unlike}


def _are_plain(rows: Sequence[Row], known: Sequence[Row]) -> bool:
    """Whether all values are of their columns' types: asked of whole columns, since that is nearly always so."""
    columns = list(zip(*rows, strict=True))
    counts, reals = (columns[0], *columns[3:6]), (*columns[1:3], columns[8])
    poses = columns[6]
    types = [set(map(type, column)) for column in (*counts, *reals, poses, columns[9])]
    if (
        any(kinds != {int} for kinds in types[:4])
        or not types[7] <= {bytes}
        or not types[8] <= {int, NoneType}
    ):
        return False
    if (
        any(not kinds <= {int, float, NoneType} for kinds in types[4:7])
        or None in columns[1]
        or None in columns[2]
    ):
        return False
    least, most = min(map(min, counts)), max(map(max, counts[1:]))
    sizes = {len(pose) for pose in (*poses, *(row[6] for row in known[:1]))}
    if least < 0 or most >= LARGEST_COUNT or max(columns[0]) >= MOST_FRAMES or len(sizes) > 1:
        return False
    if not set(columns[7]) <= {None, *TRACKING_STATES} or min(sizes) % 8:
        return False
    return bool(np.isfinite(np.frombuffer(b"".join(poses), "<f8")).all())


def _are_numbers(row: Row) -> bool:
    counts = all(isinstance(value, int) and abs(value) < LARGEST_COUNT for value in (*row[3:6], row[9] or 0))
    reals = all(isinstance(value, int | float) for value in (*row[1:3], row[8] or 0.0))
    return counts and reals and isinstance(row[6], bytes) and (row[7] is None or row[7] in TRACKING_STATES)


def time_from(text: str) -> TimeTaken | None:
    """What `add_time` wrote; None for what it did not."""
    try:
        return decode_json(text, TimeTaken)
    except DecodeError:
        return None


def _damage(known: CheckedStore, frame: int, text: str, row: Row | None) -> str:
    """What of a frame's numbers does not match its checksums, as text; "" if all do or did before."""
    if row is None:
        return LOST
    if not known.holds_row(frame, text, row):
        if text == GIVEN_UP or not Sums(text).row_fits(row):
            return NUMBERS
        known.add_row(frame, text, row)
    return ""


def _known_damage(known: CheckedStore, due: Mapping[int, str]) -> dict[int, str]:
    """The damage of some frames that was found before, as text."""
    damage = known.damage()
    return {
        frame: damage[frame][1]
        for frame, text in due.items()
        if frame in damage and damage[frame][0] == hash(text)
    }


def _damaged_parts(sums: Sums, result: bytes | None, layers: Mapping[int, bytes]) -> str:
    """The blobs of a frame that do not match its checksums, as text; "" if all do. result : None where it has none."""
    if result is None or not sums.fits("result", result):
        return LOST if result is None else RESULT
    return _layers_in_words(sums.wrong_layers(layers))


def _layers_in_words(layers: Iterable[int]) -> str:
    return ", ".join(f"layer {layer + 1}" for layer in layers)


def _open_to_read(path: Path) -> sqlite3.Connection:
    """A read-only connection; also to a store in a read-only folder."""
    try:
        return _open(path, "rw")
    except sqlite3.OperationalError:
        return _open(path, "immutable")


def _open(path: Path, way: str) -> sqlite3.Connection:
    connection = open_database(path, way, patience=10.0, shared=True)
    try:
        connection.execute("PRAGMA query_only = ON")
        check_tables(connection, path)
        check_version(connection, path)
    except BaseException:
        connection.close()
        raise
    # A blob that a flipped bit made a text fits no checksum, and is no reason not to read the others.
    connection.text_factory = _readable
    return connection


def _readable(content: bytes) -> str:
    return content.decode("utf-8", "replace")


def check_version(connection: sqlite3.Connection, path: Path) -> None:
    """Raises SessionError for a store of a newer studio; an unreadable one is reported elsewhere."""
    with suppress(*UNREADABLE):
        row = connection.execute("SELECT value FROM meta WHERE key = 'schema'").fetchone()
        if row is not None and str(row[0]).isdigit() and int(row[0]) > SCHEMA_VERSION:
            raise SessionError(
                f"'{path}' has schema version {row[0]}, this studio knows versions up to {SCHEMA_VERSION}.",
                "Open it with a newer studio.",
            )
