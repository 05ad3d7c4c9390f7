"""Atomic file replacement: a file is either the old version or the new one.

The new content goes to a temporary file in the same folder, is flushed to the disk, and then takes the old
one's place in one step (`os.replace`); syncing the folder makes the step itself last through a power cut.
Copies of whole folders are made beside their place under a hidden name and renamed into it the same way.
"""

import contextlib
import errno
import os
import shutil
import sqlite3
import tempfile
import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from studio.foundations.errors import NotFoundError, SessionError
from studio.foundations.foreign_files import NO_ROOM, check_file, check_inside, read_file
from studio.sessions.names import free_name
from studio.sessions.session_databases import check_tables, open_database

_one_at_a_time = threading.Lock()
PARTIAL_PREFIX = ".partial-"


def check_writable(folder: Path) -> None:
    """Raise SessionError where nothing can be written into a folder: before work whose result would be lost."""
    if not os.access(folder, os.W_OK):
        raise SessionError(
            f"The folder '{folder}' cannot be written.",
            "Check the folder's permissions, or choose another place.",
        )


def write_bytes(path: Path, content: bytes) -> None:
    """Write `content` to `path`, atomically. Raises SessionError; then the old file is unchanged."""
    check_inside(path.parent)
    with writing("The file", path), _folder(path.parent) as folder:
        handle, temporary = tempfile.mkstemp(prefix=PARTIAL_PREFIX, dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            with contextlib.suppress(OSError):
                # Its folder may have been moved meanwhile.
                os.unlink(temporary if folder is None else os.path.basename(temporary), dir_fd=folder)
            raise
    sync_folder(path.parent)


@contextlib.contextmanager
def _folder(path: Path) -> Generator[int | None]:
    """A folder's descriptor, which stays when the folder is moved; None where the system has none."""
    if os.unlink not in os.supports_dir_fd:
        yield None
        return
    folder = os.open(path, os.O_RDONLY)
    try:
        yield folder
    finally:
        os.close(folder)


def write_text(path: Path, content: str) -> None:
    """Like `write_bytes`, as UTF-8."""
    write_bytes(path, content.encode("utf-8"))


def copy_file(source: Path, path: Path) -> None:
    """A byte-for-byte copy of `source` at `path`, in one step. Raises SessionError."""
    try:
        content = read_file(source)
    except OSError as error:
        raise SessionError(
            f"'{source}' cannot be read ({_reason(error)}).", "Check the disk and the folder's permissions."
        ) from None
    write_bytes(path, content)


def keep_before(path: Path) -> None:
    """Keep what a file holds beside it, as NAME-before.ENDING, numbered if there are more. Raises SessionError."""
    if path.exists():
        taken_names = {entry.stem for entry in path.parent.glob(f"*{path.suffix}")}
        copy_file(path, path.with_stem(free_name(f"{path.stem}-before", taken_names)))


def copy_part(source: Path, target: Path) -> None:
    """Copy a file or a folder of a session. Raises OSError, and SessionError for what a link leads out of it to."""

    def copied(path: str, place: str) -> None:
        check_file(Path(path), SessionError)
        shutil.copyfile(path, place)

    if source.is_dir():
        shutil.copytree(source, target, copy_function=copied, dirs_exist_ok=True)
    else:
        copied(str(source), str(target))


def copy_database(source: Path, target: Path) -> None:
    """A copy of an SQLite database, even while it is written, with all commits. Raises SessionError."""
    reading = open_database(source, "rw", patience=30.0)
    writing = open_database(target)
    try:
        check_tables(reading, source)
        reading.backup(writing)
        writing.execute("PRAGMA journal_mode = WAL")
    except sqlite3.DatabaseError as error:
        raise SessionError(
            f"'{source}' cannot be copied ({error}).", "Delete the damaged run first."
        ) from None
    finally:
        reading.close()
        writing.close()


def changed_while_copied(name: str, file: str) -> SessionError:
    """The refusal of a copy of `name` whose `file` went or changed while it was made."""
    return SessionError(
        f"'{name}' was changed by other work while it was copied ('{file}').",
        "Do this again: it then begins from what there is now.",
    )


def new_folder_beside(path: Path, parents: bool = True) -> Path:
    """An empty hidden folder next to `path`, to be filled and then given to `move_into_place`. Raises SessionError.

    parents : make the folders above that are missing; False in a session, which may have been renamed meanwhile.
    """
    check_inside(path.parent)
    with writing("The folder", path.parent):
        try:
            path.parent.mkdir(parents=parents, exist_ok=True)
        except FileExistsError as error:
            # A file stands where a folder would have to be.
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), error.filename) from None
        made = Path(tempfile.mkdtemp(prefix=PARTIAL_PREFIX, dir=path.parent))
        made.chmod(0o777 & ~_umask())
    return made


