"""The viser scene of one window, behind the web application's relay.

Building viser blocks for some milliseconds: in a thread. All methods may be called from any thread; they post
what is requested to the scene's own thread and return.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields

from studio.errors import SettingsError
from studio.scene.director import Director
from studio.scene.guarded_server import GuardedServer
from studio.scene.scene_poses import ScenePoses
from studio.scene.view_options import Shown, ViewOptions
from studio.scene.wishes import Control
from studio.sessions.workspace import Workspace


class SceneStage:
    """The scene as one window sees it. control : the tracking process as its owner sees it, shared by all windows.

    moved : called with every move that the scene's own controls, its playback or the tracking make, in the
    scene's thread; it returns at once. Moves made through this class's methods are not reported.
    """

    def __init__(
        self, workspace: Workspace, control: Control, moved: Callable[[Shown], None] = lambda _: None
    ) -> None:
        self._server = GuardedServer()
        self._director = Director(self._server, workspace, control, moved)
        self._director.start()
        self.poses = ScenePoses(self._director)
        self.port: int = self._server.get_port()

    def stop(self) -> None:
        """Close the scene; its viewers are disconnected, its files and threads are released."""
        self._director.stop()
        self._server.stop()

    @property
    def is_viewed(self) -> bool:
        """Whether a browser is connected."""
        return self._server.is_viewed

    def relay_headers(self) -> Mapping[str, str]:
        """The secret that the inner server asks of whoever connects."""
        return self._server.relay_headers()

    @property
    def shown(self) -> Shown:
        """What is shown now."""
        return self._director.state.shown

    def show_run(
        self, session: str, run: str = "", frame: int | None = None, layer: int | None = None
    ) -> None:
        """Show a session and one of its runs ("" : the session alone), a frame, one layer's cloud (None:
        all).
        """
        self._director.show_run(session, run, frame, layer)

    def show_frame(self, frame: int) -> None:
        """Show a stored frame; where it is not stored the nearest one."""
        self._director.show_frame(frame, told=False)

    def show_layer(self, layer: int | None) -> None:
        """Show one layer's cloud, or all (None)."""
        self._director.choose_layer(layer, told=False)

    def follow(self, following: bool) -> None:
        """Show each frame as it is tracked, or stay where the viewer is."""
        self._director.set_playback(follow=following, told=False)

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back where they were (None or "")."""
        self._director.look_through(camera or None)

    def set_options(self, **changes: object) -> None:
        """Change what is drawn, by the names of `ViewOptions`. Raises SettingsError for a name that is
        none.
        """
        known = [entry.name for entry in fields(ViewOptions)]
        for name in changes:
            if name not in known:
                raise SettingsError(f"The scene has no option '{name}'.", f"Known: {', '.join(known)}.")
        self._director.change_options(changes)

    def play(self, playing: bool) -> None:
        """Play stored frames, or stop."""
        self._director.set_playback(playing=playing)
