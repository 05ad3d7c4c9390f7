"""The viser window: one scene that every viewer shares, behind the web application's relay.

Started and stopped by the web application (building viser blocks for a moment: in a thread). All methods
may be called from any thread; they post what is wished to the scene's own thread and return.
"""

from collections.abc import Callable
from dataclasses import fields

from studio.errors import SettingsError
from studio.export.task import Writer
from studio.scene.director import Director
from studio.scene.guarded_server import GuardedServer
from studio.scene.recording import record_scene
from studio.scene.scene_poses import ScenePoses
from studio.scene.view_options import Shown, ViewOptions
from studio.scene.wishes import Control
from studio.sessions.workspace import Workspace


class SceneStage:
    """The scene of a workspace. control : the tracking process as its owner sees it.

    record_scene : writes a run's scene as a recording, beside the one that is shown.
    """

    def __init__(self, workspace: Workspace, control: Control) -> None:
        self._workspace = workspace
        self._control = control
        self._server: GuardedServer | None = None
        self._director: Director | None = None
        self._watchers: list[Callable[[Shown], None]] = []
        self.record_scene: Writer = record_scene

    def start(self) -> int:
        """Build the scene; returns the loopback port of viser's server."""
        if self._server is None:
            self._server = GuardedServer()
            self._director = Director(self._server, self._workspace, self._control, self._moved)
            self._director.start()
        return self._server.get_port()

    def stop(self) -> None:
        """Close the scene; every viewer is disconnected."""
        if self._director is not None:
            self._director.stop()
        if self._server is not None:
            self._server.stop()
        self._server = self._director = None

    @property
    def port(self) -> int:
        """The inner server's loopback port, 0 while it is not running."""
        return self._server.get_port() if self._server else 0

    def relay_headers(self) -> dict[str, str]:
        """The secret that the inner server asks of whoever connects."""
        return self._server.relay_headers() if self._server else {}

    @property
    def shown(self) -> Shown:
        """What is shown now."""
        return self._director.state.shown if self._director else Shown()

    def watch(self, callback: Callable[[Shown], None]) -> None:
        """Hear of every move that the scene's own controls, its playback or the tracking make; `callback`
        is called in the scene's thread and returns at once. Moves made through this class's methods are not
        told.
        """
        self._watchers.append(callback)

    def show_run(
        self, session: str, run: str = "", frame: int | None = None, layer: int | None = None
    ) -> None:
        """Show a session and one of its runs ("" : the session alone), a frame, one layer's cloud (None:
        all).
        """
        if self._director is not None:
            self._director.show_run(session, run, frame, layer)

    @property
    def poses(self) -> ScenePoses:
        """Start poses that were found, and poses under a person's hands."""
        return ScenePoses(lambda: self._director)

    def show_frame(self, frame: int) -> None:
        """Show a stored frame; where it is not stored the nearest one."""
        if self._director is not None:
            self._director.show_frame(frame, told=False)

    def show_layer(self, layer: int | None) -> None:
        """Show one layer's cloud, or all (None)."""
        if self._director is not None:
            self._director.choose_layer(layer, told=False)

    def follow(self, following: bool) -> None:
        """Show each frame as it is tracked, or stay where the viewer is."""
        if self._director is not None:
            self._director.set_playback(follow=following, told=False)

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back where they were (None or "")."""
        if self._director is not None:
            self._director.look_through(camera or None)

    def set_options(self, **changes: object) -> None:
        """Change what is drawn, by the names of `ViewOptions`. Raises SettingsError for a name that is
        none.
        """
        known = [entry.name for entry in fields(ViewOptions)]
        for name in changes:
            if name not in known:
                raise SettingsError(f"The scene has no option '{name}'.", f"Known: {', '.join(known)}.")
        if self._director is not None:
            self._director.change_options(changes)

    def play(self, playing: bool) -> None:
        """Play stored frames, or stop."""
        if self._director is not None:
            self._director.set_playback(playing=playing)

    def _moved(self, shown: Shown) -> None:
        for callback in self._watchers:
            callback(shown)
