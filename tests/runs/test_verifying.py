"""Damage on the disk is named, shown as a gap, and tracked again bit for bit."""

import contextlib
import os
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from flipped_bytes import flip_in_file, flip_stored
from toy_session import make_session, true_poses
from tracked_runs import finish, opened, poses_of

import studio
from studio.foundations.errors import DamagedError, SessionError
from studio.results.verifying import repair, verify
from studio.runs.new_run import prepare_run
from studio.sessions import salvaging
from studio.sessions.file_checksums import note_files
from studio.sessions.results_store import FILE_NAME, ResultsWriter
from studio.sessions.salvaging import faults_of_database
from studio.sessions.session import Session
from studio.sessions.session_databases import open_database
from studio.sessions.stored_run import StoredRun

QUICK = {"particles": 20, "layers": 2, "start_repeats": 2}
LAST = 5


@pytest.fixture
def run(session_on_disk: Session) -> StoredRun:
    """A finished run."""
    start = true_poses()[0] + 0.02
    made = prepare_run(session_on_disk, name="a", seed=7, start_pose=start, last=LAST, knobs=QUICK)
    finish(session_on_disk, made)
    return made


def content(run: StoredRun) -> list[bytes]:
    """All that the run found, bit for bit."""
    with run.results() as results:
        found = [results.poses()[1].tobytes()]
        for frame in results.frames():
            particles = results.result(frame).carried.particles
            found += [particles.poses.tobytes(), particles.log_weights.tobytes()]
            found += [record.poses.tobytes() for record in results.layers(frame)]
    return found


def change(run: StoredRun, sql: str) -> None:
    with contextlib.closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        connection.execute(sql)
        connection.commit()


