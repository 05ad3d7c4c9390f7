"""viser behind our own address: its one-file client at `GET /scene/WINDOW/`, its socket relayed at `WebSocket
/scene/WINDOW` to the scene of that window. Without a window's name: the scene of all callers that send none.

The client derives its socket's address from the page's, without the trailing slash. Both come through the
access guard like everything else; the inner server listens on loopback and wants a secret header that only
this relay sends.
"""

import asyncio
import gzip
import hashlib
from functools import cache
from pathlib import Path

import msgspec
import viser
from fastapi import APIRouter, Request, Response, WebSocket
from starlette.responses import RedirectResponse
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from studio.app.server.access import VIEWING
from studio.app.server.app_state import AppState
from studio.app.server.windows import WindowInPath
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import read_file
from studio.foundations.package import assets_folder

router = APIRouter(tags=["scene"], include_in_schema=False)

SUBPROTOCOL_PREFIX = "viser-v"
TRY_AGAIN = 1013
VIEWERS_MESSAGES = frozenset(("ViewerCameraMessage",))
"""What a viewer's client may send on."""


class SceneMissingError(StudioError, status=500, code="scene"):
    """viser's client is not where its wheel puts it."""


@cache
def client_page() -> tuple[bytes, bytes, str]:
    """viser's client from the installed wheel, with our script put first: as it is, gzipped, and its tag."""
    path = Path(viser.__file__).parent / "client" / "build" / "index.html"
    if not path.is_file():
        raise SceneMissingError("viser's page is missing from its package.", "Install viser again.")
    own = b"<head><script>" + read_file(assets_folder() / "js" / "scene_context.js") + b"</script>"
    content = read_file(path).replace(b"<head>", own, 1)
    return content, gzip.compress(content, 6), f'"{hashlib.sha256(content).hexdigest()}"'


@router.get("/scene")
@router.get("/scene/{window}")
def scene_without_slash(request: Request) -> Response:
    """To the address with a slash, from which the client finds its socket."""
    return RedirectResponse(f"{request.url.path}/", status_code=308)


@router.get("/scene/")
@router.get("/scene/{window}/")
def scene_page(request: Request) -> Response:
    """viser's client, the same for every window."""
    plain, packed, tag = client_page()
    # The browser keeps the page and asks whether it changed: the client must be of the server's version.
    headers = {"cache-control": "no-cache", "etag": tag, "vary": "accept-encoding"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    if "gzip" in request.headers.get("accept-encoding", ""):
        return Response(packed, media_type="text/html", headers=headers | {"content-encoding": "gzip"})
    return Response(plain, media_type="text/html", headers=headers)


@router.websocket("/scene")
async def common_scene_socket(browser: WebSocket) -> None:
    """The scene of all callers that name no window."""
    await scene_socket(browser, "")


@router.websocket("/scene/{window}")
async def scene_socket(browser: WebSocket, window: WindowInPath) -> None:
    """Carry messages between a window and its own scene until either side ends."""
    app: AppState = browser.app.state.studio
    offered = [
        Subprotocol(name)
        for name in browser.scope.get("subprotocols", [])
        if name.startswith(SUBPROTOCOL_PREFIX)
    ]
    try:
        viewing = VIEWING.get()
        scene = await asyncio.to_thread(app.scenes.scene, window, viewing)
        inner = await connect(
            f"ws://127.0.0.1:{scene.port}",
            subprotocols=offered or None,
            additional_headers=dict(scene.relay_headers()),
            compression=None,
            max_size=None,
            proxy=None,
            ping_interval=None,
        )
    except StudioError as problem:
        await browser.close(TRY_AGAIN, problem.message)
        return
    except (OSError, InvalidHandshake, TimeoutError):
        await browser.close(TRY_AGAIN, "the scene cannot be reached")
        return
    async with inner:
        await browser.accept(subprotocol=inner.subprotocol)
        await _carry(browser, inner, viewing)


async def _carry(browser: WebSocket, inner: ClientConnection, viewing: bool) -> None:
    """Both directions at once; when one ends, the other is ended too."""
    ways = {
        asyncio.create_task(_inwards(browser, inner, viewing)),
        asyncio.create_task(_outwards(browser, inner)),
    }
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)


async def _inwards(browser: WebSocket, inner: ClientConnection, viewing: bool) -> None:
    """Browser to viser; of a viewer's messages those that say where it looks from."""
    while True:
        message = await browser.receive()
        if message["type"] == "websocket.disconnect":
            return
        content = message.get("bytes")
        if viewing and _kind(content) not in VIEWERS_MESSAGES:
            continue
        try:
            await inner.send(content if content is not None else message.get("text") or "")
        except ConnectionClosed:
            return


def _kind(content: bytes | None) -> str:
    """The type of a message of viser's client, "" for what is none."""
    try:
        kind: object = msgspec.msgpack.decode(content or b"", type=dict[str, object]).get("type")
    except msgspec.DecodeError:
        return ""
    return kind if isinstance(kind, str) else ""


async def _outwards(browser: WebSocket, inner: ClientConnection) -> None:
    """viser to browser; a slow browser slows this reading, and viser then keeps only the newest of each property."""
    try:
        async for content in inner:
            await (browser.send_text(content) if isinstance(content, str) else browser.send_bytes(content))
    except ConnectionClosed:
        pass
    code = inner.close_code if inner.close_code in (1000, 1001, 1002, 1008, 1011) else 1001
    await browser.close(code, inner.close_reason or "")
