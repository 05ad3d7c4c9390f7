"""What our pages may load, run and contact, sent with every answer.

Our own pages have no inline script or style sheet and contact nothing but this server (style attributes are
allowed: the charts' tooltips are made of them). viser's client is one file
with everything inlined (and WebAssembly), so `/scene` has a wider policy; `connect-src 'self'` there
defeats the client's `?websocket=ws://elsewhere`.
"""

import base64
import hashlib

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from studio.app.server.error_responses import PAGE_STYLE

_ERROR_PAGE_STYLE = base64.b64encode(hashlib.sha256(PAGE_STYLE.encode()).digest()).decode()
PAGE_POLICY = (
    f"default-src 'none'; script-src 'self'; style-src 'self' 'sha256-{_ERROR_PAGE_STYLE}'; "
    "style-src-attr 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; "
    "frame-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
SCENE_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob: data:; "
    "worker-src blob: data:; style-src 'unsafe-inline'; img-src blob: data: 'self'; font-src data: blob:; "
    "connect-src 'self' data: blob:; frame-ancestors 'self'"
)


def policy_of(path: str) -> str:
    """The Content-Security-Policy of an address."""
    return SCENE_POLICY if path == "/scene" or path.startswith("/scene/") else PAGE_POLICY


class PolicyHeaders:
    """ASGI middleware: puts the policy on every answer, refusals and errors included."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, adding headers to the answer."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def send_with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["content-security-policy"] = policy_of(scope["path"])
                headers["x-content-type-options"] = "nosniff"
                headers["referrer-policy"] = "no-referrer"
                headers["cross-origin-resource-policy"] = "same-origin"
                headers["cross-origin-opener-policy"] = "same-origin"
                # Assets are kept by the browser, which asks each time whether they changed.
                fresh = "no-cache" if scope["path"].startswith("/assets/") else "no-store"
                headers.setdefault("cache-control", fresh)
            await send(message)

        await self.app(scope, receive, send_with_policy)