def test_a_disk_that_cannot_be_written_is_no_damage(
    session_on_disk: Session, run: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(path: Path, mode: str = "rwc", **rest: bool) -> sqlite3.Connection:
        if mode != "immutable":
            raise sqlite3.OperationalError("unable to open database file")
        return open_database(path, mode, **rest)

    monkeypatch.setattr(salvaging, "open_database", read_only)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert not faults_of_database(run.folder)
    with pytest.raises(SessionError, match="cannot be written"):
        # Before the minutes that a fit takes.
        studio.fit_subject(session_on_disk, progress=lambda *_: pytest.fail("the fit has begun"))


@pytest.mark.parametrize(
    ("in_store", "in_files"),
    [(6, 14), pytest.param(60, 40, marks=pytest.mark.slow)],
    ids=["few", "a hundred"],
)
def test_each_flip_is_named_and_repaired(
    session_on_disk: Session, run: StoredRun, in_store: int, in_files: int
) -> None:
    whole, rng = content(run), np.random.default_rng(14)
    note_files(session_on_disk.path)
    store = (run.folder / FILE_NAME).read_bytes()
    files = [
        path.relative_to(session_on_disk.path).as_posix()
        for path in sorted(session_on_disk.path.rglob("*"))
        if path.is_file() and not path.name.startswith((".", "results."))
    ]
    assert len(files) > 12
    assert verify(session_on_disk).faults == ()
    for _ in range(in_store):
        frame = flip_stored(run.folder / FILE_NAME, rng)
        found = verify(session_on_disk).faults
        assert [(fault.run, fault.frame) for fault in found] == [("a", frame)]
        assert [entry.same for entry in repair(session_on_disk, found)] in ([1], [0])
        assert content(run) == whole
    assert verify(session_on_disk).faults == ()
    (run.folder / FILE_NAME).write_bytes(store)
    for number in range(in_files):
        name = files[number % len(files)]
        path = session_on_disk.path / name
        before, status = path.read_bytes(), path.stat()
        flip_in_file(path, rng)
        assert [fault.place for fault in verify(session_on_disk).faults] == [name]
        path.write_bytes(before)
        assert path.stat().st_size == status.st_size
    assert verify(session_on_disk).faults == ()


def test_a_damaged_frame_is_a_gap_everywhere_until_it_is_tracked_again(
    session_on_disk: Session, run: StoredRun
) -> None:
    whole = content(run)
    change(run, "UPDATE layers SET blob = X'00' || blob WHERE frame = 2 AND layer = 1")
    change(run, "UPDATE frames SET log_weight = log_weight + 1 WHERE frame = 3")
    with run.results() as results:
        with pytest.raises(DamagedError, match=r"Frame 2 of run 'a' is damaged on the disk \(layer 2\)"):
            results.layers(2)
        assert (
            results.frames() == results.timeline().frames.tolist() == results.poses()[0].tolist() == [0, 1, 4]
        )
        assert results.damaged() == {2: "layer 2", 3: "its numbers"}
    summary = run.summary()
    assert (summary.damaged, summary.done, summary.status, summary.tracked_to) == (
        (2, 3),
        3,
        "interrupted",
        5,
    )
    with opened(session_on_disk, run) as tracking:
        frames = []
        while not tracking.finished:
            stepped = tracking.step_layer()
            frames += [stepped.result.frame] if stepped.result else []
    assert frames == [2, 3]
    assert content(run) == whole
    assert run.summary().damaged == ()


def test_damage_in_the_middle_of_an_unfinished_run_comes_first(session_on_disk: Session) -> None:
    def made(name: str) -> StoredRun:
        start = true_poses()[0] + 0.02
        return prepare_run(session_on_disk, name=name, seed=7, start_pose=start, last=LAST, knobs=QUICK)

    wanted = finish(session_on_disk, made("whole"))
    run = made("a")
    finish(session_on_disk, run, layers=8)
    change(run, "UPDATE frames SET pose = zeroblob(32) WHERE frame = 1")
    change(run, "DELETE FROM frames WHERE frame = 0")
    assert run.summary().damaged == (0, 1)
    assert np.array_equal(finish(session_on_disk, run), wanted)


def test_flips_anywhere_in_the_store_change_nothing_or_are_named(
    session_on_disk: Session, run: StoredRun
) -> None:
    """Flips of any byte of the database: its pages, its lists, what is not in use."""
    with contextlib.closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    path, rng, whole, named = run.folder / FILE_NAME, np.random.default_rng(3), content(run), 0
    before = path.read_bytes()
    for _ in range(60):
        flip_in_file(path, rng)
        faults = verify(session_on_disk).faults
        named += bool(faults)
        if not faults:
            assert content(run) == whole
        for ending in ("", "-wal", "-shm"):
            path.with_name(path.name + ending).unlink(missing_ok=True)
        path.write_bytes(before)
    assert named > 10


def test_a_broken_database_is_made_anew(session_on_disk: Session, run: StoredRun) -> None:
    whole = content(run)
    with contextlib.closing(sqlite3.connect(run.folder / FILE_NAME)) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        page = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'layers'").fetchone()[0]
        size = connection.execute("PRAGMA page_size").fetchone()[0]
    with (run.folder / FILE_NAME).open("r+b") as stream:
        stream.seek((page - 1) * size)
        stream.write(b"\xff" * 64)
    found = verify(session_on_disk)
    assert any("the database is damaged" in fault.what for fault in found.faults)
    assert [entry.problem for entry in repair(session_on_disk, found.faults)] == [""]
    assert verify(session_on_disk).faults == ()
    assert content(run) == whole


def test_stores_without_checksums_still_open_and_count_as_unchecked(
    session_on_disk: Session, run: StoredRun
) -> None:
    whole = content(run)
    change(run, "DROP TABLE checksums")
    assert content(run) == whole
    found = verify(session_on_disk)
    assert (found.unchecked, found.faults) == (LAST, ())
    change(run, "UPDATE layers SET blob = substr(blob, 1, 40) || X'00' || substr(blob, 42) WHERE frame = 2")
    found = verify(session_on_disk)
    assert [fault.frame for fault in found.faults] == [2]
    (done,) = repair(session_on_disk, found.faults)
    assert (done.frames, done.same, done.compared) == ((2,), 1, 1)
    assert verify(session_on_disk).faults == ()
    assert content(run) == whole


def test_first_settings_and_a_half_searched_frame(session_on_disk: Session, run: StoredRun) -> None:
    wanted = poses_of(run)
    change(run, "UPDATE settings SET \"values\" = replace(\"values\", '20', '21')")
    change(run, "UPDATE meta SET value = 'perhaps' WHERE key = 'ended'")
    found = verify(session_on_disk)
    assert [fault.place for fault in found.faults] == ["runs/a/results.sqlite: settings version 1"]
    assert [entry.problem for entry in repair(session_on_disk, found.faults)] == [""]
    assert verify(session_on_disk).faults == ()

    other = prepare_run(
        session_on_disk, name="b", seed=7, start_pose=true_poses()[0] + 0.02, last=LAST, knobs=QUICK
    )
    finish(session_on_disk, other, layers=3)
    change(other, "UPDATE partial SET blob = zeroblob(30)")
    assert ["the unfinished frame" in fault.place for fault in verify(session_on_disk).faults] == [True]
    assert np.array_equal(finish(session_on_disk, other), wanted)


def test_what_is_written_again_is_no_damage_but_footage_is(session_on_disk: Session, tmp_path: Path) -> None:
    note_files(session_on_disk.path)
    session = session_on_disk.path / "session.json"
    session.write_text(session.read_text() + "\n")
    found = verify(session_on_disk)
    assert (found.faults, found.written_again) == ((), ("session.json",))
    picture = next((session_on_disk.path / "pictures").rglob("*.png"))
    picture.write_bytes(picture.read_bytes() + b"\0")
    assert len(verify(session_on_disk).faults) == 1
    picture.unlink()
    assert [fault.what for fault in verify(session_on_disk).faults] == ["is gone"]


def test_a_database_whose_names_are_damaged_is_named(session_on_disk: Session, run: StoredRun) -> None:
    """SQLite quotes them as they are, and they are no text any more."""
    whole = content(run)
    change(run, "CREATE TABLE odd_name (one INTEGER)")
    change(run, "PRAGMA wal_checkpoint(TRUNCATE)")
    store = run.folder / FILE_NAME
    damaged = (
        store.read_bytes()
        .replace(b"CREATE TABLE odd", b"CREATX TABLE odd")
        .replace(b"odd_name", b"odd_\xffame")
    )
    store.write_bytes(damaged)
    with pytest.raises(SessionError, match="cannot be read"):
        run.summary()
    with pytest.raises(SessionError, match="cannot be written"):
        ResultsWriter(run.folder)
    found = verify(session_on_disk).faults
    assert any("the database is damaged" in fault.what for fault in found)
    repair(session_on_disk, found)
    finish(session_on_disk, run)
    assert content(run) == whole


def test_poses_of_one_byte_are_tracked_again(tmp_path: Path) -> None:
    """However many frames have them: the first one that is mended is not the odd one among them."""
    session = make_session(tmp_path / "toy", 3)
    run = prepare_run(session, name="one", start_pose=true_poses()[0], knobs={"particles": 20, "layers": 2})
    finish(session, run)
    with contextlib.closing(sqlite3.connect(run.folder / "results.sqlite")) as store, store:
        store.execute("UPDATE frames SET pose = x'01'")
        store.execute("DELETE FROM checksums")
    (repaired,) = repair(session, verify(session).faults)
    assert (repaired.frames, repaired.problem) == ((0, 1, 2), "")
    assert verify(session).faults == ()
