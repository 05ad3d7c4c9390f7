"""Which calibration a recording is made with, by whatever name it is given."""

from pathlib import Path

import pytest

from studio.foundations.errors import FootageError
from studio.sessions.recordings import calibration_given
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.workspace import Workspace, begin_session


def test_a_session_goes_by_name_or_folder_and_a_calibration_by_file_or_folder(
    session_on_disk: Session,
) -> None:
    workspace, own = Workspace(), session_on_disk.path / CAMERAS_PATH
    assert calibration_given("toy", workspace) == own
    assert calibration_given(session_on_disk.path, workspace) == own
    assert calibration_given(str(own), workspace) == own
    assert calibration_given(own.parent, workspace) == own.parent


def test_what_has_no_calibration_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    workspace = Workspace()
    begin_session(workspace.place_for("bare"))
    with pytest.raises(FootageError, match="Session 'bare' has no calibration"):
        calibration_given("bare", workspace)
    with pytest.raises(FootageError, match="no calibration 'gone'") as refusal:
        calibration_given("gone", workspace)
    assert "name" in refusal.value.hint
    with pytest.raises(FootageError, match=r"no calibration '\.\./gone'"):
        calibration_given("../gone", workspace)
