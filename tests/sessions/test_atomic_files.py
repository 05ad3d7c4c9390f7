"""A file is the old one or the new one."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

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
    with pytest.raises(OSError, match="No space"):
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
