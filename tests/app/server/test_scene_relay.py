"""viser comes through our address, and only through it."""

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path

import httpx
import msgspec
import pytest
import viser
import zstandard
from waiting import until
from web_doubles import (
    TOKEN,
    VIEWERS_TOKEN,
    RecordingControl,
    RecordingScenes,
    RecordingStage,
    Studio,
    cookie_header,
    let_in,
    serving,
)
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from studio.app.scene.guarded_server import GuardedServer
from studio.app.server.access import Tokens
from studio.app.server.app import build_app
from studio.foundations.package import assets_folder
from studio.sessions.workspace import Workspace

MARK = b"a label that only this scene has"
VISER = f"viser-v{viser.__version__}"
# viser takes a client for real when it tells where it looks from.
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": [1, 1, 1], "fov": 1.0, "near": 0.1,
    "far": 100.0, "image_height": 480, "image_width": 640, "look_at": [0, 0, 0], "up_direction": [0, 0, 1],
}  # fmt: skip


@pytest.fixture(scope="module")
def inner() -> Iterator[GuardedServer]:
    """A real viser server with one thing in it."""
    server = GuardedServer()
    server.scene.add_label("/mark-of-the-studio", MARK.decode())
    yield server
    server.stop()


@pytest.fixture
def relayed(tmp_path: Path, inner: GuardedServer) -> Iterator[Studio]:
    """The application in front of the real viser server."""
    workspace, control = Workspace(tmp_path), RecordingControl()
    scenes = RecordingScenes(RecordingStage(inner.get_port(), inner.relay_headers()))
    app = build_app(workspace, control, scenes, Tokens(TOKEN, VIEWERS_TOKEN))
    with serving(app) as base, let_in(base, TOKEN) as client:
        yield Studio(client, base, control, scenes, workspace, app, tmp_path / "log")


def opened(
    studio: Studio, path: str = "/scene", protocol: str = VISER, client: httpx.Client | None = None
) -> ClientConnection:
    """viser's client's socket. client : whose cookie it has, by default that of who may do everything."""
    return connect(
        studio.base.replace("http", "ws") + path,
        origin=studio.base,  # pyright: ignore[reportArgumentType]
        additional_headers={"cookie": cookie_header(client or studio.client)},
        subprotocols=[protocol],  # pyright: ignore[reportArgumentType]
        max_size=None,
        proxy=None,
    )


def unpacked(message: str | bytes) -> bytes:
    """What is inside one of viser's messages: 16 bytes of lengths, then msgpack under zstd."""
    assert isinstance(message, bytes)
    length = int.from_bytes(message[8:16], "little")
    return zstandard.ZstdDecompressor().decompress(message[16 : 16 + length])


def shows_the_mark(socket: ClientConnection) -> bool:
    """Whether the label arrives before the connection ends or falls silent."""
    try:
        while True:
            if MARK in unpacked(socket.recv(timeout=5)):
                return True
    except (ConnectionClosed, TimeoutError):
        return False


def test_the_client_comes_from_the_installed_wheel(relayed: Studio) -> None:
    page = relayed.client.get("/scene/")
    build = Path(viser.__file__).parent / "client" / "build" / "index.html"
    begin, own, end = page.content.partition(assets_folder().joinpath("js", "scene_context.js").read_bytes())
    assert own
    assert (begin + end).replace(b"<script></script>", b"", 1) == build.read_bytes()
    relayed.get("/scene/", headers={"if-none-match": page.headers["etag"]}, code=304)
    assert relayed.client.get("/scene").headers["location"] == "/scene/"


def test_the_scene_reaches_the_browser_under_viser_s_own_subprotocol(relayed: Studio) -> None:
    with opened(relayed) as socket:
        assert socket.subprotocol == VISER
        assert shows_the_mark(socket)


