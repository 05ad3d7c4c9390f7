"""Recording streams: an even rate, whole fragments, times that are read back."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from toy_footage import number_of, numbered_frame

from studio.footage.capture.camera_streams import Shot
from studio.footage.capture.pictures import NumberedReader, has_picture, picture_path
from studio.footage.capture.stream_files import (
    Cadence,
    StreamWriter,
    TimesFile,
    jpeg_of_pixels,
    mend_recording,
    whole_boxes,
)
from studio.footage.capture.timestamps import read_timestamps
from studio.footage.capture.video import VideoReader, measure_video
from studio.foundations.errors import FootageError

FPS = 30.0


@pytest.fixture
def times(tmp_path: Path) -> Iterator[TimesFile]:
    made = TimesFile(tmp_path / "timestamps.csv")
    yield made
    made.close()


def written(folder: Path, lines: TimesFile, times: list[float]) -> StreamWriter:
    """A recording of numbered frames that came at these times; not closed."""
    writer = StreamWriter("cam1", folder / "cam1.mp4", FPS, lines)
    for number, came in enumerate(times):
        writer.write(Shot(numbered_frame(number), b"", came))
    return writer


def test_what_is_recorded_is_read_back_with_its_times(tmp_path: Path, times: TimesFile) -> None:
    came = [50.0 + k / FPS + 0.004 * (k % 3) for k in range(40)]
    written(tmp_path, times, came).close()
    measured = measure_video(tmp_path / "cam1.mp4")
    assert (measured.frame_count, measured.fps, measured.uneven_frame) == (40, pytest.approx(FPS), -1)
    reader = VideoReader(tmp_path / "cam1.mp4", 40)
    assert [number_of(reader.read(k)) for k in (0, 17, 39)] == [0, 17, 39]
    reader.close()
    assert read_timestamps(tmp_path / "timestamps.csv")["cam1"] == pytest.approx(came, abs=1e-6)


def test_a_streams_own_jpeg_is_kept_as_it_came(tmp_path: Path, times: TimesFile) -> None:
    content = jpeg_of_pixels(numbered_frame(5), 80)
    writer = StreamWriter("cam1", tmp_path / "cam1.mp4", FPS, times)
    writer.write(Shot(np.zeros((96, 128, 3), np.uint8), content, 1.0))
    writer.close()
    assert content in (tmp_path / "cam1.mp4").read_bytes()


def test_a_lost_picture_is_stood_in_for_and_one_too_many_left_out(tmp_path: Path, times: TimesFile) -> None:
    steps = [0, 1, 2, 5, 6, 6.2, 7, 8]
    writer = written(tmp_path, times, [9.0 + step / FPS for step in steps])
    writer.close()
    assert (writer.figures.pictures, writer.figures.repeated, writer.figures.left_out) == (9, 2, 1)
    reader = VideoReader(tmp_path / "cam1.mp4", 9)
    assert [number_of(reader.read(k)) for k in range(9)] == [0, 1, 2, 2, 2, 3, 4, 6, 7]
    reader.close()


@pytest.mark.parametrize(("source", "kept"), [(30.0, 30.0), (60.0, 30.0), (29.9, 30.0), (50.0, 30.0)])
def test_a_picture_s_number_tells_its_time(source: float, kept: float) -> None:
    cadence = Cadence(kept)
    for number in range(3000):
        came = 5.0 + number / source
        if cadence.copies(came):
            assert abs((cadence.count - 1) - (came - 5.0) * kept) <= 0.61
    assert cadence.count == pytest.approx(3000 / source * kept, abs=1.5)


def test_a_kill_loses_the_piece_that_was_being_written(tmp_path: Path, times: TimesFile) -> None:
    """What lies on disk while the writer is still at it is what a kill leaves; a cut in it is mended."""
    writer = written(tmp_path, times, [k / FPS for k in range(60)])
    content = (tmp_path / "cam1.mp4").read_bytes()
    killed = tmp_path / "killed.mp4"
    killed.write_bytes(content)
    assert measure_video(killed).frame_count >= 60 - FPS, "less than a second is lost"
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(content[: len(content) * 2 // 3])
    with pytest.raises(FootageError):
        measure_video(cut)
    assert mend_recording(cut) > 0
    count = measure_video(cut).frame_count
    assert 60 * 2 // 3 - FPS <= count <= 40
    assert mend_recording(cut) == 0
    reader = VideoReader(cut, count)
    assert number_of(reader.read(count - 1)) == count - 1
    reader.close()
    writer.close()


def test_nothing_whole_is_said(tmp_path: Path, times: TimesFile) -> None:
    path = tmp_path / "cam1.mp4"
    path.write_bytes(b"\0\0\1\0ftyp")
    assert whole_boxes(path) == 0
    with pytest.raises(FootageError, match="no complete piece"):
        mend_recording(path)


def test_a_camera_that_changes_its_size_is_named(tmp_path: Path, times: TimesFile) -> None:
    writer = written(tmp_path, times, [0.0])
    with pytest.raises(FootageError, match="cam1 changed its pictures from 128x96 to 64x48"):
        writer.write(Shot(np.zeros((48, 64, 3), np.uint8), b"", 0.1))
    writer.close()


def test_a_disk_that_refuses_is_an_oserror(tmp_path: Path, times: TimesFile) -> None:
    writer = StreamWriter("cam1", tmp_path / "gone" / "cam1.mp4", FPS, times)
    with pytest.raises(FileNotFoundError):
        writer.write(Shot(numbered_frame(0), b"", 0.0))


def test_numbered_pictures_show_the_one_before_a_gap(tmp_path: Path, times: TimesFile) -> None:
    for number in (2, 5):
        picture_path(tmp_path, number).write_bytes(jpeg_of_pixels(numbered_frame(number)))
    reader = NumberedReader(tmp_path)
    assert [number_of(reader.read(k)) for k in (0, 2, 4, 5, 9)] == [2, 2, 2, 5, 5]
    assert [has_picture(tmp_path, k) for k in (2, 3)] == [True, False]
    picture_path(tmp_path, 3).write_bytes(jpeg_of_pixels(numbered_frame(3)))
    assert number_of(reader.read(4)) == 3, "the folder may grow"
    with pytest.raises(FootageError, match="no picture near frame 7"):
        NumberedReader(tmp_path / "nothing").read(7)
