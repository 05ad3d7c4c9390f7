"""A viewer without a screen: it connects to the scene as a browser does, receives everything and draws nothing.

It measures the cost of an open scene to the tracking. A browser's own drawing is not included: almost nothing with a
graphics card, up to a whole core in software.
"""

import contextlib
import threading
from collections.abc import Mapping

import msgspec
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from studio.foundations.errors import StudioError

PATIENCE_SECONDS = 20.0
CAMERA: dict[str, object] = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (3.0, 3.0, 1.5),
    "fov": 0.8,
    "near": 0.01,
    "far": 1000.0,
    "image_height": 720,
    "image_width": 1280,
    "look_at": (0.0, 0.0, 1.0),
    "up_direction": (0.0, 0.0, 1.0),
}
"""A browser's first message about its view; viser counts it as a client from then on."""


class LightViewer:
    """port, headers : of the scene, see `SceneServer`. messages, size : number and bytes received so far."""

    def __init__(self, port: int, headers: Mapping[str, str]) -> None:
        self.messages = self.size = 0
        self._connected = threading.Event()
        self._socket = connect(
            f"ws://127.0.0.1:{port}",
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            additional_headers=dict(headers),
            compression=None,
            max_size=None,
            proxy=None,
            ping_interval=None,
        )
        self._thread = threading.Thread(target=self._take_all, name="light-viewer", daemon=True)
        self._thread.start()
        self._socket.send(msgspec.msgpack.encode(CAMERA))
        if not self._connected.wait(PATIENCE_SECONDS):
            self.close()
            raise StudioError("The scene sends nothing to a viewer.", "See the log.")

    def close(self) -> None:
        self._socket.close()
        self._thread.join()

    def _take_all(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for content in self._socket:
                self.messages += 1
                self.size += len(content)
                self._connected.set()
