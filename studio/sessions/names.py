"""Names of sessions and runs, which are folder names and parts of URLs, and names inside uploads and archives.

A name is `[A-Za-z0-9_-]{1,64}` and none of the device names that Windows reserves; a path made from one is
resolved and must still lie inside its root, so that neither `..` nor a link leads out.

Names inside an upload or an archive come from outside: whatever could lead elsewhere is refused, not repaired (`..`,
absolute names, backslashes, drive letters, NUL and other control characters, names of devices, links).
"""

import re
import unicodedata
from pathlib import Path, PurePosixPath

from studio.foundations.errors import NotFoundError, SessionError, StudioError

PATTERN = re.compile(r"[A-Za-z0-9_-]{1,64}")
LONGEST = 64
RESERVED = frozenset(
    ["con", "prn", "aux", "nul"] + [f"{port}{digit}" for port in ("com", "lpt") for digit in range(10)]
)


class NameRefused(SessionError, status=422, code="name"):
    """A name that cannot be the name of a session or run."""


def checked_name(name: str, kind: str = "session") -> str:
    """Returns a valid name unchanged. Raises NameRefused."""
    if not PATTERN.fullmatch(name) or name.lower() in RESERVED:
        shown = name if len(name) <= LONGEST else name[:LONGEST] + "…"
        raise NameRefused(
            f"{shown!r} cannot be the name of a {kind}.",
            "Use 1 to 64 letters, digits, '-' and '_' (no device name such as 'con').",
        )
    return name


def is_name(text: str) -> bool:
    """Whether `text` could be the name of a session or run."""
    return bool(PATTERN.fullmatch(text)) and text.lower() not in RESERVED


def name_from(text: str, fallback: str = "session") -> str:
    """A valid name that resembles `text` (a title, the name of a folder)."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    made = re.sub(r"[^A-Za-z0-9_-]+", "-", plain).strip("-")[:LONGEST].rstrip("-")
    if not made:
        made = fallback
    return made if is_name(made) else f"{made}-{fallback}"[:LONGEST]


def free_name(wanted: str, taken: set[str]) -> str:
    """`wanted`, or `wanted-2`, `wanted-3`, … if it is taken (also in another case: some disks see no difference)."""
    used = {name.lower() for name in taken}
    if wanted.lower() not in used:
        return wanted
    number = 2
    while f"{wanted[: LONGEST - 5]}-{number}".lower() in used:
        number += 1
    return f"{wanted[: LONGEST - 5]}-{number}"


def inside(root: Path, name: str, kind: str = "session") -> Path:
    """The resolved path of `name` in `root`, whether or not it exists.

    Raises NameRefused for a name that is not lawful, NotFoundError if a link leads out of the root.
    """
    place = root.resolve()
    path = (place / checked_name(name, kind)).resolve()
    if not path.is_relative_to(place) or path == place:
        raise NotFoundError(
            f"{kind.capitalize()} '{name}' leads out of '{place.name}'.",
            "Replace the link by the folder itself, or name it by its path.",
        )
    return path


LONGEST_PART, LONGEST_PATH, DEEPEST = 200, 1000, 8
FORBIDDEN = frozenset('\\:*?"<>|')


class PathRefused(StudioError, status=422, code="path"):
    """A path that might lead out of where it belongs."""


def relative_path(text: str) -> PurePosixPath:
    """A name inside an upload or archive, with forward slashes. Raises PathRefused."""
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
