"""A body as the skeleton of an animation: a rest pose of offsets, and turns away from it.

In the rest pose no joint is turned: `offsets` lead from each joint's pivot to its children's, along the world's axes.
A pose turns each joint by the rotation that takes its frame from rest to there. The rest pose is a T-pose where the
body has arms and legs (what Blender, Mixamo and retargeting tools expect): legs straight down, arms stretched sideways
with the palms down, facing x; otherwise the body's neutral pose.

A body's joints as animation formats know them: each turns about one point that is fixed in its parent.

A body's joint may move and turn in any order of steps (`body/model.py`). Here every joint is cut into pieces whose
varying turns all go through one point, its pivot; a piece whose pivot itself moves in its parent is marked as moving.
"""

import dataclasses
from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import MOVE, TURN, BodyModel, Joint, Step
from studio.foundations.arrays import Array

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
    pieces, start, turned = list[tuple[Step, ...]](), 0, False
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


LIMB_MARKERS = tuple(
    f"{side}{name}" for side in "LR" for name in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
)
CHAINS = (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
DOWN = np.array([0.0, 0.0, -1.0])
STUB_MM = 50.0
NOTHING_MM = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton:
    """J joints in the rest pose, mm along the world's axes (z up).

    tree : their names, parents and how poses place them. offsets (J, 3) : from the parent's pivot. turns (J, 3, 3) :
    the frames' rotations at rest. ends : for joints without children the far end of what they carry, from the pivot;
    None for others. kind : "T-pose" or "neutral pose".
    """

    body: BodyModel
    tree: JointTree
    offsets: Array
    turns: Array
    ends: tuple[Array | None, ...]
    kind: str

    @property
    def names(self) -> tuple[str, ...]:
        return self.tree.names

    @property
    def rest_pivots(self) -> Array:
        """(J, 3) mm where the joints are in the rest pose, the root at the origin."""
        places = np.zeros_like(self.offsets)
        for joint, parent in enumerate(self.tree.parents):
            if parent >= 0:
                places[joint] = places[parent] + self.offsets[joint]
        return places

    def animated(self, poses: Array) -> tuple[Array, Array]:
        """Translations (N, J, 3) mm and turns (N, J, 3, 3) of each joint in its parent's turned frame."""
        pivots, frames = self.tree.placed(poses)
        turned = frames @ self.turns.transpose(0, 2, 1)
        moves, turns = np.broadcast_to(self.offsets, pivots.shape).copy(), turned.copy()
        for joint, parent in enumerate(self.tree.parents):
            if parent < 0:
                moves[:, joint] = pivots[:, joint]
                continue
            back = turned[:, parent].transpose(0, 2, 1)
            turns[:, joint] = back @ turned[:, joint]
            if self.tree.moving[joint]:
                moves[:, joint] = (back @ (pivots[:, joint] - pivots[:, parent])[..., None])[..., 0]
        return moves, turns


def skeleton_of(body: BodyModel, rest: str = "tpose") -> Skeleton:
    """The skeleton of a body. rest : "tpose" (where the body has arms and legs) or "neutral"."""
    tree = joint_tree(body)
    neutral = body.neutral[None]
    pivots, frames = (part[0] for part in tree.placed(neutral))
    aims = _aims(body) if rest == "tpose" else {}
    turns = _aim(body, tree, frames, aims)
    offsets = np.zeros_like(pivots)
    for joint, parent in enumerate(tree.parents):
        if parent >= 0:
            offsets[joint] = turns[parent] @ frames[parent].T @ (pivots[joint] - pivots[parent])
    kind = "T-pose" if aims else "neutral pose"
    return Skeleton(body, tree, offsets, turns, _ends(body, tree, turns, offsets), kind)


def _aims(body: BodyModel) -> dict[int, tuple[Array, Array]]:
    """For the joints of arms and legs: the bone's direction in the neutral pose and in the T-pose (world)."""
    index = {marker.name: at for at, marker in enumerate(body.markers)}
    if not {"Neck", *LIMB_MARKERS} <= set(index):
        return {}
    points = marker_points(body, body.neutral)[0]
    across = points[index["LShoulder"]] - points[index["RShoulder"]]
    across[2] = 0.0
    if np.linalg.norm(across) < NOTHING_MM:
        return {}
    across /= np.linalg.norm(across)
    aims: dict[int, tuple[Array, Array]] = {}
    for side, outwards in (("L", across), ("R", -across)):
        for start, end in CHAINS:
            near, far = index[side + start], index[side + end]
            aim = outwards if start in ("Shoulder", "Elbow") else DOWN
            aims[body.markers[near].joint] = (points[far] - points[near], aim)
    return aims


def _aim(body: BodyModel, tree: JointTree, frames: Array, aims: dict[int, tuple[Array, Array]]) -> Array:
    """The frames' rotations at rest: each follows its parent, and those with an aim turn to it the short way."""
    wanted = {tree.whole[joint]: aim for joint, aim in aims.items()}
    turns = frames.copy()
    for joint, parent in enumerate(tree.parents):
        carried = turns[parent] @ frames[parent].T if parent >= 0 else np.eye(3)
        turns[joint] = carried @ frames[joint]
        if joint in wanted:
            bone, aim = wanted[joint]
            turns[joint] = _short_way(carried @ bone, aim) @ turns[joint]
    return turns


def _short_way(start: Array, aim: Array) -> Array:
    """The smallest rotation that takes one direction to another (not opposite ones)."""
    one, two = start / np.linalg.norm(start), aim / np.linalg.norm(aim)
    axis, cosine = np.cross(one, two), float(one @ two)
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + cosine)


def _ends(body: BodyModel, tree: JointTree, turns: Array, offsets: Array) -> tuple[Array | None, ...]:
    """Of each joint without children the farthest of its limbs' ends and markers, else a stub that goes on."""
    origins, pivots = tree.origins(body.neutral[None])[0], tree.placed(body.neutral[None])[0][0]
    frames = tree.placed(body.neutral[None])[1][0]
    carried: dict[int, list[Array]] = {}
    for limb in body.drawn:
        tips = [np.zeros(3), np.array([0.0, 0.0, limb.length])]
        carried.setdefault(tree.whole[limb.joint], []).extend(tips)
    for marker in body.markers:
        carried.setdefault(tree.whole[marker.joint], []).append(np.asarray(marker.offset))
    ends: list[Array | None] = []
    for joint in range(len(tree.names)):
        if joint in tree.parents:
            ends.append(None)
            continue
        shift = frames[joint].T @ (origins[joint] - pivots[joint])
        reach = [turns[joint] @ (point + shift) for point in carried.get(joint, [])]
        farthest = max(reach, key=np.linalg.norm, default=np.zeros(3))
        ends.append(farthest if np.linalg.norm(farthest) > NOTHING_MM else _stub(offsets[joint]))
    return tuple(ends)


def _stub(offset: Array) -> Array:
    length = float(np.linalg.norm(offset))
    return STUB_MM * (offset / length if length > NOTHING_MM else -DOWN)
