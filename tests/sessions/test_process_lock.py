"""Only what another holds is held: not what a full disk or a folder without permission refuses."""

import os
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from studio.foundations.errors import SessionError
from studio.sessions import session_databases
from studio.sessions.process_lock import ProcessLock

HOLD = """
import sys; from pathlib import Path
from studio.sessions.process_lock import ProcessLock
lock = ProcessLock.take(Path(sys.argv[1]))
print("held" if lock else "not held", flush=True)
sys.stdin.read()
"""


@contextmanager
def held_by_another(path: Path) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )
    with process:
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


def test_another_process_holds_it_until_it_dies(tmp_path: Path) -> None:
    path = tmp_path / "a.lock"
    assert not ProcessLock.is_held(path)
    with held_by_another(path) as process:
        assert ProcessLock.is_held(path)
        assert ProcessLock.take(path) is None
        process.kill()
        process.wait()
        assert not ProcessLock.is_held(path)
        lock = ProcessLock.take(path)
        assert ProcessLock.is_held(path)
        lock.free()
    assert not ProcessLock.is_held(path)
    assert path.stat().st_size == 0
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("code", "message"), [(sqlite3.SQLITE_FULL, "disk full"), (sqlite3.SQLITE_READONLY, "cannot be written")]
)
def test_what_the_disk_refuses_is_not_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, message: str
) -> None:
    path = tmp_path / "a.lock"
    path.touch()

    class Refusing(sqlite3.Connection):
        def execute(self, sql: str, *_: object) -> sqlite3.Cursor:
            error = sqlite3.OperationalError("refused")
            error.sqlite_errorcode = code
            raise error

    monkeypatch.setattr(session_databases, "SessionDatabase", Refusing)
    assert not ProcessLock.is_held(path)
    with pytest.raises(SessionError, match=message):
        ProcessLock.take(path)


def test_looking_writes_nothing(tmp_path: Path) -> None:
    """No journal is made, which a full disk refuses and a folder without permission, too."""
    path = tmp_path / "a.lock"
    path.touch()
    before = (path.stat().st_size, path.stat().st_mtime_ns)
    seen: list[str] = []
    os.chmod(tmp_path, 0o555)
    try:
        assert not ProcessLock.is_held(path)
        seen = [entry.name for entry in tmp_path.iterdir()]
    finally:
        os.chmod(tmp_path, 0o755)
    assert seen == ["a.lock"]
    assert (path.stat().st_size, path.stat().st_mtime_ns) == before


def test_a_place_that_is_no_file_is_reported(tmp_path: Path) -> None:
    assert not ProcessLock.is_held(tmp_path)
    with pytest.raises(SessionError, match="cannot be written"):
        ProcessLock.take(tmp_path)
