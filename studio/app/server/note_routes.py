"""Notes and bookmarks on a run's frames."""

from typing import Annotated

from fastapi import Path, Response

from studio.app.server import files
from studio.app.server.answers import Router
from studio.app.server.app_state import App, AppState
from studio.app.server.requests import Arguments, body_of
from studio.app.server.run_routes import RUN, RunInPath
from studio.foundations.csv_text import as_csv
from studio.foundations.declaring import LARGEST
from studio.operations.notes import NoteList
from studio.operations.notes import note as write
from studio.operations.notes import notes as read
from studio.runs.notes import Note
from studio.sessions.stored_run import StoredRun

router = Router(prefix="/api", tags=["notes"])


@router.get(RUN + "/notes")
def notes(run: RunInPath) -> NoteList:
    """The notes and bookmarks on its frames."""
    return NoteList(read(run))


@router.get(RUN + "/notes.csv", response_class=Response)
def notes_csv(run: RunInPath) -> Response:
    """The same as a table: frame, text, made."""
    rows = [[entry.frame, entry.text, entry.made] for entry in read(run)]
    name = f"{run.session_name}-{run.name}-notes.csv"
    return files.download(as_csv([["frame", "text", "made"], *rows]), name, files.CSV)


@router.put(RUN + "/frames/{frame}/note")
def put_note(
    run: RunInPath,
    frame: int,
    arguments: Annotated[Arguments, body_of(write, "NoteRequest", only=("text",))],
    app: App,
) -> NoteList:
    """Put a note on a frame, in place of the one it has; without a text a bookmark. `notes` events tell of it."""
    return _published(app, run, write(run, frame, **arguments))


@router.delete(RUN + "/frames/{frame}/note")
def delete_note(run: RunInPath, frame: Annotated[int, Path(le=LARGEST)], app: App) -> NoteList:
    """Take a frame's note away."""
    return _published(app, run, write(run, frame, remove=True))


def _published(app: AppState, run: StoredRun, kept: tuple[Note, ...]) -> NoteList:
    app.events.publish({"type": "notes", "session": run.session_name, "run": run.name})
    return NoteList(kept)
