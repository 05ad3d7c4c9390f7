"""The store gives back every bit, while it is written, and stays readable when the writer dies."""

import dataclasses
import os
import sqlite3
import subprocess
import sys
import textwrap
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from store_records import layer_of, result_of

from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.search.trackers.tracker import LayerRecord
from studio.sessions.results_codec import kept_rows, particles_from
from studio.sessions.results_reader import FILE_NAME, Row
from studio.sessions.results_store import ResultsReader, ResultsWriter, is_being_written

ARRAYS = (
    "variance_weighed",
    "variance_resampled",
    "variance_diffused",
    "best",
    "mean",
    "poses",
    "log_weights",
)
NUMBERS = ("frame", "layer", "settings_version", "beta", "alpha_reached", "best_log_weight", "milliseconds")


def same_layer(one: LayerRecord, other: LayerRecord) -> bool:
    equal = all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ARRAYS)
    equal &= all(getattr(one, name) == getattr(other, name) for name in NUMBERS)
    return equal and np.isnan(one.alpha_wanted) == np.isnan(other.alpha_wanted)


def write(writer: ResultsWriter, frame: int) -> None:
    writer.write_frame(result_of(frame), [layer_of(frame, layer) for layer in range(3)])


def test_every_bit_comes_back(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        write(writer, 4)
        found = reader.result(4)
        wanted = result_of(4)
        for name in ("pose", "mean", "mode"):
            assert np.array_equal(getattr(found.estimate, name), getattr(wanted.estimate, name))
        for name in ("poses", "log_weights", "raw_log_weights"):
            assert np.array_equal(
                getattr(found.carried.particles, name), getattr(wanted.carried.particles, name)
            )
        assert np.array_equal(
            found.carried.particles.extra["velocities"], wanted.carried.particles.extra["velocities"]
        )
        assert np.array_equal(found.carried.previous_estimate, wanted.carried.previous_estimate)
        assert (found.frame, found.layers, found.evaluations) == (4, 3, 36)
        for layer, record in enumerate(reader.layers(4)):
            assert same_layer(record, layer_of(4, layer))
        assert same_layer(reader.layer(4, 2), layer_of(4, 2))


def test_reader_sees_each_frame_as_soon_as_it_is_written(tmp_path: Path) -> None:
    reader = ResultsReader(tmp_path)
    assert reader.frames() == []
    with ResultsWriter(tmp_path) as writer:
        for frame in range(5):
            write(writer, frame)
            assert reader.frames() == list(range(frame + 1))
            frames, poses = reader.poses()
            assert frames.tolist() == list(range(frame + 1))
            assert np.array_equal(poses[-1], result_of(frame).estimate.pose)
    line = reader.timeline()
    assert np.array_equal(line.log_weights, [-0.5, -1.5, -2.5, -3.5, -4.5])
    assert line.evaluations.tolist() == [36] * 5
    reader.close()


def test_how_a_frame_went_is_kept_and_stores_without_it_read_as_tracked(tmp_path: Path) -> None:
    folder = tmp_path
    with ResultsWriter(folder) as writer, ResultsReader(folder) as reader:
        for frame, state in enumerate(("tracked", "lost", "no evidence", "recovered", "lost")):
            result = dataclasses.replace(result_of(frame), tracking=state, overlap=0.5 + frame, doubts=frame)
            writer.write_frame(result, [layer_of(frame, 0)])
        assert reader.timeline().tracking == ("tracked", "lost", "no evidence", "recovered", "lost")
        assert [reader.result(frame).tracking for frame in range(3)] == ["tracked", "lost", "no evidence"]
        assert reader.timeline().overlaps.tolist() == [0.5, 1.5, 2.5, 3.5, 4.5]
        assert reader.timeline().doubts.tolist() == [0, 1, 2, 3, 4]
        assert (reader.result(3).overlap, reader.result(3).doubts) == (3.5, 3)
        writer.write_frame(result_of(1), [layer_of(1, 0)])
        writer.forget_from(4)
        writer.write_frame(result_of(4), [layer_of(4, 0)])
        assert reader.timeline().tracking == ("tracked", "tracked", "no evidence", "recovered", "tracked")
    older = sqlite3.connect(folder / "results.sqlite")
    older.execute("DROP TABLE tracking")
    older.execute("DROP TABLE checksums")
    older.commit()
    older.close()
    with ResultsReader(folder) as reader:
        assert reader.timeline().tracking == ("tracked",) * 5
        assert np.isnan(reader.timeline().overlaps).all()


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        write(writer, 0)
        for read in (lambda: reader.result(1), lambda: reader.layers(1), lambda: reader.layer(0, 3)):
            with pytest.raises(NotFoundError, match="has no"):
                read()


def test_fewer_particles_are_kept_the_heaviest_in_their_order_and_the_last_set_whole(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        writer.write_frame(result_of(0), [layer_of(0, 0)], particles=5)
        stored, whole = reader.layer(0, 0), layer_of(0, 0)
        assert len(stored.poses) == 5
        assert stored.log_weights.min() >= np.sort(whole.log_weights)[-5]
        places = [int(np.flatnonzero((whole.poses == pose).all(axis=1))[0]) for pose in stored.poses]
        assert places == sorted(places)
        assert np.array_equal(stored.best, whole.best)
        carried = reader.result(0).carried.particles
        assert len(carried.poses) == 12


@pytest.mark.parametrize("wanted", [0, 1, 3, 7, 100])
def test_equal_weights_are_chosen_the_same_each_time(wanted: int) -> None:
    rows = kept_rows(np.zeros(7), wanted)
    assert rows.tolist() == list(range(min(wanted, 7)))


def test_a_frame_left_in_the_middle_is_kept_whole_and_goes_when_the_frame_is_done(tmp_path: Path) -> None:
    state = {"set_poses": np.ones((3, 4)), "set_log_weights": np.zeros(3), "set_raw_log_weights": np.zeros(0)}
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        write(writer, 0)
        writer.write_partial(1, 2, state, [layer_of(1, 0), layer_of(1, 1)])
        partial = reader.partial()
        assert (partial.frame, partial.next_layer) == (1, 2)
        assert np.array_equal(particles_from(partial.state).poses, np.ones((3, 4)))
        assert [record.layer for record in reader.layers(1)] == [0, 1]
        assert same_layer(reader.layer(1, 1), layer_of(1, 1))
        assert reader.frames() == [0]
        write(writer, 1)
        assert reader.partial() is None
        assert len(reader.layers(1)) == 3


def test_a_failed_frame_leaves_nothing_behind(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        write(writer, 0)
        with pytest.raises(SessionError):
            writer.write_frame(result_of(1), [layer_of(1, 0), layer_of(1, 0)])
        assert reader.frames() == [0]
        with pytest.raises(NotFoundError):
            reader.layers(1)
        write(writer, 1)
        assert reader.frames() == [0, 1]


def test_settings_and_their_end(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        writer.write_settings(1, 0, 0, {"survival": 0.5})
        writer.write_settings(2, 3, 4, {"survival": 0.4, "carry": "mode", "on": True})
        history = reader.settings_history()
        assert [(entry.version, entry.frame, entry.layer) for entry in history] == [(1, 0, 0), (2, 3, 4)]
        assert history[1].values == {"survival": 0.4, "carry": "mode", "on": True}
        assert reader.ended() == ""
        writer.mark_ended("cancelled")
        assert reader.ended() == "cancelled"


@pytest.mark.parametrize("text", ["{", "3", "[]", '{"survival"', b"\xff"])
def test_settings_that_no_checksum_guards_and_that_are_damaged_are_named(
    tmp_path: Path, text: str | bytes
) -> None:
    with ResultsWriter(tmp_path) as writer:
        writer.write_settings(1, 0, 0, {"survival": 0.5})
    with closing(sqlite3.connect(tmp_path / "results.sqlite")) as store, store:
        store.execute('UPDATE settings SET "values" = ?', (text,))
        store.execute("DELETE FROM checksums")
    with ResultsReader(tmp_path) as reader, pytest.raises(SessionError, match="Version 1 of the settings"):
        reader.settings_history()


def test_later_frames_can_be_dropped(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        writer.write_settings(1, 0, 0, {})
        writer.write_settings(2, 2, 1, {})
        for frame in range(4):
            write(writer, frame)
        writer.forget_from(2)
        assert reader.frames() == [0, 1]
        assert [entry.version for entry in reader.settings_history()] == [1]


def test_only_one_writer(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path):
        assert is_being_written(tmp_path)
        with pytest.raises(RunError, match="another process"):
            ResultsWriter(tmp_path)
    assert not is_being_written(tmp_path)
    ResultsWriter(tmp_path).close()


def test_a_writer_killed_in_the_middle_of_a_frame_leaves_whole_frames_only(tmp_path: Path) -> None:
    """The process dies with a transaction half written; what it had finished is there, and the run is
    free."""
    script = textwrap.dedent(
        """
        import os, signal, sys
        from pathlib import Path
        from store_records import layer_of, result_of
        from studio.sessions.results_store import ResultsWriter

        def layers(frame, deadly):
            for layer in range(3):
                yield layer_of(frame, layer)

        class Deadly:
            def __init__(self, connection): self.inner, self.count = connection, 0
            def __getattr__(self, name): return getattr(self.inner, name)
            def execute(self, sql, *values):
                self.count += "INSERT INTO layers" in sql
                if self.count == 8:
                    os.kill(os.getpid(), signal.SIGKILL)
                return self.inner.execute(sql, *values)

        writer = ResultsWriter(Path(sys.argv[1]))
        writer._connection = Deadly(writer._connection)
        for frame in range(5):
            writer.write_frame(result_of(frame), layers(frame, False))
        """
    )
    paths = os.pathsep.join([str(Path(__file__).parents[1]), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], env={**os.environ, "PYTHONPATH": paths}, check=False
    )
    assert done.returncode == -9
    with ResultsReader(tmp_path) as reader:
        assert reader.frames() == [0, 1]
        assert same_layer(reader.layer(1, 2), layer_of(1, 2))
        with pytest.raises(NotFoundError):
            reader.layers(2)
    with ResultsWriter(tmp_path) as writer:
        write(writer, 2)


def test_a_damaged_store_is_reported(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_bytes(b"not a database at all" * 100)
    with ResultsReader(tmp_path) as reader, pytest.raises(SessionError, match="cannot be read"):
        reader.frames()


def test_a_damaged_blob_is_reported_and_the_rest_stays_readable(tmp_path: Path) -> None:
    with ResultsWriter(tmp_path) as writer:
        write(writer, 0)
        write(writer, 1)
    connection = sqlite3.connect(tmp_path / FILE_NAME)
    connection.execute("UPDATE layers SET blob = X'00FF00' WHERE frame = 0 AND layer = 1")
    connection.commit()
    connection.close()
    with ResultsReader(tmp_path) as reader:
        with pytest.raises(SessionError, match="damaged"):
            reader.layers(0)
        assert len(reader.layers(1)) == 3


def set_layer(tmp_path: Path, frame: int, blob: bytes) -> bytes:
    """Put another blob in the place of a frame's layer 1; returns the one before."""
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as connection:
        place = "FROM layers WHERE frame = ? AND layer = 1"
        [(before,)] = connection.execute(f"SELECT blob {place}", (frame,)).fetchall()
        connection.execute("UPDATE layers SET blob = ? WHERE frame = ? AND layer = 1", (blob, frame))
        connection.commit()
    return before


@pytest.fixture
def blobs_read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The queries for blobs of any reader."""
    asked: list[str] = []
    query = ResultsReader._query

    def noting(self: ResultsReader, sql: str, values: tuple[int, ...] = ()) -> list[tuple[object, ...]]:
        if "blob" in sql:
            asked.append(sql)
        return query(self, sql, values)

    monkeypatch.setattr(ResultsReader, "_query", noting)
    return asked


def test_what_is_stored_is_read_once_by_a_process_and_some_frames_at_a_time(
    tmp_path: Path, blobs_read: list[str]
) -> None:
    with ResultsWriter(tmp_path) as writer:
        for frame in range(20):
            write(writer, frame)
    with ResultsReader(tmp_path) as reader:
        assert reader.frames(blobs=False) == list(range(20))
        assert len(reader.poses(blobs=False)[0]) == len(reader.timeline(blobs=False).frames) == 20
        assert not reader.is_checked()
        assert blobs_read == []
        assert reader.frames() == list(range(20))
        assert len(blobs_read) == 6, "results and layers of eight frames each"
    with ResultsReader(tmp_path) as reader:
        assert reader.is_checked()
        assert reader.frames() == list(range(20))
    assert len(blobs_read) == 6


@pytest.fixture
def rows_read(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many rows each reading of numbers got."""
    read, rows = list[int](), ResultsReader._rows

    def noting(self: ResultsReader, frame: int | None = None, after: int = -1) -> list[Row]:
        found = rows(self, frame, after)
        read.append(len(found))
        return found

    monkeypatch.setattr(ResultsReader, "_rows", noting)
    return read


def test_the_numbers_are_read_once_until_something_changes(tmp_path: Path, rows_read: list[int]) -> None:
    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        write(writer, 0)
        for _ in range(3):
            assert reader.damaged(blobs=False) == {}
            assert len(reader.timeline(blobs=False).frames) == 1
            assert not reader.is_checked()
        assert rows_read == [1]
        write(writer, 1)
        assert reader.frames(blobs=False) == [0, 1]
        assert rows_read == [1, 1]
        with ResultsReader(tmp_path) as other:
            other.frames()
        assert reader.is_checked()


@pytest.mark.parametrize("blobs", [False, True])
def test_of_a_run_that_goes_on_only_new_frames_are_read(
    tmp_path: Path, rows_read: list[int], *, blobs: bool
) -> None:
    def whole() -> list[int]:
        with ResultsReader(tmp_path) as fresh:
            found = fresh.frames(blobs=blobs)
        rows_read.clear()
        assert reader.frames(blobs=blobs) == found
        poses = reader.poses(blobs=blobs)[1]
        assert np.array_equal(poses, [result_of(frame).estimate.pose for frame in found])
        return found

    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        for frame in range(20):
            write(writer, frame)
        assert whole() == list(range(20))
        for frame in (20, 23):
            write(writer, frame)
        assert whole() == [*range(21), 23]
        assert rows_read == [2]
        writer.mark_ended("cancelled")
        assert whole() == [*range(21), 23]
        writer.forget_from(10)
        write(writer, 10)
        assert whole() == list(range(11))
        assert rows_read == [11], "frames were dropped"
        writer.give_up(4)
        write(writer, 11)
        assert whole() == [0, 1, 2, 3, *range(5, 12)]
        write(writer, 4)
        assert whole() == list(range(12))
        assert rows_read == [12], "a frame was replaced"


def test_a_frame_that_is_stored_while_a_reader_looks_is_read_once(
    tmp_path: Path, rows_read: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    query, coming = ResultsReader._query, [4, 5]

    def asked(self: ResultsReader, sql: str, values: tuple[int, ...] = ()) -> list[Row]:
        found = query(self, sql, values)
        if sql == "PRAGMA data_version" and coming and not self._within:
            write(writer, coming.pop(0))
        return found

    with ResultsWriter(tmp_path) as writer, ResultsReader(tmp_path) as reader:
        for frame in range(3):
            write(writer, frame)
        assert reader.frames(blobs=False) == [0, 1, 2]
        monkeypatch.setattr(ResultsReader, "_query", asked)
        write(writer, 3)
        rows_read.clear()
        for _ in range(3):
            reader.frames(blobs=False)
        assert reader.frames(blobs=False) == [0, 1, 2, 3, 4, 5]
    assert rows_read == [2, 1], "none of them twice"


def test_damage_that_was_found_is_known_without_reading_until_it_is_mended(
    tmp_path: Path, blobs_read: list[str]
) -> None:
    with ResultsWriter(tmp_path) as writer:
        for frame in range(3):
            write(writer, frame)
    before = set_layer(tmp_path, 1, b"no layer")
    with ResultsReader(tmp_path) as reader, ResultsReader(tmp_path) as other:
        assert reader.frames(blobs=False) == [0, 1, 2]
        assert other.damaged() == {1: "layer 2"}
        blobs_read.clear()
        assert reader.frames(blobs=False) == [0, 2]
        assert reader.damaged(blobs=False) == {1: "layer 2"}
        assert reader.is_checked()
        assert blobs_read == []
        set_layer(tmp_path, 1, before)
        assert other.frames() == [0, 1, 2]
        assert reader.frames(blobs=False) == [0, 1, 2]


def test_frames_that_cannot_be_read_together_are_read_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ResultsWriter(tmp_path) as writer:
        for frame in range(4):
            write(writer, frame)
    set_layer(tmp_path, 2, b"no layer")
    query = ResultsReader._query

    def torn(self: ResultsReader, sql: str, values: tuple[int, ...] = ()) -> list[tuple[object, ...]]:
        if "BETWEEN" in sql:
            raise SessionError("The results cannot be read.", "")
        return query(self, sql, values)

    monkeypatch.setattr(ResultsReader, "_query", torn)
    with ResultsReader(tmp_path) as reader:
        assert reader.damaged() == {2: "layer 2"}


def test_a_frame_alone_is_judged_without_the_others(tmp_path: Path, blobs_read: list[str]) -> None:
    with ResultsWriter(tmp_path) as writer:
        for frame in range(3):
            write(writer, frame)
    set_layer(tmp_path, 1, b"no layer")
    with ResultsReader(tmp_path) as reader:
        assert [reader.is_whole(frame) for frame in (0, 1, 2, 3)] == [True, False, True, False]
        assert all("WHERE frame = ?" in sql for sql in blobs_read)
        with closing(sqlite3.connect(tmp_path / FILE_NAME)) as connection:
            connection.execute("UPDATE frames SET log_weight = log_weight + 1 WHERE frame = 2")
            connection.commit()
        assert not reader.is_whole(2)


def test_another_process_reads_while_it_is_written(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from studio.sessions.results_store import ResultsReader;"
        "r = ResultsReader(Path(sys.argv[1])); print(r.frames(), float(r.layer(1, 2).poses.sum()))"
    )
    with ResultsWriter(tmp_path) as writer:
        write(writer, 0)
        write(writer, 1)
        writer._connection.execute("BEGIN IMMEDIATE")
        writer._connection.execute("DELETE FROM frames")
        finished = subprocess.run(
            [sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True, check=True
        )
        writer._connection.execute("ROLLBACK")
    assert finished.stdout.split("]")[0] == "[0, 1"
    assert float(finished.stdout.split()[-1]) == float(layer_of(1, 2).poses.sum())
