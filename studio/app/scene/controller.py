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
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal, TypeVarTuple

import numpy as np
import viser

from studio.app.scene import METRES_PER_MM
from studio.app.scene.body_trial import TrialView, trial_pose
from studio.app.scene.controls import Change
from studio.app.scene.floor_view import FloorView, light
from studio.app.scene.model import (
    STEP_RATE,
    LayerPlayback,
    Model,
    Selection,
    Subject,
    Trial,
    advance,
    advance_layers,
    camera_clicked,
    change_options,
    edit_pose,
    hear,
    limb_clicked,
    look_through,
    only_phase_differs,
    opened,
    point_at,
    refuse,
    request,
    same_drawing,
    same_panel,
    same_pictures,
    scrub,
    select,
    set_playback,
    settle,
    show_frame,
    stop_layers,
)
from studio.app.scene.opened_run import Moment, OpenedRun
from studio.app.scene.panel import Panel, dress, notify
from studio.app.scene.pose_edit import begun, edit_of, ended, moved, saved
from studio.app.scene.pose_handles import PoseHandles, drag
from studio.app.scene.pose_refining import PoseRefining, outcome
from studio.app.scene.scene_views import SceneViews, first_view
from studio.app.scene.search_view import Pointed
from studio.app.scene.twin import Places, differ, following, joining
from studio.app.scene.viewers import Viewers, place_viewer
from studio.app.scene.viewpoint import Eye, Preset, direction, framed, is_in_sight, is_well_framed, zoomed
from studio.body.dragging import Dragger
from studio.body.forward_kinematics import limb_ends
from studio.body.mirroring import Mirror
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, StudioError
from studio.foundations.knobs import Value, checked
from studio.operations.jobs import commands
from studio.operations.jobs.control import StudioControl
from studio.operations.jobs.events import (
    Acknowledged,
    Event,
    FrameFinished,
    LayerFinished,
    RunState,
    StateChanged,
)
from studio.operations.poses import set_start_pose
from studio.runs.drawing.colour_tokens import ColourTokens, colour_tokens
from studio.runs.setup.pose_search import BetterPose
from studio.search.settings import all_knobs
from studio.sessions.workspace import Workspace

REDRAW_SECONDS = 1.0 / 30.0
TRAVEL_SECONDS = 1.0 / 19.0
"""Between two places of particles that travel from one layer to the next: often enough to be seen as one motion."""
PICTURE_SECONDS, LIVE_PICTURE_SECONDS = 1.0 / 10.0, 1.0 / 2.0
"""Composing pictures ten times a second costs a third of a core, which a live run needs."""
PICTURES_WAIT, ANNEALED_PICTURES_WAIT = 0.06, 0.4
"""Seconds without another change after which pictures are composed, so that a burst of changes has its pictures once,
and a frame that is annealed again its clouds before: a browser that draws in software takes so long for them."""
IDLE_SECONDS = 0.5
POINTED_PIXELS = 12.0
"""Between the pointer and a particle that it is on."""
SHARES = 0.1, 0.05
"""Of a core's time that a scene and its pictures take while frames are tracked as fast as they can be."""
_LOG = logging.getLogger(__name__)
_WAKE = Event("", "")


Move = Preset | Literal["body", "first"]
Values = TypeVarTuple("Values")


