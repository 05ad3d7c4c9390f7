"""Live cameras recorded and tracked: STREAMED streams on loopback, replayed videos, one that stops."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mjpeg_streams import Streams, jpeg, served
from sample_walk import STREAM_FPS, STREAMED, copy_of_walk, streamed_pictures
from waiting import PATIENCE

from studio.footage.capture.camera_addresses import CameraAddress, camera_address
from studio.footage.capture.timestamps import read_timestamps
from studio.foundations.errors import FootageError
from studio.operations.jobs.camera_readers import CameraReaders
from studio.operations.jobs.camera_tracking import LiveRecordingRequest, open_recording, track_cameras
from studio.operations.jobs.live_tracking import replay_live
from studio.operations.jobs.stream_recording import StreamRecording
from studio.runs.live.live_replay import prepare_replay
from studio.runs.live.live_summary import summary_of
from studio.runs.live.set_following import SetFollower
from studio.runs.problem_source import ProblemSource
from studio.search.settings import default_settings
from studio.sessions.live_recordings import read_sets
from studio.sessions.recordings import import_recording
from studio.sessions.session import Session

QUICK: dict[str, Any] = dict(
    tracker="annealed",
    weighting="edge-region",
    live=True,
    seed=3,
    knobs={"particles": 30, "layers": 3, "recovery": "off"},
)
FRAMES = 50


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """The bundled walk: four cameras, empty clips, a start pose."""
    return copy_of_walk(tmp_path_factory.mktemp("base") / "walk")


@pytest.fixture(scope="module")
def pictures(walk: Session) -> dict[str, list[bytes]]:
    """Every second frame of two cameras as JPEG, so 30 a second."""
    return streamed_pictures(walk, FRAMES)


def replays(walk: Session) -> list[CameraAddress]:
    return [
        camera_address(source.name, str(walk.path / source.path), replays=True)
        for source in walk.manifest.footage.cameras
    ]


def of_streams(streams: Streams) -> list[CameraAddress]:
    return [camera_address(name, streams.address(name)) for name in STREAMED]


class Watcher:
    """Hears how a live run goes: lets the streams begin, silences one, and ends the run when that was said and the
    others went on.
    """

    def __init__(self, streams: Streams) -> None:
        self.streams, self.until = streams, time.monotonic() + PATIENCE
        self.heard = self.after = 0

    def __call__(self, step: str, done: int, total: int) -> None:
        assert time.monotonic() < self.until
        if not step.startswith("live"):
            return
        self.streams.going.set()
        self.heard += 1
        if self.heard == 8:
            self.streams.silent.add("cam2")
        if "cam2: stopped" in step:
            self.after += 1
        if self.after == 8:
            raise KeyboardInterrupt


@pytest.mark.slow
def test_two_mjpeg_streams_are_tracked_and_recorded_and_one_that_stops_is_left_out(
    walk: Session, pictures: dict[str, list[bytes]], tmp_path: Path
) -> None:
    place = tmp_path / "take"
    with served(pictures, STREAM_FPS) as streams, pytest.raises(KeyboardInterrupt):
        track_cameras(
            walk, of_streams(streams), LiveRecordingRequest(place, seconds=60.0), QUICK, Watcher(streams)
        )
    take = Session(place)
    run, taken = take.runs()[0], read_sets(place)
    notice = next(note for note in take.manifest.notes if note.startswith("Camera cam2 stopped"))
    print(notice, taken.spreads.in_words, f"latency {summary_of(run).latency(0.5):.0f} ms")
    assert "the others went on" in notice
    assert taken.ended == "it was stopped"
    assert take.manifest.frame_count == taken.sets[-1].frame + 1
    assert taken.sets[0].left_out == ()
    alone = [one.frame for one in taken.sets if one.left_out == ("cam2",)]
    tracked = summary_of(run).tracked
    assert len([frame for frame in tracked if frame in alone]) >= 3, "it went on with the other"
    assert alone[-1] == taken.sets[-1].frame
    assert run.summary().status == "cancelled"
    again = prepare_replay(take, run)
    assert replay_live(take, run, again, lambda *_: None).different == (), "bit for bit"
    _evidence_has_only_the_others(take, alone[0])


def _evidence_has_only_the_others(take: Session, frame: int) -> None:
    problems = ProblemSource(take, take.body())
    settings = default_settings("annealed", "edge-region")
    assert [view.camera for view in problems.evidence(frame, settings).views] == ["cam1"]
    assert [view.camera for view in problems.evidence(0, settings).views] == ["cam1", "cam2"]
    weights = problems.problem(frame, settings).log_likelihood(take.body().neutral[None])
    assert np.isfinite(weights).all()
    problems.close()


@pytest.mark.slow
def test_four_replayed_videos_are_tracked_live(walk: Session, tmp_path: Path) -> None:
    heard: list[str] = []
    found = track_cameras(
        walk,
        replays(walk),
        LiveRecordingRequest(tmp_path / "take", fps=60.0),
        QUICK,
        lambda step, done, total: heard.append(step),
    )
    assert found.standing.ended == "all replayed videos are over"
    assert found.run.summary().status == "finished"
    taken = read_sets(found.session.path)
    assert {one.frame for one in taken.sets} >= set(found.summary.tracked)
    assert len(found.summary.tracked) >= 5
    assert found.summary.tracked[0] >= 1, "the set to get ready with is not tracked late"
    assert any("ms apart" in step for step in heard)
    assert not SetFollower(found.session.path).over(-1)
    assert SetFollower(found.session.path).over(taken.sets[-1].frame)


def test_four_replayed_videos_are_recorded(walk: Session, tmp_path: Path) -> None:
    with CameraReaders(replays(walk)) as readers:
        readers.await_pictures()
        recording = StreamRecording(readers, tmp_path / "take.recording", 60.0)
        until = time.monotonic() + PATIENCE
        while not recording.wait(0.05):
            assert time.monotonic() < until
        standing = recording.close()
    assert standing.ended == "all replayed videos are over"
    calibration = walk.path / "calibration" / "cameras.toml"
    report, spreads = import_recording(
        tmp_path / "take.recording", tmp_path / "take", calibration, standing.notes
    )
    footage = report.session.manifest.footage
    assert [camera.name for camera in footage.cameras] == ["cam1", "cam2", "cam3", "cam4"]
    assert footage.frame_count >= 130
    assert spreads.sets == footage.frame_count
    times = read_timestamps(report.session.path / "timestamps.csv")
    assert {name: len(moments) for name, moments in times.items()} == {
        camera.name: camera.frame_count for camera in footage.cameras
    }
    assert any("ms apart" in note for note in report.session.manifest.notes)
    assert not (tmp_path / "take.recording").exists()


def test_what_cannot_be_a_take_is_refused_and_leaves_nothing(
    walk: Session, pictures: dict[str, list[bytes]], tmp_path: Path
) -> None:
    small = {"cam1": [jpeg(np.zeros((48, 64, 3), np.uint8))], "cam9": pictures["cam1"]}
    with served(small, STREAM_FPS) as streams:
        for name, said in (
            ("cam1", "sends 64x48 pixels and was calibrated at 640x480"),
            ("cam9", "no camera 'cam9'"),
        ):
            address = camera_address(name, streams.address(name))
            with CameraReaders([address]) as readers, pytest.raises(FootageError, match=said):
                open_recording(
                    walk, readers, LiveRecordingRequest(tmp_path / name, seconds=5.0, fps=STREAM_FPS)
                )
            assert not (tmp_path / name).exists()


def test_a_camera_that_is_not_there_is_named_without_its_password(walk: Session) -> None:
    with served({}, STREAM_FPS) as streams:
        place = f"http://root:geheim@127.0.0.1:{streams.port}/nothing"
        address = camera_address("cam1", place)
        with CameraReaders([address]) as readers, pytest.raises(FootageError) as caught:
            readers.await_pictures(1.0)
    assert "cam1" in caught.value.message
    assert "geheim" not in json.dumps([caught.value.message, caught.value.hint])
