"""The viser scene of one window, behind the web application's relay.

Building viser blocks for some milliseconds, so do it in a thread. All methods may be called from any thread; they post
the request to the scene's own thread and return.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from studio.app.scene.controller import Move, SceneController
from studio.app.scene.guarded_server import GuardedServer
from studio.app.scene.model import (
    Ghost,
    LayerPlayback,
    LiveSearch,
    Selection,
    ViewOptions,
    change_options,
    discard_what_if,
    edit_pose,
    look_through,
    scrub,
    select,
    set_layer_playback,
    set_playback,
    show_frame,
    show_ghosts,
)
from studio.app.scene.pose_edit import UNDO, PoseEdit, changed_whole
from studio.app.scene.scene_pictures import ScenePictures
from studio.app.scene.search_view import Pointed
from studio.app.scene.twin import show_trial
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError
from studio.operations.jobs.control import StudioControl
from studio.sessions.workspace import Workspace

ANSWER_SECONDS = 2.0


class SceneServer:
    """The scene of one window. process : the tracking process, shared by all windows.

    moved : called with every move that the scene's own controls, its playback or the tracking make, in the scene's
    thread; it returns at once. bare : without controls. Moves made through `show_run` and its like are not reported,
    but whether and how layers are played always is.
    """

    def __init__(
        self,
        workspace: Workspace,
        process: StudioControl,
        moved: Callable[[Selection, LayerPlayback], None] = lambda shown, layers: None,
        *,
        bare: bool = False,
    ) -> None:
        self._server = GuardedServer()
        self._controller = SceneController(self._server, workspace, process, moved)
        self._controller.bare = bare
        if bare:
            # Docked it would take its width from the scene though it is empty.
            self._server.gui.main_panel.float()
            self._server.gui.main_panel.minimize()
        self._controller.start()
        self.poses = ScenePoses(self._controller)
        self.pictures = ScenePictures(self._server, self._controller)
        self.port: int = self._server.get_port()

    def stop(self) -> None:
        """Close the scene; its viewers are disconnected, its files and threads are released."""
        self._controller.stop()
        self._server.stop()

    @property
    def is_viewed(self) -> bool:
        return self._server.is_viewed

    def relay_headers(self) -> Mapping[str, str]:
        """The secret that the inner server requires of every connection."""
        return self._server.relay_headers()

    @property
    def shown(self) -> Selection:
        return self._controller.model.selection

    @property
    def layers(self) -> LayerPlayback:
        return self._controller.model.layers

    def show_run(
        self,
        session: str,
        run: str = "",
        frame: int | None = None,
        layer: int | None = None,
        *,
        is_scrubbed: bool = True,
    ) -> None:
        """Show a session and one of its runs ("" : the session alone), a frame, one layer's cloud (None: all).
        is_scrubbed : layers that are played stop; else they go on, and `layer` counts only where none are.
        """
        show = partial(self._controller.show_run, is_scrubbed=is_scrubbed)
        self._controller.post(show, session, run, frame, layer, announce=False)

    def show_frame(self, frame: int) -> None:
        """Show a stored frame; where it is not stored the nearest one."""
        self._controller.post(show_frame, frame, announce=False)

    def select(self, **changes: object) -> None:
        """Select a layer, limb, parameter, particle or camera, by the names of `Selection`; None: none."""
        self._controller.post(lambda model: select(model, **changes), announce=False)

    def show_layer(self, layer: int | None) -> None:
        """Show one layer's cloud, or all (None); layers that are played stop."""
        self._controller.post(scrub, layer, announce=False)

    def follow(self, following: bool) -> None:
        """Show each frame as it is tracked, or stay where the viewer is."""
        self.select(follow=following)

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back where they were (None or "")."""
        self._controller.post(look_through, camera or None, announce=False)

    def look_from(self, eye: Sequence[float] | None) -> None:
        """Put the viewers' eyes at a place, looking at another: (6,) metres; None: the usual place."""
        place = None if eye is None else tuple(map(float, eye))
        self._controller.post(self._controller.look_from, place, announce=False)

    def move_camera(self, move: Move) -> None:
        """Let the viewers go to where the body is framed, to its front, side or top, or to the first view."""
        self._controller.post(self._controller.move_camera, move)

    def zoom(self, factor: float, at: tuple[float, float]) -> None:
        """Take the viewers nearer to a place of their view (shares of it), or away. factor : of the distance."""
        self._controller.post(self._controller.zoom, factor, at)

    def point(self, at: tuple[float, float] | None, choose: bool = False) -> Pointed | None:
        """The particle at a place of the viewers' view (shares of it; None: nowhere), None where there is none: its
        line is drawn, or it is chosen. Waits for the scene's thread.
        """
        answer: Future[Pointed | None] = Future()
        self._controller.post(self._controller.point, at, choose, answer)
        with suppress(TimeoutError):
            return answer.result(timeout=ANSWER_SECONDS)
        return None

    def discard_what_if(self) -> None:
        """Forget the frame that was annealed again."""
        self._controller.post(discard_what_if, announce=False)

    def show_trial(self, trial: LiveSearch | None) -> None:
        """Show what was tried of a frame in its place; None: what is stored."""
        self._controller.post(show_trial, trial or LiveSearch(), announce=False)

    def lead(self, follower: "SceneServer | None") -> None:
        """Let another scene show trials of the moment that this one shows as stored, seen alike; None: no longer."""
        if follower is not None:
            follower.set_options(trials=True, stored=False)
        self.set_options(trials=follower is None)
        self._controller.lead(None if follower is None else follower._controller)

    def show_ghosts(self, ghosts: Sequence[tuple[str, Sequence[float]]]) -> None:
        """Draw bodies beside the answer until another frame is shown: a colour's token and a pose (D,) of each."""
        shown = [Ghost(np.array(pose, dtype=np.float64), colour) for colour, pose in ghosts]
        self._controller.post(show_ghosts, shown, announce=False)

    def try_body(self, session: str, body: BodyModel | None) -> None:
        """Show a body that is being made in place of a session's own, or ("") alone; None: no longer."""
        self._controller.post(self._controller.try_body, session, body, announce=False)

    def set_options(self, **changes: object) -> None:
        """Change what is drawn, by the names of `ViewOptions`. Raises SettingsError for a name that is none."""
        known = [entry.name for entry in fields(ViewOptions)]
        for name in changes:
            if name not in known:
                raise SettingsError(f"The scene has no option '{name}'.", f"Known: {', '.join(known)}.")
        self._controller.post(change_options, changes, announce=False)

    def play(
        self, playing: bool | None = None, *, speed: float | None = None, loop: bool | None = None
    ) -> None:
        """Play stored frames, or stop. speed : 1 is real time. loop : start over at the end. None leaves each."""
        self._controller.post(set_playback, playing, speed, loop, announce=False)

    def play_layers(
        self, playing: bool | None = None, *, rate: float | None = None, mode: str | None = None
    ) -> None:
        """Play the shown frame's layers, or stop. rate : layers a second. mode : of LAYER_MODES. None leaves each."""
        self._controller.post(set_layer_playback, playing, rate, mode)


