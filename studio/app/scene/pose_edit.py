"""A pose being edited: a start pose, or the corrected pose of a run's frame. A value and plain functions."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from studio.body.dragging import Dragger
from studio.body.mirroring import Mirror
from studio.foundations.arrays import Array

REMEMBERED = 200
UNDO, RESET = "undo", "reset"
MIRROR, ROUND = "mirror left / right", "turn round"


@dataclass(frozen=True, slots=True, eq=False)
class PoseEdit:
    """start, original, pose : (D,) the start pose, the one that `RESET` restores, and the current one.

    active : whether it is edited now; otherwise editing can be resumed. frame : of the run being corrected, None: the
    start pose. past : earlier poses, newest last. source : of the last change; consecutive changes from one source are
    undone together. grip : the limb that carries the gizmo, "" none. held : the limb being dragged, "" the root.
    refining : progress of the search around the pose, 0 to 1. confidence : of a pose that was searched for, as
    text.
    """

    start: Array
    original: Array
    pose: Array
    active: bool = False
    frame: int | None = None
    past: tuple[Array, ...] = ()
    source: str = ""
    grip: str = ""
    held: str | None = None
    refining: float | None = None
    confidence: str = ""

    @property
    def is_moved(self) -> bool:
        """Whether it is another pose than the original."""
        return not np.array_equal(self.pose, self.original)


def edit_of(pose: Array) -> PoseEdit:
    """A start pose (D,) that is not edited yet."""
    return PoseEdit(pose, pose, pose)


def begun(
    edit: PoseEdit, pose: Array | None = None, frame: int | None = None, confidence: str = ""
) -> PoseEdit:
    """Edit the start pose, or the corrected pose of a frame. pose : (D,) to start from; None: the current one."""
    if not edit.active or frame != edit.frame:
        first = pose if frame is not None else edit.start if edit.frame is not None else None
        if first is not None:
            edit = replace(edit_of(first), start=edit.start, grip=edit.grip)
    edit = replace(edit, active=True, frame=frame, confidence=confidence)
    return edit if pose is None else moved(edit, pose)


def ended(edit: PoseEdit) -> PoseEdit:
    """Stop editing; the pose is kept until another session or run is opened."""
    return replace(edit, active=False, held=None, refining=None, confidence="")


def moved(edit: PoseEdit, pose: Array, source: str = "") -> PoseEdit:
    """Take a pose (D,). source : see `PoseEdit`; "": this change is undone separately."""
    edit = replace(edit, active=True)
    if np.array_equal(pose, edit.pose):
        return edit
    joined = bool(source) and source == edit.source
    past = edit.past if joined else (*edit.past, edit.pose)[-REMEMBERED:]
    return replace(edit, pose=np.array(pose, dtype=np.float64), past=past, source=source)


def entry_moved(edit: PoseEdit, index: int, value: float) -> PoseEdit:
    """Give an entry of the pose (radians or mm) another value."""
    pose = edit.pose.copy()
    pose[index] = value
    return moved(edit, pose, source=f"entry {index}")


def dragged(
    edit: PoseEdit, dragger: Dragger, grip: str, place: Array, wxyz: Array, *, is_last: bool
) -> PoseEdit:
    """Bring a limb's end to a place (3,) mm, or ("") the root to a place and attitude. is_last : it is released."""
    if grip:
        pose = dragger.dragged(edit.pose, grip, place).pose
    else:
        turn = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
        pose = dragger.with_root(edit.pose, np.column_stack([turn, place]))
    edit = moved(edit, pose, source=f"drag {grip}")
    return replace(edit, held=None, source="") if is_last else replace(edit, held=grip)


def changed_whole(edit: PoseEdit, change: str, mirror: Mirror | None) -> PoseEdit:
    """UNDO, RESET, MIRROR or ROUND."""
    edit = replace(edit, active=True)
    if change == UNDO:
        past = edit.past
        return replace(edit, source="", pose=past[-1], past=past[:-1]) if past else replace(edit, source="")
    if change == RESET:
        return moved(edit, edit.original)
    if mirror is None:
        return edit
    return moved(edit, (mirror.mirrored if change == MIRROR else mirror.turned_round)(edit.pose))


def saved(edit: PoseEdit) -> PoseEdit:
    """The edit after its pose was stored as the start pose, which is the original now."""
    return replace(edit, start=edit.pose, original=edit.pose)
