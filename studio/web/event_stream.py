"""One stream of events to everyone who watches: `WebSocket /api/events`.

The worker's queue is emptied by one task; each event is encoded once and offered to every watcher. A
watcher keeps at most `LIMIT` messages: a newer one of the same kind takes the older one's place (one state,
one message a layer), and beyond the limit the oldest goes and is counted, so a sleeping browser costs
nothing and slows nobody.
"""

import asyncio
import queue
from collections import OrderedDict
from typing import TYPE_CHECKING

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from studio.web.event_encoding import as_json, key_of, message_of
from studio.web.windows import WindowInQuery
from studio.worker.events import Event, SettingsApplied, StateChanged
from studio.worker.watchers import Subscription

if TYPE_CHECKING:
    from studio.web.doors import Control

router = APIRouter(tags=["events"])

LIMIT = 256


class Watcher:
    """One window's messages that have not been sent yet. Used from the event loop only."""

    def __init__(self, limit: int = LIMIT, window: str = "") -> None:
        self.dropped = 0
        self.window = window
        self._limit = limit
        self._number = 0
        self._waiting: OrderedDict[object, str] = OrderedDict()
        self._something = asyncio.Event()

    def offer(self, key: tuple | None, text: str) -> None:
        """Keep a message; never waits."""
        self._number += 1
        slot = key if key is not None else self._number
        self._waiting.pop(slot, None)
        self._waiting[slot] = text
        if len(self._waiting) > self._limit:
            self._waiting.popitem(last=False)
            self.dropped += 1
        self._something.set()

    async def next(self) -> str:
        """The oldest message that still stands; after a loss, first a message that says how much was lost."""
        while not self._waiting:
            self._something.clear()
            await self._something.wait()
        if self.dropped:
            lost, self.dropped = self.dropped, 0
            return as_json({"type": "dropped", "session": "", "run": "", "count": lost})
        return self._waiting.popitem(last=False)[1]


class EventStream:
    """Takes the worker's events and the web's own messages to all watchers."""

    def __init__(self, control: "Control") -> None:
        self._control = control
        self._watchers: set[Watcher] = set()
        self._settings: dict[str, object] | None = None
        self._task: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self) -> None:
        """Begin to empty the worker's queue; call on the event loop."""
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.create_task(self._pump(self._control.subscribe()))

    async def stop(self) -> None:
        """End at once."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    def watch(self, window: str = "") -> Watcher:
        """A new watcher, greeted with the present state and settings. window : that it belongs to, "" for none."""
        watcher = Watcher(window=window)
        for message in (message_of(self._control.state), self._settings):
            if message is not None:
                watcher.offer(key_of(message), as_json(message))
        self._watchers.add(watcher)
        return watcher

    def leave(self, watcher: Watcher) -> None:
        """Forget a watcher."""
        self._watchers.discard(watcher)

    def windows(self) -> set[str]:
        """The windows that watch."""
        return {watcher.window for watcher in self._watchers}

    def publish(self, message: dict[str, object], window: str | None = None) -> None:
        """Send a message of the web's own to one window, or to all (None); from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._offer, message, window)

    def session_changed(self, session: str, run: str = "") -> None:
        """Tell all pages that a session is not as it was; "" for the list of them. run : that it concerns, if one."""
        self.publish({"type": "sessions", "session": session, "run": run})

    def _offer(self, message: dict[str, object], window: str | None = None) -> None:
        watchers = [watcher for watcher in self._watchers if window in (None, watcher.window)]
        if not watchers:
            return
        text, key = as_json(message), key_of(message)
        for watcher in watchers:
            watcher.offer(key, text)

    def _take(self, event: Event) -> None:
        message = message_of(event)
        if isinstance(event, SettingsApplied):
            self._settings = message
        elif isinstance(event, StateChanged) and event.state == "idle":
            self._settings = None
        self._offer(message)

    async def _pump(self, source: Subscription) -> None:
        try:
            while True:
                self._take(await source.next())
                # A flood of events must not keep the loop from everything else.
                await asyncio.sleep(0)
        except queue.Empty:
            return
        finally:
            source.close()


@router.websocket("/api/events")
async def events(socket: WebSocket, window: WindowInQuery = "") -> None:
    """Every event as one JSON text message, state and settings first; what a browser sends is ignored. Of the
    `scene` events only those of `window`'s own scene.
    """
    stream: EventStream = socket.app.state.doors.events
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
            await socket.send_text(await watcher.next())
    except WebSocketDisconnect:
        return
