"""What a session's parts were made from, and what a change makes stale."""

import dataclasses

import msgspec
import pytest
from toy_session import make_session, true_poses

from studio.footage.capture.calibration_files import read_calibration, write_calibration
from studio.runs.new_run import prepare_run
from studio.runs.setup.workflow import workflow_of
from studio.sessions import provenance
from studio.sessions.named_rows import write_pose
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import CAMERAS_PATH, START_POSE_NAME, Session, redescribe


@pytest.fixture
def session(tmp_path) -> Session:
    """The toy session with a start pose."""
    made = make_session(tmp_path / "toy")
    names = tuple(entry.name for entry in made.body().parameters)
    write_pose(made.path / START_POSE_NAME, names, true_poses()[0])
    return made


def step(session: Session, name: str):
    """A step's status."""
    return next(one for one in workflow_of(session).steps if one.step == name)


def move_cameras(session: Session) -> Session:
    """The session with another calibration."""
    cameras = read_calibration(session.path / CAMERAS_PATH).cameras
    moved = tuple(dataclasses.replace(one, translation=one.translation + 5.0) for one in cameras)
    write_calibration(moved, session.path / CAMERAS_PATH)
    return Session(session.path)


def test_a_start_pose_is_stale_after_the_calibration_changed(session):
    provenance.note(session, "start-pose", "confidence 90 %")
    assert step(session, "start-pose").state == "done"
    assert step(session, "start-pose").words == "confidence 90 %"
    moved = move_cameras(session)
    assert provenance.changed_inputs(moved, "start-pose") == ("calibration",)
    stale = step(moved, "start-pose")
    assert stale.state == "stale"
    assert "calibration" in stale.why
    provenance.note(moved, "start-pose")
    assert step(moved, "start-pose").state == "done"


def test_a_given_start_pose_counts_as_of_what_was_there(session):
    provenance.adopt(session)
    assert step(move_cameras(session), "start-pose").state == "stale"


def test_a_pose_that_was_replaced_by_hand_is_nobodys(session):
    provenance.note(session, "start-pose")
    names = tuple(entry.name for entry in session.body().parameters)
    write_pose(session.path / START_POSE_NAME, names, true_poses()[2])
    assert provenance.changed_inputs(move_cameras(session), "start-pose") == ()


def test_measured_masks_are_stale_after_other_knobs(session):
    provenance.note(session, "background", "agree 0.95", good=True)
    assert step(session, "background").words == "agree 0.95"
    (session.path / "evidence.json").write_text('{"schema": 1, "knobs": {"mask_threshold": 7}, "given": {}}')
    assert provenance.changed_inputs(session, "background") == ("masks",)
    provenance.note(session, "background", "agree 0.50", good=False)
    assert step(session, "background").state == "ready"


def test_a_run_is_stale_where_its_snapshot_differs(session):
    run = prepare_run(session)
    assert step(session, "track").state == "ready"
    with ResultsWriter(run.folder):
        pass
    assert step(session, "check").state == "blocked"
    moved = move_cameras(session)
    assert step(moved, "track").state == "ready"


def test_a_missing_footage_file_is_reported(session):
    source = session.manifest.footage
    lost = tuple(dataclasses.replace(camera, path="pictures/nowhere") for camera in source.cameras)
    manifest = msgspec.structs.replace(session.manifest, footage=dataclasses.replace(source, cameras=lost))
    changed = redescribe(session, manifest)
    assert step(changed, "footage").state == "stale"
    assert "front" in step(changed, "footage").why
