"""Folders of this machine that a page may name: only those under the roots that footage may be taken from."""

import os
from pathlib import Path

from studio.errors import NotFoundError
from studio.sessions.names import PathRefused

MOUNTS = ("/mnt", "/media", "/run/media", "/Volumes", "/data", "/srv")
ROOTS_VARIABLE = "STUDIO_FOOTAGE_ROOTS"


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
