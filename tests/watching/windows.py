"""Ten windows on ten runs: each shows its own, and what looking costs a run that is tracked meanwhile.

The windows are sockets without a browser, as each brings its own processor where it is looked at: a page's events and
its scene, read to the end. One of them follows the run that is tracked. Stretches with and without them take turns, so
that other load disturbs both alike; each tracks the same frames as a run of its own, which ends by itself.
"""

import contextlib
import json
import statistics
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import viser
from playwright.sync_api import Browser
from sample_walk import copy_of_walk
from scene_messages import PanelReader
from studio_server import StudioServer
from tracked_runs import finish
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from studio.app.scene.window_scenes import GRACE_SECONDS
from studio.app.server.app import SWEEP_SECONDS
from studio.runs.new_run import prepare_run
from watching.figures import Figures, cpu_seconds

WINDOWS, STRETCHES, FRAMES = 10, 8, 12
"""STRETCHES : with and without the windows, together. FRAMES : tracked in each of them."""
PATIENCE = 300.0
"""Seconds without an event after which a stretch counts as failed."""
REST_SECONDS = 3.0
"""Windows that were sent nothing for so long have all that they show."""
SURVIVAL = "survival rate"
PARTICLES = 400


def survival_of(number: int) -> float:
    """The survival rate by which a run is known."""
    return round(0.31 + 0.04 * number, 2)


class Window:
    """A page's two sockets. name : of the run that it shows; number : by which its survival rate goes."""

    def __init__(self, studio: StudioServer, run: str) -> None:
        self.name, self.run, self.received = f"window-of-{run}", run, 0
        studio.post("/api/scene/show", {"session": "walk", "run": run, "follow": True}, window=self.name)
        self.scene = PanelReader(connected(studio, self.name))
        self.events = _socket(studio, f"/api/events?window={self.name}")
        self._threads = [threading.Thread(target=self._drain, args=(self.events,))]
        self._threads[0].start()

    def shows(self, survival: float) -> None:
        """Wait until the panel has the run's name and knob; what comes then is only counted."""
        self.scene.until(lambda seen: f"walk / {self.run}" in seen.words)
        self.scene.until(lambda seen: seen.knob(SURVIVAL) == survival)
        self._threads.append(threading.Thread(target=self._drain, args=(self.scene.socket,)))
        self._threads[-1].start()

    def _drain(self, socket: ClientConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            for content in socket:
                self.received += len(content)

    def close(self) -> None:
        self.events.close()
        self.scene.socket.close()
        for thread in self._threads:
            thread.join()


def connected(studio: StudioServer, window: str) -> ClientConnection:
    """The socket of a window's scene."""
    return _socket(studio, f"/scene/{window}", f"viser-v{viser.__version__}")


def _socket(studio: StudioServer, path: str, *protocols: str) -> ClientConnection:
    return connect(
        studio.origin.replace("http", "ws") + path,
        origin=studio.origin,  # pyright: ignore[reportArgumentType]
        additional_headers={"authorization": f"Bearer {studio.token}"},
        subprotocols=protocols or None,  # pyright: ignore[reportArgumentType]
        max_size=None,
        # What comes between two stretches waits unread; a full queue would answer no pings.
        max_queue=None,
        proxy=None,
        ping_interval=None,
        open_timeout=PATIENCE,
    )


@contextlib.contextmanager
def _open(studio: StudioServer, watched: str, found: Figures, sizes: list[int]) -> Iterator[None]:
    """Ten windows, the last on the run that is tracked."""
    runs = [*(f"run-{number}" for number in range(WINDOWS - 1)), watched]
    windows = [Window(studio, run) for run in runs]
    try:
        for number, window in enumerate(windows):
            try:
                window.shows(survival_of(number))
            except AssertionError as problem:
                found.wrong.append(f"{window.name}: {problem}")
        _rest(windows)
        before = windows[-1].received
        yield
        sizes.append(windows[-1].received - before)
    finally:
        for window in windows:
            window.close()


def _rest(windows: Sequence[Window]) -> None:
    """Wait until the windows have all that they show, pictures too: opening them is not what is measured."""
    before, deadline = -1, time.monotonic() + PATIENCE
    while (now := sum(window.received for window in windows)) != before and time.monotonic() < deadline:
        before = now
        time.sleep(REST_SECONDS)


def _pace(studio: StudioServer, run: str) -> float:
    """Track a run to its end. Returns the milliseconds that a frame took after the first one."""
    with contextlib.closing(_socket(studio, f"/api/events?window=clock-of-{run}")) as events:
        studio.post(f"/api/sessions/walk/runs/{run}/start")
        told = list[float]()
        while True:
            event = json.loads(events.recv(timeout=PATIENCE))
            if event["type"] == "frame" and event["run"] == run:
                told.append(time.monotonic())
            elif event["type"] == "state" and event["run"] == run and event["state"] == "failed":
                raise AssertionError(f"{run} failed: {event['message']}")
            elif event["type"] == "state" and event["run"] == run and event["state"] == "finished":
                break
    return 1e3 * (told[-1] - told[0]) / (len(told) - 1)


def measure_windows(
    browser: Browser | None, folder: Path, stretches: int = STRETCHES, frames: int = FRAMES
) -> Figures:
    """Track in stretches, with ten windows open in every second one."""
    del browser
    found = Figures()
    session = copy_of_walk(folder / "workspace" / "walk")
    for number in range(WINDOWS - 1):
        knobs = {"survival": survival_of(number), "particles": 20, "layers": 3}
        finish(session, prepare_run(session, name=f"run-{number}", last=2, knobs=knobs))
    knobs = {"survival": survival_of(WINDOWS - 1), "particles": PARTICLES}
    # The first one reads and compiles what no later one has to, and does not count.
    for number in range(stretches + 1):
        prepare_run(session, name=f"watched-{number}", last=frames, knobs=knobs)
    studio = StudioServer("serve", folder / "workspace")
    try:
        _pace(studio, "watched-0")
        paces: dict[bool, list[float]] = {True: [], False: []}
        costs: dict[bool, list[float]] = {True: [], False: []}
        sizes = list[int]()
        with found.loaded():
            for number in range(1, stretches + 1):
                is_watched, run = number % 4 in (2, 3), f"watched-{number}"
                if number % 4 == 0:
                    # The scenes of closed windows are kept for a while, in case they come back.
                    time.sleep(GRACE_SECONDS + 2 * SWEEP_SECONDS)
                with _open(studio, run, found, sizes) if is_watched else contextlib.nullcontext():
                    before = _spent(studio)
                    paces[is_watched].append(_pace(studio, run))
                    costs[is_watched].append(1e3 * (_spent(studio) - before) / frames)
        alone, seen = statistics.median(paces[False]), statistics.median(paces[True])
        found.lines += [
            f"a frame of {PARTICLES} particles: {alone:.1f} ms alone, {seen:.1f} ms with {WINDOWS} windows: ratio"
            f" {seen / alone:.3f} (medians of {stretches // 2} stretches of {frames} frames each)",
            f"processor time of the server a frame: {statistics.median(costs[False]):.1f} ms alone,"
            f" {statistics.median(costs[True]):.1f} ms with {WINDOWS} windows",
            f"sent to the window that follows: {statistics.median(sizes) / 1e3 / frames:.0f} kB a frame",
        ]
    finally:
        studio.stop()
    return found


def _spent(studio: StudioServer) -> float:
    """Processor seconds of the server without the tracking."""
    return cpu_seconds(studio.process.pid) - cpu_seconds(studio.worker().pid)
