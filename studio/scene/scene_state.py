"""The scene's state and how it changes. Everything here happens in the presenter's thread."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import viser
from numpy.typing import NDArray

from studio.errors import StudioError
from studio.runs.colour_tokens import colour_tokens
from studio.scene.live_search import LiveSearch
from studio.scene.opened_run import OpenedRun
from studio.scene.panel import Panel, dress, tell
from studio.scene.playback import nearest
from studio.scene.player import Player
from studio.scene.presenter import Presenter
from studio.scene.proposal import Proposal
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.shown_run import ShownRun
from studio.scene.view_options import Shown, ViewOptions
from studio.scene.wishes import Control, Wishes
from studio.sessions.workspace import Workspace
from studio.worker.events import Event, FrameFinished, LayerFinished, SettingsApplied, StateChanged

Array = NDArray[np.float64]

_NEAR_THE_END = 3


class SceneState:
    """watch : called with `Shown` whenever the scene's own controls, playback or the tracking move it."""

    def __init__(
        self,
        server: viser.ViserServer,
        workspace: Workspace,
        control: Control,
        wishes: Wishes,
        *,
        watch: Callable[[Shown], None],
        refused: Callable[[StudioError], None],
    ) -> None:
        self._server, self._workspace, self._control = server, workspace, control
        self._wishes, self._watch, self._refused = wishes, watch, refused
        self.shown = Shown()
        self.options = ViewOptions()
        self.player = Player()
        self.live = LiveSearch()
        self.run: ShownRun | None = None
        self._edited: Array | None = None
        self._proposal: Proposal | None = None
        self._dress()

    def attach(self, panel: Panel, presenter: Presenter) -> None:
        """Take the panel that shows this state, and the presenter that draws it."""
        self._panel, self._presenter = panel, presenter

    def show_run(self, session: str, run: str, frame: int | None, layer: int | None) -> None:
        """Show a session ("" : none) and one of its runs ("" : none), a frame (None: as it is), a layer."""
        if (session, run) != (self.shown.session, self.shown.run):
            self._open(session, run)
        if frame is not None:
            self.show_frame(frame, False)
        self.change_shown(False, layer=layer)

    def _open(self, session: str, run: str) -> None:
        before, self.run = self.run, None
        same_place = before is not None and before.opened.session.name == session
        if before is not None:
            before.close()
        self.live, self._edited = LiveSearch(), None
        self.player.play(False)
        self.shown = Shown(follow=self.shown.follow)
        if not session:
            return
        place = self._workspace.session(session)
        opened = OpenedRun(place, place.run(run) if run else None)
        drawing = SceneDrawing(self._server, opened, self.options.dark)
        self.run = current = ShownRun(drawing, opened, self._volume_made, self._refused)
        current.drawing.on_camera_clicked(self._camera_clicked)
        current.drawing.first_view(move_viewers=not same_place)
        self.shown = replace(
            self.shown, session=session, run=run, frame=current.frames[-1] if current.frames else None
        )
        self._panel.settings.show_settings(current.settings)
        self._panel.show.show_body(opened.body)
        self._panel.show.offer_blobs(current.has_blobs)
        self._panel.pose.show_body(opened.body, opened.start_pose())
        self._follow_shown()
        self._show_state()
        self._show_proposal()
        if opened.truth_problem:
            tell(self._server, "The truth cannot be shown", opened.truth_problem, bad=True)

    def show_frame(self, frame: int | None, told: bool) -> None:
        """Show a stored frame, or the nearest one. told : whether the watcher hears of it."""
        if self.run is None or frame is None:
            return
        near = frame if self.live.frame == frame else nearest(frame, self.run.frames)
        near = near if self.run.frames else frame
        newest = self.run.frames[-_NEAR_THE_END:]
        follow = self.shown.follow and (not self._wishes.searching or not newest or frame >= newest[0])
        if self.live.reannealed and near != self.live.frame:
            self.live = LiveSearch()
        self.change_shown(told, frame=near, follow=follow)

    def change_shown(self, told: bool, **changes: object) -> None:
        """Change what is shown, and tell the watcher if it is `told`."""
        after = replace(self.shown, **changes)  # pyright: ignore[reportArgumentType]
        if after == self.shown:
            return
        self.shown = after
        self._follow_shown()
        if told:
            self._watch(after)

    def _follow_shown(self) -> None:
        """Bring the panel to what is shown, and ask for a redraw."""
        if self.run is not None:
            self._panel.run.show_frame(self.shown.frame, self.run.opened.span)
            self._panel.show.show_layers(self.run.layer_count(self.shown.frame, self.live), self.shown.layer)
        pace = self.player.state
        self._panel.run.show_playback(pace, self.shown.follow)
        self._presenter.redraw()

    def look_through(self, camera: str | None, told: bool) -> None:
        """Look through a camera (None: no longer); unknown ones change nothing."""
        if self.run is None or (camera is not None and camera not in self.run.drawing.cameras.views):
            return
        self.run.drawing.cameras.look_through(camera)
        self.change_shown(told, look_through=camera)

    def set_playback(
        self, playing: bool | None, speed: float | None, loop: bool | None, follow: bool | None, told: bool
    ) -> None:
        """Change pace and following; None leaves it."""
        if playing is not None:
            self.player.play(playing)
        self.player.set_pace(speed, loop)
        self.change_shown(told, follow=self.shown.follow if follow is None else follow)
        self._follow_shown()

    def change_options(self, changes: Mapping[str, object]) -> None:
        """Show other things, or in another theme."""
        options = replace(self.options, **changes)  # pyright: ignore[reportArgumentType]
        themed = options.dark != self.options.dark
        self.options = options
        self._panel.show.show_options(options)
        if themed:
            self._dress()
        self._presenter.redraw()

    def edit_pose(self, pose: Array | Proposal | None) -> None:
        """Show a start pose being edited; None ends it.

        One that was found is shown if it is one of the body that is shown. It stays when another run of its session is
        opened, until a person saves it or ends the editing.
        """
        if isinstance(pose, Proposal):
            self._propose(pose)
            return
        self._edited = pose
        if pose is None:
            self._proposal = None
        self._presenter.redraw()

    def _propose(self, proposal: Proposal) -> None:
        tell(self._server, "Start pose found", proposal.said)
        self._proposal = proposal
        if self.shown.session != proposal.session:
            self._open(proposal.session, "")
        else:
            self._show_proposal()

    def _show_proposal(self) -> None:
        found, run = self._proposal, self.run
        if found is None or run is None or run.opened.session.name != found.session:
            self._proposal = None
            return
        if len(run.opened.body.parameters) == len(found.pose):
            self._panel.pose.propose(found.pose)
            self._edited = found.pose
            self.show_frame(found.frame, True)
            self._presenter.redraw()

    def save_pose(self, pose: Array) -> None:
        """Store a start pose for the session."""
        if self.run is None:
            return
        self.run.save_start_pose(pose)
        self._proposal = None
        self._panel.pose.saved()
        tell(self._server, "Start pose saved", "Runs that are started from now on begin with it.")

    def heard(self, event: Event) -> None:
        """Take an event of the tracking process."""
        answer = self._wishes.settled(event)
        if answer is not None:
            self._panel.settings.settle(answer[0], answer[1] is None)
            if answer[1] is not None:
                self._refused(answer[1])
        if isinstance(event, StateChanged):
            self._presenter.yield_to_live(event.live is not None and event.state == "tracking")
            self._show_state()
            if event.run and not self.shown.session and self.shown.follow:
                self._open(event.session, event.run)
        if self.run is None or (event.session, event.run) != (self.shown.session, self.shown.run):
            return
        if isinstance(event, SettingsApplied):
            self.run.apply(event.values)
            self._panel.settings.show_applied(event)
            self._presenter.redraw()
        elif isinstance(event, LayerFinished | FrameFinished):
            self._heard_search(event, self.run)

    def _show_state(self) -> None:
        state, shown = self._control.state, self.shown
        self._panel.run.show_pace(state.seconds_a_layer)
        if (
            self.run is None
            or (state.session, state.run) == (shown.session, shown.run)
            or state.state == "lost"
        ):
            self._panel.run.show_state(state)
        else:
            first, last = self.run.opened.span
            self._panel.run.show_stored(shown.session, shown.run, len(self.run.frames), last - first)

    def _heard_search(self, event: LayerFinished | FrameFinished, run: ShownRun) -> None:
        self.live = self.live.after(event)
        if isinstance(event, FrameFinished) and not event.reannealed:
            run.frame_finished(event.result.frame)
        if self.shown.follow and not event.reannealed and self.live.frame is not None:
            self.change_shown(True, frame=self.live.frame)
        layers = run.layer_count(self.shown.frame, self.live)
        self._panel.show.show_layers(layers, self.shown.layer)
        self._presenter.redraw(pictures=isinstance(event, FrameFinished))

    def tick(self, seconds: float) -> bool:
        """Let time go by; whether the scene moves by itself."""
        if self.run is None or not self.player.state.playing:
            return False
        run = self.run
        frame = self.player.advance(seconds, run.opened.fps, self.shown.frame, run.frames)
        if frame != self.shown.frame:
            self.show_frame(frame, True)
        return True

    def _camera_clicked(self, camera: str) -> None:
        """Clicked in some viewer, so in another thread: look through it, or no longer if that is done
        already.
        """
        self._presenter.post(
            lambda: self.look_through(None if camera == self.shown.look_through else camera, True)
        )

    def _volume_made(self) -> None:
        """A hull is there, which was made in another thread."""
        self._presenter.post(lambda: self._presenter.redraw(pictures=False))

    def draw(self) -> None:
        """Bring everything but the pictures up to date."""
        if self.run is None:
            return
        moment = self.run.moment(self.shown.frame, self.live, self._edited, self.options.track)
        self._panel.show.offer_tracks(self.run.opened.tracks())
        self.run.draw(moment, self.options, self.shown.layer)
        tokens = colour_tokens(self.options.dark)
        found = self._proposal.said if self._proposal is not None and self._edited is not None else ""
        self._panel.run.show_mark(moment.tracking, tokens, found)
        self._panel.show.show_legend(tokens, max(1, moment.layer_count), moment.truth is not None)

    def draw_pictures(self) -> None:
        """Bring the pictures on the cameras up to date."""
        if self.run is not None and (self.options.pictures or self.shown.look_through):
            moment = self.run.moment(self.shown.frame, self.live, self._edited, self.options.track)
            self.run.hang(moment, self.options, self.shown.layer)

    def _dress(self) -> None:
        dress(self._server, colour_tokens(self.options.dark))

    def place(self, client: viser.ClientHandle) -> None:
        """Put a viewer that just came where the others are."""
        if self.run is not None and self.shown.look_through:
            self.run.drawing.cameras.place_viewer(client, self.shown.look_through)
