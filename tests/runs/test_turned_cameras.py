"""Cameras turned by their silhouettes: measured, reported, stored, and undone byte for byte."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from nudged_camera import DEGREES, NUDGED, make_nudged_session, nudged, true_cameras

from studio.foundations.errors import CalibrationError, NotFoundError
from studio.runs.new_run import prepare_run
from studio.runs.setup.aligning import SessionAlignment, align_cameras
from studio.runs.setup.turned_cameras import (
    alignment_words,
    remember_alignment,
    turn_back,
    turn_cameras,
    turned_from,
)
from studio.runs.setup.workflow import StepStatus, workflow_of
from studio.sessions.calibration_changes import restore_calibration, stale_runs
from studio.sessions.manifest import write_manifest
from studio.sessions.session import CAMERAS_PATH, Session


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """One camera stands 1.2° from where its calibration has it."""
    return make_nudged_session(tmp_path / "nudged")


@pytest.fixture
def aligned(session: Session) -> SessionAlignment:
    """What its silhouettes say."""
    return align_cameras(session)


def calibration_step(session: Session) -> StepStatus:
    """Step Calibration of the guided set-up."""
    return next(step for step in workflow_of(session).steps if step.step == "calibration")


def apart(session: Session) -> float:
    """Degrees between the nudged camera as the session has it and as it truly stands, relative to the first camera."""
    found = {camera.name: camera.rotation for camera in session.cameras()}
    truth = {camera.name: camera.rotation for camera in true_cameras()}
    left = (found[NUDGED] @ found["cam1"].T) @ (truth[NUDGED] @ truth["cam1"].T).T
    return float(np.degrees(np.arccos(np.clip((np.trace(left) - 1.0) / 2.0, -1.0, 1.0))))


def test_the_way_recommends_turning_and_is_content_afterwards(
    session: Session, aligned: SessionAlignment
) -> None:
    assert calibration_step(session).why == ""
    assert apart(session) == pytest.approx(DEGREES, abs=0.01)
    remember_alignment(session, aligned)
    status = calibration_step(session)
    assert status.state == "done"
    assert f"({NUDGED})" in status.why
    assert status.why.startswith("The silhouettes miss by up to")
    assert "step Background" in status.why
    change = turn_cameras(session, aligned)
    assert apart(change.session) < 0.4 * DEGREES
    assert calibration_step(change.session).why == ""
    assert "aligned by silhouettes" in calibration_step(change.session).words


def test_after_a_good_board_large_turns_are_proposed_only_after_the_masks(
    session: Session, aligned: SessionAlignment
) -> None:
    def words(source: str, turn: float) -> str:
        turns = np.where(aligned.aligned.turns == np.nanmax(aligned.aligned.turns), turn, 0.0)
        measured = replace(aligned, aligned=replace(aligned.aligned, turns=turns))
        manifest = msgspec.structs.replace(session.manifest, calibration_source=source)
        write_manifest(session.path, manifest)
        return alignment_words(Session(session.path), measured)

    board, large = "ChArUco board 8x11, 0.48 px", "with cameras turned by up to 4.45°"
    before, _, after = words(board, 4.45).partition(large)
    assert f"the masks of {NUDGED}" in before
    assert "0.48 px" in before
    assert after
    for source, turn in ((board, 0.6), ("chessboard 8x6, 3.20 px", 4.45), ("calibration.toml", 4.45)):
        said = words(source, turn)
        assert "masks" not in said
        assert f"turned by up to {turn:.2f}°" in said


@pytest.mark.slow
def test_turning_back_restores_every_byte_and_makes_runs_good_again(
    session: Session, aligned: SessionAlignment
) -> None:
    run = prepare_run(session, start_pose=session.body().neutral, last=2, name="before")
    report = session.path / "calibration" / "cameras.report.json"
    report.write_text('{"cameras": []}')
    before = (session.path / CAMERAS_PATH).read_bytes()
    turned = turn_cameras(session, aligned).session
    assert turned_from(turned)
    assert not report.exists()
    assert stale_runs(turned) == (run.name,)
    change = turn_back(turned)
    assert (session.path / CAMERAS_PATH).read_bytes() == before
    assert report.read_text() == '{"cameras": []}'
    assert change.session.manifest.calibration_source == "board.toml"
    assert (change.stale_runs, change.notes) == ((), ())
    assert turned_from(change.session) == ""
    with pytest.raises(NotFoundError, match="were not turned"):
        turn_back(change.session)


@pytest.mark.slow
def test_cameras_turned_twice_go_back_one_by_one(session: Session, aligned: SessionAlignment) -> None:
    first = (session.path / CAMERAS_PATH).read_bytes()
    once = turn_cameras(session, aligned).session
    second = (session.path / CAMERAS_PATH).read_bytes()
    twice = turn_cameras(once, align_cameras(once)).session
    back = turn_back(twice).session
    assert (session.path / CAMERAS_PATH).read_bytes() == second
    assert turned_from(back)
    turn_back(back)
    assert (session.path / CAMERAS_PATH).read_bytes() == first


@pytest.mark.slow
def test_good_cameras_are_left_alone(tmp_path: Path) -> None:
    session = make_nudged_session(tmp_path / "good", degrees=0.0)
    found = align_cameras(session)
    assert not found.needed
    remember_alignment(session, found)
    assert calibration_step(session).why == ""


def test_another_calibration_since_is_not_turned(session: Session, aligned: SessionAlignment) -> None:
    turned = turn_cameras(session, aligned).session
    (session.path / CAMERAS_PATH).write_bytes((session.path / CAMERAS_PATH).read_bytes() + b"\n")
    assert turned_from(turned) == ""
    with pytest.raises(NotFoundError, match="kept no calibration 'gone'"):
        restore_calibration(session, "gone", "")
    with pytest.raises(CalibrationError, match="has changed"):
        turn_cameras(turned, aligned)


def test_the_nudge_equals_the_oracles() -> None:
    wrong, right = nudged(true_cameras()), true_cameras()
    assert [
        one.name for one, two in zip(wrong, right, strict=True) if not np.allclose(one.rotation, two.rotation)
    ] == [NUDGED]
