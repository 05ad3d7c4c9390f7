"""Notes on frames of a run: a sentence, or a bookmark without one. They lie in the run's folder and go with it."""

from collections.abc import Mapping
from pathlib import Path

import msgspec

from studio.foundations.errors import NotFoundError, SettingsError
from studio.sessions.manifest import now
from studio.sessions.record_files import RecordFile
from studio.sessions.stored_run import StoredRun
from studio.sessions.work_under_way import one_at_a_time

FILE_NAME = "notes.json"
LONGEST = 2000


class Note(msgspec.Struct, frozen=True):
    """A note or a bookmark.

    frame : that it is about.
    text : "" for a bookmark.
    made : when it was written, ISO 8601.
    """

    frame: int
    text: str = ""
    made: str = ""


class _Notes(msgspec.Struct, frozen=True):
    notes: tuple[Note, ...] = ()
    schema: int = 1


_RECORD = RecordFile(
    _Notes,
    "a list of notes",
    "Move the file away: the run is unchanged without it.",
    ("Run '{name}' has no notes.", "Write one."),
)


def notes_of(run: StoredRun) -> tuple[Note, ...]:
    """The run's notes by frame. Raises SessionError where their file is damaged."""
    return _RECORD.read(_path(run), _Notes()).notes


def notes_by_frame(run: StoredRun) -> Mapping[int, str]:
    """Frame to its note, "bookmark" for one without text."""
    return {note.frame: note.text or "bookmark" for note in notes_of(run)}


def write_note(run: StoredRun, frame: int, text: str = "") -> tuple[Note, ...]:
    """Put a note on a frame in place of the old one, and return all notes.

    Raises NotFoundError for a frame that the run does not span, SettingsError for a text that is too long.
    """
    record = run.record
    if not record.first <= frame < record.last:
        raise NotFoundError(
            f"Run '{run.name}' has no frame {frame}.", f"It goes from {record.first} to {record.last - 1}."
        )
    if len(text) > LONGEST:
        raise SettingsError(f"The note has {len(text)} characters.", f"Write at most {LONGEST}.")
    with one_at_a_time(run.folder.parent.parent):
        return _keep(run, (*_others(run, frame), Note(frame, text.strip(), now())))


def remove_note(run: StoredRun, frame: int) -> tuple[Note, ...]:
    """Remove a frame's note, if it has one, and return the others."""
    with one_at_a_time(run.folder.parent.parent):
        return _keep(run, _others(run, frame))


def _others(run: StoredRun, frame: int) -> tuple[Note, ...]:
    return tuple(note for note in notes_of(run) if note.frame != frame)


def _keep(run: StoredRun, notes: tuple[Note, ...]) -> tuple[Note, ...]:
    kept = tuple(sorted(notes, key=lambda note: note.frame))
    _RECORD.write(_path(run), _Notes(kept))
    return kept


def _path(run: StoredRun) -> Path:
    return run.folder / FILE_NAME
