"""Notes and bookmarks on frames: kept with the run, exported, and the same from Python, the command line and HTTP."""

import csv
import io
import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from command_line import answer_of, call
from tracked_runs import finish

import studio
from studio.foundations.errors import NotFoundError, SessionError, SettingsError
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.shared_page import shared_page
from studio.runs.new_run import prepare_run
from studio.runs.notes import FILE_NAME, LONGEST
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@pytest.fixture
def run(session_on_disk: Session) -> StoredRun:
    """Three frames of the arm."""
    made = prepare_run(session_on_disk, name="noted", last=3, knobs={"layers": 1, "particles": 6})
    finish(session_on_disk, made)
    return made


def test_a_note_replaces_the_one_of_its_frame(run: StoredRun) -> None:
    assert studio.notes(run) == ()
    studio.note(run, 2, "  the elbow is off ")
    studio.note(run, 0)
    kept = studio.note(run, 2, "the elbow is off by a hand")
    assert [(note.frame, note.text) for note in kept] == [(0, ""), (2, "the elbow is off by a hand")]
    assert studio.notes(run) == kept
    assert studio.note(run, 0, remove=True) == kept[1:]
    assert studio.note(run, 1, remove=True) == kept[1:]
    with pytest.raises(NotFoundError, match="no frame 3"):
        studio.note(run, 3)
    with pytest.raises(SettingsError, match="characters"):
        studio.note(run, 1, "x" * (LONGEST + 1))
    (run.folder / FILE_NAME).write_text("{")
    with pytest.raises(SessionError):
        studio.notes(run)


def rows_of(table: Path) -> list[list[str]]:
    return list(csv.reader(io.StringIO(table.read_text(encoding="utf-8"))))


def test_notes_are_exported(run: StoredRun, session_on_disk: Session, tmp_path: Path) -> None:
    bare = tmp_path / "bare.csv"
    studio.export_run(run, to=bare)
    studio.note(run, 1, 'left, or "right"?')
    studio.note(run, 2)
    table = tmp_path / "noted.csv"
    studio.export_run(run, to=table)
    rows = rows_of(table)
    assert rows[0][-1] == "note"
    assert [row[-1] for row in rows[1:]] == ["", 'left, or "right"?', "bookmark"]
    assert [row[:-1] for row in rows] == rows_of(bare)
    studio.export_run(run, to=tmp_path / "noted.parquet")
    metadata = pq.read_schema(tmp_path / "noted.parquet").metadata
    assert json.loads(metadata[b"notes"]) == {"1": 'left, or "right"?', "2": "bookmark"}
    page = shared_page(InspectedRun(session_on_disk, run), 1)
    assert "Frame 2: bookmark" in page


def test_the_command_line_writes_them(run: StoredRun) -> None:
    name = (run.session_name, run.name)
    written = call("note", *name, "--frame", "1", "--text", "look here")
    assert "frame 1: look here" in written.output
    listed = answer_of("notes", *name)
    assert listed["notes"][0]["text"] == "look here"
    call("note", *name, "--frame", "1", "--remove")
    assert studio.notes(run) == ()