class SceneController:
    """Owns a scene's model and views. moved : called in the scene's thread with the selection and the playback of
    layers whenever the scene's controls, playback or the tracking changed the selection, or anything whether and how
    layers are played; it must return at once.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        workspace: Workspace,
        process: StudioControl,
        moved: Callable[[Selection, LayerPlayback], None],
    ) -> None:
        self._server, self._workspace, self._process, self._moved = server, workspace, process, moved
        self.model = Model(process.state)
        self.opened: OpenedRun | None = None
        self.views: SceneViews | None = None
        self.handles: PoseHandles | None = None
        self._refining: PoseRefining | None = None
        self._events = process.subscribe(self._concerns)
        self._inbox: deque[tuple[Change, tuple[Any, ...], bool]] = deque()
        self._drawings = Due(REDRAW_SECONDS), Due(PICTURE_SECONDS, PICTURES_WAIT)
        self._travelling = Due(REDRAW_SECONDS)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="scene", daemon=True)
        self._theme, self._has_shadows = "", True
        self.bare = False
        """Whether it has no controls."""
        self.viewers = Viewers(server, self._move_with_viewer)
        self._centre: Array | None = None
        self._frames_next = False
        self._twin: SceneController | None = None
        self._is_leading, self._places = True, Places()
        self._trial: TrialView | None = None
        self._panel_of: Model | None = None
        self._floor: FloorView | None = None
        self.panel = Panel(server, self.post, self.request_knobs, self.refine_pose, self.save_pose)
        server.on_client_connect(self._greet)

    def start(self) -> None:
        self.post(lambda model: hear(model, self._process.state))
        self._thread.start()

    def stop(self) -> None:
        """End drawing and release files; returns when the thread has ended."""
        self._stopping.set()
        self._events.close()
        if self._thread.is_alive():
            self._thread.join(timeout=10.0)
        self._close()

    def post(
        self, change: Callable[[Model, *Values], Model], *values: *Values, announce: bool = True
    ) -> None:
        """Queue a change. announce : whether `moved` is called for it; callers from outside know already."""
        self._inbox.append((change, values, announce))
        self._events.put(_WAKE)

    def draw_now(self, drawn: Callable[[int], None]) -> None:
        """Draw, after the changes that are posted already, and call `drawn` with the number of layers there are."""

        def draw(model: Model) -> Model:
            self._run_safely(self._draw)
            drawn(self._layers_so_far())
            return model

        self.post(draw, announce=False)

    def refused(self, problem: StudioError) -> None:
        """Show a refusal to every viewer."""
        notify(self._server, problem.message, problem.hint, bad=True)

    def lead(self, follower: "SceneController | None") -> None:
        """Let another scene show the same moment in the same way from now on; None: no longer."""
        for one in (self._twin, follower):
            if one is not None:
                one._twin, one._is_leading = (self if one is follower else None), one is not follower
        self._twin, self._is_leading = follower, True
        if follower is not None:
            # Before a trial that is to be shown there: a run that is opened after it would drop it.
            follower.post(follower.join, self.model)
            self.post(self._bring_along)

    def _bring_along(self, model: Model) -> Model:
        """Let the twin show what is shown here, seen from where it is seen here."""
        if self._twin is not None:
            self._twin.post(self._twin.join, model)
            for client in self._server.get_clients().values():
                self._twin.put_viewers(
                    (*map(float, client.camera.position), *map(float, client.camera.look_at))
                )
        return model

    def join(self, model: Model, other: Model) -> Model:
        """Show what the other of two scenes shows (`twin`)."""
        if self._is_leading:
            return joining(model, other)
        return following(self._open(model, other.selection.session, other.selection.run), other)

    def put_viewers(self, eye: tuple[float, ...]) -> None:
        """Put this scene's viewers to a place, looking at another (6,) metres; from any thread."""
        self._places.note(eye)
        for client in self._server.get_clients().values():
            place_viewer(client, eye)

    def _move_with_viewer(self, eye: Eye) -> None:
        """Viewers were put somewhere: the other scene's come along."""
        self._places.note(eye)
        if self._twin is not None:
            self._twin.put_viewers(eye)

    def _sees(self, camera: viser.CameraHandle) -> None:
        """A viewer moved: the other scene's come along."""
        eye = (*map(float, camera.position), *map(float, camera.look_at))
        is_own = not self._places.is_echo(eye)
        if self._twin is not None and is_own and not (self._is_leading or self._places.is_reached):
            return
        self.viewers.looking, self.viewers.is_answer = camera, not is_own
        if is_own:
            self._move_with_viewer(eye)

    # Changes that need more than the model.

    def show_run(
        self,
        model: Model,
        session: str,
        run: str,
        frame: int | None = None,
        layer: int | None = None,
        *,
        is_scrubbed: bool = True,
    ) -> Model:
        """Show a session ("" : none) and one of its runs ("" : none), a frame (None: as it is), a layer. is_scrubbed :
        whether the layer was chosen by hand, else playing layers continue.
        """
        model = show_frame(replace(self._open(model, session, run), trial=None), frame)
        return scrub(model, layer) if is_scrubbed or not model.layers.playing else model

    def try_body(self, model: Model, session: str, body: BodyModel | None) -> Model:
        """Show a body that is being made in place of a session's own, or ("") alone on the floor; None: no longer."""
        model = self._open(model, session, "")
        if self.opened is not None and model.trial is None:
            model = show_frame(model, self.opened.session.start_pose_frame())
        trial = None if body is None else Trial(body, trial_pose(body, self.opened))
        if trial is not None and model.trial is None and self.opened is None:
            self._show_alone(trial)
        return replace(model, trial=trial)

    def _show_alone(self, trial: Trial) -> None:
        """Let viewers see a body without a session."""
        place, scale = limb_ends(trial.body, trial.pose)[0].reshape(-1, 3), scale_of(trial.body)
        with self._server.atomic():
            self._floor = FloorView(self._server, [place.mean(axis=0)], scale)
        view = self._server.initial_camera
        view.position, view.look_at = first_view(place * METRES_PER_MM, [], scale)
        self.viewers.put(self.viewers.first_eye)

    def propose_pose(self, model: Model, session: str, pose: Array, text: str, frame: int | None) -> Model:
        """Show a found start pose (D,) without a run, if it fits the session's body.

        It stays until the user saves it, ends the editing, opens a run or another session, or tracks.
        """
        notify(self._server, "Start pose found", text)
        model = self.show_run(model, session, "")
        if model.subject is None or len(model.subject.body.parameters) != len(pose):
            return model
        return show_frame(edit_pose(model, lambda edit: begun(edit, pose, confidence=text)), frame)

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
        kept = set_start_pose(self.opened.session, model.edit.pose.tolist(), body=self.opened.body)
        notify(self._server, "Start pose saved", f"New runs begin with it, in frame {kept.frame}.")
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
            done=lambda search, better: self.post(self._refined, search, better),
        )
        return self._refining_at(model, 0.0)

    def _refining_at(self, model: Model, share: float) -> Model:
        return edit_pose(model, lambda edit: replace(edit, refining=share)) if self._refining else model

    def _refined(self, model: Model, search: PoseRefining, better: BetterPose | StudioError) -> Model:
        if search is not self._refining:
            return model
        self._refining = None
        model = edit_pose(model, lambda edit: replace(edit, refining=None))
        if isinstance(better, StudioError):
            self.refused(better)
            return model
        notify(self._server, "Refined", outcome(better))
        return edit_pose(model, lambda edit: moved(edit, better.pose))

    def _open(self, model: Model, session: str, run: str) -> Model:
        """Open a session or run, unless it is shown already. If that fails nothing is open."""
        if (session, run) == (model.selection.session, model.selection.run):
            return model
        same_place = model.subject is not None and model.selection.session == session
        framed = self.viewers.framed if same_place else None
        self._close()
        # Layers that are looked at already are those of another body now.
        self.viewers.framed, self._frames_next = framed, self._is_leading
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
        current = self.opened = OpenedRun(place, place.run(run) if run else None)
        self.views = SceneViews(
            self._server,
            current,
            clicked=lambda camera, twice: self.post(camera_clicked, camera, twice),
            limb_clicked=lambda limb, at: self.post(self._click_limb, limb, at),
            volume_made=lambda: self.post(lambda model: replace(model)),
            failed=lambda problem: self.post(self._fail, problem),
        )
        self.views.look_at_person(move_viewers=self._is_leading and not same_place)
        subject = subject_of(current)
        self.handles = PoseHandles(self._server, subject.dragger, self.post)
        if current.results is not None and not current.results.is_checked():
            threading.Thread(target=self._check, args=(current,), name="scene-check", daemon=True).start()
        if current.truth_problem:
            notify(self._server, "The truth cannot be shown", current.truth_problem, bad=True)
        return opened(
            model, session, run, subject, current.frames(), current.settings(), edit_of(current.start_pose())
        )

    def _check(self, opened: OpenedRun) -> None:
        """Read all that is stored, beside the scene's thread, and leave out what is damaged."""
        with suppress(StudioError):
            self.post(self._leave_out, opened, opened.damaged_frames())

    def _leave_out(self, model: Model, opened: OpenedRun, damaged: set[int]) -> Model:
        """Leave out the frames that were found damaged after their run was opened."""
        if opened is not self.opened or not damaged.intersection(model.frames):
            return model
        model = replace(model, frames=tuple(frame for frame in model.frames if frame not in damaged))
        opened.forget_from(min(damaged))
        return show_frame(model, model.selection.frame)

    def _close(self) -> None:
        """Release what is open and clear the scene."""
        if self._refining is not None:
            self._refining.stop()
        if self.views is not None:
            self.views.close()
        if self.opened is not None:
            self.opened.close()
        self.views = self.opened = self.handles = self._refining = None
        self._trial = self._floor = None
        self._centre = self.viewers.framed = None

    def _fail(self, _: Model, problem: StudioError) -> Model:
        raise problem

    async def _greet(self, client: viser.ClientHandle) -> None:
        def place(model: Model) -> Model:
            eye = model.selection.eye or self.viewers.framed
            if eye is not None:
                self.viewers.put(eye, client)
            if self.views is not None:
                self.views.cameras.place(client)
            now = time.monotonic()
            self.viewers.settle(now)
            self._drawings[0].want(now)
            if self._twin is not None and not self._is_leading:
                self._twin.post(self._twin._bring_along)
            return model

        self._places = Places()
        self.post(place)
        client.camera.on_update(self._sees)

    # From where it is looked at.

    def look_from(self, model: Model, eye: Eye | None) -> Model:
        """Put the viewers' eyes at a place, looking at another (6,) metres; None: the usual place."""
        if eye == model.selection.eye:
            return model
        self.viewers.put(self.viewers.usual_eye if eye is None else eye)
        return select(model, eye=eye)

    def move_camera(self, model: Model, move: Move) -> Model:
        """Let the viewers go to where the body is framed, to a preset, or back to the first view."""
        model = self._leave_camera(model)
        now = time.monotonic()
        if move == "first":
            self.viewers.framed = None
            self.viewers.ease(self.viewers.first_eye, now)
            return select(change_options(model, {"follows_body": False}), eye=None)
        body = self._shown_body()
        if body is None or self.opened is None:
            return model
        eye = self.viewers.eye()
        toward = (
            np.array(eye[:3]) - np.array(eye[3:])
            if move == "body"
            else direction(move, self.opened.body, body)
        )
        lens = self.viewers.lens()
        self.viewers.framed, self.viewers.framed_for = framed(body.reshape(-1, 3), toward, *lens), lens[1]
        self.viewers.ease(self.viewers.framed, now)
        return select(model, eye=None)

    def zoom(self, model: Model, factor: float, at: tuple[float, float]) -> Model:
        """Take the viewers nearer to what is at `at` (shares of the view), or away; the body is never lost."""
        body = self._shown_body()
        if body is None:
            return model
        model = self._leave_camera(model)
        eye = zoomed(self.viewers.eye(), factor, at, *self.viewers.lens(), body.reshape(-1, 3))
        self.viewers.put(eye)
        return select(model, eye=tuple(round(number, 3) for number in eye))

    def point(
        self, model: Model, at: tuple[float, float] | None, choose: bool, answer: Future[Pointed | None]
    ) -> Model:
        """Draw the line of the particle at `at` (shares of the view; None: the pointer left), or choose it."""
        pointed = None if at is None else self._particle_at(model, at)
        answer.set_result(pointed)
        if not choose:
            return point_at(model, None if pointed is None else pointed.particle)
        if pointed is None:
            return model
        model = stop_layers(model)
        same = pointed.particle == model.selection.particle
        return select(model, layer=pointed.layer, particle=None if same else pointed.particle)

    def _particle_at(self, model: Model, at: tuple[float, float]) -> Pointed | None:
        if self.views is None or not model.is_looking_at_layers:
            return None
        reach = POINTED_PIXELS / self.viewers.height()
        return self.views.search.pointed(at, self.viewers.eye(), self.viewers.lens(), reach)

    def _click_limb(self, model: Model, limb: str, at: tuple[float, float]) -> Model:
        """Choose a limb, or let it go; of a body of glass a particle before or behind it comes first."""
        return model if self._particle_at(model, at) is not None else limb_clicked(model, limb)

    def _leave_camera(self, model: Model) -> Model:
        """Look through no camera any more, from where the viewers are."""
        if model.selection.look_through is None or self.views is None:
            return model
        self.views.cameras.leave_here()
        return look_through(model, None)

    def _shown_body(self) -> Array | None:
        """(L, 2, 3) metres: both ends of the shown body's limbs."""
        moment = self._moment()
        if self.opened is None or moment is None or moment.pose is None:
            return None
        return limb_ends(self.opened.body, moment.pose[None])[0] * METRES_PER_MM

    def _frame_for_layers(self, model: Model) -> Model:
        """Frame the body as its layers begin to be looked at, unless a viewer chose a place from where it is seen."""
        body = self._shown_body()
        if body is None or model.selection.look_through is not None:
            return model
        points, eye, lens = body.reshape(-1, 3), self.viewers.eye(), self.viewers.lens()
        is_chosen = model.selection.eye is not None and is_in_sight(points, eye, *lens)
        return model if is_chosen or is_well_framed(points, eye, *lens) else self.move_camera(model, "body")

    def _frame_again(self, model: Model) -> Model:
        """Frame a framed body again where the view took another shape; for the first time once a viewer has come."""
        if self._frames_next:
            self._drawings[0].want(time.monotonic())
        is_framed = self._is_leading and model.selection.eye is None and model.selection.look_through is None
        if not (is_framed and self.viewers.is_reshaped) or self.viewers.is_moving:
            return model
        return self.move_camera(model, "body")

    def _follow_body(self) -> None:
        """Take the viewers along with the body, where they follow it."""
        follows = self.model.options.follows_body and self._is_leading
        body = self._shown_body() if follows else None
        centre = None if body is None else body.reshape(-1, 3).mean(axis=0)
        before, self._centre = self._centre, centre
        if centre is None or before is None or self.model.selection.look_through is not None:
            return
        shift = centre - before
        if float(np.abs(shift).max()) > 1e-4:
            self.viewers.shift(shift, self.model.selection.eye is None)

    def _note_eye(self, model: Model) -> Model:
        """Note from where a viewer looks; one who is dragged out of a camera no longer looks through it."""
        if self.viewers.is_answer:
            self.viewers.looking = None
            return model
        through = model.selection.look_through
        if through is None:
            moved = self.viewers.moved_eye(model.selection.eye, time.monotonic())
            return model if moved is None or model.options.follows_body else select(model, eye=moved[0])
        if self.views is None:
            return model
        plane = self.views.cameras.views[through].plane
        if not self.viewers.was_dragged_from(through, plane.position, plane.forward):
            return model
        return self._leave_camera(model)

    # The thread.

    def _run(self) -> None:
        before = time.monotonic()
        while not self._stopping.is_set():
            self._pace()
            self._listen(self._patience())
            self._take_posts()
            if self.viewers.looking is not None:
                self._happen(self._note_eye, ())
                self._happen(self._frame_again, ())
            now = time.monotonic()
            if self.model.playback.playing:
                self._happen(advance, (now - before,))
            if self.model.layers.playing or self.model.layers.phase < 1.0:
                self._happen(advance_layers, (self._layers_time(now - before), self._layers_so_far()))
            before = now
            self.viewers.tick(now)
            if self._travelling.is_due(now) and not self._drawings[0].is_wanted and self.views is not None:
                self._travelling.done(now)
                self.views.travel(self.model.layers.phase)
            self._pace()
            for drawing, draw in zip(self._drawings, (self._draw, self._draw_pictures), strict=True):
                if drawing.is_due(now):
                    drawing.done(now)
                    began = time.thread_time()
                    self._run_safely(draw)
                    drawing.took = time.thread_time() - began

    def _pace(self) -> None:
        """Set how soon what is pending is drawn; layers that are annealed again and come together are drawn at once."""
        (scene, pictures), late = self._drawings, is_annealed_again(self.model)
        scene.calm = REDRAW_SECONDS if late else 0.0
        pictures.calm = ANNEALED_PICTURES_WAIT if late else PICTURES_WAIT
        pictures.pause = LIVE_PICTURE_SECONDS if late else picture_pause(self.model.search)
        search = self.model.search
        is_fast = search.state is RunState.TRACKING and not search.seconds_a_layer
        scene.share, pictures.share = SHARES if is_fast else (1.0, 1.0)

    def _patience(self) -> float:
        """Seconds to wait for events: until the next redraw is due."""
        now = time.monotonic()
        layers = self.model.layers
        travels = layers.playing or layers.phase < 1.0
        moves = self.model.playback.playing or self.viewers.is_moving
        rest = REDRAW_SECONDS if moves else TRAVEL_SECONDS if travels else IDLE_SECONDS
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
            for drawing in self._drawings:
                drawing.took = 0.0  # What a person does is drawn at once.
            if change is drag and self._inbox and not values[-1]:
                following, newer, _ = self._inbox[0]
                if following is drag and newer[0] == values[0]:
                    continue
            self._happen(change, values, announce=announce)

    def _concerns(self, event: Event) -> bool:
        """Whether an event is for this scene, as far as its sender can tell: layers of other runs are many."""
        shown = self.model.selection
        return not isinstance(event, LayerFinished) or (event.session, event.run) == (
            shown.session,
            shown.run,
        )

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
        after = self._run_safely(lambda: change(before, *values))
        if after is not None:
            self.model = after
        if self.model is before or same_drawing(before, self.model):
            return
        if self._is_leading and self.model.is_looking_at_layers and not before.is_looking_at_layers:
            self._frames_next = True
        through = self.model.selection.look_through
        if through is not None and through != before.selection.look_through:
            self.viewers.entered()
        now = time.monotonic()
        if only_phase_differs(before, self.model):
            self._travelling.want(now)
            return
        self._drawings[0].want(now)
        if self._drawings[1].is_wanted or not same_pictures(before, self.model):
            self._drawings[1].want(now)
        edit = self.model.edit
        if self._refining is not None and (edit is None or edit.refining is None):
            self._refining.stop()
            self._refining = None
        twin = self._twin
        if twin is not None and change != self.join and differ(before, self.model):
            twin.post(twin.join, self.model)
        is_moved = announce and self.model.selection != before.selection
        if is_moved or self.model.layers.state != before.layers.state:
            self._moved(self.model.selection, self.model.layers)

    def _run_safely(self, action: Callable[[], Any]) -> Any:  # noqa: ANN401 - what the action gives
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

    def _layers_time(self, seconds: float) -> float:
        """The time that passes for layers: in a scene that follows, particles travel as fast as in the leading one."""
        leader = None if self._is_leading else self._twin
        plays = leader is not None and leader.model.layers.playing
        return seconds * self.model.layers.rate / STEP_RATE if plays else seconds

    def _layers_so_far(self) -> int:
        """How many layers of the shown frame are there: of what was tried where the twin shows it, as on the page."""
        moment, twin = self._moment(), self._twin
        tried = twin.model.live.records if twin else ()
        records = tried or (moment.records if moment is not None else ())
        return max((record.layer + 1 for record in records), default=0)

    def _draw(self) -> None:
        model, tokens = self.model, colour_tokens(self.model.options.dark)
        moment = self._moment()
        if tokens.name != self._theme:
            dress(self._server, tokens)
            self._theme = tokens.name
        if model.options.shadows != self._has_shadows:
            self._has_shadows = model.options.shadows
            light(self._server, self._has_shadows)
        if self.bare:
            self.panel.hide()
        elif self._panel_of is None or not same_panel(self._panel_of, model):
            self.panel.show(model, moment, tokens)
            self._panel_of = model
        if self.views is not None and moment is not None:
            self.views.show(model, moment, tokens)
            self._follow_body()
            if self._frames_next and self.viewers.has_come:
                self._frames_next = False
                if model.is_looking_at_layers:
                    self.model = self._frame_for_layers(self.model)
        if self.handles is not None and model.edit is not None:
            self.handles.show(model.edit, tokens)
        self._draw_trial(model, tokens)
        # Knobs and poses are not of a body that is being made.
        has_controls = not self.bare and model.trial is None
        if self.panel.tabs.visible != has_controls:
            self.panel.tabs.visible = has_controls

    def _draw_trial(self, model: Model, tokens: ColourTokens) -> None:
        """Draw the body that is being made, again where it changed."""
        trial = model.trial
        with self._server.atomic():
            if self._trial is not None and (trial is None or self._trial.trial is not trial):
                self._trial.remove()
                self._trial = None
            if trial is None:
                return
            self._trial = self._trial or TrialView(self._server, trial)
            self._trial.show(tokens, model.selection.look_through is None)
            if self._floor is not None:
                self._floor.show(tokens, shadows=model.options.shadows)

    def _draw_pictures(self) -> None:
        moment = self._moment()
        if self.views is not None and moment is not None:
            self.views.hang_pictures(self.model, moment, colour_tokens(self.model.options.dark))


