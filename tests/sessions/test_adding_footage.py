"""Footage added to a session that is there: empty, with footage, calibrated."""

import shutil
from pathlib import Path

import cv2
import pytest
from toy_session import FRAMES, make_session

from studio.body.subject import Subject, write_subject
from studio.evidence.strokes import Stroke
from studio.foundations.errors import CalibrationError, FootageError, SessionError, WorkCancelledError
from studio.runs.setup.workflow import workflow_of
from studio.sessions.importers.importing import ImportOptions, add_footage
from studio.sessions.session import Session
from studio.sessions.stroke_files import OUTDATED, write_strokes
from studio.sessions.workspace import begin_session


@pytest.fixture
def made(tmp_path: Path) -> Session:
    """The toy session, whose parts are the raw files."""
    return make_session(tmp_path / "toy")


@pytest.fixture
def raw(tmp_path: Path, made: Session) -> Path:
    """Its pictures and masks alone, as a camera leaves them."""
    folder = tmp_path / "raw"
    for part in ("pictures", "masks"):
        shutil.copytree(made.path / part, folder / part)
    return folder


@pytest.fixture
def empty(tmp_path: Path) -> Session:
    """A session without anything."""
    return begin_session(tmp_path / "mine")


def test_an_archive_is_added_like_its_folder(tmp_path: Path, empty: Session, raw: Path) -> None:
    packed = Path(shutil.make_archive(str(tmp_path / "take"), "zip", raw))
    added = add_footage(empty, packed, ImportOptions(fps=60.0))
    assert added.session.manifest.frame_count == FRAMES
    assert not [path for path in empty.path.parent.iterdir() if path.name.startswith(".partial")]


def test_an_empty_session_takes_bare_footage(empty, raw):
    added = add_footage(empty, raw, ImportOptions(fps=60.0))
    source = added.session.manifest.footage
    assert [(camera.name, camera.width, camera.height) for camera in source.cameras] == [("front", 160, 120)]
    assert (source.frame_count, source.fps) == (FRAMES, 60.0)
    assert not added.calibrated
    assert source.cameras[0].masks == "masks/front"
    footage = added.session.footage()
    assert footage.picture("front", 3).shape == (120, 160, 3)
    footage.close()
    way = workflow_of(added.session)
    assert way.steps[0].state == "done"
    assert way.next == "calibration"
    with pytest.raises(SessionError, match="no calibration yet"):
        added.session.cameras()


def test_a_calibration_beside_the_footage_is_taken_over(empty, raw, made):
    shutil.copytree(made.path / "calibration", raw / "calibration")
    added = add_footage(empty, raw, ImportOptions(fps=60.0))
    assert added.calibrated
    assert [camera.name for camera in added.session.cameras()] == ["front"]


@pytest.fixture
def animals(tmp_path: Path) -> Session:
    """An empty session, begun for an animal."""
    return begin_session(tmp_path / "mouse", body="mouse31")


def test_the_body_of_a_session_stays_where_footage_comes_with_a_calibration(
    animals: Session, raw: Path, made: Session
) -> None:
    shutil.copytree(made.path / "calibration", raw / "calibration")
    added = add_footage(animals, raw, ImportOptions(fps=60.0, allow_inconsistent=True))
    assert added.calibrated
    assert Session(animals.path).manifest.body == "mouse31"
    assert not any("mouse31" in note for note in added.notes)


@pytest.mark.parametrize("measures", ["", "height_mm = 400\n"])
def test_only_a_subject_that_names_its_body_changes_it_and_that_is_said(
    animals: Session, raw: Path, made: Session, measures: str
) -> None:
    shutil.copytree(made.path / "calibration", raw / "calibration")
    (raw / "subject.toml").write_text(measures or 'body = "planar_arm4"\n')
    added = add_footage(animals, raw, ImportOptions(fps=60.0, allow_inconsistent=True))
    body = added.session.manifest.body
    assert body == ("mouse31" if measures else "planar_arm4")
    told = [note for note in added.notes if "'planar_arm4', which takes the place of 'mouse31'" in note]
    assert len(told) == (0 if measures else 1)
    assert set(told) <= set(added.session.manifest.notes)
    subject = added.session.subject()
    assert subject is not None
    assert subject.body == body


def test_measures_that_a_session_has_stay_with_their_body(animals: Session, raw: Path, made: Session) -> None:
    write_subject(Subject("mouse31"), animals.path / "subject.toml")
    shutil.copytree(made.path / "calibration", raw / "calibration")
    (raw / "subject.toml").write_text('body = "planar_arm4"\n')
    added = add_footage(animals, raw, ImportOptions(fps=60.0, allow_inconsistent=True)).session
    subject = added.subject()
    assert subject is not None
    assert (added.manifest.body, subject.body) == ("mouse31", "mouse31")


def test_footage_is_replaced_and_old_files_are_gone(empty, raw, tmp_path):
    first = add_footage(empty, raw, ImportOptions(fps=60.0)).session
    for path in sorted((raw / "pictures" / "front").iterdir())[5:]:
        path.unlink()
    write_strokes(
        first, [Stroke(camera="front", frame=0, kind="inside", width=3.0, points=((5.0, 5.0), (9.0, 5.0)))]
    )
    added = add_footage(first, raw, ImportOptions(fps=60.0))
    assert OUTDATED in added.notes
    second = added.session
    source = second.manifest.footage
    assert source.frame_count == 5
    assert source.cameras[0].path == "take-2/pictures/front"
    assert not (second.path / "pictures" / "front").exists()
    assert second.manifest.footage_changed


def test_another_camera_joins_at_the_same_rate_only(empty, raw, tmp_path):
    session = add_footage(empty, raw, ImportOptions(fps=60.0)).session
    other = tmp_path / "other"
    shutil.copytree(raw / "pictures" / "front", other / "pictures" / "side")
    with pytest.raises(FootageError, match="frame rates differ"):
        add_footage(session, other, ImportOptions(fps=30.0))
    assert [camera.name for camera in Session(session.path).manifest.footage.cameras] == ["front"]
    joined = add_footage(session, other, ImportOptions(fps=60.0)).session
    assert [camera.name for camera in joined.manifest.footage.cameras] == ["front", "side"]
    alone = add_footage(joined, other, ImportOptions(fps=60.0, replace=True)).session
    assert [camera.name for camera in alone.manifest.footage.cameras] == ["side"]


def test_a_calibrated_session_refuses_footage_of_another_size(made, raw, tmp_path):
    for path in (raw / "pictures" / "front").iterdir():
        picture = cv2.imread(str(path))
        assert picture is not None
        cv2.imwrite(str(path), cv2.resize(picture, (80, 60)))
    shutil.rmtree(raw / "masks")
    with pytest.raises((CalibrationError, FootageError)):
        add_footage(made, raw, ImportOptions(fps=60.0))
    assert Session(made.path).manifest == made.manifest


def test_a_cancelled_addition_leaves_nothing(empty, raw):
    def stopped(step: str, _done: int, _total: int) -> None:
        if step == "finishing":
            raise WorkCancelledError("Stopped.")

    with pytest.raises(WorkCancelledError):
        add_footage(empty, raw, ImportOptions(fps=60.0), progress=stopped)
    assert sorted(path.name for path in empty.path.iterdir()) == ["session.json"]


def test_references_stay_where_they_lie(empty, raw):
    session = add_footage(empty, raw, ImportOptions(fps=60.0, copy=False)).session
    assert session.manifest.footage.cameras[0].path == str(raw / "pictures" / "front")
    assert not (session.path / "pictures").exists()
