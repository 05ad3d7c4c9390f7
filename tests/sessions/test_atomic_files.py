"""A file is the old one or the new one."""

import errno
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from studio.foundations.errors import SessionError
from studio.sessions import atomic_files


def test_replaces_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    atomic_files.write_text(path, "old")
    atomic_files.write_text(path, "new")
    assert path.read_text() == "new"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]


def test_a_failure_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    atomic_files.write_text(path, "old")

    def full_disk(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(SessionError, match=r"The file '.*a\.json' cannot be written: disk full \(No space"):
        atomic_files.write_text(path, "new")
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]


def test_killed_before_the_new_file_takes_its_place(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    atomic_files.write_text(path, "old")
    script = textwrap.dedent(
        """
        import os, signal, sys
        from pathlib import Path
        from studio.sessions import atomic_files
        os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)
        atomic_files.write_text(Path(sys.argv[1]), "new" * 10000)
        """
    )
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False)
    assert done.returncode == -9
    assert path.read_text() == "old"


def test_folders_take_their_place_whole(tmp_path: Path) -> None:
    folder = atomic_files.new_folder_beside(tmp_path / "run")
    (folder / "x").write_text("1")
    atomic_files.move_into_place(folder, tmp_path / "run")
    assert (tmp_path / "run" / "x").read_text() == "1"
    second = atomic_files.new_folder_beside(tmp_path / "run")
    with pytest.raises(FileExistsError):
        atomic_files.move_into_place(second, tmp_path / "run")
    assert (tmp_path / "run" / "x").read_text() == "1"


def refuse(*_: object, **__: object) -> None:
    raise OSError(errno.EIO, os.strerror(errno.EIO))


@pytest.mark.parametrize(
    ("step", "do", "place"),
    [
        ("mkdir", lambda folder: atomic_files.new_folder_beside(folder / "new" / "run"), "folder '{}/new'"),
        (
            "rename",
            lambda folder: atomic_files.move_into_place(folder / "kept", folder / "run"),
            "folder '{}/run'",
        ),
        ("replace", lambda folder: atomic_files.write_text(folder / "a.json", "new"), "file '{}/a.json'"),
        (
            "unlink",
            lambda folder: atomic_files.write_text(folder / "a.json" / "b", "new"),
            "file '{}/a.json/b'",
        ),
    ],
)
def test_what_the_disk_refuses_is_said_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, do: Callable[[Path], object], place: str
) -> None:
    (tmp_path / "kept").mkdir()
    (tmp_path / "a.json").write_text("old")
    monkeypatch.setattr(os, step, refuse)
    with pytest.raises(SessionError) as caught:
        do(tmp_path)
    assert caught.value.message.startswith(f"The {place.format(tmp_path)} cannot be written (")
    assert caught.value.hint
    assert (tmp_path / "a.json").read_text() == "old"


def test_nothing_is_left_in_a_folder_that_is_moved_while_a_file_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "toy").mkdir()
    replace = os.replace

    def moved(*places: str | Path) -> None:
        (tmp_path / "toy").rename(tmp_path / "new")
        replace(*places)

    monkeypatch.setattr(os, "replace", moved)
    with pytest.raises(SessionError, match="its folder is no longer there"):
        atomic_files.write_text(tmp_path / "toy" / "a.json", "words")
    assert not list((tmp_path / "new").iterdir())


def test_what_cannot_be_copied_is_named(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match=r"'.*a' cannot be read \(No such file"):
        atomic_files.copy_file(tmp_path / "a", tmp_path / "b")
