"""The order of a body's pose parameters for searches that take one part of the pose at a time.

It is derived from the tree and so holds for any body: the root is what hangs on the world; a limb (an
arm, the head; the groups of the body file) is cut in two behind the first of its two longest drawn parts, at the
elbow or the knee, unless others hang on it; limbs of one kind (both legs) are those whose names differ in their side
only.
"""

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel, joints_above, joints_upwards, moving_joint
from studio.foundations.arrays import Indices
from studio.search.trackers.tracker import Hierarchy

ROOT, NEAR, FAR = 0, 1, 2
SIDES = ("left", "right")


def hierarchy_of(body: BodyModel) -> Hierarchy:
    """Depth, position, subspace and pair of every parameter of the body's pose vector."""
    joint = _joints(body)
    depth = np.full(len(body.parameters), NEAR, dtype=np.int64)
    for limb in _limbs(body):
        if _carries(body, limb, joint):
            continue
        rows = np.array([row for row, entry in enumerate(body.parameters) if entry.limb == limb])
        depth[rows[joint[rows] >= _cut(body, {int(number) for number in joint[rows]})]] = FAR
    depth[[moving_joint(body, body.joints[int(number)].parent) < 0 for number in joint]] = ROOT
    lengths = np.array([entry.kind == "length" for entry in body.parameters])
    position = lengths & (depth == ROOT)
    return Hierarchy(depth, position, _subspaces(body, joint, depth, position), _pairs(body, depth))


def _joints(body: BodyModel) -> Indices:
    """(D,) the first joint that each parameter moves."""
    joints = {
        step.parameter: number
        for number, joint in reversed(list(enumerate(body.joints)))
        for step in joint.steps
        if step.parameter >= 0
    }
    return np.array([joints[row] for row in range(len(body.parameters))], dtype=np.int64)


def _limbs(body: BodyModel) -> tuple[str, ...]:
    return tuple(dict.fromkeys(entry.limb for entry in body.parameters))


def _cut(body: BodyModel, joints: set[int]) -> int:
    """The joint at which the farther part of a limb begins; one past the last where the limb is not cut."""
    lengths: dict[int, float] = {}
    for limb in body.drawn:
        # A cone may sit on a fixed joint below the one that moves it.
        at = next((joint for joint in joints_upwards(body, limb.joint) if joint in joints), -1)
        if at >= 0 and body.joints[at].parent >= 0:
            lengths[at] = max(lengths.get(at, 0.0), abs(limb.length))
    longest = sorted(lengths, key=lambda number: (-lengths[number], number))[:2]
    return max(longest) if len(longest) == 2 else len(body.joints)


def _subspaces(body: BodyModel, joint: Indices, depth: Indices, position: NDArray[np.bool_]) -> Indices:
    """(D,) subspace numbers in the order of the tree, parents first."""
    limbs = _limbs(body)
    first_joint = {limb: _least(joint, [entry.limb == limb for entry in body.parameters]) for limb in limbs}
    keys: list[tuple[int, bool, int, int]] = []
    for row, entry in enumerate(body.parameters):
        if depth[row] == ROOT:
            keys.append((0, not position[row], 0, 0))
        else:
            keys.append((1, not _carries(body, entry.limb, joint), first_joint[entry.limb], int(depth[row])))
    order = {key: number for number, key in enumerate(sorted(set(keys)))}
    return np.array([order[key] for key in keys], dtype=np.int64)


def _carries(body: BodyModel, limb: str, joint: Indices) -> bool:
    """Whether the joints of another limb hang on this one's."""
    own = {int(joint[row]) for row, entry in enumerate(body.parameters) if entry.limb == limb}
    others = {int(number) for number in joint} - own
    return any(above in own for number in others for above in joints_above(body, number))


def _pairs(body: BodyModel, depth: Indices) -> Indices:
    """(D,) the number of a limb's kind where it has a side, else -1."""
    kinds = [_kind(entry.limb) for entry in body.parameters]
    number = {kind: at for at, kind in enumerate(dict.fromkeys(kind for kind in kinds if kind))}
    return np.array(
        [number[kind] if kind and depth[row] != ROOT else -1 for row, kind in enumerate(kinds)],
        dtype=np.int64,
    )


def _kind(limb: str) -> str:
    """A limb's name without its side; empty where it has none."""
    words = limb.split()
    plain = [word for word in words if word not in SIDES]
    return " ".join(plain) if len(plain) < len(words) else ""


def _least(joint: Indices, rows: list[bool]) -> int:
    return int(joint[np.array(rows)].min())
