"""Notes and bookmarks on frames of a run."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from studio.foundations.declaring import Terminal, Web, operation
from studio.operations.opening import RunName, open_run
from studio.runs.notes import LONGEST, Note, notes_of, remove_note, write_note


@dataclass(frozen=True, slots=True)
class NoteList:
    """A run's notes, by frame."""

    notes: tuple[Note, ...] = ()


@operation
def notes(run: RunName) -> tuple[Note, ...]:
    """List the notes and bookmarks of a run, by frame.

    Raises SessionError where their file is damaged.
    """
    return notes_of(open_run(run))


@operation
def note(
    run: RunName,
    frame: Annotated[int, Field(ge=0, description="The frame that it is about."), Terminal("--frame")],
    text: Annotated[
        str,
        Field(max_length=LONGEST, description="The note; without it: a bookmark."),
        Terminal("--text"),
        Web(kind=str),
    ] = "",
    *,
    remove: Annotated[bool, Field(description="Remove the frame's note instead.")] = False,
) -> tuple[Note, ...]:
    """Put a note or a bookmark on a frame of a run, in place of the one it has, and return all notes of the run.

    Raises NotFoundError for a frame that the run does not have.
    """
    stored = open_run(run)
    return remove_note(stored, frame) if remove else write_note(stored, frame, text)
