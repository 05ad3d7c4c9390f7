"""Sessions: list, look, rename, duplicate, throw away, bring back."""

from typing import Annotated

from fastapi import APIRouter, Depends, Response

from studio.errors import NotFoundError, StudioError
from studio.sessions.session import Session
from studio.sessions.workspace import SessionSummary
from studio.web.doors import Doors, doors_of, let_go
from studio.web.schemas import (
    NewName,
    SessionChange,
    SessionDetail,
    SessionList,
    TrashChoice,
    TrashEntry,
    TrashList,
)
from studio.web.session_views import session_detail, session_line

router = APIRouter(prefix="/api", tags=["sessions"])

Door = Annotated[Doors, Depends(doors_of)]


def session_of(session: str, doors: Door) -> Session:
    """The session that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return doors.workspace.session(session)


OpenSession = Annotated[Session, Depends(session_of)]


@router.get("/sessions")
def sessions(doors: Door) -> SessionList:
    """All sessions by name with their runs, newest first; those that cannot be opened say why."""
    summaries = doors.workspace.sessions()
    return SessionList(sessions=[session_line(entry, _opened(doors, entry)) for entry in summaries])


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
    return Response(path.read_bytes(), media_type="image/jpeg", headers={"cache-control": "no-cache"})


@router.patch("/sessions/{session}")
def change_session(session: OpenSession, change: SessionChange, doors: Door) -> NewName:
    """Change a session's title or name. Refused while a run of it is being tracked."""
    name = session.name
    if change.title is not None:
        doors.workspace.retitle(name, change.title)
    if change.name is not None and change.name != name:
        let_go(doors, name)
        name = doors.workspace.rename(name, change.name).name
    return _changed(doors, name)


@router.post("/sessions/{session}/duplicate", status_code=201)
def duplicate(session: OpenSession, doors: Door, wish: NewName | None = None) -> NewName:
    """A copy with its runs, under the given name or a free one."""
    return _changed(doors, doors.workspace.duplicate(session.name, wish.name if wish else None).name)


@router.delete("/sessions/{session}")
def delete(session: OpenSession, doors: Door) -> TrashEntry:
    """Move a session to the trash. Refused while a run of it is being tracked."""
    let_go(doors, session.name)
    place = doors.workspace.trash(session.name)
    _changed(doors, session.name)
    return TrashEntry(id=place.name, name=session.name, restorable=True)


@router.get("/trash")
def trash(doors: Door) -> TrashList:
    """What lies in the trash, oldest first."""
    entries = [(name, name.rpartition("--")[0] or name) for name in doors.workspace.trashed()]
    # A run keeps its session's name in front, which no session's name can look like.
    return TrashList(
        entries=[TrashEntry(id=full, name=name, restorable="--" not in name) for full, name in entries]
    )


@router.post("/trash/restore")
def restore(choice: TrashChoice, doors: Door) -> NewName:
    """Bring a session back under its own name, or one like it."""
    return _changed(doors, doors.workspace.restore(choice.entry).name)


def _changed(doors: Doors, name: str) -> NewName:
    """Tell all watchers that the list of sessions is another one."""
    doors.events.publish({"type": "sessions", "session": name, "run": ""})
    return NewName(name=name)


def _opened(doors: Doors, entry: SessionSummary) -> Session | None:
    try:
        return None if entry.problem else doors.workspace.session(entry.name)
    except StudioError:
        return None
