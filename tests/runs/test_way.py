"""The guided way: how far a session is, and what a change makes stale."""

import pytest

from studio.errors import SessionError
from studio.runs.way import way_of
from studio.sessions.beginning import begin_session
from studio.sessions.workspace import Workspace

STEPS = ["footage", "calibration", "background", "subject", "start-pose", "track", "check", "export"]


def states(session) -> dict[str, str]:
    """Step to state."""
    return {step.step: step.state for step in way_of(session).steps}


def test_an_empty_session_waits_for_footage(tmp_path):
    workspace = Workspace(tmp_path)
    session = begin_session(workspace.place_for("mine"), "My take")
    way = way_of(session)
    assert [step.step for step in way.steps] == STEPS
    assert way.next == "footage"
    assert [step.state for step in way.steps] == ["ready"] + ["blocked"] * 7
    assert all(step.why for step in way.steps[1:])
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
