"""What page and panel wish of the scene: may be called from any thread, posts to the scene's own, returns
at once.
"""

from collections.abc import Callable, Mapping

import viser

from studio.errors import StudioError
from studio.knobs import Value
from studio.scene.panel import Panel, tell
from studio.scene.playback import stepped
from studio.scene.pose_desk import PoseDesk
from studio.scene.presenter import Presenter
from studio.scene.proposal import EditWish, Proposal
from studio.scene.scene_state import SceneState
from studio.scene.view_options import Shown
from studio.scene.wishes import Control, Wishes
from studio.sessions.workspace import Workspace


class Director:
    """watch : called with `Shown` whenever the scene's own controls, playback or the tracking move it.

    `state` is what is shown; it is changed in the scene's thread only.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        workspace: Workspace,
        control: Control,
        watch: Callable[[Shown], None],
    ) -> None:
        self._server, self._control = server, control
        self.wishes = Wishes(control)
        self.state = state = SceneState(
            server, workspace, control, self.wishes, watch=watch, refused=self.refused
        )
        self._presenter = Presenter(
            control.subscribe(),
            heard=state.heard,
            tick=state.tick,
            draw=state.draw,
            draw_pictures=state.draw_pictures,
            failed=self.refused,
        )
        self.posing = PoseDesk(server, self._presenter.post, self.refused)
        state.attach(Panel(server, self), self._presenter, self.posing)
        server.on_client_connect(self._client_came)

    def start(self) -> None:
        """Begin to draw."""
        self._presenter.post(lambda: self.state.heard(self._control.state))
        self._presenter.start()

    def stop(self) -> None:
        """End drawing and let go of files."""
        self._presenter.stop()
        if self.state.run is not None:
            self.state.run.close()
            self.state.run = None

    def show_run(self, session: str, run: str, frame: int | None = None, layer: int | None = None) -> None:
        """Show a session ("" : none) and one of its runs ("" : none)."""
        self._presenter.post(lambda: self.state.show_run(session, run, frame, layer))

    def show_frame(self, frame: int | None, *, told: bool = True) -> None:
        """Show a stored frame; the one nearest where it is not stored. told : whether watchers hear of it."""
        self._presenter.post(lambda: self.state.show_frame(frame, told))

    def step(self, frames: int) -> None:
        """Show the stored frame so many places on."""
        self._presenter.post(
            lambda: self.state.show_frame(
                stepped(self.state.shown.frame, self.state.run.frames if self.state.run else (), frames), True
            )
        )

    def choose_layer(self, layer: int | None, *, told: bool = True) -> None:
        """Show one layer's cloud, or all (None)."""
        self._presenter.post(lambda: self.state.change_shown(told, layer=layer))

    def look_through(self, camera: str | None) -> None:
        """Put the viewers into a camera's place, or back where they were (None)."""
        self._presenter.post(lambda: self.state.look_through(camera, False))

    def set_playback(
        self,
        *,
        playing: bool | None = None,
        speed: float | None = None,
        loop: bool | None = None,
        follow: bool | None = None,
        told: bool = True,
    ) -> None:
        """Play stored frames or stop, change how, and whether the scene follows the tracking; None leaves
        it.
        """
        self._presenter.post(lambda: self.state.set_playback(playing, speed, loop, follow, told))

    def change_options(self, changes: Mapping[str, object]) -> None:
        """Show other things. changes : new values by the names of `ViewOptions`; the others stay as they are then."""
        self._presenter.post(lambda: self.state.change_options(changes))

    def change_settings(self, changes: dict[str, Value]) -> str:
        """Ask for knobs of the run that is shown; while nothing is tracked, the shown frame is annealed
        again.

        Returns the identifier of the answer. Raises StudioError if it cannot be asked.
        """
        run = self.state.run
        if run is None or run.opened.run is None:
            raise StudioError("No run is open.", "Open or start a run first.")
        frame = self.state.shown.frame if self.state.shown.frame in run.frames else None
        return self.wishes.change_settings(changes, run.opened.session.path, run.opened.run.folder, frame)

    def reanneal_shown(self) -> None:
        """Anneal the shown frame again with the settings in use; the stored answer stays beside it."""
        frame = self.state.shown.frame
        if frame is None:
            raise StudioError("No frame is shown.", "Open a run and choose a frame first.")
        self.search(lambda: self.wishes.reanneal(frame))

    def search(self, command: Callable[[], None]) -> None:
        """Give the tracking process a command about the run that is shown here. Raises StudioError while another
        run is tracked, or none is shown.
        """
        run = self.state.run
        if run is None or run.opened.run is None:
            raise StudioError("No run is open.", "Open or start a run first.")
        self.wishes.make_current(run.opened.session.path, run.opened.run.folder)
        command()

    def propose(self, proposal: Proposal) -> None:
        """Show a start pose that was found, in its session and frame."""
        self._presenter.post(lambda: self.state.propose(proposal))

    def edit(self, wish: EditWish) -> None:
        """Let a pose be edited, or leave off."""
        self._presenter.post(lambda: self.state.edit(wish))

    def refused(self, problem: StudioError) -> None:
        """Tell every viewer about a refusal."""
        tell(self._server, problem.message, problem.hint, bad=True)

    async def _client_came(self, client: viser.ClientHandle) -> None:
        self._presenter.post(lambda: self.state.place(client))
