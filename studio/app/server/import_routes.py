"""Importing sessions: from a folder of this machine, from an upload, or the sample that travels with the
studio.

An import takes as long as the footage takes to be decoded once, so it runs in the background and reports how
far it is (`GET /api/imports/{identifier}` and `import` events). Nothing appears in the workspace before all
of it was read.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import Query
from pydantic import Field

from studio.app.server.answers import Router, Shown
from studio.app.server.app_state import App, AppState, release
from studio.app.server.job_routes import add_job_routes
from studio.app.server.requests import Arguments, MaybeName, body_of
from studio.app.server.safe_paths import folder_to_import
from studio.app.server.schemas import Request, RunName
from studio.app.server.session_routes import NewName, OpenSession
from studio.app.server.upload_routes import forget, upload_folder
from studio.footage.capture.naming import CameraMatch
from studio.foundations.progress import Progress
from studio.operations.footage import add_footage, import_footage, unpacked_upload
from studio.operations.jobs.job_runner import Job, JobKind, NumberedJob
from studio.sessions.importers.importing import ImportReport
from studio.sessions.names import PathRefused, relative_path
from studio.sessions.samples import install_sample
from studio.sessions.session import Session

router = Router(prefix="/api", tags=["importing"])


class ImportState(NumberedJob):
    """How an import stands. name: of the session. layout: whose the source was taken for."""

    name: str
    notes: list[str] = Field(default_factory=list)
    warnings: list[str] = Field(default_factory=list)
    matching: Annotated[tuple[CameraMatch, ...], Shown] = ()
    layout: str = ""


IMPORT = JobKind(
    "import",
    "import",
    ImportState,
    changes_session=True,
    makes_session=True,
    at="/api/imports/{identifier}",
    page="/?session={session}",
)


@dataclass(frozen=True, slots=True)
class FolderView:
    """Folders of the server's machine that footage may be imported from."""

    path: str
    parent: str | None
    folders: list[str]


class SampleRequest(Request):
    """A session that travels with the studio."""

    name: Literal["walk", "planar_arm", "branched_arms"] = "walk"


Taker = Callable[[Path, Progress], ImportReport | Session]
"""take(folder, progress) reads a source into the workspace."""
FROM: dict[str, Any] = {
    "source": (
        Annotated[str | None, Field(max_length=4096)],
        Field(None, description="Folder on the server's machine."),
    ),
    "upload": (MaybeName, Field(None, description="Identifier of a finished upload.")),
}
"""Where footage lies, for a body: a folder of this machine, or an upload."""
NAMED: dict[str, Any] = {"name": (RunName, Field(description="What the session will be called.")), **FROM}
FOLDERS_SHOWN = 1000


@router.post("/imports", status_code=202)
async def begin_import(
    arguments: Annotated[Arguments, body_of(import_footage, "ImportRequest", **NAMED)], app: App
) -> ImportState:
    """Begin an import; the name must be free. Ask for its state, or wait for `import` events."""
    name = arguments.more["name"]
    into = await asyncio.to_thread(app.workspace.place_for, name)

    def take(folder: Path, progress: Progress) -> Session:
        return import_footage(folder, into, **_reading(arguments), progress=progress)

    return await begin_taking(app, name, arguments, take)


@router.post("/sessions/{session}/footage", status_code=202)
async def begin_adding(
    session: OpenSession,
    arguments: Annotated[Arguments, body_of(add_footage, "FootageAddition", **FROM)],
    app: App,
) -> ImportState:
    """Begin to add footage to a session that is there, like an import (`GET /api/imports/{identifier}`)."""
    release(app, session.name)

    def take(folder: Path, progress: Progress) -> ImportReport:
        return add_footage(session, folder, **_reading(arguments), progress=progress)

    return await begin_taking(app, session.name, arguments, take)


async def begin_taking(app: AppState, name: str, arguments: Arguments, take: Taker) -> ImportState:
    """Take a source in the background; its progress is known by the identifier."""
    source, upload = arguments.more["source"], arguments.more["upload"]
    if arguments.get("calibration"):
        relative_path(arguments["calibration"])
    if (source is None) == (upload is None):
        raise PathRefused("An import needs either 'source' or 'upload'.", "Give a folder, or upload one.")
    if upload is None:
        place = await asyncio.to_thread(folder_to_import, source, app.footage_roots)
    else:
        place = upload_folder(app, upload)

    def work(job: Job) -> dict[str, object]:
        folder = unpacked_upload(place, progress=job.report) if upload else place
        taken = take(folder, job.report_or_stop)
        result = taken.manifest if isinstance(taken, Session) else taken
        if upload:
            forget(app, upload)
        return {
            # An upload's folder is named by a number that is shown nowhere.
            "notes": [note.replace(f"'{upload}'", "what was uploaded") for note in result.notes],
            "warnings": list(result.warnings),
            "layout": result.layout,
            "matching": result.matching,
        }

    return app.jobs.begin(IMPORT, ImportState(session=name, name=name, step="reading"), work)


add_job_routes(router, "/imports/{identifier}", IMPORT)


@router.post("/samples", status_code=201)
def add_sample(request: SampleRequest, app: App) -> NewName:
    """Copy a sample session into the workspace (if it has none) and return its name."""
    session = install_sample(app.workspace, request.name)
    app.events.session_changed(session.name)
    return NewName(name=session.name)


@router.get("/folders")
def folders(
    app: App, path: Annotated[str, Query(description="A full path; empty: the roots.")] = ""
) -> FolderView:
    """Folders inside a folder, for choosing one to import; only where footage may be taken from."""
    if not path.strip():
        return FolderView("", None, [str(root) for root in app.footage_roots])
    place = folder_to_import(path, app.footage_roots)
    try:
        names = sorted(entry.name for entry in place.iterdir() if entry.is_dir() and entry.name[:1] != ".")
    except PermissionError:
        raise PathRefused(f"'{place}' may not be read.", "Check the folder's permissions.") from None
    inside = any(place.parent.is_relative_to(root) for root in app.footage_roots)
    return FolderView(str(place), str(place.parent) if inside else "", names[:FOLDERS_SHOWN])


def _reading(arguments: Arguments) -> dict[str, Any]:
    """How a source is to be read; what was uploaded is removed afterwards, so it is always copied."""
    return {**arguments, "copy": arguments["copy"] or arguments.more["upload"] is not None}
