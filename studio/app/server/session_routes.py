"""Sessions: list, look, rename, duplicate, throw away, bring back."""

from typing import Annotated

from fastapi import Depends, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState, moving
from studio.app.server.schemas import Request, RunName
from studio.foundations.errors import NotFoundError
from studio.foundations.foreign_files import read_file
from studio.operations.overview import SessionDetail, SessionList, list_lines, session_detail
from studio.operations.trash import Restored, TrashEntry, TrashList, list_trash, trash_entry
from studio.operations.trash import restore as bring_back
from studio.sessions.session import Session

router = Router(prefix="/api", tags=["sessions"])


class SessionChange(Request):
    """New words for a session; both may change at once."""

    name: RunName | None = None
    title: str | None = Field(None, max_length=200)


class NewName(Request):
    """A name; null lets the studio find a free one."""

    name: RunName | None = None


class TrashChoice(Request):
    """An entry of the trash by its id."""

    entry: RunName


def session_of(session: str, app: App) -> Session:
    """The session that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return app.workspace.session(session)


OpenSession = Annotated[Session, Depends(session_of)]


@router.get("/sessions")
def sessions(app: App) -> SessionList:
    """All sessions by name with their runs, newest first; those that cannot be opened say why."""
    return list_lines(app.workspace)


@router.get("/sessions/{session}")
def session_detail_of(session: OpenSession) -> SessionDetail:
    """Cameras, body, subject, how footage and calibration were matched, warnings, runs."""
    return session_detail(session)


@router.get("/sessions/{session}/thumbnail.jpg", response_class=Response)
def thumbnail(session: OpenSession) -> Response:
    """A small picture of the session (JPEG)."""
    path = session.thumbnail()
    if path is None:
        raise NotFoundError(f"Session '{session.name}' has no picture to show.", "Check its footage.")
    return files.picture(read_file(path), revalidated=True)


@router.patch("/sessions/{session}")
def change_session(session: OpenSession, change: SessionChange, app: App) -> NewName:
    """Change a session's title or name. Refused while a run of it is being tracked."""
    name = session.name
    if change.title is not None:
        app.workspace.retitle(name, change.title)
    if change.name is not None and change.name != name:
        with moving(app, name):
            name = app.workspace.rename(name, change.name).name
    return _tell_watchers(app, name)


@router.post("/sessions/{session}/duplicate", status_code=201)
def duplicate(session: OpenSession, app: App, request: NewName | None = None) -> NewName:
    """A copy with its runs, under the given name or a free one."""
    return _tell_watchers(app, app.workspace.duplicate(session.name, request.name if request else None).name)


@router.delete("/sessions/{session}")
def delete(session: OpenSession, app: App) -> TrashEntry:
    """Move a session to the trash. Refused while a run of it is being tracked."""
    with moving(app, session.name):
        place = app.workspace.trash(session.name)
    _tell_watchers(app, session.name)
    return trash_entry(place)


@router.get("/trash")
def trash(app: App) -> TrashList:
    """What lies in the trash, oldest first."""
    return list_trash(app.workspace)


@router.post("/trash/restore")
def restore(choice: TrashChoice, app: App) -> Restored:
    """Bring a session, a model, or a run or comparison into its session, back under its own name or one like it."""
    restored = bring_back(app.workspace, choice.entry)
    app.events.session_changed(restored.name)
    return restored


def _tell_watchers(app: AppState, name: str) -> NewName:
    """Tell all watchers that the list of sessions is another one."""
    app.events.session_changed(name)
    return NewName(name=name)
