"""Sessions in a real S3-speaking server: put there, listed, copied, changed, broken off, refused in words."""

import importlib.util
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import s3fs
from s3_server import BUCKET, s3_server, used_here
from store_records import layer_of, record_of, result_of
from toy_session import make_session

from studio.foundations.errors import NotFoundError, SessionError
from studio.sessions import remote_sessions
from studio.sessions.file_checksums import note_files
from studio.sessions.object_stores import Store, above, below, folder_of, is_address
from studio.sessions.process_lock import ProcessLock
from studio.sessions.remote_sessions import (
    address_of,
    bring_runs,
    download,
    free_run_name_at,
    put_run,
    remote_runs,
    remote_session,
    sessions_at,
    upload,
    upload_unless_there,
)
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import Workspace

FOLDER = f"s3://{BUCKET}/sessions"


@pytest.fixture(scope="module")
def server() -> Iterator[Mapping[str, str]]:
    with s3_server() as variables:
        yield variables


@pytest.fixture
def address(
    server: Mapping[str, str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, request: pytest.FixtureRequest
) -> Iterator[str]:
    """Where this test's session is put; copies lie in its own cache."""
    with used_here(server, monkeypatch, tmp_path / "cache"):
        yield f"{FOLDER}-{abs(hash(request.node.name))}/toy"


@pytest.fixture
def toy(tmp_path: Path) -> Session:
    session = make_session(tmp_path / "workspace" / "toy")
    note_files(session.path)
    return session


def stored(session: Session, name: str, frames: int = 2) -> StoredRun:
    run = session.new_run(record_of(session, name))
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, run.record.settings)
        for frame in range(frames):
            writer.write_frame(result_of(frame, count=5, layers=1), [layer_of(frame, 0, count=5)])
    return run


def contents(folder: Path, *left_out: str) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.startswith("results.") and path.name not in left_out
    }


def test_places() -> None:
    assert [is_address(one) for one in ("s3://a/b", "memory://x", "walk", "/a/b", "C:\\x", "file:///a")] == [
        True, True, False, False, False, True,
    ]  # fmt: skip
    assert folder_of("file:///shared/my%20walk") == "/shared/my walk"
    assert above("s3://bucket/a/b") == "s3://bucket/a"
    assert above("s3://bucket") == "s3://bucket"
    assert above("/a/b") == "/a"
    assert below("s3://bucket/a/", "b", "c") == "s3://bucket/a/b/c"


def test_a_session_comes_back_byte_for_byte(address: str, toy: Session, tmp_path: Path) -> None:
    run = stored(toy, "run-1")
    assert upload(toy, address) == address
    (line,) = sessions_at(above(address))
    assert (line.name, line.address, line.whole, line.runs) == ("toy", address, True, ("run-1",))
    assert sessions_at(address) == (line,)

    copy = remote_session(address)
    assert copy.name == "toy"
    assert address_of(copy) == address
    assert contents(copy.path) == {
        name: content for name, content in contents(toy.path).items() if not name.startswith("runs/")
    }
    assert remote_session(address).path == copy.path

    whole = download(address, tmp_path / "elsewhere" / "toy")
    assert contents(whole.path) == contents(toy.path)
    assert address_of(whole) == ""
    with whole.run("run-1").results() as found, run.results() as given:
        assert found.frames() == given.frames() == [0, 1]
        assert (found.poses()[1] == given.poses()[1]).all()


