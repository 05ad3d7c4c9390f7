"""Names inside an upload or an archive, which come from outside.

Everything that could lead elsewhere is refused, not repaired: `..`, absolute names, backslashes, drive letters, NUL and
other control characters, names of devices, links.
"""

from pathlib import Path, PurePosixPath

from studio.errors import StudioError
from studio.sessions.names import RESERVED

LONGEST_PART, LONGEST_PATH, DEEPEST = 200, 1000, 8
FORBIDDEN = frozenset('\\:*?"<>|')


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
