"""`studio new`, `add-footage` and `workflow`."""

import json
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from toy_session import FRAMES, make_session

from studio.cli.main import main


@pytest.fixture
def workspace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty workspace."""
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    return tmp_path / "workspace"


def printed(*words: str) -> dict:
    """The command's JSON."""
    result = studio(*words, "--json")
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def studio(*words: str) -> Result:
    """The command's result."""
    return CliRunner().invoke(main, list(words))


def test_the_way_from_nothing_to_footage_with_a_calibration(workspace: Path, tmp_path: Path) -> None:
    assert printed("new", "mine", "--title", "My take")["next"] == "footage"
    assert printed("workflow", "mine")["next"] == "footage"
    made = make_session(tmp_path / "toy")
    for part in ("pictures", "calibration"):
        shutil.copytree(made.path / part, tmp_path / "raw" / part)
    added = printed("add-footage", "mine", str(tmp_path / "raw"), "--fps", "60")
    assert (added["cameras"], added["frames"], added["calibrated"]) == (["front"], FRAMES, True)
    states = {step["step"]: step["state"] for step in printed("workflow", "mine")["steps"]}
    assert (states["footage"], states["calibration"], states["track"]) == ("done", "done", "ready")
    assert "✓ calibration" in studio("workflow", "mine").stdout


@pytest.mark.parametrize("verb", ["track", "initialise", "background", "synchronise", "fit-subject"])
def test_commands_say_what_an_empty_session_lacks(workspace: Path, verb: str) -> None:
    printed("new", "mine")
    result = studio(verb, "mine")
    assert result.exit_code == 2, result.output
    assert "no footage yet" in result.stderr


def test_a_taken_name_is_refused(workspace: Path) -> None:
    printed("new", "mine")
    result = studio("new", "mine")
    assert result.exit_code == 2
    assert "already" in result.stderr
