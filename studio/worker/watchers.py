"""Events to all who watch, newest wins: a slow watcher loses what is out of date and holds nobody up.

Each watcher has a subscription of its own. An event takes the place of an older one of the same kind (one
state, one settings message, one result, one record for each layer of a frame), so what waits is bounded
however long a watcher sleeps; acknowledgements and log lines are kept one by one up to a limit.
"""

import asyncio
import contextlib
import queue
import threading
from collections import OrderedDict
from collections.abc import Hashable

from studio.worker.events import Acknowledged, Event, FrameFinished, LayerFinished, LogLine

LIMIT = 512


class Subscription:
    """One watcher's events that it has not taken yet. Reads like a `queue.Queue`; thread-safe."""

    def __init__(self, limit: int = LIMIT) -> None:
        self._limit = limit
        self._number = 0
        self._waiting: OrderedDict[Hashable, Event] = OrderedDict()
        self._something = threading.Condition()
        self._futures: list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]] = []
        self.closed = False

    def put(self, event: Event) -> None:
        """Offer an event; never waits."""
        with self._something:
            if self.closed:
                return
            self._number += 1
            key = _key(event) or ("one", self._number)
            self._waiting.pop(key, None)
            self._waiting[key] = event
            while len(self._waiting) > self._limit:
                self._waiting.popitem(last=False)
            self._wake()

    def get(self, block: bool = True, timeout: float | None = None) -> Event:
        """The oldest event that still stands. Raises queue.Empty after `timeout` seconds, or when closed and
        empty."""
        with self._something:
            if block:
                self._something.wait_for(lambda: self._waiting or self.closed, timeout)
            if not self._waiting:
                raise queue.Empty
            return self._waiting.popitem(last=False)[1]

    def get_nowait(self) -> Event:
        """Like `get` without waiting."""
        return self.get(block=False)

    async def next(self) -> Event:
        """Like `get` for an event loop. Raises queue.Empty when closed and empty."""
        while True:
            with self._something:
                if self._waiting:
                    return self._waiting.popitem(last=False)[1]
                if self.closed:
                    raise queue.Empty
                loop = asyncio.get_running_loop()
                future: asyncio.Future[None] = loop.create_future()
                self._futures.append((loop, future))
            await future

    def close(self) -> None:
        """Take no more events; those that wait can still be read."""
        with self._something:
            self.closed = True
            self._wake()

    def _wake(self) -> None:
        self._something.notify_all()
        for loop, future in self._futures:
            # A loop that has ended meanwhile has nobody left to wake.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(_settle, future)
        self._futures.clear()


class Watchers:
    """All subscriptions to one stream of events."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._subscriptions: list[Subscription] = []

    def subscribe(self) -> Subscription:
        """A new subscription; events from now on."""
        subscription = Subscription()
        with self._lock:
            self._subscriptions.append(subscription)
        return subscription

    def publish(self, event: Event) -> None:
        """Offer an event to all; closed subscriptions are forgotten."""
        with self._lock:
            self._subscriptions = [entry for entry in self._subscriptions if not entry.closed]
            for entry in self._subscriptions:
                entry.put(event)

    def close(self) -> None:
        """Close all subscriptions."""
        with self._lock:
            for entry in self._subscriptions:
                entry.close()


def _key(event: Event) -> Hashable:
    """Events of one key replace each other; None: each is kept."""
    if isinstance(event, LayerFinished):
        return (LayerFinished, event.record.layer, event.reannealed)
    if isinstance(event, FrameFinished):
        return (FrameFinished, event.reannealed)
    if isinstance(event, Acknowledged | LogLine):
        return None
    return type(event)


def _settle(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)
