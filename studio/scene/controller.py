"""The one thread that owns a scene's model and its views.

Changes of the model, `change(model, *values) -> Model`, are posted from any thread and applied here one after another;
then the difference is drawn. Changes that need more than the model (files, commands for the tracking process) are
methods of the controller of the same form. Redraws are limited to 30 a second and pictures to 10; the newest wins.
"""

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import viser
from numpy import float64
from numpy.typing import NDArray

from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.errors import BodyError, StudioError
from studio.knobs import Value, checked
from studio.runs.colour_tokens import colour_tokens
from studio.runs.pose_search import BetterPose
from studio.runs.start_pose_file import keep_start_pose
from studio.scene.controls import Change
from studio.scene.model import (
    Model,
    Selection,
    Subject,
    advance,
    camera_clicked,
    edit_pose,
    hear,
    opened,
    refuse,
    request,
    same_pictures,
    select,
    set_playback,
    settle,
    show_frame,
)
from studio.scene.opened_run import Moment, OpenedRun
from studio.scene.panel import Panel, dress, notify
from studio.scene.pose_edit import begun, edit_of, ended, moved, saved
from studio.scene.pose_handles import PoseHandles, drag
from studio.scene.pose_refining import PoseRefining, outcome
from studio.scene.scene_views import SceneViews
from studio.sessions.workspace import Workspace
from studio.settings import all_knobs
from studio.worker import commands
from studio.worker.control import StudioControl
from studio.worker.events import Acknowledged, Event, FrameFinished, StateChanged

Array = NDArray[float64]

REDRAW_SECONDS = 1.0 / 30.0
PICTURE_SECONDS, LIVE_PICTURE_SECONDS = 1.0 / 10.0, 1.0 / 2.0
"""Composing pictures ten times a second costs a third of a core, which a live run needs."""
IDLE_SECONDS = 0.5
_LOG = logging.getLogger(__name__)
_WAKE = Event("", "")


