"""What viser's server tells the browser, read off the page's own socket: point clouds, visibility, the camera."""

from collections.abc import Callable

import msgspec
import numpy as np
from playwright.sync_api import Page, WebSocket
from scene_messages import decoded


class SceneWire:
    """Keeps the newest of each thing that the browser was told to draw. viewer : from where it said that it looks;
    eye : that and what it looks at; lens : field of view and width over height.
    shadows : whether lamps cast any. of_trials : of the window's second scene, else of its own.
    """

    def __init__(self, page: Page, *, of_trials: bool = False) -> None:
        self._of_trials = of_trials
        self.clouds: dict[str, np.ndarray] = {}
        self.visible: dict[str, bool] = {}
        self.camera_moves = 0
        self.shadows = True
        self.viewer: tuple[float, ...] = ()
        self.eye: tuple[float, ...] = ()
        self.lens = 0.0, 0.0
        self._raw: list[bytes | str] = []
        page.on("websocket", self._opened)

    def _opened(self, socket: WebSocket) -> None:
        if "/scene/" in socket.url and socket.url.endswith("-tried") == self._of_trials:
            socket.on("framereceived", lambda content: self._raw.append(content))
            socket.on("framesent", self._sent)

    def _sent(self, content: bytes | str) -> None:
        message = msgspec.msgpack.decode(content) if isinstance(content, bytes) else {}
        if isinstance(message, dict) and message.get("type") == "ViewerCameraMessage":
            self.viewer = tuple(message["position"])
            self.eye = (*self.viewer, *message["look_at"])
            self.lens = message["fov"], message["image_width"] / message["image_height"]

    def read(self) -> "SceneWire":
        """Take in what came since the last time; returns itself."""
        raw, self._raw[:] = list(self._raw), []
        for content in raw:
            if isinstance(content, bytes):
                for message in decoded(content):
                    self._take(message)
        return self

    def layers(self) -> dict[int, np.ndarray]:
        """The clouds that are shown, (N, 3) metres by layer number."""
        self.read()
        prefix = "/particles/layer "
        return {
            int(name.removeprefix(prefix)): points
            for name, points in self.clouds.items()
            if name.startswith(prefix) and self.visible.get(name, True)
        }

    def shown(self, prefix: str) -> bool:
        """Whether any node under a name is shown."""
        self.read()
        return any(visible for name, visible in self.visible.items() if name.startswith(prefix))

    def _take(self, message: dict) -> None:
        kind, name = message.get("type"), message.get("name", "")
        if kind == "PointCloudMessage":
            self._points(name, message["props"])
        elif kind == "SceneNodeUpdateMessage":
            self._points(name, message["updates"])
        elif kind == "SetSceneNodeVisibilityMessage":
            self.visible[name] = message["visible"]
        elif kind == "SetCameraPositionMessage":
            self.camera_moves += 1
        elif kind == "EnableLightsMessage":
            self.shadows = message["cast_shadow"]
        elif kind == "RemoveSceneNodeMessage":
            self.clouds.pop(name, None)
            self.visible.pop(name, None)

    def _points(self, name: str, changes: dict) -> None:
        points = changes.get("points")
        if isinstance(points, np.ndarray) and name.startswith("/particles/"):
            self.clouds[name] = points.reshape(-1, 3)


def until(page: Page, condition: Callable[[], object], patience: float = 60.0) -> None:
    """Wait for a state that only Python can see, letting the browser's events in meanwhile."""
    for _ in range(round(patience * 25)):
        if condition():
            return
        page.wait_for_timeout(40)
    raise AssertionError("it never came about")
