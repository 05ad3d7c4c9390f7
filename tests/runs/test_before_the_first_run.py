"""Imported footage is compared with its calibration before the first run, without being asked."""

import dataclasses
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from nudged_camera import make_nudged_session, true_cameras

from studio.footage.capture.calibration_files import write_calibration
from studio.foundations.errors import CalibrationError
from studio.runs.setup.mask_quality import look_before_the_first_run
from studio.runs.setup.silhouette_faults import accepted_faults, known_faults
from studio.sessions.session import CAMERAS_PATH, Session, redescribe


def imported(folder: Path) -> Session:
    session = make_nudged_session(folder, 0.0)
    return redescribe(
        session, msgspec.structs.replace(session.manifest, layout="folder in the studio's layout")
    )


def test_exchanged_cameras_are_found_before_a_frame_is_tracked(tmp_path: Path) -> None:
    session = imported(tmp_path / "exchanged")
    first, second, *others = true_cameras()
    exchanged = (dataclasses.replace(second, name=first.name), dataclasses.replace(first, name=second.name))
    write_calibration((*exchanged, *others), session.path / CAMERAS_PATH)
    session = Session(session.path)
    look_before_the_first_run(session)
    with pytest.raises(CalibrationError, match="cam1 and cam2 are exchanged"):
        accepted_faults(session, allow_inconsistent=False)


def test_what_agrees_is_not_remembered_and_stops_nothing(tmp_path: Path) -> None:
    session = imported(tmp_path / "right")
    look_before_the_first_run(session)
    assert known_faults(session) == ()
    assert accepted_faults(session, allow_inconsistent=False) == ()


def test_masks_of_no_use_are_said_with_what_helps(tmp_path: Path) -> None:
    """One camera's masks lie where the others see nothing; the run is not refused."""
    session = imported(tmp_path / "good")
    assert look_before_the_first_run(session) == ()
    for path in (session.path / "masks" / "cam1").iterdir():
        mask = np.zeros_like(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        mask[:40, :40] = 255
        cv2.imwrite(str(path), mask)
    (note,) = look_before_the_first_run(Session(session.path)) or ("",)
    assert note.startswith("The views' masks agree by 0.00 only")
    assert f"{session.name} --source best'" in note
