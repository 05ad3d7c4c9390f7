"""Files and folders that a page may name: in an upload, or on this machine under the roots of footage."""

import os
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.app.server.app_state import AppState
from studio.app.server.schemas import Request, RunName
from studio.app.server.upload_routes import upload_folder
from studio.foundations.errors import NotFoundError
from studio.operations.footage import unpacked_upload
from studio.sessions.names import PathRefused, place_in, relative_path

PlaceName = Annotated[str, Field(max_length=4096)]


class FootagePlace(Request):
    """Files of this machine or of an upload. path: a full path, or with an upload a path inside it."""

    path: PlaceName = ""
    upload: RunName | None = None


MOUNTS = ("/mnt", "/media", "/run/media", "/Volumes", "/data", "/srv")
ROOTS_VARIABLE = "STUDIO_FOOTAGE_ROOTS"


def default_footage_roots(workspace: Path) -> tuple[Path, ...]:
    """Folders that footage may be imported from: the person's own, where the studio was started (and beside
    it), what is mounted, and those in STUDIO_FOOTAGE_ROOTS."""
    named = [Path(part) for part in os.environ.get(ROOTS_VARIABLE, "").split(os.pathsep) if part.strip()]
    folders = [Path.home(), Path.cwd(), Path.cwd().parent, workspace, *map(Path, MOUNTS), *named]
    kept = [path.expanduser().resolve() for path in folders if path.expanduser().is_dir()]
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


PARTS = ("intrinsic*", "extrinsic*", "calib*", "cam*")


def place_of(app: AppState, request: FootagePlace) -> Path:
    """The file or folder that a client means. Raises PathRefused, NotFoundError."""
    if request.upload is not None:
        folder = unpacked_upload(upload_folder(app, request.upload), PARTS)
        return place_in(folder, relative_path(request.path)) if request.path else folder
    path = Path(request.path.strip()).expanduser()
    if path.is_absolute() and path.is_file():
        folder = folder_to_import(str(path.parent), app.footage_roots)
        place = (folder / path.name).resolve()
        if not any(place.is_relative_to(root) for root in app.footage_roots):
            raise PathRefused(
                f"'{path.name}' leads out of the folders that may be read.",
                "Copy it there instead of linking it.",
            )
        return place
    if path.is_absolute() and path.suffix and not path.exists():
        folder_to_import(str(path.parent), app.footage_roots)
        raise NotFoundError(f"There is no file '{path}'.", "Check the path.")
    return folder_to_import(request.path, app.footage_roots)
