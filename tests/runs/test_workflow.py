"""The guided set-up: how far a session is, and what a change makes stale."""

import shutil
from pathlib import Path

import msgspec
import pytest
from tracked_runs import finish

from studio.body.subject import Subject, read_subject, write_subject
from studio.foundations.errors import SessionError
from studio.runs.new_run import prepare_run
from studio.runs.setup.subject_choice import choose_subject, lengths_left_out
from studio.runs.setup.workflow import run_to_use, subject_step, workflow_of
from studio.sessions.provenance import note
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import SUBJECT_NAME, Session
from studio.sessions.workspace import Workspace, begin_session

STEPS = ["footage", "calibration", "background", "subject", "start-pose", "track", "check", "export"]


def states(session) -> dict[str, str]:
    """Step to state."""
    return {step.step: step.state for step in workflow_of(session).steps}


def test_an_empty_session_waits_for_footage(tmp_path):
    workspace = Workspace(tmp_path)
    session = begin_session(workspace.place_for("mine"), "My take")
    found = workflow_of(session)
    assert [step.step for step in found.steps] == STEPS
    assert found.next == "footage"
    assert [step.state for step in found.steps] == ["ready"] + ["blocked"] * 7
    assert all(step.why for step in found.steps[1:])
    assert [summary.name for summary in workspace.sessions()] == ["mine"]
    with pytest.raises(SessionError, match="no footage yet"):
        session.cameras()
    with pytest.raises(SessionError, match="no footage yet"):
        session.footage()


def test_a_name_is_taken_once(tmp_path):
    workspace = Workspace(tmp_path)
    begin_session(workspace.place_for("mine"))
    with pytest.raises(SessionError, match="already"):
        workspace.place_for("mine")


def test_a_fitted_subject_is_as_tall_as_its_body_stands_not_as_was_guessed(tmp_path: Path) -> None:
    session = begin_session(Workspace(tmp_path).place_for("mine"), body="human31")
    guess = Subject(body="human31", height_mm=1800.0)
    write_subject(guess, session.path / SUBJECT_NAME)
    assert subject_step(session).words == "human31, 1.80 m, by height"
    body = session.body()
    shorter = {name: 0.95 * body.dimensions[name] for name in ("left_shin_length", "right_shin_length")}
    write_subject(msgspec.structs.replace(guess, dimensions_mm=shorter), session.path / SUBJECT_NAME)
    note(session, "subject")
    assert subject_step(session).words == "human31, 1.78 m, fitted to the footage"


def test_a_height_that_replaces_measured_lengths_says_so_and_keeps_them(tmp_path: Path) -> None:
    session = begin_session(Workspace(tmp_path).place_for("mine"), body="human31")
    measured = Subject(body="human31", lengths_mm={"LHip_LKnee": 430.0, "LKnee_LAnkle": 410.0})
    write_subject(measured, session.path / SUBJECT_NAME)
    assert subject_step(session).words == "human31, by 2 measured lengths"
    height = Subject(body="human31", height_mm=1800.0)
    [note_of_it] = lengths_left_out(session, height)
    assert "2 measured lengths (LHip_LKnee, LKnee_LAnkle)" in note_of_it
    assert not lengths_left_out(session, measured)
    choose_subject(session, height)
    assert subject_step(session).words == "human31, 1.80 m, by height"
    assert read_subject(session.path / "subject-before.toml") == measured
    assert not lengths_left_out(session, height)


def test_a_cancelled_run_does_not_hide_the_whole_one(session_on_disk: Session) -> None:
    whole = prepare_run(session_on_disk, name="whole", last=2, knobs={"layers": 1, "particles": 4})
    finish(session_on_disk, whole)
    later = prepare_run(session_on_disk, name="later", knobs={"layers": 1, "particles": 4})

    def step(name: str) -> tuple[str, str]:
        found = next(one for one in workflow_of(session_on_disk).steps if one.step == name)
        return found.state, found.run

    assert step("track") == ("done", "whole")
    with ResultsWriter(later.folder) as writer:
        writer.mark_ended("cancelled")
    used = run_to_use(session_on_disk)
    assert used.name == "whole"
    assert (step("track"), step("check"), step("export")) == (
        ("done", "whole"),
        ("ready", "whole"),
        ("ready", "whole"),
    )
    words = next(one.why for one in workflow_of(session_on_disk).steps if one.step == "track")
    assert words == "later was cancelled: whole is used."

    # What was cancelled after some frames is used where there is nothing else.
    shutil.rmtree(whole.folder)
    finish(session_on_disk, later, layers=2)
    assert step("check") == ("ready", "later")
