"""Offsets and turns changed after the import, and what that makes stale."""

from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from other_layouts import pose2sim
from sources import FRAMES, full_source
from toy_footage import number_of

from studio.foundations.errors import FootageError
from studio.runs.new_run import prepare_run
from studio.sessions.footage_changes import change_footage, stale_runs
from studio.sessions.importers.importing import ImportOptions, import_source
from studio.sessions.run_record import write_run_record
from studio.sessions.session import Session


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """Two videos with masks, backgrounds, a start pose and a truth."""
    return import_source(full_source(tmp_path / "source"), tmp_path / "take").session


def test_offsets_keep_the_smallest_at_zero(session: Session) -> None:
    first = change_footage(session, {"cam_1": 5, "cam_2": 2}).session
    assert [camera.offset for camera in first.manifest.footage.cameras] == [3, 0]
    assert first.manifest.frame_count == FRAMES - 3
    pictures = first.footage().pictures(4).pictures
    assert [number_of(picture) for picture in pictures] == [7, 4]
    back = change_footage(first, {"cam_1": -4}).session
    assert [camera.offset for camera in back.manifest.footage.cameras] == [0, 4]
    assert Session(session.path).manifest == back.manifest


@pytest.mark.slow
def test_the_notes_name_stale_parts(session: Session) -> None:
    assert session.thumbnail() is not None
    old = prepare_run(session, name="old")
    change = change_footage(session, {"cam_2": 1})
    assert change.stale_runs == ("old",)
    notes = " ".join(change.notes)
    for words in (
        "11 frames are in all cameras",
        "Run old was tracked",
        "start pose belongs",
        "truth counts its time",
    ):
        assert words in notes
    assert not (session.path / "thumbnail.jpg").exists()
    assert old.record.last == FRAMES
    # A run made afterwards is not stale; the old one stays so when its record is written again or made earlier.
    new = prepare_run(change.session, name="new")
    assert stale_runs(Session(session.path)) == ("old",)
    assert new.record.last == FRAMES - 1
    earlier = msgspec.structs.replace(old.record, created="2026-01-01T00:00:00+00:00")
    write_run_record(old.folder, earlier)
    assert stale_runs(Session(session.path)) == ("old",)


def test_a_turn_is_of_pictures_masks_and_background(session: Session) -> None:
    before = session.footage()
    picture, mask = before.picture("cam_2", 3), before.mask("cam_2", 3)
    changed = change_footage(session, rotations={"cam_2": 180}).session.footage()
    np.testing.assert_array_equal(changed.picture("cam_2", 3), cv2.rotate(picture, cv2.ROTATE_180))
    assert mask is not None
    turned = changed.mask("cam_2", 3)
    assert turned is not None
    np.testing.assert_array_equal(turned, cv2.rotate(mask, cv2.ROTATE_180))
    np.testing.assert_array_equal(changed.picture("cam_1", 3), before.picture("cam_1", 3))


def test_masks_that_would_not_suffice_are_refused(session: Session) -> None:
    (session.path / "masks" / "cam_2" / f"frame{FRAMES - 1:04d}.png").unlink()
    with pytest.raises(FootageError, match="Camera cam_2 has 11 masks, and with these offsets 12 are needed"):
        change_footage(session, {"cam_2": 2})
    assert Session(session.path).manifest.footage.cameras[1].offset == 0


def test_manifests_from_before_offsets_are_read(tmp_path: Path) -> None:
    path = (
        import_source(pose2sim(tmp_path / "source"), tmp_path / "take", ImportOptions(fps=60.0)).session.path
        / "session.json"
    )
    text = path.read_text()
    for line in ('"offset": 0', '"turned": 0', '"layout": "Pose2Sim trial"', '"footage_changed": ""'):
        assert line in text
        text = text.replace(f",\n        {line}", "").replace(f",\n  {line}", "")
    text = "\n".join(line for line in text.splitlines() if '"offset"' not in line)
    path.write_text(text)
    camera = Session(path.parent).manifest.footage.cameras[0]
    assert (camera.offset, camera.turned) == (0, 0)