def test_a_run_is_put_beside_its_original_and_comes_from_there(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    upload(toy, address)
    copy = remote_session(address)
    assert free_run_name_at(copy) == "run-1"
    put_run(copy, stored(copy, "run-1"))
    assert remote_runs(copy) == {"run-1"}
    monkeypatch.setenv("STUDIO_CACHE", str(tmp_path / "of another machine"))
    other = remote_session(address)
    assert other.path != copy.path
    assert not other.runs()
    assert free_run_name_at(other) == "run-2"
    with pytest.raises(SessionError, match="has a run 'run-1'"):
        free_run_name_at(other, "run-1")
    bring_runs(other, "run-")
    with other.run("run-1").results() as found:
        assert found.frames() == [0, 1]
    # A run beside it is no other footage.
    assert remote_session(address).path == other.path


def test_what_an_upload_broke_off_is_no_session(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    stored(toy, "run-1")
    written = Store.write

    def breaks(store: Store, name: str, content: bytes) -> None:
        if name.endswith("session.json"):
            raise KeyboardInterrupt
        written(store, name, content)

    monkeypatch.setattr(Store, "write", breaks)
    with pytest.raises(KeyboardInterrupt):
        upload(toy, address)
    monkeypatch.setattr(Store, "write", written)
    (line,) = sessions_at(above(address))
    assert not line.whole
    for use in (lambda: remote_session(address), lambda: download(address, tmp_path / "x" / "toy")):
        with pytest.raises(SessionError, match=r"no complete session: it has no 'session\.json'") as no:
            use()
        assert "interrupted" in no.value.hint
    assert not (tmp_path / "x" / "toy").exists()
    upload(toy, address)
    assert remote_session(address).manifest.frame_count == toy.manifest.frame_count


def test_a_session_that_other_work_changes_while_it_is_put_says_so_and_is_none_there(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    alignment = toy.path / "calibration" / "cameras.alignment.json"
    alignment.parent.mkdir(exist_ok=True)
    alignment.write_text("{}")
    put = Store.put

    def goes_first(store: Store, *given: Any) -> None:  # noqa: ANN401 - as `Store.put` takes it
        alignment.unlink()
        (toy.path / "calibration" / "later.json").write_text("{}")
        put(store, *given)

    monkeypatch.setattr(Store, "put", goes_first)
    with pytest.raises(
        SessionError, match=r"'toy' was changed by other work .*cameras\.alignment\.json"
    ) as no:
        upload(toy, address)
    assert no.value.hint.startswith("Do this again")
    assert not Store(address).has("session.json")
    monkeypatch.setattr(Store, "put", put)
    assert upload(toy, address) == address
    assert Store(address).has("calibration/later.json")


@pytest.mark.slow
def test_a_killed_upload_of_a_run_is_no_run(
    address: str, toy: Session, server: Mapping[str, str], tmp_path: Path
) -> None:
    """Another process is killed when everything but the record is there."""
    upload(toy, address)
    stored(toy, "run-1")
    script = (
        "import os, shutil, signal, sys\n"
        "from studio.sessions import remote_sessions as remote\n"
        "from studio.sessions.object_stores import Store\n"
        "Store.write = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
        "copy = remote.remote_session(sys.argv[1])\n"
        "shutil.copytree(sys.argv[2], copy.path / 'runs' / 'run-1')\n"
        "remote.put_run(copy, copy.run('run-1'))\n"
    )
    place = str(toy.path / "runs" / "run-1")
    done = subprocess.run(
        [sys.executable, "-c", script, address, place], env={**os.environ, **server}, check=False
    )
    assert done.returncode == -9
    assert any("runs/run-1/" in name for name in Store(address).listed())
    copy = remote_session(address)
    assert remote_runs(copy) == frozenset()
    assert not sessions_at(address)[0].runs
    assert (copy.path / "runs" / "run-1").is_dir()
    put_run(copy, copy.run("run-1"))
    assert remote_runs(copy) == {"run-1"}


def test_changed_footage_is_another_copy_and_a_damaged_one_is_none(address: str, toy: Session) -> None:
    upload(toy, address)
    first = remote_session(address)
    name = "pictures/front/0003.png"
    good = Store(address).read(name)
    store = Store(address)
    store.write(name, b"another picture")
    with pytest.raises(SessionError, match=r"0003\.png' is not what was written"):
        remote_session(address)
    store.remove([name])
    with pytest.raises(SessionError, match=r"0003\.png' is gone"):
        remote_session(address)
    assert first.footage().picture("front", 3).any()
    store.write(name, good)
    assert contents(remote_session(address).path) == contents(toy.path)
    left = [
        path.name for path in remote_sessions.cache_folder().iterdir() if path.name.startswith(".partial")
    ]
    assert not left


def test_what_came_shorter_than_listed_is_refused(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(toy, address)
    files = Store(address)._files
    got = files.get

    def shortened(sources: list[str], places: list[str]) -> None:
        got(sources, places)
        Path(places[0]).write_bytes(b"x")

    monkeypatch.setattr(files, "get", shortened)
    with pytest.raises(SessionError, match=r"came with 1 of \d+ bytes"):
        remote_session(address)


def test_what_a_killed_copy_left_is_made_anew_and_many_wait_for_one(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload(toy, address)
    store = Store(address)
    key = remote_sessions._key(address, remote_sessions._needed_files(store))
    left = remote_sessions.cache_folder() / f".partial-{key}" / "toy"
    left.mkdir(parents=True)
    (left / "session.json").write_text("half")
    brought: list[int] = []
    real = Store.bring

    def counted(self: Store, *given: object) -> None:
        brought.append(1)
        real(self, *given)  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(Store, "bring", counted)
    found: list[Path] = []
    threads = [threading.Thread(target=lambda: found.append(remote_session(address).path)) for _ in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 5
    assert len(set(found)) == 1
    assert brought == [1]
    assert contents(found[0]) == contents(toy.path)


@pytest.mark.slow
def test_copies_that_nobody_uses_make_room(
    address: str, toy: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = []
    for number in range(3):
        upload(toy, f"{address}{number}")
        places.append(remote_session(f"{address}{number}").path)
    size = sum(path.stat().st_size for path in places[0].rglob("*") if path.is_file())
    monkeypatch.setenv("STUDIO_CACHE_GB", str(2.5 * size / 1e9))
    # All three are held by this process.
    upload(toy, f"{address}3")
    places.append(remote_session(f"{address}3").path)
    assert all(place.is_dir() for place in places)
    for place in (places[0], places[2]):
        remote_sessions._holds.pop(place.parent).free()
    upload(toy, f"{address}4")
    remote_session(f"{address}4")
    assert [place.is_dir() for place in places] == [False, True, False, True]
    assert remote_session(f"{address}0").manifest.name == "toy"
    monkeypatch.setenv("STUDIO_CACHE_GB", "much")
    upload(toy, f"{address}5")
    with pytest.raises(SessionError, match="STUDIO_CACHE_GB is 'much'"):
        remote_session(f"{address}5")


def test_a_lock_is_shared_or_taken(tmp_path: Path) -> None:
    one, two = ProcessLock.share(tmp_path / "lock"), ProcessLock.share(tmp_path / "lock")
    assert ProcessLock.take(tmp_path / "lock") is None
    one.free()
    assert ProcessLock.take(tmp_path / "lock") is None
    two.free()
    taken = ProcessLock.take(tmp_path / "lock")
    assert ProcessLock.share(tmp_path / "lock") is None
    taken.free()


def test_what_is_not_there(address: str, toy: Session, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match="There is no session at"):
        remote_session(address)
    with pytest.raises(NotFoundError, match="There is nothing at"):
        sessions_at(above(address))
    with pytest.raises(NotFoundError, match="no such bucket or folder: 's3://none-of-that-name/toy'") as no:
        upload(toy, "s3://none-of-that-name/toy")
    assert "Make the bucket" in no.value.hint
    with pytest.raises(SessionError, match="Protocol not known: nowhere"):
        remote_session("nowhere://x/toy")
    with pytest.raises(SessionError, match="needs a package that is not installed"):
        remote_session("gs://x/toy")
    with pytest.raises(SessionError, match=r"'a b' cannot be the name"):
        upload(toy, f"s3://{BUCKET}/a b")


@pytest.mark.slow
def test_a_store_that_refuses_says_why(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    s3fs.S3FileSystem.clear_instance_cache()
    with pytest.raises(SessionError, match="does not do what it should") as no:
        remote_session(address)
    assert "can be reached" in no.value.hint


def test_without_credentials_nobody_is_let_in(
    address: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", str(tmp_path / "none"))
    monkeypatch.setenv("AWS_CONFIG_FILE", str(tmp_path / "none"))
    s3fs.S3FileSystem.clear_instance_cache()
    with pytest.raises(SessionError, match="refuses access") as no:
        remote_session(address)
    assert "AWS_ACCESS_KEY_ID" in no.value.hint


def test_the_extra_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    known = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "fsspec" else known(name))
    with pytest.raises(SessionError, match="needs fsspec, which is not installed") as no:
        Store("s3://a/b")
    assert 'pip install "capture-studio[remote]"' in no.value.hint


def test_names_that_lead_out_are_refused(address: str, toy: Session, tmp_path: Path) -> None:
    upload(toy, address)
    Store(address).write("pictures/../../../outside", b"x")
    with pytest.raises(Exception, match="does not name a file inside"):
        remote_session(address)


def test_footage_that_lies_elsewhere_and_a_taken_place(address: str, toy: Session) -> None:
    upload(toy, address)
    with pytest.raises(SessionError, match="There is a session at"):
        upload(toy, address)
    text = (toy.path / "session.json").read_text()
    (toy.path / "session.json").write_text(text.replace("pictures/front", "/elsewhere/front"))
    with pytest.raises(SessionError, match="lies elsewhere") as no:
        upload(Session(toy.path), f"{address}-other")
    assert "--copy" in no.value.hint


def test_rendered_footage_is_put_once_and_again_where_it_is_other(address: str, toy: Session) -> None:
    upload_unless_there(toy, address)
    stamps = Store(address).listed()
    (toy.path / "session.json").touch()
    upload_unless_there(toy, address)
    assert Store(address).listed() == stamps
    (toy.path / "pictures" / "front" / "0003.png").unlink()
    Store(address).write("left.over", b"x")
    upload_unless_there(toy, address)
    assert set(stamps) - set(Store(address).listed()) == {"pictures/front/0003.png"}
    assert "left.over" not in Store(address).listed()


def test_the_workspace_takes_folders_by_address_and_refuses_to_change_what_is_far(
    address: str, toy: Session
) -> None:
    assert Workspace().resolve(toy.path.as_uri()).path == toy.path
    with pytest.raises(SessionError, match="is not on this machine") as no:
        Workspace().resolve(address)
    assert f"studio download {address}" in no.value.hint
    with pytest.raises(SessionError, match="cannot begin at") as no:
        Workspace().place_for(address)
    assert "studio upload" in no.value.hint
    shutil.rmtree(toy.path)
