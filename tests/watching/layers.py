"""Layers being played: how often places are sent and drawn, beside how often the same browser draws the scene orbited.

What is sent is counted on a socket without a browser, so that no slow browser holds it up; the server's processor time
is that of the same stretch. A browser in software is measured after it.
"""

import math
import threading
import time
from pathlib import Path

from playwright.sync_api import Browser
from sample_walk import copy_of_walk
from scene_messages import decoded
from studio_page import StudioPage
from studio_server import StudioServer
from tracked_runs import finish
from websockets.exceptions import ConnectionClosed

from studio.runs.new_run import prepare_run
from watching.drawing import Drawing, cloud_sizes, watched
from watching.figures import Figures, cpu_seconds
from watching.windows import connected

PARTICLES = 100, 1000
RATES = 1, 3, 10
SECONDS = 8.0
SETTLE_SECONDS = 4.0
LIMBS = 5
"""Limb ends that carry particles in the walk."""


class _Counter:
    """A scene's socket; counts the messages with new places of particles."""

    def __init__(self, studio: StudioServer, window: str) -> None:
        self.times: list[float] = []
        self.bytes = 0
        self.socket = connected(studio, window)
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        try:
            for content in self.socket:
                assert isinstance(content, bytes)
                self.bytes += len(content)
                if any(_is_cloud(message) for message in decoded(content)):
                    self.times.append(time.monotonic())
        except ConnectionClosed:
            pass

    def close(self) -> None:
        self.socket.close()
        self._thread.join()


def _is_cloud(message: dict) -> bool:
    return message.get("name", "").startswith("/particles/") and "points" in (message.get("updates") or {})


def measure_layers(browser: Browser, folder: Path, seconds: float = SECONDS) -> Figures:
    """Play the layers of a frame of a hundred particles, then of a thousand."""
    found = Figures()
    session = copy_of_walk(folder / "workspace" / "walk")
    for particles in PARTICLES:
        run = prepare_run(session, name=f"with-{particles}", last=2, knobs={"particles": particles})
        finish(session, run)
    with StudioServer("serve", folder / "workspace") as studio, found.loaded():
        for particles in PARTICLES:
            for rate in RATES:
                _sent(studio, particles, rate, seconds, found)
        for particles in PARTICLES:
            _drawn(browser, studio, particles, seconds, found)
    return found


def _sent(studio: StudioServer, particles: int, rate: int, seconds: float, found: Figures) -> None:
    window = f"layers-{particles}-{rate}"
    studio.post("/api/scene/show", {"session": "walk", "run": f"with-{particles}", "frame": 1}, window=window)
    counter = _Counter(studio, window)
    try:
        studio.post("/api/scene/play-layers", {"playing": True, "rate": rate}, window=window)
        time.sleep(SETTLE_SECONDS)
        before, clock, size = cpu_seconds(studio.process.pid), time.monotonic(), counter.bytes
        time.sleep(seconds)
        spent, took = cpu_seconds(studio.process.pid) - before, time.monotonic() - clock
        sent = sum(1 for one in counter.times if clock <= one < clock + took)
        size = (counter.bytes - size) / took
        studio.post("/api/scene/play-layers", {"playing": False}, window=window)
    finally:
        counter.close()
    if not sent:
        found.wrong.append(f"of {particles} particles nothing was sent")
    found.lines.append(
        f"{particles} particles at {rate} layers a second: {sent / took:.1f} places a second sent,"
        f" {size / 1e3:.0f} kB a second, {100 * spent / took:.1f} % of a core by the server"
    )


def _drawn(browser: Browser, studio: StudioServer, particles: int, seconds: float, found: Figures) -> None:
    window = StudioPage(watched(browser), studio, open_at="about:blank")
    try:
        window.page.goto(f"{studio.address}&session=walk&run=with-{particles}&frame=1")
        window.see_scene()
        window.page.wait_for_timeout(1e3 * SETTLE_SECONDS)
        drawing = Drawing(window)
        box = window.page.locator("#scene").bounding_box()
        across, down = box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"]
        window.page.mouse.move(across, down)
        window.page.mouse.down()
        drawing.clear()
        began = time.monotonic()
        while (passed := time.monotonic() - began) < seconds:
            window.page.mouse.move(across + 60.0 * math.sin(3.0 * passed), down)
        orbited = len(drawing.pictures()) / passed
        window.page.mouse.up()
        play = "async (playing) => (await import('/assets/js/api.js')).post('/api/scene/play-layers', { playing })"
        window.page.evaluate(play, True)
        window.page.wait_for_timeout(1e3 * SETTLE_SECONDS)
        drawing.clear()
        began = time.monotonic()
        window.page.wait_for_timeout(1e3 * seconds)
        passed = time.monotonic() - began
        played, moved = drawing.pictures(), drawing.uploads(cloud_sizes(particles * LIMBS))
        window.page.evaluate(play, False)
    finally:
        window.close()
    found.lines.append(
        f"{particles} particles in the browser: {len(played) / passed:.1f} pictures a second while layers play"
        f" ({len(moved) / passed:.1f} of them with new places), {orbited:.1f} while the scene is orbited"
    )
