"""Sessions: list, look, rename, duplicate, throw away, bring back."""

from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Response
from pydantic import Field

from studio.app.server import files
from studio.app.server.app_state import App, AppState, moving
from studio.app.server.error_responses import log
from studio.app.server.schemas import Answer, Request, RunName
from studio.app.server.session_views import SessionDetail, SessionLine, session_detail, session_line
from studio.foundations.errors import NotFoundError, StudioError
from studio.foundations.foreign_files import read_file
from studio.operations.comparison_folders import bring_back
from studio.operations.model_repository import bring_back_model, thrown_model
from studio.results.comparison.kept_comparison import RECORD_NAME as COMPARISON_FILE_NAME
from studio.results.comparison.kept_comparison import KeptComparison
from studio.sessions.manifest import FILE_NAME, read_manifest
from studio.sessions.names import inside
from studio.sessions.run_record import FILE_NAME as RUN_FILE_NAME
from studio.sessions.run_record import read_run_record
from studio.sessions.session import Session
from studio.sessions.workspace import TRASH_NAME, SessionSummary, unusable

router = APIRouter(prefix="/api", tags=["sessions"])


class SessionList(Answer):
    """All sessions of the workspace, by name."""

    sessions: list[SessionLine]


class SessionChange(Request):
    """New words for a session; both may change at once."""

    name: RunName | None = None
    title: str | None = Field(None, max_length=200)


class NewName(Request):
    """A name; null lets the studio find a free one."""

    name: RunName | None = None


class TrashEntry(Answer):
    """Something in the trash. name: what it was called; what is "other" cannot be restored."""

    id: str
    name: str
    kind: Literal["session", "run", "comparison", "model", "other"]
    restorable: bool = True


class TrashList(Answer):
    """What lies in the trash, oldest first."""

    entries: list[TrashEntry]


class Restored(Answer):
    """Where something came back to. name: the session, "" for a model; run, comparison, model: "" where it is none."""

    name: str
    run: str = ""
    comparison: str = ""
    model: str = ""


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
    summaries = app.workspace.sessions()
    return SessionList(sessions=[_line(app, entry) for entry in summaries])


def _line(app: AppState, entry: SessionSummary) -> SessionLine:
    try:
        return session_line(entry, _opened(app, entry))
    except Exception as error:  # whatever a foreign session holds, the others are listed
        log.exception("session '%s' cannot be summed up", entry.name)
        reason = str(error) if isinstance(error, StudioError) else f"{type(error).__name__}: {error}"
        return session_line(unusable(entry.name, f"The session cannot be summed up ({reason})."), None)


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
    return files.picture(read_file(path), checked_anew=True)


@router.patch("/sessions/{session}")
def change_session(session: OpenSession, change: SessionChange, app: App) -> NewName:
    """Change a session's title or name. Refused while a run of it is being tracked."""
    name = session.name
    if change.title is not None:
        app.workspace.retitle(name, change.title)
    if change.name is not None and change.name != name:
        with moving(app, name):
            name = app.workspace.rename(name, change.name).name
    return _changed(app, name)


@router.post("/sessions/{session}/duplicate", status_code=201)
def duplicate(session: OpenSession, app: App, request: NewName | None = None) -> NewName:
    """A copy with its runs, under the given name or a free one."""
    return _changed(app, app.workspace.duplicate(session.name, request.name if request else None).name)


@router.delete("/sessions/{session}")
def delete(session: OpenSession, app: App) -> TrashEntry:
    """Move a session to the trash. Refused while a run of it is being tracked."""
    with moving(app, session.name):
        place = app.workspace.trash(session.name)
    _changed(app, session.name)
    return trash_entry(place)


@router.get("/trash")
def trash(app: App) -> TrashList:
    """What lies in the trash, oldest first."""
    folder = app.workspace.root / TRASH_NAME
    return TrashList(entries=[trash_entry(folder / name) for name in app.workspace.trashed()])


@router.post("/trash/restore")
def restore(choice: TrashChoice, app: App) -> Restored:
    """Bring a session, a model, or a run or comparison into its session, back under its own name or one like it."""
    if (inside(app.workspace.root / TRASH_NAME, choice.entry) / RUN_FILE_NAME).is_file():
        run = app.workspace.restore_run(choice.entry)
        session = run.folder.parent.parent.name
        _changed(app, session)
        return Restored(name=session, run=run.name)
    if (inside(app.workspace.root / TRASH_NAME, choice.entry) / COMPARISON_FILE_NAME).is_file():
        owner, kept = bring_back(app.workspace, choice.entry)
        _changed(app, owner.name)
        return Restored(name=owner.name, comparison=kept.name)
    if thrown_model(inside(app.workspace.root / TRASH_NAME, choice.entry)):
        model = bring_back_model(app.workspace, choice.entry).stem
        app.events.session_changed("")
        return Restored(name="", model=model)
    session = app.workspace.restore(choice.entry).name
    _changed(app, session)
    return Restored(name=session)


def trash_entry(place: Path) -> TrashEntry:
    """What lies at a place in the trash, by its own record."""
    try:
        if (place / FILE_NAME).is_file():
            return TrashEntry(id=place.name, name=read_manifest(place).name, kind="session")
        if (place / RUN_FILE_NAME).is_file():
            record = read_run_record(place)
            return TrashEntry(id=place.name, name=f"{record.session} / {record.name}", kind="run")
        if (place / COMPARISON_FILE_NAME).is_file():
            arguments = KeptComparison(place).record()
            return TrashEntry(
                id=place.name, name=f"{arguments.plan.session} / {arguments.name}", kind="comparison"
            )
        if model := thrown_model(place):
            return TrashEntry(id=place.name, name=model, kind="model")
    except StudioError:
        pass
    return TrashEntry(id=place.name, name=place.name, kind="other", restorable=False)


def _changed(app: AppState, name: str) -> NewName:
    """Tell all watchers that the list of sessions is another one."""
    app.events.session_changed(name)
    return NewName(name=name)


def _opened(app: AppState, entry: SessionSummary) -> Session | None:
    try:
        return None if entry.problem else app.workspace.session(entry.name)
    except StudioError:
        return None
