"""Videos extended by playing forwards and backwards; a stage's clock."""

from pathlib import Path

import numpy as np
import pytest

from studio.footage.capture.footage import folded
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.garden.benchmarks.live_footage import lengthen
from studio.garden.benchmarks.live_stages import STAGES, StageClock
from studio.results.drawing_footage.clips import ClipWriter
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, SIZE = 5, (32, 32)


@pytest.fixture
def short(tmp_path: Path) -> Session:
    """Five even frames of rising brightness, by two cameras."""
    folder = tmp_path / "short"
    (folder / "videos").mkdir(parents=True)
    cameras = []
    for name in ("cam1", "cam2"):
        with ClipWriter(folder / "videos" / f"{name}.mp4", SIZE, 10.0, 10.0) as clip:
            for frame in range(FRAMES):
                clip.add(np.full((*SIZE, 3), 40 + 40 * frame, dtype=np.uint8))
        cameras.append(CameraSource(name, "video", f"videos/{name}.mp4", *SIZE, FRAMES))
    source = FootageSource(10.0, FRAMES, tuple(cameras))
    write_manifest(folder, SessionManifest(name="short", title="", created=now(), body="", footage=source))
    return Session(folder)


def test_a_clip_becomes_long_enough_and_never_jumps(short: Session) -> None:
    lengthen(short, 2.3)
    longer = Session(short.path)
    assert longer.manifest.frame_count == 23
    footage = longer.footage()
    for camera in footage.cameras:
        levels = [float(footage.picture(camera, frame).mean()) for frame in range(23)]
        expected = [40.0 + 40.0 * folded(frame, FRAMES) for frame in range(23)]
        assert np.allclose(levels, expected, atol=8.0)
    footage.close()


def test_a_clip_that_is_long_enough_stays(short: Session) -> None:
    lengthen(short, 0.5)
    assert Session(short.path).manifest == short.manifest


def test_the_clock_gives_medians_over_frames_after_the_first() -> None:
    clock = StageClock()
    for spent in (100.0, 1.0, 2.0, 4.0):
        clock.start()
        for number, name in enumerate(STAGES):
            clock.spent[name][-1] = spent * (1 + number)
    found = clock.medians(1)
    assert found["decoding"] == 2.0
    assert found["reconstruction"] == 4.0
    assert found["whole frame"] == 2.0 * 15