class SceneController:
    """Owns a scene's model and views. moved : called in the scene's thread with the selection whenever the scene's
    controls, playback or the tracking changed it; it must return at once.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        workspace: Workspace,
        process: StudioControl,
        moved: Callable[[Selection], None],
    ) -> None:
        self._server, self._workspace, self._process, self._moved = server, workspace, process, moved
        self.model = Model(process.state)
        self.opened: OpenedRun | None = None
        self.views: SceneViews | None = None
        self.handles: PoseHandles | None = None
        self._refining: PoseRefining | None = None
        self._events = process.subscribe()
        self._inbox: deque[tuple[Change, tuple[Any, ...], bool]] = deque()
        self._drawings = Due(REDRAW_SECONDS), Due(PICTURE_SECONDS)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="scene", daemon=True)
        self._theme = ""
        self.panel = Panel(server, self.post, self.request_knobs, self.refine_pose, self.save_pose)
        server.on_client_connect(self._greet)

    def start(self) -> None:
        """Start drawing."""
        self.post(lambda model: hear(model, self._process.state))
        self._thread.start()

    def stop(self) -> None:
        """End drawing and release files; returns when the thread has ended."""
        self._stopping.set()
        self._events.close()
        if self._thread.is_alive():
            self._thread.join(timeout=10.0)
        self._close()

    def post(self, change: Change, *values: Any, announce: bool = True) -> None:  # noqa: ANN401 - what the change takes
        """Queue a change. announce : whether `moved` is called for it; callers from outside know already."""
        self._inbox.append((change, values, announce))
        self._events.put(_WAKE)

    def refused(self, problem: StudioError) -> None:
        """Show a refusal to every viewer."""
        notify(self._server, problem.message, problem.hint, bad=True)

    # Changes that need more than the model.

    def show_run(
        self, model: Model, session: str, run: str, frame: int | None = None, layer: int | None = None
    ) -> Model:
        """Show a session ("" : none) and one of its runs ("" : none), a frame (None: as it is), a layer."""
        return select(show_frame(self._open(model, session, run), frame), layer=layer)

    def propose_pose(self, model: Model, session: str, pose: Array, text: str, frame: int | None) -> Model:
        """Show a found start pose (D,) without a run, if it fits the session's body.

        It stays until the user saves it, ends the editing, opens a run or another session, or tracks.
        """
        notify(self._server, "Start pose found", text)
        model = self.show_run(model, session, "")
        if model.subject is None or len(model.subject.body.parameters) != len(pose):
            return model
        return show_frame(edit_pose(model, lambda edit: begun(edit, pose, found=text)), frame)

    def begin_edit(
        self, model: Model, session: str, run: str, frame: int | None, pose: Array | None
    ) -> Model:
        """Start editing a session's start pose, or the corrected pose of a run's frame. pose : (D,) initial."""
        model = select(set_playback(self._open(model, session, run), False), follow=False)
        model = show_frame(model, frame)
        if pose is None and run and self.opened is not None:
            pose = self.opened.moment(frame, model.live, track=model.options.track).pose
        return edit_pose(model, lambda edit: begun(edit, pose, frame if run else None))

    def end_edit(self, model: Model) -> Model:
        """Stop editing."""
        return edit_pose(model, ended)

    def request_knobs(self, model: Model, changes: Mapping[str, Value]) -> Model:
        """Request knobs of the shown run from the tracking process; all are changed or, if one is refused, none. While
        nothing is tracked the shown frame is annealed again.
        """
        if model.knobs is None:
            return model
        declared = {knob.name: knob for knob in all_knobs(model.knobs.settings)}
        shown = model.knobs.shown
        try:
            wanted = {name: checked(declared[name], value) for name, value in changes.items()}
            wanted = {name: value for name, value in wanted.items() if value != shown[name]}
            return self._send_knobs(model, wanted) if wanted else model
        except StudioError as problem:
            self.refused(problem)
            return refuse(model, changes)

    def _send_knobs(self, model: Model, wanted: Mapping[str, Value]) -> Model:
        """Request knobs of the shown run and, while nothing is tracked, its frame, in one command.

        Raises StudioError without a run.
        """
        if self.opened is None or self.opened.run is None:
            raise StudioError("No run is open.", "Open or start a run first.")
        frame = model.selection.frame
        chosen = frame if frame is not None and frame in model.frames else -1
        command = commands.ChangeSettings(
            changes=dict(wanted), frame=chosen, **commands.about(self.opened.run.folder)
        )
        self._process.send(command)
        return request(model, command.identifier, wanted)

    def save_pose(self, model: Model) -> Model:
        """Make the edited pose the session's start pose."""
        if self.opened is None or model.edit is None:
            return model
        session = self.opened.session
        keep_start_pose(session, self.opened.body, model.edit.pose)
        frame = session.start_pose_frame()
        notify(
            self._server,
            "Start pose saved",
            f"New runs begin with it, in frame {frame}.",
        )
        return edit_pose(model, saved)

    def refine_pose(self, model: Model) -> Model:
        """Search around the edited pose, or stop searching."""
        opened, edit = self.opened, model.edit
        if opened is None or edit is None:
            return model
        if self._refining is not None:
            return edit_pose(model, lambda edit: replace(edit, refining=None))
        frame = model.selection.frame if edit.frame is None else edit.frame
        self._refining = PoseRefining(
            opened.session,
            opened.run,
            opened.span[0] if frame is None else frame,
            edit.pose,
            progress=lambda share: self.post(self._refining_at, share),
            done=lambda search, found: self.post(self._refined, search, found),
        )
        return self._refining_at(model, 0.0)

    def _refining_at(self, model: Model, share: float) -> Model:
        return edit_pose(model, lambda edit: replace(edit, refining=share)) if self._refining else model

    def _refined(self, model: Model, search: PoseRefining, found: BetterPose | StudioError) -> Model:
        if search is not self._refining:
            return model
        self._refining = None
        model = edit_pose(model, lambda edit: replace(edit, refining=None))
        if isinstance(found, StudioError):
            self.refused(found)
            return model
        notify(self._server, "Refined", outcome(found))
        return edit_pose(model, lambda edit: moved(edit, found.pose))

    def _open(self, model: Model, session: str, run: str) -> Model:
        """Open a session or run, unless it is shown already. If that fails nothing is open."""
        if (session, run) == (model.selection.session, model.selection.run):
            return model
        same_place = model.subject is not None and model.selection.session == session
        self._close()
        self.model = nothing = opened(model, "", "", None)
        with self._server.atomic():
            self._server.scene.reset()
            self._theme = ""
        if not session:
            return nothing
        place = self._workspace.session(session)
        if not (place.has_footage and place.is_calibrated):
            # Nothing to place in the room yet: the guided set-up shows the next step.
            return opened(model, session, "", None)
        found = self.opened = OpenedRun(place, place.run(run) if run else None)
        self.views = SceneViews(
            self._server,
            found,
            clicked=lambda camera: self.post(camera_clicked, camera),
            volume_made=lambda: self.post(lambda model: replace(model)),
            failed=lambda problem: self.post(self._fail, problem),
        )
        self.views.look_at_person(move_viewers=not same_place)
        subject = subject_of(found)
        self.handles = PoseHandles(self._server, subject.dragger, self.post)
        if found.truth_problem:
            notify(self._server, "The truth cannot be shown", found.truth_problem, bad=True)
        return opened(
            model, session, run, subject, found.frames(), found.settings(), edit_of(found.start_pose())
        )

    def _close(self) -> None:
        """Release what is open and clear the scene."""
        if self._refining is not None:
            self._refining.stop()
        if self.views is not None:
            self.views.close()
        if self.opened is not None:
            self.opened.close()
        self.views = self.opened = self.handles = self._refining = None

    def _fail(self, _: Model, problem: StudioError) -> Model:
        raise problem

    async def _greet(self, client: viser.ClientHandle) -> None:
        def place(model: Model) -> Model:
            if self.views is not None:
                self.views.cameras.place(client)
            return model

        self.post(place)

    # The thread.

    def _run(self) -> None:
        before = time.monotonic()
        while not self._stopping.is_set():
            self._listen(self._patience())
            self._take_posts()
            now = time.monotonic()
            if self.model.playback.playing:
                self._happen(advance, (now - before,))
            before = now
            self._drawings[1].pause = picture_pause(self.model.search)
            for drawing, draw in zip(self._drawings, (self._draw, self._draw_pictures), strict=True):
                if drawing.is_due(now):
                    drawing.done(now)
                    self._guarded(draw)

    def _patience(self) -> float:
        """Seconds to wait for events: until the next redraw is due."""
        now = time.monotonic()
        rest = REDRAW_SECONDS if self.model.playback.playing else IDLE_SECONDS
        return min((drawing.waits(now) for drawing in self._drawings if drawing.is_wanted), default=rest)

    def _listen(self, patience: float) -> None:
        try:
            event = self._events.get(timeout=patience)
            while True:
                if event is not _WAKE:
                    self._happen(self._hear, (event,))
                event = self._events.get_nowait()
        except queue.Empty:
            if self._events.closed:
                self._stopping.wait(REDRAW_SECONDS)

    def _take_posts(self) -> None:
        """Apply the posted changes; of a drag only the newest, so that solving never lags behind the hand."""
        while self._inbox:
            change, values, announce = self._inbox.popleft()
            if change is drag and self._inbox and not values[-1]:
                following, newer, _ = self._inbox[0]
                if following is drag and newer[0] == values[0]:
                    continue
            self._happen(change, values, announce=announce)

    def _hear(self, model: Model, event: Event) -> Model:
        if isinstance(event, Acknowledged):
            if not event.ok and model.knobs is not None and event.identifier in model.knobs.requested:
                self.refused(StudioError(event.message, event.hint))
            return settle(model, event.identifier, event.ok)
        if not isinstance(event, FrameFinished) or event.reannealed or self.opened is None:
            return hear(model, event)
        if (event.session, event.run) != (model.selection.session, model.selection.run):
            return model
        frame = event.result.frame
        self.opened.forget_from(frame)
        # The newest event wins, so some frames may have had no event; and a frame that replaces an older result
        # drops the frames that followed from it.
        newest = model.frames[-1] if model.frames else self.opened.span[0] - 1
        frames = (*model.frames, frame) if frame == newest + 1 else tuple(self.opened.frames())
        return hear(model, event, frames)

    def _happen(self, change: Change, values: tuple[Any, ...], *, announce: bool = True) -> None:
        before = self.model
        after = self._guarded(lambda: change(before, *values))
        if after is not None:
            self.model = after
        if self.model is before:
            return
        self._drawings[0].is_wanted = True
        self._drawings[1].is_wanted |= not same_pictures(before, self.model)
        edit = self.model.edit
        if self._refining is not None and (edit is None or edit.refining is None):
            self._refining.stop()
            self._refining = None
        if announce and self.model.selection != before.selection:
            self._moved(self.model.selection)

    def _guarded(self, action: Callable[[], Any]) -> Any:  # noqa: ANN401 - what the action gives
        """Call an action and handle its errors, so that an unreadable file does not end the thread."""
        try:
            return action()
        except StudioError as problem:
            self.refused(problem)
        except Exception:
            _LOG.exception("The scene could not be drawn.")
        return None

    def _moment(self) -> Moment | None:
        if self.opened is None or self.model.knobs is None:
            return None
        return self.opened.moment(
            self.model.selection.frame,
            self.model.live,
            edited=self.model.edited_pose,
            layers=int(getattr(self.model.knobs.settings.tracker, "layers", 1)),
            track=self.model.options.track,
        )

    def _draw(self) -> None:
        model, tokens = self.model, colour_tokens(self.model.options.dark)
        moment = self._moment()
        if tokens.name != self._theme:
            dress(self._server, tokens)
            self._theme = tokens.name
        self.panel.show(model, moment, tokens)
        if self.views is not None and moment is not None:
            self.views.show(model, moment, tokens)
        if self.handles is not None and model.edit is not None:
            self.handles.show(model.edit, tokens)

    def _draw_pictures(self) -> None:
        moment = self._moment()
        if self.views is not None and moment is not None:
            self.views.hang_pictures(self.model, moment, colour_tokens(self.model.options.dark))


class Due:
    """A redraw, pending or not, at most once in `pause` seconds."""

    def __init__(self, pause: float) -> None:
        self.pause, self.is_wanted, self._last = pause, False, float("-inf")

    def is_due(self, now: float) -> bool:
        """Whether it is pending and its pause is over."""
        return self.is_wanted and now - self._last >= self.pause

    def waits(self, now: float) -> float:
        """Seconds until its pause is over."""
        return max(0.0, self._last + self.pause - now)

    def done(self, now: float) -> None:
        """Note that it was drawn."""
        self._last, self.is_wanted = now, False


def picture_pause(state: StateChanged) -> float:
    """Seconds between two updates of the pictures."""
    return LIVE_PICTURE_SECONDS if state.live is not None and state.state == "tracking" else PICTURE_SECONDS


def subject_of(found: OpenedRun) -> Subject:
    """The model's subject for an opened session or run."""
    try:
        mirror = Mirror(found.body)
    except BodyError:
        mirror = None
    names = tuple(camera.name for camera in found.cameras)
    return Subject(found.body, names, found.span, found.fps, Dragger(found.body), mirror)
