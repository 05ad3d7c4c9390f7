"""From a slider's move to the new cloud drawn, in a browser that draws in software, and the server's share of it.

The demo's run is paused at its newest frame; each move of the survival rate by the keyboard anneals that frame again.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
from playwright.sync_api import Browser, WebSocket
from scene_messages import decoded
from scene_wire import until
from stored_clouds import differing, stored_clouds
from studio_page import StudioPage
from studio_server import StudioServer

from watching.drawing import Drawing, cloud_sizes, watched
from watching.figures import Figures, spent

RUN = "/api/sessions/walk/runs/run-1"
FRAMES_BEFORE = 6
MOVES = 20
PARTS = (
    "browser, from the key to the move sent",
    "server and search, from the move sent to the last cloud received",
    "browser, from the last cloud received to it drawn",
)


class Wire:
    """When the window's scene sent a knob, and when clouds came; seconds since 1970."""

    def __init__(self, window: StudioPage) -> None:
        self.sent: list[float] = []
        self._came: list[tuple[float, bytes]] = []
        window.page.on("websocket", self._opened)

    def _opened(self, socket: WebSocket) -> None:
        if "/scene/" in socket.url:
            socket.on("framesent", self._was_sent)
            socket.on("framereceived", self._has_come)

    def _was_sent(self, content: bytes | str) -> None:
        message = msgspec.msgpack.decode(content) if isinstance(content, bytes) else {}
        if isinstance(message, dict) and message.get("type") == "GuiUpdateMessage":
            self.sent.append(time.time())

    def _has_come(self, content: bytes | str) -> None:
        if isinstance(content, bytes):
            self._came.append((time.time(), content))

    def clear(self) -> None:
        self.sent.clear()
        self._came.clear()

    def clouds(self) -> list[float]:
        """When messages with new places of particles came."""
        return [
            when
            for when, content in self._came
            for message in decoded(content)
            if str(message.get("name", "")).startswith("/particles/")
            and "points" in (message.get("props") or message.get("updates") or {})
        ]


@contextmanager
def paused_demo(browser: Browser, folder: Path) -> Iterator[tuple[StudioPage, Wire]]:
    """A window on the demo, its run paused after some frames and the last of them shown."""
    demo = StudioServer("demo", folder / "workspace")
    try:
        demo.post("/api/sessions/walk/runs", {"name": "run-1"})
        demo.post(f"{RUN}/start")
        demo.pace(0.1)
        demo.until(lambda state: state["done"] >= FRAMES_BEFORE)
        demo.post(f"{RUN}/pause")
        demo.until(lambda state: state["state"] == "paused")
        window = StudioPage(watched(browser), demo, open_at="about:blank")
        wire = Wire(window)
        window.page.goto(f"{demo.origin}/?token={demo.token}&session=walk&run=run-1")
        window.see_scene()
        window.key("End")
        window.until(
            "get('detail')?.frame === get('frame') && get('frame') === get('summary').frames.at(-1).frame"
        )
        yield window, wire
        window.close()
    finally:
        demo.stop()


def measure_slider(browser: Browser, folder: Path, moves: int = MOVES) -> Figures:
    """Move the slider so many times, each when the last answer is drawn."""
    found = Figures()
    with paused_demo(browser, folder) as (window, wire):
        drawing, frame = Drawing(window), window.get("frame")
        assert isinstance(frame, int)
        clouds = stored_clouds(window, frame)
        until(window.page, lambda: differing(window.wire.layers(), clouds) == set())
        sizes = cloud_sizes(len(clouds[0]))
        window.slider("survival rate").focus()
        _moved(window, wire, drawing, sizes, 0)
        first, whole, parts = list[float](), list[float](), list[tuple[float, ...]]()
        before = spent(window.studio.process.pid)
        with found.loaded():
            for number in range(1, moves + 1):
                key, drawn = _moved(window, wire, drawing, sizes, number)
                sent, came = 1e3 * wire.sent[0], 1e3 * wire.clouds()[-1]
                first.append(drawn[0] - key)
                whole.append(drawn[-1] - key)
                parts.append((sent - key, came - sent, drawn[-1] - came))
        after = spent(window.studio.process.pid)
        if differing(window.tried_wire.layers(), clouds) != set(clouds) - {0}:
            found.wrong.append("the clouds that are drawn at the end are not the new ones")
        if differing(window.wire.layers(), clouds) != set():
            found.wrong.append("the stored clouds do not stand beside the new ones")
        found.times("slider's move to the first new layer drawn", first)
        found.times("slider's move to the last new layer drawn", whole)
        for name, times in zip(PARTS, zip(*parts, strict=True), strict=True):
            found.times(f"of it {name}", times)
        per_move = [1e3 * (now - then) / moves for then, now in zip(before, after, strict=True)]
        found.lines.append(
            f"processor time a move: server and search {per_move[0]:.0f} ms, browser {per_move[1]:.0f} ms"
        )
    return found


def _moved(
    window: StudioPage, wire: Wire, drawing: Drawing, sizes: set[int], number: int
) -> tuple[float, list[float]]:
    """Move the slider by one step. Returns when, and when each new cloud was drawn; ms since 1970."""
    drawing.clear()
    wire.clear()
    window.page.keyboard.press("ArrowRight" if number % 2 else "ArrowLeft")
    while True:
        drawn = drawing.settled(sizes)
        work = window.get("work")
        if isinstance(work, dict) and work["state"] == "paused":
            return drawing.keys()[0], drawn
