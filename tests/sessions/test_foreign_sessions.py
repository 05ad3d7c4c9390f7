"""Sessions of others: what leads out of them is not followed, what is odd about them is said before they are opened."""

import contextlib
import os
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
import zstandard
from store_records import layer_of, record_of, result_of
from toy_session import make_session

from studio.foundations.errors import SessionError, StudioError
from studio.foundations.foreign_files import read_file
from studio.results import verifying
from studio.results.verifying import UNTOUCHED_SECONDS, remove_left_behind, verify
from studio.runs.moved_knobs import FILE_NAME as MOVED_NAME
from studio.sessions import atomic_files, file_checksums, foreign_sessions
from studio.sessions.file_checksums import check_files
from studio.sessions.foreign_sessions import inspect_place
from studio.sessions.object_stores import Store
from studio.sessions.process_lock import ProcessLock
from studio.sessions.remote_sessions import upload
from studio.sessions.results_codec import LARGEST_BLOB, unpack
from studio.sessions.results_store import ResultsReader, ResultsWriter
from studio.sessions.run_log import append_to_log, read_log
from studio.sessions.session import Session
from studio.sessions.session_databases import open_database
from studio.sessions.workspace import Workspace


@pytest.fixture
def taken(tmp_path: Path) -> Session:
    """A session with a run of two frames; beside it, `outside`."""
    session = make_session(tmp_path / "taken", frames=2)
    run = session.new_run(record_of(session, "done"))
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, {"particles": 12})
        for frame in range(2):
            writer.write_frame(result_of(frame), [layer_of(frame, 0)], 2000)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside" / "secret").write_text("secret")
    return session


def linked(path: Path, target: Path) -> Path:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.symlink_to(target)
    return path


def test_a_file_is_read_where_it_lies_and_through_links_that_stay_inside(taken: Session) -> None:
    (taken.path / "note").write_text("words")
    linked(taken.path / "same", Path("note"))
    assert read_file(taken.path / "same") == b"words"
    with pytest.raises(SessionError, match="larger than"):
        read_file(taken.path / "note", 4)
    assert read_file(taken.path / "note", 5) == b"words"


@pytest.mark.parametrize("target", ["outside/secret", "outside", "outside/none"])
def test_no_link_leads_out(taken: Session, target: str) -> None:
    path = linked(taken.path / "thing", taken.path.parent / target)
    with pytest.raises(SessionError, match="leads by a link out of session 'taken'"):
        read_file(path)
    with pytest.raises(SessionError, match="leads by a link out"):
        Session(taken.path)
    with pytest.raises(SessionError, match="leads by a link out"):
        atomic_files.write_text(path / "made", "words")
    assert [entry.name for entry in (taken.path.parent / "outside").iterdir()] == ["secret"]


def test_footage_alone_may_lie_elsewhere_and_is_never_changed(taken: Session) -> None:
    elsewhere = taken.path.parent / "disk"
    (taken.path / "pictures").rename(elsewhere)
    linked(taken.path / "pictures", elsewhere)
    session = Session(taken.path)
    footage = session.footage()
    assert footage.picture("front", 1).shape == (120, 160, 3)
    footage.close()
    found = inspect_place(taken.path)
    assert [(one.place, one.footage) for one in found.oddities] == [("pictures", True)]
    assert found.harmless


@pytest.mark.parametrize("name", ["log.jsonl", MOVED_NAME, "cameras.toml", "run.json", "results.sqlite"])
@pytest.mark.parametrize("kind", ["a pipe", "a device", "a link"])
def test_no_file_of_a_run_blocks_or_leads_out(taken: Session, name: str, kind: str) -> None:
    run = taken.run("done")
    path = run.folder / name
    path.unlink(missing_ok=True)
    if kind == "a pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero" if kind == "a device" else taken.path.parent / "outside" / "secret")
    # All that reads them, and the list of all sessions.
    for read in (
        lambda: read_log(run.folder),
        lambda: append_to_log(run.folder, "info", "words"),
        run.cameras,
        lambda: taken.run("done").record,
        run.summary,
    ):
        with contextlib.suppress(StudioError):
            read()
    (line,) = Workspace(taken.path.parent).sessions()
    assert line.name == "taken"
    assert (taken.path.parent / "outside" / "secret").read_text() == "secret"


