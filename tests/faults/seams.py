"""Where the studio meets the system, made to fail: files opened, read, written and renamed, and databases.

Inside `watched`, each touch of a file in a folder is counted and handed to `act`, which may raise, wait, or end the
process, before the touch is made. Native libraries open their files past this; faults in those are planted on the disk.
"""

import builtins
import functools
import io
import os
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

OPEN, READ, WRITE, NAME, LOOK, STORE = "open", "read", "write", "name", "look up", "store"
"""A file opened to be read; its content read; a file made or written; one renamed, removed or a folder made; a database
read; a database written.
"""
READING, WRITING = (OPEN, READ, LOOK), (WRITE, NAME, STORE)
ALL = (*READING, *WRITING)
LOOKS = ("SELECT", "PRAGMA", "ATTACH")
NAMING = ("rename", "replace", "mkdir", "unlink", "rmdir", "remove")


@dataclass(frozen=True, slots=True)
class Touch:
    """number : from 0. half : writes the first half of what is being written, for a write that is torn."""

    number: int
    kind: str
    half: Callable[[], object] = lambda: None


Act = Callable[[Touch], None]


@contextmanager
def watched(folder: Path, act: Act) -> Iterator[list[str]]:
    """The kinds of the touches of files in `folder`, noted in the order in which they come."""
    touches: list[str] = []
    root = str(folder.resolve())
    real_open, busy = io.open, []

    def touch(kind: str, path: object, half: Callable[[], object] = lambda: None) -> None:
        inside = isinstance(path, str | os.PathLike) and os.path.abspath(os.fspath(path)).startswith(root)
        if not inside or busy:
            return
        touches.append(kind)
        busy.append(True)
        try:
            act(Touch(len(touches) - 1, kind, half))
        finally:
            busy.clear()

    def opened(file: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:  # noqa: ANN401
        writes = not set(mode).isdisjoint("wax+")
        name = os.readlink(f"/proc/self/fd/{file}") if isinstance(file, int) else file
        touch(WRITE if writes else OPEN, name)
        return _File(real_open(file, mode, *rest, **named), name, touch)

    def naming(real: Callable[..., Any]) -> Callable[..., Any]:
        def named(path: Any, *rest: Any, **options: Any) -> Any:  # noqa: ANN401
            touch(NAME, path)
            return real(path, *rest, **options)

        return named

    @functools.cache
    def touching(kind: type[sqlite3.Connection]) -> type[sqlite3.Connection]:
        class Database(kind):
            def __init__(self, database: Any, *rest: Any, **named: Any) -> None:  # noqa: ANN401
                self.place = str(database).removeprefix("file://").partition("?")[0]
                touch(LOOK, self.place)
                super().__init__(database, *rest, **named)

            def execute(self, sql: str, *values: Any) -> sqlite3.Cursor:  # noqa: ANN401
                # Nothing is behind a ROLLBACK: SQLite has done it by itself where the disk is the reason.
                if sql != "ROLLBACK":
                    touch(LOOK if sql.startswith(LOOKS) or sql == "BEGIN" else STORE, self.place)
                return super().execute(sql, *values)

            def executescript(self, sql: str) -> sqlite3.Cursor:
                touch(STORE, self.place)
                return super().executescript(sql)

        return Database

    def connect(
        *at: Any,  # noqa: ANN401
        factory: type[sqlite3.Connection] = sqlite3.Connection,
        **named: Any,  # noqa: ANN401
    ) -> sqlite3.Connection:
        return real_connect(*at, factory=touching(factory), **named)

    real_connect = sqlite3.connect
    patches = [
        mock.patch.object(io, "open", opened),
        mock.patch.object(builtins, "open", opened),
        mock.patch.object(sqlite3, "connect", connect),
        # Else copies are made past Python's own reads and writes.
        mock.patch.object(shutil, "_USE_CP_SENDFILE", False, create=True),
        *(mock.patch.object(os, name, naming(getattr(os, name))) for name in NAMING),
    ]  # fmt: skip
    for patch in patches:
        patch.start()
    try:
        yield touches
    finally:
        for patch in patches:
            patch.stop()


class _File:
    """A file whose reads and writes are touches."""

    def __init__(self, inner: Any, place: object, touch: Callable[..., None]) -> None:  # noqa: ANN401
        self.inner, self.place, self.touch = inner, place, touch

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        return getattr(self.inner, name)

    def __enter__(self) -> "_File":
        return self

    def __exit__(self, *_: object) -> None:
        self.inner.close()

    def __iter__(self) -> Iterator[Any]:
        self.touch(READ, self.place)
        return iter(self.inner)

    def __next__(self) -> Any:  # noqa: ANN401
        return next(self.inner)

    def read(self, *size: int) -> Any:  # noqa: ANN401
        self.touch(READ, self.place)
        return self.inner.read(*size)

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401
        self.touch(READ, self.place)
        return self.inner.readinto(buffer)

    def write(self, content: Any) -> int:  # noqa: ANN401
        def half() -> None:
            self.inner.write(content[: len(content) // 2])
            self.inner.flush()

        self.touch(WRITE, self.place, half)
        return self.inner.write(content)
