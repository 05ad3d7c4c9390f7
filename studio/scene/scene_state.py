"""The scene's state and how it changes. Everything here happens in the presenter's thread."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import viser

from studio.errors import StudioError
from studio.runs.colour_tokens import colour_tokens
from studio.scene.live_search import LiveSearch
from studio.scene.opened_run import OpenedRun
from studio.scene.panel import Panel, dress, tell
from studio.scene.playback import nearest
from studio.scene.player import Player
from studio.scene.pose_desk import PoseDesk
from studio.scene.presenter import Presenter
from studio.scene.proposal import EditWish, Proposal
from studio.scene.scene_drawing import SceneDrawing
from studio.scene.shown_run import ShownRun
from studio.scene.view_options import Shown, ViewOptions
from studio.scene.wishes import SEARCHING, Control, Wishes
from studio.sessions.workspace import Workspace
from studio.worker.events import Event, FrameFinished, LayerFinished, SettingsApplied, StateChanged

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
        self._proposal: Proposal | None = None
        self._searching = False
        self._dress()

    def attach(self, panel: Panel, presenter: Presenter, posing: PoseDesk) -> None:
        """Take the panel that shows this state, the presenter that draws it, and where poses are edited."""
        self._panel, self._presenter, self._posing = panel, presenter, posing
        posing.attach(panel, lambda: self.shown.frame, self._pose_changed)

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
        self.live = LiveSearch()
        self.player.play(False)
        self.shown = Shown(follow=self.shown.follow)
        if not session:
            self._posing.open(None)
            return
        place = self._workspace.session(session)
        if not (place.has_footage and place.is_calibrated):
            # Nothing to be placed in the room yet: the guided way says what is next.
            self._posing.open(None)
            self.shown = replace(self.shown, session=session)
            return
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
        self._posing.open(opened)
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

    def edit(self, wish: EditWish) -> None:
        """Let the start pose of a session be edited, or a frame of a run, or leave off."""
        if not wish.editing:
            self._posing.end()
            return
        if (wish.session, wish.run) != (self.shown.session, self.shown.run):
            self._open(wish.session, wish.run)
        self.player.play(False)
        self.change_shown(False, follow=False)
        if wish.frame is not None:
            self.show_frame(wish.frame, True)
        pose = wish.pose
        if pose is None and wish.run and self.run is not None:
            pose = self.run.moment(wish.frame, self.live, None, self.options.track).pose
        self._posing.begin(pose, wish.frame if wish.run else None)

    def _pose_changed(self) -> None:
        """The pose under a person's hands is another one, or no longer is one."""
        editing = self._posing.pose is not None
        if not editing:
            self._proposal = None
        self.change_shown(True, editing=editing)
        self._presenter.redraw()

    def propose(self, proposal: Proposal) -> None:
        """Show a start pose that was found, with its session alone, if it is one of the session's body.

        It stays until a person saves it or ends the editing, opens a run or another session, or tracks.
        """
        tell(self._server, "Start pose found", proposal.said)
        self._proposal = proposal
        self.show_run(proposal.session, "", None, None)
        self._show_proposal()

    def _show_proposal(self) -> None:
        found, run = self._proposal, self.run
        if found is None or run is None or (self.shown.session, self.shown.run) != (found.session, ""):
            self._proposal = None
            return
        if len(run.opened.body.parameters) == len(found.pose):
            self._posing.begin(found.pose)
            self.show_frame(found.frame, True)

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
        is_shown = (state.session, state.run) == (shown.session, shown.run)
        before, self._searching = self._searching, is_shown and state.state in SEARCHING
        if self._searching and not before and shown.editing:
            self._posing.end()  # what is searched is to be seen now
        self._panel.run.show_pace(state.seconds_a_layer)
        if self.run is None or is_shown or state.state == "lost":
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
        moment = self.run.moment(self.shown.frame, self.live, self._posing.pose, self.options.track)
        self._panel.show.offer_tracks(self.run.opened.tracks())
        self.run.draw(moment, self.options, self.shown.layer)
        tokens = colour_tokens(self.options.dark)
        found = self._proposal.said if self._proposal is not None and self._posing.pose is not None else ""
        self._panel.run.show_mark(moment.tracking, tokens, found)
        self._panel.show.show_legend(tokens, max(1, moment.layer_count), moment.truth is not None)

    def draw_pictures(self) -> None:
        """Bring the pictures on the cameras up to date."""
        if self.run is not None and (self.options.pictures or self.shown.look_through):
            moment = self.run.moment(self.shown.frame, self.live, self._posing.pose, self.options.track)
            self.run.hang(moment, self.options, self.shown.layer)

    def _dress(self) -> None:
        dress(self._server, colour_tokens(self.options.dark))

    def place(self, client: viser.ClientHandle) -> None:
        """Put a viewer that just came where the others are."""
        if self.run is not None and self.shown.look_through:
            self.run.drawing.cameras.place_viewer(client, self.shown.look_through)
