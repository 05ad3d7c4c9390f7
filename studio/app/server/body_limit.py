"""A limit on what a request may carry, counted as it arrives (the Content-Length header is only a promise).

Upload routes stream to disk and count for themselves; everything else is small JSON.
"""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studio.app.server.error_responses import TooLargeError, error_response

JSON_LIMIT = 1_000_000
DRAINED = 16_000_000
UPLOAD_PREFIX = "/api/uploads"


class BodyLimit:
    """ASGI middleware: refuses bodies over `limit` bytes, except under the upload routes."""

    def __init__(self, app: ASGIApp, *, limit: int = JSON_LIMIT) -> None:
        self.app = app
        self.limit = limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["path"].startswith(UPLOAD_PREFIX):
            await self.app(scope, receive, send)
            return
        too_large = TooLargeError(
            f"The request carries more than {self.limit} bytes.", "Send less at a time."
        )
        # Read here, because a route's own reading would answer for an error of ours. What is somewhat too large
        # is read to its end: a browser that is cut off while it sends never hears why.
        body, arrived, more = bytearray(), 0, True
        while more and arrived <= self.limit + DRAINED:
            message = await receive()
            if message["type"] == "http.disconnect":
                return
            chunk = message.get("body", b"")
            arrived += len(chunk)
            body += chunk if arrived <= self.limit else b""
            more = message.get("more_body", False)
        if arrived > self.limit:
            await error_response(too_large)(scope, receive, send)
            return
        given = False

        async def replay() -> Message:
            nonlocal given
            if given:
                return await receive()
            given = True
            return {"type": "http.request", "body": bytes(body), "more_body": False}

        await self.app(scope, replay, send)
