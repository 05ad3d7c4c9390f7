"""What is shown, and how it changes: wishes from page and panel, events from the search, time going by.

Public methods may be called from any thread and only post; methods with an underscore run in the
presenter's thread.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import viser
from numpy.typing import NDArray

from studio.errors import StudioError
from studio.knobs import Value
from studio.runs.colour_tokens import colour_tokens
from studio.scene.live_search import LiveSearch
from studio.scene.opened_run import OpenedRun
from studio.scene.panel import Panel, dress, tell
from studio.scene.playback import nearest, stepped
from studio.scene.player import Player
from studio.scene.presenter import Presenter
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.shown_run import ShownRun
from studio.scene.view_options import Shown, ViewOptions
from studio.scene.wishes import Control, Wishes
from studio.sessions.workspace import Workspace
from studio.worker.events import Event, FrameFinished, LayerFinished, SettingsApplied, StateChanged

Array = NDArray[np.float64]

_NEAR_THE_END = 3


class Director:
    """watch : called with `Shown` whenever the scene's own controls, playback or the tracking move it."""

    def __init__(
        self,
        server: viser.ViserServer,
        workspace: Workspace,
        control: Control,
        watch: Callable[[Shown], None],
    ) -> None:
        self._server, self._workspace, self._control, self._watch = server, workspace, control, watch
        self.wishes = Wishes(control)
        self.shown = Shown()
        self.options = ViewOptions()
        self._player = Player()
        self._live = LiveSearch()
        self._edited: Array | None = None
        self._run: ShownRun | None = None
        self._presenter = Presenter(
            control.subscribe(),
            heard=self._heard,
            tick=self._tick,
            draw=self._draw,
            draw_pictures=self._draw_pictures,
            failed=self.refused,
        )
        self._panel = Panel(server, self)
        self._dress()
        server.on_client_connect(self._client_came)

    # ------------------------------------------------------------------ for any thread

    def start(self) -> None:
        """Begin to draw."""
        self._presenter.post(lambda: self._heard(self._control.state))
        self._presenter.start()

    def stop(self) -> None:
        """End drawing and let go of files."""
        self._presenter.stop()
        if self._run is not None:
            self._run.close()
            self._run = None

    def show_run(self, session: str, run: str, frame: int | None = None, layer: int | None = None) -> None:
        """Show a session ("" : none) and one of its runs ("" : none)."""
        self._presenter.post(lambda: self._show_run(session, run, frame, layer))

    def show_frame(self, frame: int | None, *, told: bool = True) -> None:
        """Show a stored frame; the one nearest where it is not stored. told : whether watchers hear of it."""
        self._presenter.post(lambda: self._show_frame(frame, told))

    def step(self, frames: int) -> None:
        """Show the stored frame so many places on."""
        self._presenter.post(
            lambda: self._show_frame(
                stepped(self.shown.frame, self._run.frames if self._run else (), frames), True
            )
        )

    def choose_layer(self, layer: int | None, *, told: bool = True) -> None:
        """Show one layer's cloud, or all (None)."""
        self._presenter.post(lambda: self._change_shown(told, layer=layer))

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back (None); the same camera again goes back, too."""
        self._presenter.post(lambda: self._look_through(camera))

    def play(self, playing: bool | None) -> None:
        """Play stored frames or stop; None: the other of the two."""
        self._presenter.post(lambda: self._player.play(playing))

    def set_playback(
        self, *, speed: float | None = None, loop: bool | None = None, follow: bool | None = None
    ) -> None:
        """Change how stored frames are played, and whether the shown frame moves on with the tracking."""
        self._presenter.post(lambda: self._set_playback(speed, loop, follow))

    def change_options(self, options: ViewOptions) -> None:
        """Show other things."""
        self._presenter.post(lambda: self._change_options(options))

    def change_settings(self, changes: dict[str, Value]) -> str:
        """Ask for knobs of the run that is shown; while nothing is tracked, the shown frame is annealed
        again.

        Returns the identifier of the answer. Raises StudioError if it cannot be asked.
        """
        run = self._run
        if run is None or run.opened.run is None:
            raise StudioError("No run is open.", "Open or start a run first.")
        frame = self.shown.frame if self.shown.frame in run.frames else None
        return self.wishes.change_settings(changes, run.opened.session.path, run.opened.run.folder, frame)

    def reanneal_shown(self) -> None:
        """Anneal the shown frame again with the settings in use; the stored answer stays beside it."""
        run, frame = self._run, self.shown.frame
        if run is None or run.opened.run is None or frame is None:
            raise StudioError("No frame is shown.", "Open a run and choose a frame first.")
        self.wishes.make_current(run.opened.session.path, run.opened.run.folder)
        self.wishes.reanneal(frame)

    def edit_pose(self, pose: Array | None) -> None:
        """Show a start pose under the sliders; None ends it."""
        self._presenter.post(lambda: self._edit_pose(pose))

    def save_pose(self, pose: Array) -> None:
        """Store a start pose for the session."""
        self._presenter.post(lambda: self._save_pose(pose))

    def refused(self, problem: StudioError) -> None:
        """Tell every viewer about a refusal."""
        tell(self._server, problem.message, problem.hint, bad=True)

    # ------------------------------------------------------------------ in the presenter's thread

    def _show_run(self, session: str, run: str, frame: int | None, layer: int | None) -> None:
        if (session, run) != (self.shown.session, self.shown.run):
            self._open(session, run)
        if frame is not None:
            self._show_frame(frame, False)
        self._change_shown(False, layer=layer)

    def _open(self, session: str, run: str) -> None:
        before, self._run = self._run, None
        same_place = before is not None and before.opened.session.name == session
        if before is not None:
            before.close()
        self._live, self._edited = LiveSearch(), None
        self._player.play(False)
        self.shown = Shown(follow=self.shown.follow)
        if not session:
            return
        place = self._workspace.session(session)
        opened = OpenedRun(place, place.run(run) if run else None)
        self._run = current = ShownRun(SceneDrawing(self._server, opened, self.options.dark), opened)
        current.drawing.on_camera_clicked(self.look_through)
        current.drawing.first_view(move_viewers=not same_place)
        self.shown = replace(
            self.shown, session=session, run=run, frame=current.frames[-1] if current.frames else None
        )
        self._panel.settings.show_settings(current.settings)
        self._panel.show.show_body(opened.body)
        self._panel.pose.show_body(opened.body, opened.start_pose())
        self._follow_shown()
        if opened.truth_problem:
            tell(self._server, "The truth cannot be shown", opened.truth_problem, bad=True)

    def _show_frame(self, frame: int | None, told: bool) -> None:
        if self._run is None or frame is None:
            return
        near = frame if self._live.frame == frame else nearest(frame, self._run.frames)
        near = near if self._run.frames else frame
        newest = self._run.frames[-_NEAR_THE_END:]
        follow = self.shown.follow and (not self.wishes.searching or not newest or frame >= newest[0])
        if self._live.reannealed and near != self._live.frame:
            self._live = LiveSearch()
        self._change_shown(told, frame=near, follow=follow)

    def _change_shown(self, told: bool, **changes: object) -> None:
        after = replace(self.shown, **changes)  # pyright: ignore[reportArgumentType]
        if after == self.shown:
            return
        self.shown = after
        self._follow_shown()
        if told:
            self._watch(after)

    def _follow_shown(self) -> None:
        """Bring the panel to what is shown, and ask for a redraw."""
        if self._run is not None:
            self._panel.run.show_frame(self.shown.frame, self._run.opened.span)
            self._panel.show.show_layers(
                self._run.layer_count(self.shown.frame, self._live), self.shown.layer
            )
        pace = self._player.state
        self._panel.run.show_playback(pace.speed, pace.loop, self.shown.follow)
        self._presenter.redraw()

    def _look_through(self, camera: str | None) -> None:
        if self._run is None or (camera is not None and camera not in self._run.drawing.cameras.views):
            return
        chosen = None if camera == self.shown.look_through else camera
        self._run.drawing.cameras.look_through(chosen)
        self._change_shown(True, look_through=chosen)

    def _set_playback(self, speed: float | None, loop: bool | None, follow: bool | None) -> None:
        self._player.set_pace(speed, loop)
        self._change_shown(True, follow=self.shown.follow if follow is None else follow)

    def _change_options(self, options: ViewOptions) -> None:
        themed = options.dark != self.options.dark
        self.options = options
        self._panel.show.show_options(options)
        if themed:
            self._dress()
        self._presenter.redraw()

    def _edit_pose(self, pose: Array | None) -> None:
        self._edited = pose
        self._presenter.redraw()

    def _save_pose(self, pose: Array) -> None:
        if self._run is None:
            return
        self._run.save_start_pose(pose)
        self._panel.pose.saved()
        tell(self._server, "Start pose saved", "Runs that are started from now on begin with it.")

    def _heard(self, event: Event) -> None:
        answer = self.wishes.settled(event)
        if answer is not None:
            self._panel.settings.settle(answer[0], answer[1] is None)
            if answer[1] is not None:
                self.refused(answer[1])
        if isinstance(event, StateChanged):
            self._panel.run.show_state(event)
            if event.run and not self.shown.run and self.shown.follow:
                self._open(event.session, event.run)
        if self._run is None or (event.session, event.run) != (self.shown.session, self.shown.run):
            return
        if isinstance(event, SettingsApplied):
            self._run.apply(event.values)
            self._panel.settings.show_applied(event)
            self._presenter.redraw()
        elif isinstance(event, LayerFinished | FrameFinished):
            self._heard_search(event, self._run)

    def _heard_search(self, event: LayerFinished | FrameFinished, run: ShownRun) -> None:
        self._live = self._live.after(event)
        if isinstance(event, FrameFinished) and not event.reannealed:
            run.frame_finished(event.result.frame)
        if self.shown.follow and not event.reannealed and self._live.frame is not None:
            self._change_shown(True, frame=self._live.frame)
        layers = run.layer_count(self.shown.frame, self._live)
        self._panel.show.show_layers(layers, self.shown.layer)
        self._presenter.redraw(pictures=isinstance(event, FrameFinished))

    def _tick(self, seconds: float) -> bool:
        if self._run is None or not self._player.state.playing:
            return False
        run = self._run
        frame = self._player.advance(seconds, run.opened.fps, self.shown.frame, run.frames)
        if frame != self.shown.frame:
            self._show_frame(frame, True)
        return True

    def _draw(self) -> None:
        if self._run is None:
            return
        moment = self._run.moment(self.shown.frame, self._live, self._edited)
        self._run.draw(moment, self.options, self.shown.layer)
        tokens = colour_tokens(self.options.dark)
        self._panel.show.show_legend(tokens, max(1, moment.layer_count), moment.truth is not None)

    def _draw_pictures(self) -> None:
        if self._run is not None and (self.options.pictures or self.shown.look_through):
            moment = self._run.moment(self.shown.frame, self._live, self._edited)
            self._run.hang(moment, self.options, self.shown.layer)

    def _dress(self) -> None:
        dress(self._server, colour_tokens(self.options.dark))

    async def _client_came(self, client: viser.ClientHandle) -> None:
        self._presenter.post(lambda: self._place(client))

    def _place(self, client: viser.ClientHandle) -> None:
        if self._run is not None and self.shown.look_through:
            self._run.drawing.cameras.place_viewer(client, self.shown.look_through)
