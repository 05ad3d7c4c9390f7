"""Which pictures belong together, by their times."""

import numpy as np
import pytest

from studio.footage.capture.footage_source import CameraSource
from studio.footage.capture.frame_pairing import drifts, file_frame, paired_by_time

FPS = 60.0
EVEN = np.arange(3600) / FPS


def test_a_minute_at_another_rate_is_said_by_how_much_and_from_when() -> None:
    times = {"a": EVEN, "b": np.arange(3600) * 1001 / 60000, "c": EVEN, "d": EVEN}
    (found,) = drifts(times, FPS)
    assert (found.camera, found.first, found.lost) == ("b", 501, ())
    assert found.most == pytest.approx(3.6, abs=0.01)
    assert "3.6 frames later" in found.words(FPS)
    assert "59.94 against 60" in found.words(FPS)
    slower = drifts(times, 60000 / 1001)[0]
    assert "59.94 against 60" in slower.words(60000 / 1001), "also where the session takes the slower rate"
    assert drifts({"a": EVEN, "b": EVEN * 1.0001}, FPS) == ()


@pytest.mark.parametrize("others", [("a", "c", "d"), ("a",)])
def test_a_lost_frame_is_named_with_its_place(others: tuple[str, ...]) -> None:
    short = np.delete(EVEN[:600], 300)
    (found,) = drifts({"b": short} | dict.fromkeys(others, EVEN[:600]), FPS)
    assert found.lost == ((300, 1),)
    assert found.first == 300
    assert "lost frames: 1 before frame 300 (5.00 s)" in found.words(FPS)


def test_each_camera_that_lost_one_is_named() -> None:
    times = {name: np.delete(EVEN[:600], at) for name, at in (("a", 300), ("b", 270), ("c", 330), ("d", 300))}
    assert {drift.camera: drift.lost[0][0] for drift in drifts(times, FPS)} == {
        "a": 300,
        "b": 270,
        "c": 330,
        "d": 300,
    }


def test_jitter_of_one_stamp_is_nothing() -> None:
    late = EVEN[:600].copy()
    late[100] += 0.45 / FPS
    assert drifts({"a": EVEN[:600], "b": late}, FPS) == ()


@pytest.mark.parametrize(
    "moments",
    [np.arange(3600) * 1001 / 60000, np.delete(EVEN, 1800), np.arange(1800) / 30.0, np.arange(7200) / 120.0],
)
def test_pairs_lie_within_half_a_frame(moments: np.ndarray) -> None:
    steps, count = paired_by_time({"a": EVEN, "b": moments}, FPS)
    assert steps["a"] == ()
    assert count > 3500
    source = CameraSource("b", "video", "b.mp4", 8, 8, len(moments) + 5, offset=5, steps=steps["b"])
    chosen = np.array([source.file_frame(frame) - 5 for frame in range(count)])
    assert chosen.max() < len(moments)
    gap = max(0.5, 0.5 * 60 * float(np.median(np.diff(moments)))) + 0.5 * (len(moments) == 3599)
    assert np.abs(moments[chosen] - np.arange(count) / FPS).max() * FPS <= gap + 1e-6
    assert source.last >= count


def test_steps_say_what_they_mean() -> None:
    steps = tuple((10 * at, at) for at in range(1, 40))
    assert [file_frame(steps, frame) for frame in (0, 9, 10, 19, 20, 395)] == [0, 9, 11, 20, 22, 434]
