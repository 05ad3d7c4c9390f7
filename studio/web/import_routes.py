"""Importing sessions: from a folder of this machine, from an upload, or the sample that travels with the
studio.

An import takes as long as the footage takes to be decoded once, so it runs in the background and tells how
far it is (`GET /api/imports/{identifier}` and `import` events). Nothing appears in the workspace before all
of it was read.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query

from studio.progress import Progress
from studio.runs.overlay_pictures import forget_composers
from studio.sessions.archives import FOOTAGE_PARTS, only_archive, unpacked, unwrapped
from studio.sessions.importers.importing import ImportOptions, ImportReport, add_footage, import_source
from studio.sessions.names import PathRefused, relative_path
from studio.web.doors import Door, Doors, let_go
from studio.web.import_schemas import (
    FolderView,
    FootageAddition,
    ImportRequest,
    ImportState,
    SampleRequest,
    SourceWish,
)
from studio.web.job_kinds import IMPORT
from studio.web.job_routes import add_job_routes
from studio.web.safe_paths import folder_to_import
from studio.web.samples import install_sample
from studio.web.schemas import NewName
from studio.web.session_routes import OpenSession
from studio.web.upload_routes import forget, upload_folder
from studio.worker.jobs import Job

router = APIRouter(prefix="/api", tags=["importing"])


Taker = Callable[[Path, Progress, Callable[[], bool]], ImportReport]
"""take(folder, progress, cancelled) reads a source into the workspace."""

FOLDERS_SHOWN = 1000


@router.post("/imports", status_code=202)
async def begin_import(wish: ImportRequest, doors: Door) -> ImportState:
    """Begin an import; the name must be free. Ask for its state, or wait for `import` events."""
    into = await asyncio.to_thread(doors.workspace.place_for, wish.name)

    def take(folder: Path, progress: Progress, cancelled: Callable[[], bool]) -> ImportReport:
        return import_source(folder, into, **_reading(wish), progress=progress, cancelled=cancelled)

    return await begin_taking(doors, wish.name, wish, take)


@router.post("/sessions/{session}/footage", status_code=202)
async def begin_adding(session: OpenSession, wish: FootageAddition, doors: Door) -> ImportState:
    """Begin to add footage to a session that is there, like an import (`GET /api/imports/{identifier}`)."""
    let_go(doors, session.name)
    asked = ImportOptions(**_reading(wish), replaced=wish.replace)

    def take(folder: Path, progress: Progress, cancelled: Callable[[], bool]) -> ImportReport:
        added = add_footage(session, folder, asked, progress=progress, cancelled=cancelled)
        forget_composers()
        return added

    return await begin_taking(doors, session.name, wish, take)


async def begin_taking(doors: Doors, name: str, wish: SourceWish, take: Taker) -> ImportState:
    """Take a source in the background; how far it is can be asked for by the identifier."""
    if wish.calibration:
        relative_path(wish.calibration)
    if (wish.source is None) == (wish.upload is None):
        raise PathRefused("An import needs either 'source' or 'upload'.", "Give a folder, or upload one.")
    if wish.source is not None:
        source = await asyncio.to_thread(folder_to_import, wish.source, doors.footage_roots)
    else:
        source = upload_folder(doors, wish.upload or "")

    def work(job: Job) -> dict[str, object]:
        folder = _unpacked(source, job) if wish.upload else source
        report = take(folder, job.report, job.cancelled)
        if wish.upload:
            forget(doors, wish.upload)
        return {
            # An upload's folder is named by a number that nobody has seen.
            "notes": [note.replace(f"'{wish.upload}'", "what was uploaded") for note in report.notes],
            "warnings": list(report.warnings),
            "layout": report.layout,
            "matching": list(report.matching),
        }

    return doors.jobs.begin(IMPORT, ImportState(session=name, name=name, step="reading"), work)


add_job_routes(router, "/imports/{identifier}", IMPORT)


@router.post("/samples", status_code=201)
def add_sample(wish: SampleRequest, doors: Door) -> NewName:
    """Copy a sample session into the workspace (if it is not there) and return its name."""
    session = install_sample(doors.workspace, wish.name)
    doors.events.session_changed(session.name)
    return NewName(name=session.name)


@router.get("/folders")
def folders(
    doors: Door, path: Annotated[str, Query(description="A full path; empty: the roots.")] = ""
) -> FolderView:
    """Folders inside a folder, for choosing one to import; only where footage may be taken from."""
    if not path.strip():
        return FolderView(path="", parent=None, folders=[str(root) for root in doors.footage_roots])
    place = folder_to_import(path, doors.footage_roots)
    try:
        found = sorted(entry.name for entry in place.iterdir() if entry.is_dir() and entry.name[:1] != ".")
    except PermissionError:
        raise PathRefused(f"'{place}' may not be read.", "Check the folder's permissions.") from None
    inside = any(place.parent.is_relative_to(root) for root in doors.footage_roots)
    return FolderView(
        path=str(place), parent=str(place.parent) if inside else "", folders=found[:FOLDERS_SHOWN]
    )


def _unpacked(folder: Path, job: Job) -> Path:
    """The uploaded folder itself: out of its archive, and without the folders that only wrap it."""
    if only_archive(folder):
        job.change(step="unpacking")
    return unwrapped(unpacked(folder), FOOTAGE_PARTS)


def _reading(wish: SourceWish) -> dict[str, Any]:
    """How a source is to be read, as the importers take it."""
    named = {"calibration", "fps", "trial", "offsets", "rotations", "unit", "up", "despite_findings"}
    return {**wish.model_dump(include=named), "copy": wish.copy_footage or wish.upload is not None}