@dataclass(frozen=True, slots=True, eq=False)
class Editing:
    """A pose being edited. frame : of the run being corrected, None: the session's start pose. pose : (D,). moved :
    whether it differs from the original. steps : changes that can be undone.
    """

    session: str
    run: str
    frame: int | None
    pose: Array
    moved: bool
    steps: int


def _undone(edit: PoseEdit) -> PoseEdit:
    return changed_whole(edit, UNDO, None)


class ScenePoses:
    """Poses shown in the scene for review and editing; thread-safe."""

    def __init__(self, controller: SceneController) -> None:
        self._controller = controller

    @property
    def editing(self) -> Editing | None:
        model = self._controller.model
        edit, selection = model.edit, model.selection
        if edit is None or not edit.active:
            return None
        pose = edit.pose.copy()
        return Editing(selection.session, selection.run, edit.frame, pose, edit.is_moved, len(edit.past))

    def propose(self, session: str, pose: Sequence[float], text: str, frame: int | None = None) -> None:
        """Show a start pose (D,) found for a session. text : its confidence, for the viewers. frame : of the pose."""
        given = np.array(pose, dtype=np.float64)
        self._controller.post(self._controller.propose_pose, session, given, text, frame)

    def edit(
        self, session: str, run: str = "", frame: int | None = None, pose: Sequence[float] | None = None
    ) -> None:
        """Start editing a session's start pose, or the corrected pose of a run's frame. pose : (D,) to start from, or
        to continue with; None: the shown one.
        """
        given = None if pose is None else np.array(pose, dtype=np.float64)
        self._controller.post(self._controller.begin_edit, session, run, frame, given)

    def undo(self) -> None:
        """Take the newest change of the edited pose back."""
        self._controller.post(edit_pose, _undone)

    def leave(self) -> None:
        self._controller.post(self._controller.end_edit)
