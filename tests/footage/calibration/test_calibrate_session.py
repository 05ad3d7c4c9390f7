"""The verb and the command on a session: the earlier calibration is kept and reported; board footage out of step."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from board_takes import BOARD, CAMERAS, FLOOR_FRAME, render_takes, session_of_takes
from command_line import call, refusal_of

import studio
from studio.footage.calibration.board_footage_reading import HowTaken
from studio.footage.calibration.verbs import calibrate
from studio.foundations.errors import CalibrationError
from studio.sessions.calibration_changes import earlier_calibrations
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return render_takes(tmp_path_factory.mktemp("takes"))


@pytest.mark.slow
def test_the_sessions_calibration_is_replaced_and_reported(takes: Path) -> None:
    session = session_of_takes(Workspace().place_for("fresh"), takes)
    words = ["calibrate", "fresh", "--board", BOARD.text, "--extrinsics", str(takes / "extrinsics")]
    words += ["--intrinsics", str(takes / "intrinsics")]
    found = studio.calibrate(
        session, BOARD, intrinsics=takes / "intrinsics", extrinsics=takes / "extrinsics", progress=False
    )
    assert session.path / "calibration" / "cameras.toml" in found.files
    assert Session(session.path).manifest.calibration_source.startswith("ChArUco board 6x5, 0.")
    before = (session.path / "calibration" / "cameras.toml").read_bytes()
    refusal_of(*words)
    call(*words, "--force", "--floor", f"frame:{FLOOR_FRAME}")
    now = Session(session.path)
    assert now.manifest.calibration_changed
    (kept,) = earlier_calibrations(now)
    assert (session.path / "calibration" / "earlier" / kept / "cameras.toml").read_bytes() == before
    assert [camera.name for camera in now.cameras()] == ["cam1", "cam2"]


def test_a_camera_that_is_not_there_is_no_offsets(takes: Path) -> None:
    session_of_takes(Workspace().place_for("fresh"), takes)
    words = ["calibrate", "fresh", "--board", BOARD.text, "--offset", "cam9=2"]
    assert "There is no camera 'cam9'" in refusal_of(*words)


def test_offsets_put_board_footage_in_step(takes: Path, tmp_path: Path) -> None:
    late = tmp_path / "late"
    shutil.copytree(takes / "extrinsics", late)
    for name in ("000.png", "001.png"):
        (late / "ext_cam2_img" / name).unlink()
    taken = HowTaken({"cam1": 2})
    found = calibrate(BOARD, intrinsics=takes / "intrinsics", extrinsics=late, taken=taken)
    apart = np.linalg.norm(found.rig.cameras[0].centre - found.rig.cameras[1].centre)
    assert apart == pytest.approx(float(np.linalg.norm(CAMERAS[0].centre - CAMERAS[1].centre)), abs=15.0)
    with pytest.raises(CalibrationError, match="no moment"):
        calibrate(BOARD, extrinsics=late, taken=HowTaken({"cam1": 40}))
