"""One scene per window of the studio: built when its window first needs it, closed when the window is gone."""

import logging
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

from studio.app.scene.model import LayerPlayback, Selection
from studio.app.scene.scene_server import SceneServer
from studio.foundations.errors import StudioError
from studio.foundations.memory import give_back_freed_memory
from studio.operations.jobs.control import StudioControl
from studio.sessions.workspace import Workspace

MOST_SCENES = 32
"""A scene takes two threads, six file descriptors and about 25 MB with four cameras of 640 × 480."""
TWIN = "-tried"
"""What is added to a window's name for its second scene, which shows trials."""
GRACE_SECONDS = 60.0
"""Seconds that a scene outlives its window, so that a reloaded page finds it unchanged."""
_LOG = logging.getLogger(__name__)


class TooManyScenesError(StudioError, status=503, code="windows"):
    """Raised when too many windows show a scene."""


@dataclass(slots=True)
class _Entry:
    """is_led : whether it shows what another window's scene leads it to (`SceneServer.lead`)."""

    scene: SceneServer
    used: float
    bare: bool
    is_led: bool = False


class WindowScenes:
    """The scenes of a workspace by the names of their windows; may be used from any thread.

    process : the tracking process, which all windows share. most : scenes at a time. `grace` : seconds for which a
    scene without its window is kept.
    """

    def __init__(
        self,
        workspace: Workspace,
        process: StudioControl,
        *,
        most: int = MOST_SCENES,
        grace: float = GRACE_SECONDS,
    ) -> None:
        self._workspace, self._process, self._most, self.grace = workspace, process, most, grace
        self._entries: dict[str, _Entry] = {}
        self._lock = threading.Lock()
        self._stopped = False
        self._moved: Callable[[str, Selection, LayerPlayback], None] = lambda window, shown, layers: None

    def watch(self, moved: Callable[[str, Selection, LayerPlayback], None]) -> None:
        """Call `moved` with the window, what it shows and how it plays layers when a scene's own controls, playback or
        the tracking move it, in that scene's thread.
        """
        self._moved = moved

    def scene(self, window: str, bare: bool = False) -> SceneServer:
        """The scene of a window, built where there is none yet (that blocks for some 30 ms). bare : without controls,
        for who may only look.

        Raises TooManyScenesError when no other scene can make room.
        """
        with self._lock:
            entry = self._entries.get(window)
            if entry is None:
                self._make_room(bare)
                scene = SceneServer(
                    self._workspace,
                    self._process,
                    lambda shown, layers: self._moved(window, shown, layers),
                    bare=bare or window.endswith(TWIN),
                )
                entry = self._entries[window] = _Entry(scene, 0.0, bare)
            entry.used = time.monotonic()
            return entry.scene

    def twin(self, window: str) -> SceneServer | None:
        """The scene that shows trials beside a window's own, None while there is none."""
        entry = self._entries.get(window + TWIN)
        return entry.scene if entry is not None and entry.is_led else None

    def split(self, window: str, is_split: bool) -> None:
        """Let a window have a second scene for trials, beside its own, or no longer. Raises as `scene`."""
        leader = self.scene(window)
        if not is_split:
            if (entry := self._entries.get(window + TWIN)) is not None:
                entry.is_led = False
            return leader.lead(None)
        # It takes one of the places that its window takes one of.
        leader.lead(self.scene(window + TWIN, self._entries[window].bare))
        self._entries[window + TWIN].is_led = True

    def open_scenes(self) -> dict[str, SceneServer]:
        return {window: entry.scene for window, entry in list(self._entries.items())}

    def close_unused(self, windows: Collection[str]) -> None:
        """Close the scenes that had no viewer and no window for a while. windows : open ones."""
        now = time.monotonic()
        with self._lock:
            for window, entry in self._entries.items():
                if window in windows or entry.scene.is_viewed:
                    entry.used = now
            gone = [window for window, entry in self._entries.items() if now - entry.used > self.grace]
            for window in gone:
                if (
                    window.endswith(TWIN)
                    and (own := self._entries.get(window.removesuffix(TWIN))) is not None
                ):
                    own.scene.lead(None)
            closing = [self._entries.pop(window) for window in gone]
        while closing:
            _close(closing.pop())
        if gone:
            give_back_freed_memory()

    def stop(self) -> None:
        """Close all scenes, for good."""
        with self._lock:
            self._stopped = True
            closing, self._entries = list(self._entries.values()), {}
        for entry in closing:
            _close(entry)

    def _make_room(self, bare: bool) -> None:
        if self._stopped:
            raise StudioError("The studio is closing.", "Start it again.")
        mine = {name: entry for name, entry in self._entries.items() if entry.bare or not bare}
        # Half of the places are kept for who may change something.
        most = self._most // 2 if bare else self._most
        if len(mine) < most:
            return
        idle = [name for name, entry in mine.items() if not entry.scene.is_viewed]
        if not idle:
            raise TooManyScenesError(
                f"{most} windows show a scene already, which is as many as the studio serves"
                f"{' to viewers' if bare else ''}.",
                "Close a window that is no longer needed, then load this one again.",
            )
        _close(self._entries.pop(min(idle, key=lambda name: self._entries[name].used)))


def _close(entry: _Entry) -> None:
    try:
        entry.scene.stop()
    except Exception:
        _LOG.exception("A scene could not be closed.")
