"""`studio new`, `add-footage` and `workflow`."""

import shutil
from pathlib import Path

import pytest
from command_line import answer_of, call, refusal_of
from toy_session import FRAMES, make_session


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty workspace."""
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    return tmp_path / "workspace"


def test_the_way_from_nothing_to_footage_with_a_calibration(workspace: Path, tmp_path: Path) -> None:
    assert answer_of("new mine --title", "My take")["next"] == "footage"
    assert answer_of("workflow mine")["next"] == "footage"
    made = make_session(tmp_path / "toy")
    for part in ("pictures", "calibration"):
        shutil.copytree(made.path / part, tmp_path / "raw" / part)
    added = answer_of("add-footage mine", tmp_path / "raw", "--fps", "60")
    assert (added["cameras"], added["frames"], added["calibrated"]) == (["front"], FRAMES, True)
    states = {step["step"]: step["state"] for step in answer_of("workflow mine")["steps"]}
    assert (states["footage"], states["calibration"], states["track"]) == ("done", "done", "ready")
    assert "✓ calibration" in call("workflow mine").stdout


@pytest.mark.parametrize("verb", ["track", "initialise", "background", "synchronise", "fit-subject"])
def test_commands_say_what_an_empty_session_lacks(workspace: Path, verb: str) -> None:
    answer_of("new mine")
    assert "no footage yet" in refusal_of(verb, "mine")


def test_a_taken_name_is_refused(workspace: Path) -> None:
    answer_of("new mine")
    assert "already" in refusal_of("new mine")
