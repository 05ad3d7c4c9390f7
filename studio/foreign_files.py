"""Files from outside: any error while one is read is reported with its name, and none may block.

Parsers raise what they like (RecursionError for deep TOML, OverflowError for 400 digits, zlib.error for a flipped bit,
an OSError for a corrupt archive's offsets), so readers do not list what may come: they read inside `foreign_file`.
"""

import codecs
import errno
import re
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from studio.errors import StudioError

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
def foreign_file(path: Path, wrong: type[StudioError], what: str, remedy: str) -> Generator[None]:
    """Read a file (or a folder of files) inside. what : what it should be, "a video". remedy : what to do if it is not.

    Raises `wrong` naming the file for whatever is raised inside, and for a pipe, socket or device, before anything of
    it is read. StudioErrors pass unchanged, and so does a full disk, which is no fault of the file.
    """
    check_regular(path, wrong)
    try:
        yield
    except StudioError:
        raise
    except OSError as problem:
        if problem.errno in NO_ROOM:
            raise
        if isinstance(problem, FileNotFoundError | PermissionError | IsADirectoryError | NotADirectoryError):
            raise wrong(f"'{path}' cannot be read ({problem.strerror}).", "Check the path.") from None
        raise _no_such(path, wrong, what, remedy, problem) from problem
    except Exception as problem:
        raise _no_such(path, wrong, what, remedy, problem) from problem


def read_foreign_text(path: Path) -> str:
    """A text file of another program: UTF-8 with or without a byte order mark, UTF-16 and UTF-32 with one, else
    Windows' Western European, if nothing in it is a control character. Raises UnicodeDecodeError for what is no text.
    """
    content = path.read_bytes()
    encoding = next((name for mark, name in BYTE_ORDER_MARKS if content.startswith(mark)), "utf-8")
    try:
        return content.decode(encoding)
    except UnicodeDecodeError:
        if encoding != "utf-8" or CONTROL.search(content):
            raise
        return content.decode("cp1252", errors="replace")


def check_regular(path: Path, wrong: type[StudioError]) -> None:
    """Raises `wrong` for a pipe, a socket or a device: reading one may wait without end. A missing file passes."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError):
        return
    kind = next((words for is_kind, words in KINDS if is_kind(mode)), "")
    if kind:
        raise wrong(f"'{path.name}' is {kind} and no regular file.", "Give a file that lies on the disk.")


def _no_such(path: Path, wrong: type[StudioError], what: str, remedy: str, problem: Exception) -> StudioError:
    # Typed decoding names an entry as `$.entry`.
    text = " ".join(str(problem).replace("`$.", "`").replace("`", "'").split()) or type(problem).__name__
    shown = text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]}…"
    return wrong(f"'{path.name}' is not {what}, or is damaged ({shown}).", remedy)
