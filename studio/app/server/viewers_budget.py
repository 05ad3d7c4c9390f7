"""What viewers may take of the machine: it is the owner's search that must not wait for those who look.

Of requests that compute (the measure of masks, views of a search, a run as one page) one of all viewers' is worked on
at a time; while a run is tracked it is followed by a rest of `REST` times as long, so that viewers together take a
ninth of the time. Measures of masks, which take longest, step back besides (`foundations.low_priority`). Of pictures
`PICTURES_AT_ONCE` are drawn at a time, and of sockets there are `MOST_SOCKETS`. What cannot be served within
`PATIENCE_SECONDS` is refused.
"""

import asyncio
import re
import time
from collections.abc import Callable

from starlette.types import ASGIApp, Receive, Scope, Send

from studio.app.server.access import VIEWING
from studio.app.server.error_responses import error_response
from studio.foundations.errors import StudioError

COMPUTED = re.compile(
    r"/(masks/quality|shared\.html|subjects|entropies|walk|evaluation|compared-runs|calibration/export)$"
    r"|/views/[a-z-]+$"
)
PICTURE = re.compile(r"\.(jpg|png)$")
REST, PICTURES_AT_ONCE, MOST_SOCKETS = 8.0, 2, 64
LONGEST_REST_SECONDS, PATIENCE_SECONDS = 60.0, 30.0


class ViewersBusyError(StudioError, status=503, code="viewers"):
    """Too many viewers want something at once."""


class ViewersBudget:
    """ASGI middleware behind the access guard. tracking : whether a run is tracked just now."""

    def __init__(self, app: ASGIApp, *, tracking: Callable[[], bool]) -> None:
        self.app, self._tracking = app, tracking
        self._computing, self._drawing = asyncio.Semaphore(1), asyncio.Semaphore(PICTURES_AT_ONCE)
        self._sockets = 0
        self._rests = set[asyncio.Task[None]]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, at once or when it is its turn."""
        if not VIEWING.get():
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        elif COMPUTED.search(scope["path"]):
            await self._in_turn(self._computing, scope, receive, send)
        elif PICTURE.search(scope["path"]):
            await self._in_turn(self._drawing, scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._sockets >= MOST_SOCKETS:
            await send({"type": "websocket.close", "code": 1013, "reason": "too many viewers"})
            return
        self._sockets += 1
        try:
            await self.app(scope, receive, send)
        finally:
            self._sockets -= 1

    async def _in_turn(self, turns: asyncio.Semaphore, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await asyncio.wait_for(turns.acquire(), PATIENCE_SECONDS)
        except TimeoutError:
            wrong = ViewersBusyError("Too many viewers look at once.", "Try again in a moment.")
            await error_response(wrong)(scope, receive, send)
            return
        began = time.monotonic()
        try:
            await self.app(scope, receive, send)
        finally:
            rest = REST * (time.monotonic() - began) if turns is self._computing and self._tracking() else 0.0
            task = asyncio.create_task(_released(turns, min(rest, LONGEST_REST_SECONDS)))
            self._rests.add(task)
            task.add_done_callback(self._rests.discard)


async def _released(turns: asyncio.Semaphore, after: float) -> None:
    try:
        await asyncio.sleep(after)
    finally:
        turns.release()
