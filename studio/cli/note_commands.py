"""Notes and bookmarks on frames: `note`, `notes`."""

from studio.cli.deriving import Call, command_of
from studio.foundations.words import counted
from studio.operations.notes import note, notes
from studio.runs.notes import Note


@command_of(notes)
def notes_command(call: Call) -> dict[str, object]:
    return _answer(call, call())


@command_of(note)
def note_command(call: Call) -> dict[str, object]:
    return _answer(call, call())


def _answer(call: Call, kept: tuple[Note, ...]) -> dict[str, object]:
    run = call.given["run"]
    lines = [f"frame {entry.frame}: {entry.text or 'bookmark'}" for entry in kept]
    return {
        "session": run.session_name,
        "run": run.name,
        "notes": list(kept),
        "text": "\n".join([f"{run.session_name} / {run.name}: {counted(len(kept), 'note')}", *lines]),
    }
