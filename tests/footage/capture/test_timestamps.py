"""Recorded times beside videos."""

from pathlib import Path

import numpy as np
import pytest

from studio.footage.capture.timestamps import offsets_from_times, read_timestamps
from studio.foundations.errors import FootageError

FPS = 30.0


def lines(times: dict[int, np.ndarray], first: dict[int, int] | None = None, column: str = "cam_id") -> str:
    """Caliscope's file, cameras mixed in the order of their times."""
    head = f"{column},frame_time" + (",frame_index" if first else "")
    rows = [
        (moment, f"{camera},{moment!r}" + (f",{first[camera] + k}" if first else ""))
        for camera, moments in times.items()
        for k, moment in enumerate(map(float, moments))
    ]
    return "\n".join([head, *(row for _, row in sorted(rows))]) + "\n"


@pytest.mark.parametrize("column", ["cam_id", "port"])
def test_offsets_of_cameras_that_began_one_after_the_other(tmp_path: Path, column: str) -> None:
    # Camera 1 began 5 frames after camera 0 and camera 10 two before it, each a little off.
    begin = {0: 100.0, 1: 100.0 + 5 / FPS + 0.004, 10: 100.0 - 2 / FPS - 0.003}
    times = {camera: start + np.arange(60) / FPS for camera, start in begin.items()}
    path = tmp_path / "timestamps.csv"
    path.write_text(lines(times, column=column))
    read = read_timestamps(path)
    assert list(read) == ["0", "1", "10"]
    np.testing.assert_allclose(read["10"], times[10])
    found = offsets_from_times(read)
    assert found.offsets == {"0": 5, "1": 0, "10": 7}
    assert found.fps == pytest.approx(FPS)
    assert found.apart == pytest.approx(0.007 * FPS)
    assert found.notes == ()


def test_numbers_of_frames_go_before_the_order_of_lines(tmp_path: Path) -> None:
    times = {0: 5.0 + np.arange(50) / FPS, 1: 5.0 + np.arange(50) / FPS}
    path = tmp_path / "timestamps.csv"
    # The first line of camera 1 is its frame 12; line 20 of camera 0 is missing.
    text = lines(times, first={0: 0, 1: 12}).splitlines()
    del text[41]
    path.write_text("\n".join(text))
    read = read_timestamps(path)
    assert (len(read["0"]), len(read["1"])) == (50, 62)
    np.testing.assert_allclose(read["0"], times[0])
    assert offsets_from_times(read).offsets == {"0": 0, "1": 12}
    # Caliscope's older file numbers the frames of the stream, not of the video.
    older = tmp_path / "frame_time_history.csv"
    older.write_text(lines(times, first={0: 300, 1: 512}, column="port"))
    assert [len(moments) for moments in read_timestamps(older).values()] == [50, 50]


def test_drift_and_lost_frames_are_reported() -> None:
    a = np.arange(100) / FPS
    lost = np.delete(a, [40, 41])
    found = offsets_from_times({"a": a, "b": lost})
    assert found.apart == pytest.approx(2.0)
    assert "2.0 frames apart" in found.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "no column 'cam_id'"),
        ("cam_id,frame_time\n", "holds no times"),
        ("cam_id,frame_time\n0,1.0\n0,late\n", "line 3 holds 'late'"),
        ("cam_id,frame_time\n0,1.0\n0,inf\n", "line 3 holds 'inf'"),
        ("cam_id,frame_time\n0,1.0\n0,1.0\n", "do not rise"),
        ("cam_id,frame_time,frame_index\n0,1.0,0\n0,2.0,99999999\n", "2 times for 100000000 frames"),
        ("cam_id,frame_time\n0,1.0\n", "do not rise"),
    ],
)
def test_what_is_no_such_file(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "timestamps.csv"
    path.write_text(text)
    with pytest.raises(FootageError, match=message) as caught:
        read_timestamps(path)
    assert caught.value.hint


def test_rates_and_takes_that_do_not_belong_together() -> None:
    with pytest.raises(FootageError, match="different frame rates"):
        offsets_from_times({"a": np.arange(60) / 30.0, "b": np.arange(60) / 25.0})
    with pytest.raises(FootageError, match="do not overlap"):
        offsets_from_times({"a": np.arange(60) / 30.0, "b": 100.0 + np.arange(60) / 30.0})


def test_a_first_picture_that_came_late_does_not_decide() -> None:
    even = np.arange(40) / 30.0
    late = even + 0.001
    late[0] += 0.020
    assert offsets_from_times({"cam1": even, "cam2": late}).offsets == {"cam1": 0, "cam2": 0}
    assert offsets_from_times({"cam1": even, "cam2": late + 1.0 / 30.0}).offsets == {"cam1": 1, "cam2": 0}


def test_a_short_take_has_too_few_times_to_tell_rates_apart() -> None:
    """Under a second of jittered times, three hundredths apart by their medians."""
    even = np.arange(24) / 30.0
    assert offsets_from_times({"cam1": even, "cam2": even * 1.03}).offsets == {"cam1": 0, "cam2": 0}
    with pytest.raises(FootageError, match="different frame rates"):
        offsets_from_times({"cam1": np.arange(90) / 30.0, "cam2": np.arange(90) / 28.5})
