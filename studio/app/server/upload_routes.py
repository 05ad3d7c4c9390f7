"""Uploading a folder, file by file, straight to the disk.

A file comes as the raw body of a PUT (nothing is held in memory, no form is parsed); `offset` continues where
a broken transfer stopped. The server counts what arrives. An upload is used by `POST /api/imports` and then
removed.
"""

import asyncio
import secrets
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from fastapi import Query, Request

from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.error_responses import TooLargeError
from studio.foundations.errors import NotFoundError, SessionError, StudioError
from studio.sessions.names import inside, place_in, relative_path

router = Router(prefix="/api/uploads", tags=["importing"])


@dataclass(frozen=True, slots=True)
class UploadState:
    """An unfinished upload: its files with the bytes received of each."""

    identifier: str
    files: dict[str, int]
    total: int
    limit: int


@dataclass(frozen=True, slots=True)
class FileState:
    """One file of an upload. received : its bytes. total : bytes of the whole upload."""

    path: str
    received: int
    total: int


LIMIT = 20 << 30
FILES = 20_000
KEEP_FREE = 1 << 30
STALE_SECONDS = 7 * 24 * 3600
UPLOADS_NAME = "uploads"


class DiskFullError(StudioError, status=507, code="disk-full"):
    """Too little room on the disk."""


def uploads_folder(app: AppState) -> Path:
    return app.state_folder / UPLOADS_NAME


def upload_folder(app: AppState, identifier: str) -> Path:
    """The folder of one upload. Raises NotFoundError, NameRefused."""
    folder = inside(uploads_folder(app), identifier, "upload")
    if not folder.is_dir():
        raise NotFoundError(f"There is no upload '{identifier}'.", "Begin a new one.")
    return folder


def forget(app: AppState, identifier: str) -> None:
    """Remove an upload and what is known of it."""
    folder = upload_folder(app, identifier)
    app.uploads.pop(identifier, None)
    shutil.rmtree(folder, ignore_errors=True)


@router.post("", status_code=201)
def begin(app: App) -> UploadState:
    """Begin an upload; uploads that were not continued for a week are removed."""
    root = uploads_folder(app)
    root.mkdir(parents=True, exist_ok=True)
    for old in root.iterdir():
        if time.time() - old.stat().st_mtime > STALE_SECONDS:
            shutil.rmtree(old, ignore_errors=True)
    identifier = secrets.token_hex(12)
    (root / identifier).mkdir()
    return _state(app, root / identifier)


@router.get("/{identifier}")
def state(identifier: str, app: App) -> UploadState:
    """What has arrived, so that a broken upload can be continued."""
    return _state(app, upload_folder(app, identifier))


@router.delete("/{identifier}", status_code=204)
def give_up(identifier: str, app: App) -> None:
    """Remove an upload."""
    forget(app, identifier)


@router.put("/{identifier}/files")
async def receive(
    identifier: str,
    request: Request,
    app: App,
    path: Annotated[str, Query(description="Name inside the folder, with forward slashes.")],
    offset: Annotated[int, Query(ge=0, description="Bytes that have arrived already.")] = 0,
) -> FileState:
    """The content of one file, from `offset` on, as the raw body."""
    folder = upload_folder(app, identifier)
    place = place_in(folder, relative_path(path))
    files = await asyncio.to_thread(_files, app, folder)
    await asyncio.to_thread(_prepare, folder, place, offset, len(files))
    name = place.relative_to(folder.resolve()).as_posix()
    others = sum(files.values()) - files.get(name, 0)
    room = min(LIMIT - others - offset, shutil.disk_usage(folder).free - KEEP_FREE)
    received = offset
    with place.open("r+b" if offset else "wb") as target:
        target.seek(offset)
        async for chunk in request.stream():
            if received + len(chunk) - offset > room:
                raise TooLargeError(
                    f"The upload of '{path}' is beyond the limit.", "Import the folder by its path instead."
                )
            await asyncio.to_thread(target.write, chunk)
            received += len(chunk)
            files[name] = received
    files[name] = received
    return FileState(name, received, others + received)


def _prepare(folder: Path, place: Path, offset: int, files: int) -> None:
    """Check that a file may be written at `place` from `offset` on, and make its folder."""
    if files >= FILES and not place.exists():
        raise TooLargeError(f"The upload has {files} files.", "Import the folder by its path instead.")
    arrived = place.stat().st_size if place.is_file() else 0
    if offset > arrived or place.is_dir():
        raise SessionError(
            f"Of '{place.name}' {arrived} bytes have arrived, not {offset}.", "Go on from there."
        )
    if shutil.disk_usage(folder).free < KEEP_FREE:
        raise DiskFullError("The disk has less than 1 GB left.", "Make room, or choose another workspace.")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise SessionError(f"'{place.parent.name}' is a file already.", "Begin a new upload.") from None


def _files(app: AppState, folder: Path) -> dict[str, int]:
    """Bytes received of each file, read from the disk once and counted from then on."""
    known = app.uploads.get(folder.name)
    if known is None:
        known = {
            path.relative_to(folder).as_posix(): path.stat().st_size
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        }
        app.uploads[folder.name] = known
    return known


def _state(app: AppState, folder: Path) -> UploadState:
    files = dict(_files(app, folder))
    return UploadState(folder.name, files, sum(files.values()), LIMIT)