def test_a_lock_and_a_store_are_not_made_elsewhere(taken: Session) -> None:
    run = taken.run("done")
    outside = taken.path.parent / "outside"
    for name, use in (
        ("results.lock", lambda: ProcessLock.take(run.folder / "results.lock")),
        ("results.sqlite-wal", lambda: open_database(run.folder / "results.sqlite")),
        ("results.sqlite", lambda: ResultsWriter(run.folder)),
    ):
        linked(run.folder / name, outside / "made")
        with pytest.raises(SessionError, match="leads by a link out"):
            use()
        (run.folder / name).unlink()
    assert [entry.name for entry in outside.iterdir()] == ["secret"]


@pytest.mark.parametrize("what", ["calibration/more", "runs/done/exports", "truth"])
def test_nothing_of_elsewhere_is_uploaded(taken: Session, what: str) -> None:
    linked(taken.path / what, taken.path.parent / "outside")
    address = f"memory://uploads/{what.replace('/', '-')}"
    with pytest.raises(SessionError, match="leads by a link out"):
        upload(taken, address)
    assert not any("secret" in name for name in Store(address).listed())


def test_a_run_that_is_a_link_deletes_nothing_elsewhere(taken: Session) -> None:
    other = make_session(taken.path.parent / "other", frames=2)
    there = other.new_run(record_of(other, "done")).folder
    before = sorted(there.rglob("*"))
    linked(taken.path / "runs" / "done", there)
    workspace = Workspace(taken.path.parent)
    with pytest.raises(StudioError):
        workspace.trash_run("taken", "done")
    linked(taken.path / "runs", there.parent)
    for change in (
        lambda: workspace.trash_run("taken", "done"),
        lambda: workspace.rename_run("taken", "done", "mine"),
    ):
        with pytest.raises(StudioError):
            change()
    assert sorted(there.rglob("*")) == before


ENDLESS = (
    "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS key, 'x' AS value FROM n"
)


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        (("DROP TABLE meta", f"CREATE VIEW meta AS {ENDLESS}"), "a view 'meta'"),
        (("CREATE TRIGGER t AFTER INSERT ON meta BEGIN SELECT 1; END",), "a trigger 't'"),
        (("CREATE TABLE more (a, b AS (zeroblob(a)))",), "computes columns of 'more'"),
        (("CREATE INDEX i ON frames (hex(pose))",), "an index 'i'"),
    ],
)
def test_tables_of_a_store_are_tables(taken: Session, statements: tuple[str, ...], words: str) -> None:
    run = taken.run("done")
    with open_database(run.folder / "results.sqlite") as store:
        for statement in statements:
            store.execute(statement)
    store.close()
    for use in (lambda: ResultsReader(run.folder).frames(), lambda: ResultsWriter(run.folder)):
        with pytest.raises(SessionError, match=words):
            use()
    assert [one.place for one in inspect_place(taken.path).oddities] == ["runs/done/results.sqlite"]


def test_a_query_that_does_not_end_is_interrupted(taken: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studio.sessions.session_databases.MOST_STEPS", 3)
    store = open_database(taken.run("done").folder / "results.sqlite")
    with pytest.raises(Exception, match="interrupted"):
        store.execute(f"SELECT count(*) FROM ({ENDLESS})").fetchall()
    store.close()


@pytest.mark.parametrize(
    "change",
    [
        "pose = x'01'",
        "pose = 'words'",
        "log_weight = 'heavy'",
        "layers = 1.5",
        "evaluations = 9223372036854775807",
    ],
)
def test_values_of_another_type_are_damage(taken: Session, change: str) -> None:
    run = taken.run("done")
    with open_database(run.folder / "results.sqlite") as store:
        store.execute(f"UPDATE frames SET {change} WHERE frame = 1")
        store.execute("DELETE FROM checksums")
    store.close()
    with run.results() as results:
        assert results.frames() == [0]
        assert list(results.damaged()) == [1]
        assert np.isfinite(results.poses()[1]).all()
        assert len(results.timeline().frames) == 1


def test_poses_that_are_no_numbers_are_damage(taken: Session) -> None:
    run = taken.run("done")
    with open_database(run.folder / "results.sqlite") as store:
        store.execute("UPDATE frames SET pose = ? WHERE frame = 0", (np.full(4, np.nan).tobytes(),))
        store.execute("DELETE FROM checksums")
    store.close()
    assert run.summary().damaged == (0,)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('"fps":60.0', '"fps":1e308'),
        ('"frame_count":2', '"frame_count":1000000000000000000'),
        ('"path":"pictures/front"', '"path":"../outside"'),
        ('"width":160', '"width":1000000000'),
    ],
)
def test_a_manifest_that_cannot_be_is_a_line_that_says_why(taken: Session, entry: str, words: str) -> None:
    path = taken.path / "session.json"
    text = path.read_text().replace(": ", ":")
    assert entry in text
    path.write_text(text.replace(entry, words))
    make_session(taken.path.parent / "whole", frames=2)
    lines = {line.name: line.problem for line in Workspace(taken.path.parent).sessions()}
    assert lines["whole"] == ""
    assert "it says" in lines["taken"]
    assert not inspect_place(taken.path).harmless