class Due:
    """A redraw, pending or not, at most once in `pause` seconds. calm : seconds without a further change that it waits
    for, no longer than the pause. share : of a core's time that it may take. took : seconds of
    it that it took last.
    """

    def __init__(self, pause: float, calm: float = 0.0) -> None:
        self.pause, self.calm, self.share, self.is_wanted = pause, calm, 1.0, False
        self._last = self._first = self._newest = float("-inf")
        self.took = 0.0

    def want(self, now: float) -> None:
        """Note a change that is to be drawn."""
        if not self.is_wanted:
            self._first = now
        self._newest, self.is_wanted = now, True

    def is_due(self, now: float) -> bool:
        """Whether it is pending and neither its pause nor further changes hold it up."""
        return self.is_wanted and now >= self._from()

    def waits(self, now: float) -> float:
        """Seconds until it is due, if nothing changes meanwhile."""
        return max(0.0, self._from() - now)

    def done(self, now: float) -> None:
        self._last, self.is_wanted = now, False

    def _from(self) -> float:
        pause = max(self.pause, self.took / self.share)
        return max(self._last + pause, min(self._newest + self.calm, self._first + self.pause))


def picture_pause(state: StateChanged) -> float:
    """Seconds between two updates of the pictures; what is searched comes first."""
    searches = state.state is RunState.REANNEALING or (
        state.live is not None and state.state is RunState.TRACKING
    )
    return LIVE_PICTURE_SECONDS if searches else PICTURE_SECONDS


def is_annealed_again(model: Model) -> bool:
    """Whether the shown frame is annealed again or was: from the moved knob on, until another frame is shown."""
    if model.is_searching:
        return False
    return model.live.reannealed or (model.knobs is not None and bool(model.knobs.requested))


def subject_of(opened: OpenedRun) -> Subject:
    """The model's subject for an opened session or run."""
    try:
        mirror = Mirror(opened.body)
    except BodyError:
        mirror = None
    names = tuple(camera.name for camera in opened.cameras)
    return Subject(opened.body, names, opened.span, opened.fps, Dragger(opened.body), mirror)
