"""Readers of live cameras: states, back-off, pairing; the clock only moves when it is set."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from studio.footage.capture.camera_addresses import CameraAddress, camera_address
from studio.footage.capture.camera_streams import Shot, Wait
from studio.footage.capture.live_cameras import (
    BEHIND_SECONDS,
    SILENCE_SECONDS,
    LiveCamera,
    LiveCameras,
    furthest,
    paired,
    spread_figures,
)
from studio.foundations.errors import FootageError

PIXELS = np.zeros((4, 6, 3), np.uint8)
STEP = 1.0 / 30.0


def shot(came: float) -> Shot:
    return Shot(PIXELS, b"", came)


def shots(*times: float) -> tuple[Shot, ...]:
    return tuple(map(shot, times))


class Clock:
    now = 100.0

    def __call__(self) -> float:
        return self.now


class Script:
    """Streams as they are written down: each opening gives pictures or an error."""

    def __init__(self, clock: Clock, *openings: Sequence[float] | FootageError) -> None:
        self.clock, self.openings, self.waits = clock, list(openings), list[float]()
        self.camera: LiveCamera

    def open(self, address: CameraAddress, wait: Wait) -> Iterator[Shot]:
        if not self.openings:
            self.camera.stop()
            return
        opening = self.openings.pop(0)
        if isinstance(opening, FootageError):
            raise opening
        for came in opening:
            self.clock.now = came
            yield shot(came)


def scripted(
    *openings: Sequence[float] | FootageError, place: str = "/dev/video0"
) -> tuple[LiveCamera, Clock]:
    clock = Clock()
    script = Script(clock, *openings)
    address = CameraAddress("cam1", "replay" if place == "replay" else "usb", place, place)
    script.camera = LiveCamera(address, clock=clock, open_camera=script.open)
    return script.camera, clock


def waits_of(camera: LiveCamera, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What the camera waits between openings, without waiting."""
    waited: list[float] = []
    stopping = camera._stopping
    monkeypatch.setattr(stopping, "wait", lambda seconds: waited.append(seconds) or stopping.is_set())
    return waited


def test_a_camera_that_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    camera, clock = scripted([100.0 + k * STEP for k in range(31)])
    assert camera.standing.state == "connecting"
    waits_of(camera, monkeypatch)
    camera.run()
    found = camera.standing
    assert (found.state, found.pictures, found.width, found.height) == ("running", 31, 6, 4)
    assert found.fps == pytest.approx(30.0)
    assert found.age == pytest.approx(0.0)
    clock.now += SILENCE_SECONDS + 0.5
    found = camera.standing
    assert found.state == "stopped"
    assert found.age == pytest.approx(SILENCE_SECONDS + 0.5)
    assert found.in_words == "cam1: stopped for 1.5 s, last picture 1.5 s old"
    assert found.message


def test_a_broken_stream_is_opened_again_later_and_later(monkeypatch: pytest.MonkeyPatch) -> None:
    away = [FootageError("Camera cam1 is away.", "Look.") for _ in range(7)]
    camera, _ = scripted(*away, [200.0, 200.1], FootageError("Gone.", "Look."))
    waited = waits_of(camera, monkeypatch)
    camera.run()
    assert waited[:7] == [0.5, 1.0, 2.0, 4.0, 8.0, 8.0, 8.0]
    assert waited[7:9] == [0.25, 0.5], "it had run, so it is soon tried again"
    assert camera.standing.pictures == 2


def test_what_a_library_throws_does_not_end_a_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    camera, _ = scripted()
    tried: list[int] = []

    def faulty(address: CameraAddress, wait: Wait) -> Iterator[Shot]:
        tried.append(1)
        if len(tried) == 3:
            camera.stop()
        raise MemoryError("a secret address")

    camera._open = faulty
    waits_of(camera, monkeypatch)
    camera.run()
    assert len(tried) == 3
    assert camera.standing.message == "Camera cam1 cannot be read (MemoryError)."


def test_a_replayed_video_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    camera, _ = scripted([100.0, 100.1], place="replay")
    waits_of(camera, monkeypatch)
    camera.run()
    assert camera.standing.state == "ended"


def test_nearest_pictures_are_paired() -> None:
    recent = {"a": shots(1.0, 1.0 + STEP, 1.0 + 2 * STEP), "b": shots(1.010, 1.010 + STEP)}
    found = paired(recent, (), STEP, after=0.0)
    assert {name: one.came for name, one in found.shots.items()} == {"a": 1.0 + STEP, "b": 1.010 + STEP}
    assert found.spread == pytest.approx(0.010)
    assert found.lagging == ""
    assert paired(recent, (), STEP, after=1.010 + STEP) is None, "nothing is paired twice"
    assert paired({}, ("a",), STEP, 0.0) is None


def test_pictures_far_apart_are_reported_with_the_lagging_camera() -> None:
    recent = {"a": shots(1.0), "b": shots(1.001), "c": shots(1.030)}
    found = paired(recent, (), STEP, after=0.0)
    assert found.lagging == "c"
    assert found.spread == pytest.approx(0.030)
    assert furthest({"a": 1.0, "b": 1.02}) == "b", "of two the later"


def test_free_running_cameras_are_never_more_than_half_a_frame_apart() -> None:
    """Two cameras of one rate and any phase, their pictures as they come: a set waits for the nearer picture."""
    rng = np.random.default_rng(3)
    for phase in rng.uniform(0.0, STEP, 12):
        clock = Clock()
        one, other = (
            LiveCamera(camera_address(name, f"/dev/video{number}"), clock=clock)
            for number, name in enumerate(("a", "b"))
        )
        cameras, after, spreads = LiveCameras((one, other), clock), 0.0, list[float]()
        times = sorted(
            [(100.0 + k * STEP, one) for k in range(40)]
            + [(100.0 + phase + k * STEP, other) for k in range(40)]
        )
        for came, camera in times:
            clock.now = came
            camera._take(shot(came))
            found = cameras.newest_set(after, 30.0)
            if found is not None:
                after = max(one.came for one in found.shots.values())
                spreads.append(found.spread)
        assert len(spreads) >= 19
        assert max(spreads) <= 0.5 * STEP + 1e-9
        assert cameras.spreads.apart == 0


def test_a_camera_that_hangs_is_left_out_and_comes_back() -> None:
    clock = Clock()
    one, other = (
        LiveCamera(camera_address(name, f"/dev/video{n}"), clock=clock) for n, name in enumerate("ab")
    )
    cameras = LiveCameras((one, other), clock)
    assert cameras.newest_set(0.0, 30.0) is None, "no set without one that never ran"
    for camera in (one, other):
        camera._take(shot(100.0))
    assert cameras.newest_set(0.0, 30.0) is not None
    clock.now = 100.0 + BEHIND_SECONDS + 0.1
    one._take(shot(clock.now))
    found = cameras.newest_set(100.0, 30.0)
    assert found.left_out == ("b",)
    assert list(found.shots) == ["a"]
    clock.now += 0.01
    other._take(shot(clock.now))
    found = cameras.newest_set(100.0, 30.0)
    assert found.left_out == ()


def test_figures_of_spreads() -> None:
    found = spread_figures(np.array([0.001, 0.002, 0.030]), ["", "", "cam2"])
    assert (found.median, found.worst, found.apart, found.lagging) == (
        pytest.approx(2.0),
        pytest.approx(30.0),
        1,
        "cam2",
    )
    assert "camera cam2 lags" in found.in_words
    assert spread_figures(np.zeros(0), []).in_words == "no complete set of pictures arrived"