def move_into_place(folder: Path, path: Path) -> None:
    """Rename a finished folder to its place. Raises FileExistsError if something is there, SessionError."""
    check_inside(path.parent)
    if path.exists() or path.is_symlink():
        raise FileExistsError(path)
    with writing("The folder", path):
        try:
            os.rename(folder, path)
        except OSError as error:
            # Another process was faster.
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST):
                raise FileExistsError(path) from None
            raise
    sync_folder(path.parent)


def _umask() -> int:
    """The permissions that the process's user withholds from what it makes; looking at it sets it for a moment."""
    with _one_at_a_time:
        mask = os.umask(0o077)
        os.umask(mask)
    return mask


def discard(folder: Path) -> None:
    """Remove a folder that did not reach its place."""
    shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def made_whole(place: Path, parents: bool = True) -> Generator[Path]:
    """An empty hidden folder to be filled, which is then renamed to `place`; where anything fails, nothing is left.

    Raises SessionError if something is at the place.
    """
    folder = new_folder_beside(place, parents)
    try:
        yield folder
        move_into_place(folder, place)
    except FileExistsError:
        raise taken(place) from None
    finally:
        discard(folder)


class NameTakenError(SessionError):
    """Something of that name is there."""


def taken(place: Path) -> NameTakenError:
    return NameTakenError(
        f"There is something at '{place}' already.", "Choose another name, or delete the old one first."
    )


def sync_folder(folder: Path) -> None:
    """Make renames inside `folder` durable; does nothing on systems without folder handles."""
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(handle)
    except OSError:
        return
    finally:
        os.close(handle)


NO_ROOM_BYTES = 64 * 1024
"""SQLite makes its shared memory in steps of 32 KiB, and says "disk I/O error" where there is no room for one."""


def unwritable(what: str, path: Path, error: OSError | sqlite3.Error | UnicodeDecodeError) -> SessionError:
    """The error to raise. what : "The results in", to be followed by the path."""
    if isinstance(error, FileNotFoundError | sqlite3.OperationalError) and not path.parent.is_dir():
        return NotFoundError(
            f"{what} '{path}' cannot be written: its folder is no longer there.",
            "Where it was renamed meanwhile, do this again under its new name.",
        )
    if is_full(path, error):
        return SessionError(
            f"{what} '{path}' cannot be written: disk full ({_reason(error)}).",
            "Make room on the disk and resume; finished work is kept.",
        )
    return SessionError(
        f"{what} '{path}' cannot be written ({_reason(error)}).",
        "Check the free disk space and the folder's permissions, or start a new run.",
    )


@contextmanager
def writing(what: str, path: Path) -> Generator[None]:
    """Report what the disk refuses inside as a SessionError; an existing file passes. what : as of `unwritable`."""
    try:
        yield
    except FileExistsError:
        raise
    except OSError as error:
        raise unwritable(what, path, error) from None


def is_full(path: Path, error: OSError | sqlite3.Error | UnicodeDecodeError) -> bool:
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


def _reason(error: OSError | sqlite3.Error | UnicodeDecodeError) -> str:
    return str((error.strerror if isinstance(error, OSError) else "") or error)