def test_a_slider_moved_in_the_browser_reaches_viser(relayed: Studio, inner: GuardedServer) -> None:
    slider = inner.gui.add_slider("survival", 0.1, 0.9, 0.1, 0.5)
    moved = threading.Event()

    @slider.on_update
    async def _(_: viser.GuiEvent) -> None:
        moved.set()

    update = {"type": "GuiUpdateMessage", "uuid": slider._impl.uuid, "updates": {"value": 0.7}}
    with opened(relayed) as socket:
        socket.recv(timeout=60)
        socket.send(msgspec.msgpack.encode(CAMERA))
        socket.send(msgspec.msgpack.encode(update))
        assert moved.wait(60.0)
    assert slider.value == 0.7
    slider.remove()


def test_of_a_viewer_s_client_only_where_it_looks_from_reaches_viser(
    relayed: Studio, inner: GuardedServer
) -> None:
    slider = inner.gui.add_slider("survival", 0.1, 0.9, 0.1, 0.5)
    update = {"type": "GuiUpdateMessage", "uuid": slider._impl.uuid, "updates": {"value": 0.7}}
    unread = [{"type": "ShareUrlRequest"}, {"type": "NoSuchMessage"}, {"type": 7}, [1, 2]]
    relayed.scenes.by_window["view-mine"] = relayed.scenes.plain
    with (
        let_in(relayed.base, VIEWERS_TOKEN) as viewer,
        opened(relayed, "/scene/mine", client=viewer) as socket,
    ):
        socket.recv(timeout=60)
        for message in (update, *unread, {**CAMERA, "fov": 0.5}, update):
            socket.send(msgspec.msgpack.encode(message))
        socket.send(b"no message at all")
        socket.send("text")
        socket.send(msgspec.msgpack.encode({**CAMERA, "fov": 0.25}))
        # What came last arrived: so would have what came before.
        until(lambda: any(abs(one.camera.fov - 0.25) < 1e-6 for one in inner.get_clients().values()))
    assert slider.value == 0.5
    slider.remove()


def test_another_version_s_client_is_turned_away(relayed: Studio) -> None:
    with opened(relayed, protocol="viser-v0.0.1") as socket:
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv(timeout=60)
        assert closed.value.rcvd.code == 1002


def test_viser_cannot_be_reached_around_the_relay(relayed: Studio, inner: GuardedServer) -> None:
    """A stranger on the loopback port, without the relay's secret, sees nothing of the scene."""
    stranger = connect(
        f"ws://127.0.0.1:{inner.get_port()}",
        subprotocols=[VISER],  # pyright: ignore[reportArgumentType]
        max_size=None,
        proxy=None,
    )
    with stranger:
        assert not shows_the_mark(stranger)
        with pytest.raises(ConnectionClosed):
            stranger.recv(timeout=20)
    friend = connect(
        f"ws://127.0.0.1:{inner.get_port()}",
        subprotocols=[VISER],  # pyright: ignore[reportArgumentType]
        additional_headers=inner.relay_headers(),
        max_size=None,
        proxy=None,
    )
    with friend:
        assert shows_the_mark(friend)
    for path in ("/scene/a/b", "/scene/no window", "/"):
        with pytest.raises(InvalidStatus):
            opened(relayed, path)


def test_the_inner_server_listens_on_loopback_and_opens_no_tunnel(inner: GuardedServer) -> None:
    assert inner.get_host() == "127.0.0.1"
    assert inner.request_share_url() is None


def test_without_a_scene_the_browser_is_asked_to_try_again(studio: Studio) -> None:
    with pytest.raises(InvalidStatus) as refused:
        opened(studio)
    assert refused.value.response.status_code in (403, 503)


def test_when_the_browser_leaves_viser_is_reported(relayed: Studio, inner: GuardedServer) -> None:
    sockets = [opened(relayed) for _ in range(3)]
    for socket in sockets:
        socket.recv(timeout=60)
        socket.close()

    async def gone() -> bool:
        for _ in range(200):
            if not inner._websock_server._live_connections:
                return True
            await asyncio.sleep(0.02)
        return False

    assert asyncio.run(gone())
