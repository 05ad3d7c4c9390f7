"""Files from outside, and every session's: a session may come from anyone.

All bytes of a session are read here (`tests/house/test_session_reading.py` keeps it; databases are opened in
`sessions.session_databases`, which asks here first): of regular files, since a pipe or a device may never end; of a
bounded size; and never through a link that leads out of the session. What OpenCV and FFmpeg open themselves is a path
that was checked here. Only footage may lie elsewhere, by a link or by an absolute path in the manifest: it is decoded
as pictures and never written.

Parsers raise what they like (RecursionError for deep TOML, OverflowError for 400 digits, zlib.error for a flipped bit,
an OSError for a corrupt archive's offsets), so readers do not list what may come: they read inside
`foreign_file`, which reports the error with the file's name.
"""

import codecs
import errno
import os
import re
import stat
from collections.abc import Generator, Iterable
from contextlib import contextmanager, suppress
from io import BufferedReader
from pathlib import Path

from studio.foundations.errors import SessionError, StudioError

MANIFEST_NAME = "session.json"
"""Marks a session's folder."""
LARGEST = 256 << 20
"""Bytes of a file that is read whole, unless its reader says less: a picture, a table of motion."""
LARGEST_RECORD = 16 << 20
"""Of a JSON or TOML file: parsed, it takes up to twenty times as much memory."""

NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT))
LONGEST_REASON = 200
BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f]")
KINDS = (
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


@contextmanager
def foreign_file(
    path: Path, wrong: type[StudioError], what: str, remedy: str, *, footage: bool = False
) -> Generator[None]:
    """Read a file (or a folder of files) inside. what : what it should be, "a video". remedy : what to do if it is not.
    footage : as of `check_file`.

    Raises `wrong` naming the file for whatever is raised inside, and for what `check_file` refuses, before anything of
    it is read. StudioErrors pass unchanged, and so does a full disk, which is no fault of the file.
    """
    check_file(path, wrong, footage=footage)
    try:
        yield
    except StudioError:
        raise
    except OSError as problem:
        if problem.errno in NO_ROOM:
            raise
        if isinstance(problem, FileNotFoundError) and not path.parent.is_dir():
            raise wrong(
                f"'{path}' is no longer there, nor is its folder.",
                "If that was renamed meanwhile, do this again under its new name.",
            ) from None
        if isinstance(problem, FileNotFoundError | PermissionError | IsADirectoryError | NotADirectoryError):
            raise wrong(f"'{path}' cannot be read ({problem.strerror}).", "Check the path.") from None
        raise _no_such(path, wrong, what, remedy, problem) from problem
    except Exception as problem:
        raise _no_such(path, wrong, what, remedy, problem) from problem


def read_file(
    path: Path, most: int = LARGEST, wrong: type[StudioError] = SessionError, *, footage: bool = False
) -> bytes:
    """A file's bytes. footage : as of `check_file`. Raises OSError, and `wrong` for a refused or too large file."""
    with open_file(path, wrong, footage=footage) as stream:
        size = os.fstat(stream.fileno()).st_size
        content = b"" if size > most else stream.read(size + 1)
        if len(content) > size:
            # It grew meanwhile, or is one of those that say no size.
            content += stream.read(max(0, most + 1 - len(content)))
        if size > most or len(content) > most:
            raise wrong(
                f"'{path.name}' is larger than {_megabytes(most)} MB, more than such a file can have.",
                "Replace it, or delete it.",
            )
        return content


def read_text(
    path: Path, most: int = LARGEST, wrong: type[StudioError] = SessionError, encoding: str = "utf-8"
) -> str:
    """Like `read_file`, as text with line breaks as Python's; also raises UnicodeDecodeError."""
    text = read_file(path, most, wrong).decode(encoding)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_foreign_text(path: Path, most: int = LARGEST, wrong: type[StudioError] = SessionError) -> str:
    """A text file of another program: UTF-8 with or without a byte order mark, UTF-16 and UTF-32 with one, else
    Windows' Western European, if nothing in it is a control character. Raises UnicodeDecodeError for what is no text,
    and as `read_file` does.
    """
    content = read_file(path, most, wrong)
    encoding = next((name for mark, name in BYTE_ORDER_MARKS if content.startswith(mark)), "utf-8")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        if encoding != "utf-8" or CONTROL.search(content):
            raise
        return content.decode("cp1252", errors="replace")


@contextmanager
def open_file(
    path: Path, wrong: type[StudioError] = SessionError, *, footage: bool = False
) -> Generator[BufferedReader]:
    """A file opened to be read piece by piece. Raises OSError, and `wrong` for what `check_file` refuses."""
    check_file(path, wrong, footage=footage)
    # What became a pipe since must not block either.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        mode = os.fstat(handle).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(mode):
            raise wrong(f"'{path.name}' is no regular file.", REGULAR)
        stream = os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise
    with stream:
        yield stream


def check_file(path: Path, wrong: type[StudioError], *, footage: bool = False) -> None:
    """Raises `wrong` for a pipe, a socket or a device: reading one may wait without end; and for what a link in a
    session leads out of it to. footage : pictures or a video, which may lie elsewhere. A missing file passes.
    """
    if not footage:
        check_inside(path, wrong)
    check_regular(path, wrong)


def check_links(folder: Path, wrong: type[StudioError] = SessionError, beside: Iterable[str] = ()) -> None:
    """Raises `wrong` for an entry of a session's folder that is a link out of it. beside : names that may be."""
    with suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink() and entry.name not in beside:
                check_inside(Path(entry.path), wrong)


def leads_out(path: Path) -> bool:
    """Whether a link leads out of the session on the way to a file: then it is not ours to change."""
    try:
        check_inside(path.parent)
    except SessionError:
        return True
    return False


def check_inside(path: Path, wrong: type[StudioError] = SessionError) -> None:
    """Raises `wrong` where a link in a session leads out of it, to a file or to a place for one."""
    named = os.path.abspath(path)
    if (real := os.path.realpath(named)) == named:
        return
    folder = os.path.dirname(named)
    while folder != (above := os.path.dirname(folder)):
        if os.path.exists(os.path.join(folder, MANIFEST_NAME)):
            root = os.path.realpath(folder)
            if real != root and not real.startswith(root + os.sep):
                raise wrong(
                    f"'{path.name}' leads by a link out of session '{os.path.basename(folder)}'; only footage may lie"
                    " elsewhere.",
                    "Replace the link by the file or the folder itself, or remove it.",
                )
        folder = above


REGULAR = "Give a file that lies on the disk."


def check_regular(path: Path, wrong: type[StudioError]) -> None:
    """Raises `wrong` for a pipe, a socket or a device: reading one may wait without end. A missing file passes."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    kind = next((words for is_kind, words in KINDS if is_kind(mode)), "")
    if kind:
        raise wrong(f"'{path.name}' is {kind} and no regular file.", REGULAR)


def _megabytes(size: int) -> str:
    return f"{size / (1 << 20):.3g}"


def _no_such(path: Path, wrong: type[StudioError], what: str, remedy: str, problem: Exception) -> StudioError:
    # Typed decoding names an entry as `$.entry`.
    text = " ".join(str(problem).replace("`$.", "`").replace("`", "'").split()) or type(problem).__name__
    shown = text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]}…"
    return wrong(f"'{path.name}' is not {what}, or is damaged ({shown}).", remedy)
