"""A body's joints as animation formats know them: each turns about one point that is fixed in its parent.

A body's joint may move and turn in any order of steps (`body/model.py`). Here every joint is cut into pieces whose
varying turns all go through one point, its pivot; a piece whose pivot itself moves in its parent is marked as moving.
"""

import dataclasses
from dataclasses import dataclass

from studio.arrays import Array
from studio.body.forward_kinematics import joint_frames
from studio.body.model import MOVE, TURN, BodyModel, Joint, Step

BASE = "base"


@dataclass(frozen=True, slots=True, eq=False)
class JointTree:
    """J joints, parents first, one root.

    names, parents (J,) : of the cut tree. moving (J,) : whether the pivot moves in the parent (true of the root).
    whole (F,) : for each of the body's own joints the piece whose frame is the joint's frame.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    moving: tuple[bool, ...]
    whole: tuple[int, ...]
    _paired: BodyModel

    def placed(self, poses: Array) -> tuple[Array, Array]:
        """Pivots (N, J, 3) mm and the pieces' world rotations (N, J, 3, 3) at poses (N, D)."""
        frames = joint_frames(self._paired, poses)
        return frames[:, 0::2, :, 3], frames[:, 1::2, :, :3]

    def origins(self, poses: Array) -> Array:
        """(N, J, 3) mm: the origins of the pieces' frames, which lie rigidly on them."""
        return joint_frames(self._paired, poses)[:, 1::2, :, 3]


def joint_tree(body: BodyModel) -> JointTree:
    """The tree of a body."""
    roots = sum(joint.parent < 0 for joint in body.joints)
    names: list[str] = [BASE] if roots > 1 else []
    parents: list[int] = [-1] * len(names)
    moving: list[bool] = [True] * len(names)
    steps: list[tuple[tuple[Step, ...], tuple[Step, ...]]] = [((), ()) for _ in names]
    whole: list[int] = []
    for joint in body.joints:
        parent = whole[joint.parent] if joint.parent >= 0 else (0 if roots > 1 else -1)
        pieces = _pieces(joint.steps)
        for index, piece in enumerate(pieces):
            last = index == len(pieces) - 1
            before, after = _at_pivot(piece)
            names.append(joint.name if last else f"{joint.name}_{index + 1}")
            parents.append(parent)
            moving.append(parent < 0 or any(_varies(step) for step in before))
            steps.append((before, after))
            parent = len(names) - 1
        whole.append(parent)
    paired: list[Joint] = []
    for name, parent, (before, after) in zip(names, parents, steps, strict=True):
        paired.append(Joint(f"{name}:pivot", 2 * parent + 1 if parent >= 0 else -1, before))
        paired.append(Joint(name, len(paired) - 1, after))
    bare = dataclasses.replace(body, joints=tuple(paired), limbs=(), markers=(), definition=None)
    return JointTree(tuple(names), tuple(parents), tuple(moving), tuple(whole), bare)


def _varies(step: Step) -> bool:
    return step.parameter >= 0


def _pieces(steps: tuple[Step, ...]) -> list[tuple[Step, ...]]:
    """Runs of steps each of whose varying turns go through one point: cut before a move between two of them, and
    before a move that varies.
    """
    varying = [index for index, step in enumerate(steps) if _varies(step)]
    last = varying[-1] if varying else -1
    pieces, start, turned = [], 0, False
    for index, step in enumerate(steps):
        if step.kind == TURN:
            turned = turned or _varies(step)
        elif turned and (_varies(step) or (step.value != 0.0 and index < last)):
            pieces.append(steps[start:index])
            start, turned = index, False
    return [*pieces, steps[start:]]


def _at_pivot(piece: tuple[Step, ...]) -> tuple[tuple[Step, ...], tuple[Step, ...]]:
    """The steps before the first varying turn, which reach the pivot, and the others.

    A piece that nothing turns (a stiff ankle) has its pivot where it would turn: before the first turn after a move.
    """
    first = next((at for at, step in enumerate(piece) if _varies(step) and step.kind == TURN), None)
    if first is None:
        moved = next((at for at, step in enumerate(piece) if step.kind == MOVE), len(piece))
        first = next((at for at in range(moved, len(piece)) if piece[at].kind == TURN), len(piece))
        first = max([first, *(at + 1 for at, step in enumerate(piece) if _varies(step))])
    return piece[:first], piece[first:]
