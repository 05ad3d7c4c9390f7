"""One stream of events to everyone who watches: `WebSocket /api/events`.

One task takes the tracking process's events; each is encoded once and offered to every watcher, as are the web's own
messages. A watcher is a coalescing queue, so a sleeping browser costs nothing and slows nothing down; what it lost
beyond the limit is counted and said.
"""

import asyncio
import queue
import threading
from collections.abc import Callable, Mapping, Sequence

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from studio.app.scene.scene_server import SceneServer
from studio.app.server.event_encoding import as_json, key_of, message_of
from studio.app.server.windows import WindowInQuery
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import (
    Event,
    FrameFinished,
    LayerFinished,
    RunState,
    SettingsApplied,
    StateChanged,
)
from studio.operations.jobs.tried_frames import TriedFrames
from studio.operations.jobs.watchers import Subscription
from studio.operations.layer_outlines import LayerOutlines

router = APIRouter(tags=["events"])

LIMIT = 256

Watcher = Subscription[str]
"""A window's messages, as text, that have not been sent yet."""


class EventStream:
    """Takes the worker's events and the web's own messages to all watchers. scenes : the open ones by window; layers,
    of which there are many, go to the windows whose scene shows their run. outlines : of the layers' clouds. tried :
    what was annealed again. under_way : gives what a new watcher is told besides, how the jobs stand.
    """

    def __init__(
        self,
        control: StudioControl,
        scenes: Callable[[], Mapping[str, SceneServer]] = lambda: {},
        outlines: LayerOutlines | None = None,
    ) -> None:
        self._control, self._scenes, self._outlines = control, scenes, outlines
        self.tried = TriedFrames()
        self.under_way: Callable[[], Sequence[dict[str, object]]] = list
        self._lock = threading.Lock()
        self._watchers: dict[Watcher, str] = {}
        self._settings: dict[str, object] | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to take the worker's events; call on the event loop."""
        self._task = asyncio.create_task(self._pump(self._control.subscribe()))

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    def watch(self, window: str = "") -> Watcher:
        """A new watcher, greeted with the present state, settings and jobs.

        window : that it belongs to, "" for none.
        """
        watcher = Watcher(LIMIT)
        with self._lock:
            for message in (message_of(self._control.state), self._settings, *self.under_way()):
                if message is not None:
                    watcher.put(as_json(message), key_of(message))
            self._watchers[watcher] = window
        return watcher

    def leave(self, watcher: Watcher) -> None:
        with self._lock:
            self._watchers.pop(watcher, None)

    def windows(self) -> set[str]:
        with self._lock:
            return set(self._watchers.values())

    def publish(self, message: dict[str, object], window: str | None = None) -> None:
        """Send a message to one window, or to all (None); from any thread."""
        elsewhere = self._elsewhere(message) if message["type"] == "layer" else set[str]()
        with self._lock:
            watchers = [
                watcher
                for watcher, of in self._watchers.items()
                if window in (None, of) and of not in elsewhere
            ]
        if watchers:
            text, key = as_json(message), key_of(message)
            for watcher in watchers:
                watcher.put(text, key)

    def _elsewhere(self, message: dict[str, object]) -> set[str]:
        """The windows that show another run than a message's."""
        run = message["session"], message["run"]
        shown = {window: scene.shown for window, scene in self._scenes().items() if window}
        return {window for window, seen in shown.items() if (seen.session, seen.run) != run}

    def session_changed(self, session: str, run: str = "") -> None:
        """Tell all pages that a session is not as it was; "" for the list of them. run : that it concerns, if one."""
        self.publish({"type": "sessions", "session": session, "run": run})

    async def _pump(self, source: Subscription[Event]) -> None:
        try:
            while True:
                event = await source.next()
                message = message_of(event)
                tried = self.tried.hear(event)
                if isinstance(event, FrameFinished):
                    message["trial"] = tried
                if isinstance(event, LayerFinished) and self._outlines is not None and self._watchers:
                    message["outline"] = self._outlines.of_event(event)
                if isinstance(event, SettingsApplied):
                    self._settings = message
                elif isinstance(event, StateChanged) and event.state is RunState.IDLE:
                    self._settings = None
                self.publish(message)
                # A flood of events must not keep the loop from everything else.
                await asyncio.sleep(0)
        except queue.Empty:
            return
        finally:
            source.close()


@router.websocket("/api/events")
async def events(socket: WebSocket, window: WindowInQuery = "") -> None:
    """Every event as one JSON text message; state, settings and jobs under way come first. What a browser sends is
    ignored. Of the `scene` events only those of `window`'s own scene.
    """
    stream: EventStream = socket.app.state.studio.events
    await socket.accept()
    watcher = stream.watch(window)
    listening = asyncio.create_task(_until_it_leaves(socket))
    sending = asyncio.create_task(_send_all(socket, watcher))
    try:
        await asyncio.wait({listening, sending}, return_when=asyncio.FIRST_COMPLETED)
    finally:
        stream.leave(watcher)
        listening.cancel()
        sending.cancel()
        await asyncio.gather(listening, sending, return_exceptions=True)


async def _until_it_leaves(socket: WebSocket) -> None:
    while (await socket.receive())["type"] != "websocket.disconnect":
        pass


async def _send_all(socket: WebSocket, watcher: Watcher) -> None:
    try:
        while True:
            text = await watcher.next()
            lost, watcher.dropped = watcher.dropped, 0
            if lost:
                await socket.send_text(as_json({"type": "dropped", "session": "", "run": "", "count": lost}))
            await socket.send_text(text)
    except WebSocketDisconnect:
        return
