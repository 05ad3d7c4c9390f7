"""What is held while a background is set up: counted, not timed."""

import gc
from pathlib import Path

import av
import numpy as np
import pytest
from toy_footage import write_video

from studio.evidence.background import GaussianBackground
from studio.evidence.masks import PackedMask
from studio.footage.capture import frame_spool
from studio.footage.capture.frame_spool import FrameSpool
from studio.footage.capture.video import VideoReader

COUNT = 40


@pytest.mark.slow
def test_frames_that_were_read_are_let_go_of(tmp_path: Path) -> None:
    """All stayed until Python collected cycles, 3 MB of full HD each."""
    rng = np.random.default_rng(0)
    pictures = [rng.integers(0, 255, (48, 64, 3), dtype=np.uint8) for _ in range(COUNT)]
    write_video(tmp_path / "clip.mp4", pictures)
    reader = VideoReader(tmp_path / "clip.mp4", COUNT)
    gc.collect()
    gc.disable()
    try:
        for frame in range(COUNT):
            reader.read(frame)
        held = sum(issubclass(type(one), av.VideoFrame) for one in gc.get_objects())
    finally:
        gc.enable()
        reader.close()
    assert held < COUNT // 4


def test_a_spool_holds_a_band_of_its_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = np.random.default_rng(1).integers(0, 255, (5, 23, 16, 3), dtype=np.uint8)
    monkeypatch.setattr(frame_spool, "BAND_BYTES", 4 * 5 * 16 * 3)
    with FrameSpool(tmp_path) as spool:
        for picture in pictures:
            spool.put(picture)
        bands = list(spool.bands())
    assert [top for top, _ in bands] == [0, 4, 8, 12, 16, 20]
    assert max(band.nbytes for _, band in bands) == 4 * 5 * 16 * 3
    np.testing.assert_array_equal(np.concatenate([band for _, band in bands], axis=1), pictures)
    assert not list(tmp_path.iterdir())


def test_a_plate_and_a_packed_mask_hold_little() -> None:
    rng = np.random.default_rng(2)
    picture = rng.integers(0, 255, (40, 48, 3), dtype=np.uint8)
    plate = GaussianBackground(picture)
    assert plate.mean.nbytes + plate.variance.nbytes < 1.2 * picture.nbytes
    mask = np.where(rng.random((41, 37)) < 0.5, np.uint8(255), np.uint8(0))
    packed = PackedMask(mask)
    assert packed.nbytes <= mask.size // 8 + 1
    np.testing.assert_array_equal(packed.unpacked(), mask)
