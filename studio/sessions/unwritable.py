"""Why something could not be written, in words: a full disk is called one, whatever the system or SQLite says of it."""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from studio.errors import SessionError
from studio.foreign_files import NO_ROOM

NO_ROOM_BYTES = 64 * 1024
"""SQLite makes its shared memory in steps of 32 KiB, and says "disk I/O error" where there is no room for one."""


def unwritable(what: str, path: Path, error: OSError | sqlite3.Error) -> SessionError:
    """The error to raise. what : "The results in", to be followed by the path."""
    if is_full(path, error):
        return SessionError(
            f"{what} '{path}' cannot be written: disk full ({_reason(error)}).",
            "Make room on the disk and go on from there; what was finished before is kept.",
        )
    return SessionError(
        f"{what} '{path}' cannot be written ({_reason(error)}).",
        "Check the free disk space and the folder's permissions, or start a new run.",
    )


@contextmanager
def room_for(what: str, path: Path) -> Iterator[None]:
    """Where the disk fills while something is made, that in words; other errors pass. Raises SessionError."""
    try:
        yield
    except OSError as error:
        if not is_full(path, error):
            raise
        raise unwritable(what, path, error) from None


def is_full(path: Path, error: OSError | sqlite3.Error) -> bool:
    """Whether there was no room left."""
    if isinstance(error, OSError):
        return error.errno in NO_ROOM
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN):
        try:
            return shutil.disk_usage(path.parent).free < NO_ROOM_BYTES
        except OSError:
            return False
    return code == sqlite3.SQLITE_FULL


def _reason(error: OSError | sqlite3.Error) -> str:
    return str(error.strerror if isinstance(error, OSError) else error)
