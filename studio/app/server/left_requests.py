"""Answers that are computed and that a browser does not wait for any more: what computes them stops."""

import asyncio
import contextlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studio.app.server.viewers_budget import COMPUTED
from studio.results.inspection.wanted import IS_WANTED, LeftError


class LeftRequests:
    """ASGI middleware: while an answer is computed it listens whether the connection is still there."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "GET" or not COMPUTED.search(scope["path"]):
            await self.app(scope, receive, send)
            return
        has_left = asyncio.Event()
        messages: asyncio.Queue[Message] = asyncio.Queue()

        async def listen() -> None:
            while not has_left.is_set():
                message = await receive()
                if message["type"] == "http.disconnect":
                    has_left.set()
                messages.put_nowait(message)

        kept = IS_WANTED.set(lambda: not has_left.is_set())
        listening = asyncio.create_task(listen())
        try:
            with contextlib.suppress(LeftError):
                await self.app(scope, messages.get, send)
        finally:
            IS_WANTED.reset(kept)
            listening.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await listening
