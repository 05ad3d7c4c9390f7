"""Recordings of a scene: what is in the file by time, and that viser's own player shows it."""

from pathlib import Path

import numpy as np
import pytest
from store_records import record_of
from toy_session import FRAMES, make_session, true_poses

from studio.app.scene.recording import read_recording
from studio.body.forward_kinematics import limb_frames
from studio.foundations.errors import ExportError
from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.runs.tracks import Track, write_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

HIDDEN = 4
LEANT = np.array([0.4, 0.0, 0.0, 0.0])


@pytest.fixture
def run(tmp_path: Path) -> tuple[Session, StoredRun]:
    """A run of the planar arm, lost in one frame."""
    session = make_session(tmp_path / "toy")
    stored = session.new_run(record_of(session, "first"))
    states = tuple("lost" if frame == HIDDEN else "tracked" for frame in range(FRAMES))
    poses = true_poses() + LEANT
    write_track(stored, Track("moved", np.arange(FRAMES), poses, np.full(FRAMES, 0.9), states))
    return session, stored


@pytest.mark.parametrize("ending", ["viser", "html"])
def test_limbs_move_as_tracked_and_hide_when_lost(run, tmp_path: Path, ending: str) -> None:
    session, stored = run
    place = tmp_path / f"scene.{ending}"
    report = export_run(session, stored, FORMATS[ending], {"track": "moved"}, place)
    assert report.notes[-1] == "The body is hidden in 1 frames."
    recording = read_recording(place)
    assert recording.seconds == pytest.approx(FRAMES / 60.0)
    times = [at for at, _ in recording.messages]
    assert times == sorted(times)
    body = stored.body()
    wanted = limb_frames(body, true_poses() + LEANT)
    tip = f"/body/{body.drawn[-1].name}"
    moved = {
        round(at * 60.0): np.array(message["position"])
        for at, message in recording.messages
        if message["type"] == "SetPositionMessage" and message["name"] == tip
    }
    for frame in set(range(FRAMES)) - {HIDDEN}:
        np.testing.assert_allclose(1000.0 * moved[frame], wanted[frame, -1, :, 3], atol=0.01)
    shown = [
        (round(at * 60.0), message["visible"])
        for at, message in recording.messages
        if message["type"] == "SetSceneNodeVisibilityMessage" and message["name"] == tip and at > 0.0
    ]
    assert shown == [(HIDDEN, False), (HIDDEN + 1, True)]
    names = {message.get("name") for _, message in recording.messages}
    assert {"/floor/plane", "/cameras/front"} <= names


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.viser").write_bytes(b"nothing of the kind, and longer than eight bytes")
    with pytest.raises(ExportError, match="is no recording of a scene"):
        read_recording(tmp_path / "scene.viser")
    with pytest.raises(ExportError, match="is no recording of a scene"):
        read_recording(tmp_path / "absent.viser")
