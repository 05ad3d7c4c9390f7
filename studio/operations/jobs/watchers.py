"""The queue of a watcher: newest wins, so a slow watcher loses what is out of date and holds up nothing.

An entry takes the place of an older one of the same key (one state, one settings message, one result, one record for
each layer), so what waits is bounded however long a watcher sleeps; those without a key (acknowledgements, log lines)
are kept one by one up to a limit.
"""

import asyncio
import contextlib
import queue
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from studio.operations.jobs.events import Event

T = TypeVar("T")

LIMIT = 512


class Subscription(Generic[T]):
    """What one watcher has not taken yet. Reads like a `queue.Queue`, and from an event loop; thread-safe.

    wanted : which entries it takes; called in the thread of who offers them. dropped : how many were lost beyond the
    limit.
    """

    def __init__(self, limit: int = LIMIT, wanted: Callable[[T], bool] = lambda _: True) -> None:
        self._limit, self._wanted = limit, wanted
        self._number = 0
        self._waiting: OrderedDict[Hashable, T] = OrderedDict()
        self._something = threading.Condition()
        self._futures: list[tuple[asyncio.AbstractEventLoop, asyncio.Future[None]]] = []
        self.closed = False
        self.dropped = 0

    def put(self, entry: T, key: Hashable = None) -> None:
        """Offer an entry in the place of what has its key; never waits."""
        if not self._wanted(entry):
            return
        with self._something:
            if self.closed:
                return
            self._number += 1
            slot = self._number if key is None else key
            self._waiting.pop(slot, None)
            self._waiting[slot] = entry
            if len(self._waiting) > self._limit:
                self._waiting.popitem(last=False)
                self.dropped += 1
            self._wake()

    def get(self, block: bool = True, timeout: float | None = None) -> T:
        """The oldest entry that still stands. Raises queue.Empty after `timeout` seconds, or when closed and empty."""
        with self._something:
            if block:
                self._something.wait_for(lambda: self._waiting or self.closed, timeout)
            if not self._waiting:
                raise queue.Empty
            return self._waiting.popitem(last=False)[1]

    def get_nowait(self) -> T:
        """Like `get` without waiting."""
        return self.get(block=False)

    async def next(self) -> T:
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
        with self._something:
            self.closed, self._wanted = True, _nothing
            self._wake()

    def _wake(self) -> None:
        self._something.notify_all()
        for loop, future in self._futures:
            # A loop that has ended meanwhile has no one left to wake.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(_settle, future)
        self._futures.clear()


class Watchers:
    """All subscriptions to one stream of events."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._subscriptions: list[Subscription[Event]] = []

    def subscribe(self, wanted: Callable[[Event], bool] = lambda _: True) -> Subscription[Event]:
        """A new subscription; events from now on, those that are wanted."""
        subscription = Subscription[Event](wanted=wanted)
        with self._lock:
            self._subscriptions.append(subscription)
        return subscription

    def publish(self, event: Event) -> None:
        """Offer an event to all; closed subscriptions are forgotten."""
        with self._lock:
            self._subscriptions = [entry for entry in self._subscriptions if not entry.closed]
            for entry in self._subscriptions:
                entry.put(event, event.key)

    def close(self) -> None:
        with self._lock:
            for entry in self._subscriptions:
                entry.close()


def _nothing(_: object) -> bool:
    return False


def _settle(future: "asyncio.Future[None]") -> None:
    if not future.done():
        future.set_result(None)
