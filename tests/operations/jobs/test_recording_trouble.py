"""Recordings that a full disk ends, takes whose recorder was killed."""

import errno
import time
from pathlib import Path

import numpy as np
import pytest
from mjpeg_streams import Streams, jpeg, served
from toy_session import facing_camera
from waiting import PATIENCE

from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.camera_addresses import camera_address
from studio.footage.capture.camera_streams import Shot
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.footage.capture.live_cameras import PictureSet
from studio.footage.capture.stream_files import StreamWriter
from studio.foundations.errors import FootageError, SessionError
from studio.operations.jobs import stream_recording
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.set_recording import SetRecording
from studio.operations.jobs.stream_recording import StreamRecording, recording_folder
from studio.runs.live.set_following import SetFollower
from studio.sessions.live_recordings import (
    SetWriter,
    begin_recording,
    finish_recording,
    is_being_recorded,
    read_sets,
)
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.recordings import check_cameras, import_recording
from studio.sessions.session import Session

PICTURE = np.random.default_rng(2).integers(0, 255, (120, 160, 3), dtype=np.uint8)


@pytest.fixture
def base(tmp_path: Path) -> Session:
    """One camera of 160x120 pixels, with a picture of the empty room."""
    folder = tmp_path / "base"
    (folder / "calibration").mkdir(parents=True)
    (folder / "background").mkdir()
    (folder / "background" / "front.jpg").write_bytes(jpeg(PICTURE))
    write_calibration((facing_camera(),), folder / "calibration" / "cameras.toml")
    source = CameraSource(
        "front", "video", "videos/front.mp4", 160, 120, 8, background="background/front.jpg"
    )
    manifest = SessionManifest(
        name="base",
        title="Base",
        created=now(),
        body="planar_arm4",
        footage=FootageSource(25.0, 8, (source,)),
    )
    write_manifest(folder, manifest)
    return Session(folder)


def one_stream() -> dict[str, list[bytes]]:
    return {"front": [jpeg(PICTURE)]}


def opened(streams: Streams) -> CameraReaders:
    readers = CameraReaders([camera_address("front", streams.address("front"))])
    readers.await_pictures()
    return readers


def a_set(came: float) -> PictureSet:
    return PictureSet({"front": Shot(PICTURE, b"", came)}, (), 0.0, "")


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_full_disk_ends_a_recording_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(one_stream(), 25.0) as streams, opened(streams) as readers:
        recording = StreamRecording(readers, tmp_path / "take.recording", 25.0)
        until = time.monotonic() + PATIENCE
        while recording.standing.figures["front"].pictures < 5:
            assert time.monotonic() < until
            recording.wait(0.02)
        monkeypatch.setattr(StreamWriter, "write", full)
        while not recording.wait(0.02):
            assert time.monotonic() < until
        standing = recording.close()
    assert standing.ended == "the disk is full"
    assert standing.notes[0] == "The recording ended early: the disk is full."
    calibration = tmp_path / "cameras.toml"
    write_calibration((facing_camera(),), calibration)
    report, _ = import_recording(tmp_path / "take.recording", tmp_path / "take", calibration, standing.notes)
    assert report.session.manifest.frame_count >= 5, "what was written stays"
    assert "The recording ended early: the disk is full." in report.session.manifest.warnings


def test_nothing_is_begun_on_a_disk_without_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_recording, "LEAST_ROOM", 10**18)
    missing = pytest.raises(FootageError, match="a recording needs")
    with served(one_stream(), 25.0) as streams, opened(streams) as readers, missing:
        StreamRecording(readers, tmp_path / "take.recording", 25.0)
    assert not (tmp_path / "take.recording").exists()


def test_a_full_disk_ends_a_take(base: Session, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(one_stream(), 25.0) as streams, opened(streams) as readers:
        recording = SetRecording(readers, begin_recording(base, tmp_path / "take", ("front",), 25.0, 1000))
        recording.await_first()
        monkeypatch.setattr(SetWriter, "put", full)
        follower = SetFollower(tmp_path / "take")
        follower.begin(0)
        until = time.monotonic() + PATIENCE
        while not follower.over(0):
            assert time.monotonic() < until
            follower.wait(0)
        session = recording.close()
    assert recording.standing.ended == "the disk is full"
    assert session.manifest.frame_count == 1
    assert "The recording ended: the disk is full." in session.manifest.notes


def test_a_killed_recorder_leaves_a_take_that_can_be_finished(base: Session, tmp_path: Path) -> None:
    take = begin_recording(base, tmp_path / "take", ("front",), 25.0, 1000)
    writer = SetWriter(take)
    assert is_being_recorded(take.path)
    with pytest.raises(SessionError, match="recorded already"):
        SetWriter(take)
    for frame in (0, 1, 4):
        writer.put(frame, a_set(10.0 + frame / 25.0))
    follower = SetFollower(take.path)
    found = follower.newest(-1)
    assert (found.frame, found.times) == (4, (10.16,))
    # What a kill leaves: no last line, a picture that no line tells of, half a line.
    (take.path / "pictures" / "front" / "000005.jpg").write_bytes(b"\xff\xd8")
    with (take.path / "live" / "sets.csv").open("a") as file:
        file.write("5,10.2")
    writer.close()
    assert not is_being_recorded(take.path)
    done = finish_recording(take)
    assert done.manifest.frame_count == 5
    assert "The recording was cut off." in done.manifest.notes
    assert not (take.path / "pictures" / "front" / "000005.jpg").exists()
    assert [one.frame for one in read_sets(take.path).sets] == [0, 1, 4]
    footage = done.footage()
    assert [footage.absent(frame) for frame in range(5)] == [frozenset()] * 5, (
        "a frame that nobody has is repeated"
    )
    assert np.array_equal(footage.picture("front", 1), footage.picture("front", 3))
    footage.close()


def test_what_a_take_needs_is_requested_first(base: Session, tmp_path: Path) -> None:
    with pytest.raises(FootageError, match="no camera 'left'"):
        begin_recording(base, tmp_path / "take", ("left",), 25.0, 10)
    with pytest.raises(SessionError, match=r"something at '.*base' already"):
        begin_recording(base, base.path, ("front",), 25.0, 10)
    (base.path / "evidence.json").write_text('{"schema": 1, "knobs": {"background_model": "median"}}')
    with pytest.raises(FootageError, match="made with 'median'"):
        begin_recording(base, tmp_path / "take", ("front",), 25.0, 10)
    assert not (tmp_path / "take").exists()
    with pytest.raises(FootageError, match="Camera left is not in"):
        check_cameras(base.path / "calibration" / "cameras.toml", ["front", "left"])
    (tmp_path / "take.recording").mkdir()
    with pytest.raises(FootageError, match="unfinished recording"):
        recording_folder(tmp_path / "take")


@pytest.mark.parametrize("line", [b"0,1\xff,0,,,front=1\n", b"0\n", b"0,1,x,,,front=1\n", b"\n"])
def test_a_damaged_list_of_sets_is_refused_by_name(tmp_path: Path, line: bytes) -> None:
    (tmp_path / "live").mkdir()
    (tmp_path / "live" / "sets.csv").write_bytes(b"frame,moment,spread_ms,lagging,left_out,arrivals\n" + line)
    with pytest.raises(SessionError, match=r"'sets\.csv' is not a recording's list of sets"):
        read_sets(tmp_path)
