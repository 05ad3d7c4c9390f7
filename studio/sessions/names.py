"""Names of sessions and runs, which are names of folders and travel in addresses.

A name is `[A-Za-z0-9_-]{1,64}` and none of the device names that Windows reserves; a path made from one is
resolved and must still lie inside its root, so that neither `..` nor a link leads out.
"""

import re
import unicodedata
from pathlib import Path

from studio.errors import NotFoundError, SessionError

PATTERN = re.compile(r"[A-Za-z0-9_-]{1,64}")
LONGEST = 64
RESERVED = frozenset(
    ["con", "prn", "aux", "nul"] + [f"{port}{digit}" for port in ("com", "lpt") for digit in range(10)]
)


class NameRefused(SessionError):
    """A name that cannot be the name of a session or run."""

    status, code = 422, "name"


def checked_name(name: str, kind: str = "session") -> str:
    """The name itself. Raises NameRefused naming it and what is allowed."""
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
    """A lawful name that looks like `text` (a title, the name of a folder)."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode("ascii")
    made = re.sub(r"[^A-Za-z0-9_-]+", "-", plain).strip("-")[:LONGEST].rstrip("-")
    if not made:
        made = fallback
    return made if is_name(made) else f"{made}-{fallback}"[:LONGEST]


def free_name(wanted: str, taken: set[str]) -> str:
    """`wanted`, or `wanted-2`, `wanted-3`, … if it is taken (also in another case: some disks see no
    difference)."""
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
