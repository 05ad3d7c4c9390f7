"""Files from outside: any error while one is read is reported with its name, and none may block.

Parsers raise what they like (RecursionError for deep TOML, OverflowError for 400 digits, zlib.error for a flipped bit,
an OSError for a corrupt archive's offsets), so readers do not list what may come: they read inside `foreign_file`.
"""

import errno
import stat
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from studio.errors import StudioError

NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT))
LONGEST_REASON = 200
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