def test_oddities_are_named_and_nothing_is_changed(taken: Session) -> None:
    os.mkfifo(taken.path / "pipe")
    (taken.path / "a\x1b[31mb").write_text("")
    linked(taken.path / "runs" / "done" / "body", taken.path.parent / "outside")
    (taken.path / ".partial-abc").mkdir()
    with (taken.path / "large.json").open("wb") as file:
        file.truncate(1 << 30)
    before = sorted(path.as_posix() for path in taken.path.rglob("*"))
    found = {one.place: one.what for one in inspect_place(taken.path).oddities}
    assert found["pipe"] == "a pipe and no regular file"
    assert "control characters" in found["a\x1b[31mb"]
    assert "leads out" in found["runs/done/body"]
    assert "interrupted" in found[".partial-abc"]
    assert "1024 MB" in found["large.json"]
    assert sorted(path.as_posix() for path in taken.path.rglob("*")) == before


def test_what_other_work_removes_meanwhile_is_neither_odd_nor_damaged(
    taken: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = taken.path / "results.sqlite-shm"
    before = inspect_place(taken.path)
    entries, files = foreign_sessions._entries, file_checksums._files
    monkeypatch.setattr(foreign_sessions, "_entries", lambda folder: [*entries(folder), gone])
    monkeypatch.setattr(file_checksums, "_files", lambda folder: [*files(folder), ("gone.json", gone)])
    assert inspect_place(taken.path) == before
    assert check_files(taken.path).damaged == {}
    assert verifying._newest(gone) > time.time() - UNTOUCHED_SECONDS


def test_an_archive_is_looked_at_without_being_unpacked(taken: Session, tmp_path: Path) -> None:
    packed = Path(shutil.make_archive(str(tmp_path / "packed"), "zip", taken.path))
    found = inspect_place(packed)
    assert (found.kind, found.harmless) == ("archive", True)
    linked(taken.path / "out", Path("/etc/passwd"))
    tar = Path(shutil.make_archive(str(tmp_path / "packed"), "tar", taken.path))
    assert [one.what for one in inspect_place(tar).oddities] == ["'out' in the archive is a link"]


def test_what_is_made_is_as_private_as_its_maker_wants(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        session = make_session(tmp_path / "mine", frames=2)
        session.new_run(record_of(session, "done"))
        atomic_files.write_text(session.path / "note", "words")
        Workspace(tmp_path).duplicate("mine", "copy")
    finally:
        os.umask(before)
    for path in tmp_path.rglob("*"):
        assert path.stat().st_mode & 0o077 == 0, path


def test_verify_names_what_was_left_behind_and_removes_it(taken: Session) -> None:
    left = [taken.path / ".partial-mask", taken.path.parent / ".partial-import"]
    for folder in left:
        (folder / "videos").mkdir(parents=True)
    going_on = taken.path.parent / ".partial-going-on"
    going_on.mkdir()
    long_ago = time.time() - 2 * UNTOUCHED_SECONDS
    for folder in left:
        for path in (folder / "videos", folder):
            os.utime(path, (long_ago, long_ago))
    assert set(verify(taken).left) == {str(path) for path in left}
    remove_left_behind(taken)
    assert verify(taken).left == ()
    assert going_on.is_dir()
    assert not any(path.exists() for path in left)


def test_a_disk_that_cannot_be_written_is_verified_all_the_same(
    taken: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise SessionError("The disk cannot be written.", "")

    monkeypatch.setattr("studio.sessions.record_files.write_bytes", refused)
    (taken.path / "new").write_text("words")
    assert verify(taken).faults == ()


def test_a_result_unpacks_to_a_bounded_size() -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(LARGEST_BLOB + 1))
    assert len(bomb) < 1 << 20
    with pytest.raises(SessionError, match="unpacks to more than"):
        unpack(bomb)


def test_verify_bears_that_a_folder_goes_while_it_looks(
    taken: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    going, real = taken.path / "runs" / ".partial-run" / "body", os.scandir
    going.mkdir(parents=True)

    def scandir(path: object = ".") -> object:
        if Path(str(path)) == going and going.exists():
            shutil.rmtree(going.parent)
        return real(path)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "scandir", scandir)
    assert verifying.left_behind(taken) == ()
    assert not going.exists()
