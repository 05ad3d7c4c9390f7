"""Where a pose is edited: the start pose of a session, or the right pose of a run's frame.

Drags, sliders, mirror, undo and the short search all come together here, in the scene's thread; what is asked in other
threads is posted. Of a drag only the newest place counts, so a slow solution never lags behind the hand.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray
from viser.transforms import SO3

from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.errors import BodyError, RunError, StudioError
from studio.runs.colour_tokens import ColourTokens, colour_tokens
from studio.runs.start_pose_file import keep_start_pose
from studio.scene.edited_pose import EditedPose
from studio.scene.opened_run import OpenedRun
from studio.scene.panel import Panel, tell
from studio.scene.pose_editor import MIRROR, RESET, ROUND, UNDO
from studio.scene.pose_handles import PoseHandles
from studio.scene.pose_refining import PoseRefining

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Editing:
    """What is being edited. frame : of the run that is corrected, None: the session's start pose. moved : whether it is
    another pose than it was.
    """

    session: str
    run: str
    frame: int | None
    pose: Array
    moved: bool


class PoseDesk:
    """post : does something in the scene's thread. refused : tells the person."""

    def __init__(
        self,
        server: viser.ViserServer,
        post: Callable[[Callable[[], None]], None],
        refused: Callable[[StudioError], None],
    ) -> None:
        self._server, self._post, self._refused = server, post, refused
        self._changed: Callable[[], None] = lambda: None
        self._panel: Panel | None = None
        self._opened: OpenedRun | None = None
        self._dragger: Dragger | None = None
        self._mirror: Mirror | None = None
        self._handles: PoseHandles | None = None
        self._edited = EditedPose(np.zeros(0))
        self._refining: PoseRefining | None = None
        self._active = False
        self._frame: int | None = None
        self._shown_frame: Callable[[], int | None] = lambda: None

    def attach(
        self, panel: Panel, shown_frame: Callable[[], int | None], changed: Callable[[], None]
    ) -> None:
        """Take the panel, who knows which frame is shown, and who is told after each change."""
        self._panel, self._shown_frame, self._changed = panel, shown_frame, changed

    @property
    def pose(self) -> Array | None:
        """(D,) the pose being edited, None while none is."""
        return self._edited.pose if self._active else None

    @property
    def editing(self) -> Editing | None:
        """What is being edited; may be asked from any thread."""
        opened, edited = self._opened, self._edited
        if not self._active or opened is None:
            return None
        run = opened.run.name if opened.run else ""
        return Editing(opened.session.name, run, self._frame, edited.pose.copy(), edited.is_moved)

    def open(self, opened: OpenedRun | None) -> None:
        """Begin anew with the body of what was opened; None: nothing is open."""
        self._stop_refining()
        if self._handles is not None:
            self._handles.remove()
        self._handles = self._dragger = self._mirror = None
        self._opened, self._active, self._frame = opened, False, None
        if opened is None:
            return
        self._dragger = Dragger(opened.body)
        try:
            self._mirror = Mirror(opened.body)
        except BodyError:
            self._mirror = None
        self._edited = EditedPose(opened.start_pose())
        assert self._panel is not None
        grips = tuple(grip.name for grip in self._dragger.grips)
        self._panel.pose.show_body(opened.body, self._edited.pose, grips, has_sides=self._mirror is not None)

    def begin(self, pose: Array | None = None, frame: int | None = None) -> None:
        """Edit the start pose, or (frame) the right pose of a frame. pose : (D,) that it begins with or goes on to;
        None: as it stands.
        """
        if self._opened is None:
            return
        if not self._active or frame != self._frame:
            if frame is not None and pose is not None:
                self._edited = EditedPose(pose)
            elif self._frame is not None:
                self._edited = EditedPose(self._opened.start_pose())
            self._active, self._frame = True, frame
        if pose is not None:
            self._edited.put(pose)
        self._show()

    def end(self) -> None:
        """Leave off; the pose is kept until another one is opened."""
        self._stop_refining()
        self._active = False
        if self._handles is not None:
            self._handles.hide()
        self._show()

    def recolour(self, tokens: ColourTokens) -> None:
        """Take another theme's colours."""
        if self._handles is not None and self._dragger is not None:
            for ball, grip in zip(self._handles.balls, self._dragger.grips, strict=True):
                ball.color = tokens[f"limb-{grip.side}"]

    def ask_editing(self, editing: bool) -> None:
        """Begin or end, in the scene's thread."""
        self._post(self.begin if editing else self.end)

    def ask_value(self, index: int, value: float) -> None:
        """Give one entry another value."""

        def turn() -> None:
            pose = self._edited.pose.copy()
            pose[index] = value
            self._put(pose, hand=f"entry {index}")

        self._post(turn)

    def ask_change(self, what: str) -> None:
        """Undo, reset, mirror or turn round."""
        self._post(lambda: self._change(what))

    def ask_grip(self, name: str) -> None:
        """Put the gizmo on a limb's end."""

        def take() -> None:
            if self._handles is not None:
                self._handles.chosen = name
            self._show()

        self._post(take)

    def ask_refinement(self) -> None:
        """Search around the pose, or stop."""
        self._post(self._refine)

    def ask_saving(self) -> None:
        """Make it the session's start pose."""
        self._post(self._save)

    def _put(self, pose: Array, hand: str = "") -> None:
        self._active = True
        self._edited.put(pose, hand)
        self._show()

    def _change(self, what: str) -> None:
        if what == UNDO:
            self._edited.undo()
        elif what == RESET:
            self._edited.reset()
        elif self._mirror is not None and what in (MIRROR, ROUND):
            act = self._mirror.mirrored if what == MIRROR else self._mirror.turned_round
            self._edited.put(act(self._edited.pose))
        self._active = True
        self._show()

    def _follow(self) -> None:
        """Bring the body to where it is dragged: to the newest place, if there is one."""
        pull = self._handles.take() if self._handles is not None else None
        if pull is None or self._dragger is None:
            return
        pose = self._edited.pose
        if pull.grip:
            moved = self._dragger.dragged(pose, pull.grip, pull.place).pose
        else:
            turn = np.asarray(SO3(pull.wxyz).as_matrix(), dtype=np.float64)
            moved = self._dragger.with_root(pose, np.column_stack([turn, pull.place]))
        self._edited.put(moved, hand=f"drag {pull.grip}")
        if pull.ended:
            self._edited.settle()
        self._show()

    def _save(self) -> None:
        if self._opened is None:
            return
        keep_start_pose(self._opened.session, self._opened.body, self._edited.pose)
        self._edited.saved()
        self._show()
        frame = self._opened.session.start_pose_frame()
        tell(
            self._server,
            "Start pose saved",
            f"Runs that are started from now on begin with it, in frame {frame}.",
        )

    def _refine(self) -> None:
        if self._refining is not None:
            self._stop_refining()
            return
        frame = self._shown_frame() if self._frame is None else self._frame
        if self._opened is None:
            raise RunError("No session is open.", "Open one first.")
        span = self._opened.span
        self._refining = PoseRefining(
            self._opened.session.path,
            self._opened.run,
            span[0] if frame is None else frame,
            self._edited.pose,
            told=lambda share: self._post(lambda: self._told(share)),
            found=lambda found: self._post(lambda: self._found(found)),
        )
        self._refining.start()
        self._told(0.0)

    def _told(self, share: float) -> None:
        if self._refining is not None and self._panel is not None:
            self._panel.pose.show_refining(share)

    def _found(self, found: "PoseRefining") -> None:
        if found is not self._refining:
            return
        self._stop_refining()
        if found.problem is not None:
            self._refused(found.problem)
        elif found.better is not None:
            self._put(found.better.pose)
            tell(self._server, "Refined", found.in_words)

    def _stop_refining(self) -> None:
        if self._refining is not None:
            self._refining.stop()
            self._refining = None
        if self._panel is not None:
            self._panel.pose.show_refining(None)

    def _show(self) -> None:
        """Bring panel and handles to the pose, and have the rest redrawn."""
        if self._panel is None or self._opened is None or self._dragger is None:
            return
        grip = self._handles.chosen if self._handles is not None else ""
        self._panel.pose.show(self._edited, editing=self._active, about=self._about(), grip=grip)
        if self._active:
            if self._handles is None:
                self._handles = self._made_handles(self._dragger)
            pose = self._edited.pose
            self._handles.show(self._dragger.points(pose), self._dragger.root_frame(pose))
        self._changed()

    def _made_handles(self, dragger: Dragger) -> PoseHandles:
        return PoseHandles(
            self._server,
            dragger.grips,
            colour_tokens(dark=True),
            rooted=dragger.root_frame(self._edited.pose) is not None,
            chosen=self.ask_grip,
            pulled=lambda: self._post(self._follow),
        )

    def _about(self) -> str:
        assert self._opened is not None
        if self._frame is None:
            return f"Start pose of **{self._opened.session.name}**"
        run = self._opened.run.name if self._opened.run else ""
        return f"Frame **{self._frame}** of **{run}**, corrected"
