"""Paths that come from outside: names inside an upload or an archive, and folders of this machine.

Everything that could lead elsewhere is refused, not repaired: `..`, absolute names, backslashes, drive
letters, NUL and other control characters, names of devices, links.
"""

import os
import stat
from pathlib import Path, PurePosixPath

from studio.errors import NotFoundError, StudioError
from studio.sessions.names import RESERVED

LONGEST_PART, LONGEST_PATH, DEEPEST = 200, 1000, 8
FORBIDDEN = frozenset('\\:*?"<>|')
MOUNTS = ("/mnt", "/media", "/run/media", "/Volumes", "/data", "/srv")
ROOTS_VARIABLE = "STUDIO_FOOTAGE_ROOTS"


class PathRefused(StudioError):
    """A path that might lead out of where it belongs."""

    status, code = 422, "path"


def relative_path(text: str) -> PurePosixPath:
    """A name inside an upload or archive, with forward slashes. Raises PathRefused naming what is wrong."""
    shown = repr(text if len(text) <= 80 else text[:80] + "…")
    parts = text.split("/")
    wrong = ""
    if not text or len(text) > LONGEST_PATH or len(parts) > DEEPEST:
        wrong = "is empty, too long or too deep"
    elif text.startswith("/") or any(part in ("", ".", "..") for part in parts):
        wrong = "does not name a file inside the folder"
    elif any(letter in FORBIDDEN or ord(letter) < 32 or ord(letter) == 127 for letter in text):
        wrong = "has a character that file names cannot have everywhere"
    elif any(len(part.encode()) > LONGEST_PART or part.endswith((" ", ".")) for part in parts):
        wrong = "has a part that is too long or ends with a space or a dot"
    elif any(part.split(".")[0].strip().lower() in RESERVED for part in parts):
        wrong = "has the name of a device"
    if wrong:
        raise PathRefused(f"The file name {shown} {wrong}.", "Rename the file and try again.")
    return PurePosixPath(*parts)


def place_in(root: Path, path: PurePosixPath) -> Path:
    """Where a relative path lies in `root`. Raises PathRefused if a link on the way leads out."""
    place = (root / path).resolve()
    if not place.is_relative_to(root.resolve()):
        raise PathRefused(f"The file name '{path}' leads out of the upload.", "Remove the link.")
    return place


def default_footage_roots(workspace: Path) -> tuple[Path, ...]:
    """Folders that footage may be imported from: the person's own, where the studio was started (and beside
    it), what is mounted, and those in STUDIO_FOOTAGE_ROOTS."""
    named = [Path(part) for part in os.environ.get(ROOTS_VARIABLE, "").split(os.pathsep) if part.strip()]
    found = [Path.home(), Path.cwd(), Path.cwd().parent, workspace, *map(Path, MOUNTS), *named]
    kept = [path.expanduser().resolve() for path in found if path.expanduser().is_dir()]
    return tuple(path for path in dict.fromkeys(kept) if path != Path(path.anchor))


def folder_to_import(text: str, roots: tuple[Path, ...]) -> Path:
    """A folder of this machine that lies under one of the roots, links resolved.

    Raises PathRefused where it lies elsewhere (whether or not it exists), NotFoundError where there is none.
    """
    if "\0" in text or not text.strip():
        raise PathRefused("The folder's name is empty or has a NUL in it.", "Give the folder's full path.")
    path = Path(text.strip()).expanduser()
    if not path.is_absolute():
        raise PathRefused(f"'{text}' is not a full path.", "Give the folder's path from the root on.")
    place = path.resolve()
    if not any(place.is_relative_to(root) for root in roots):
        allowed = ", ".join(f"'{root}'" for root in roots) or "none"
        raise PathRefused(
            f"'{place}' does not lie in a folder that footage may be taken from ({allowed}).",
            f"Copy it there, or add its folder to the environment variable {ROOTS_VARIABLE}.",
        )
    if not place.is_dir():
        raise NotFoundError(f"There is no folder '{place}'.", "Check the path.")
    return place


def is_link(mode: int) -> bool:
    """Whether a file's mode, as archives keep it, is that of a link or a device."""
    kind = stat.S_IFMT(mode)
    return kind not in (0, stat.S_IFREG, stat.S_IFDIR)
