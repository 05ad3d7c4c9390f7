"""A viser server that only our own relay can talk to.

viser has no authentication and no check of origins, listens on every address by default and lets
any client open a public tunnel. Here it listens on the loopback address at a free port, refuses sockets
that do not carry a secret header (which only the web application's relay knows), and never opens a tunnel.
"""

import contextlib
import hmac
import secrets
import threading
from collections.abc import Generator

import rich
import viser
from viser.infra import WebsockClientConnection
from websockets.asyncio.server import ServerConnection

RELAY_HEADER = "X-Studio-Relay"
_POLICY_VIOLATION = 1008
_CONSOLE = threading.Lock()


class GuardedServer(viser.ViserServer):
    """viser on 127.0.0.1 at a free port, behind a secret. Building it blocks for some milliseconds: use a thread."""

    def __init__(self) -> None:
        self._relay_secret = secrets.token_urlsafe(32)
        with _quietly():
            super().__init__(host="127.0.0.1", port=0, label="Capture studio", verbose=False)
        # Appended after viser's own callbacks, all of which run before the first message is sent or read.
        self._websock_server.on_client_connect(self._refuse_strangers)
        # A client that connected before the guard was set is dropped here, and refused when it reconnects.
        self._websock_server.disconnect_all_clients()

    def relay_headers(self) -> dict[str, str]:
        """The headers that the relay must send when it opens the socket; never written to a log or a page."""
        return {RELAY_HEADER: self._relay_secret}

    @property
    def is_viewed(self) -> bool:
        return bool(self._connections())

    def request_share_url(self, verbose: bool = True) -> str | None:
        """None: the scene is never published."""
        return None

    def stop(self) -> None:
        """End the server and its threads."""
        with _quietly():
            super().stop()

    def _connections(self) -> dict[int, ServerConnection]:
        return self._websock_server._live_connections  # pyright: ignore[reportPrivateUsage] - viser offers none

    async def _refuse_strangers(self, client: WebsockClientConnection) -> None:
        connection = self._connections().get(client.client_id)
        if connection is None or connection.request is None:
            return
        shown = connection.request.headers.get_all(RELAY_HEADER)
        # Headers are bytes of any kind, and there may be several: whatever is not the one secret is refused.
        known = len(shown) == 1 and hmac.compare_digest(
            shown[0].encode("utf-8", "surrogatepass"), self._relay_secret.encode()
        )
        if not known:
            await connection.close(_POLICY_VIOLATION, "This socket is for the studio's relay only.")


@contextlib.contextmanager
def _quietly() -> Generator[None]:
    """Silences viser, which prints its own address and its end even when not verbose: a second address misleads."""
    # One at a time: two that overlap would leave the console silent for good.
    with _CONSOLE:
        console = rich.get_console()
        before, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = before
