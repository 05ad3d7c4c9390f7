"""Initial poses of the search for a start pose: all headings, many attitudes of the limbs, placed on the hull.

An attitude's own middle is laid on the hull's mean (Caillette, Galata & Howard 2007, section 6.2, Fig. 7). Headings are
taken all around, evenly: the hull of a person who stands is about as deep as wide, and limbs turn its axes. Lying and
upside-down candidates are added where the hull's longest axis suggests them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.branches import within_limits
from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.evidence.volume.alignment import axes_of_pose, root_candidates, root_parameters, with_root_at
from studio.evidence.volume.blob_model import cone_blobs
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.tracking_space import Box
from studio.foundations.arrays import Array
from studio.foundations.geometry.rotations import axis_turn

IntArray = NDArray[np.int64]

HEADINGS = 16
NARROW, WIDE = 0.12, 0.25
"""Standard deviations of the attitudes drawn about the rest pose, as shares of the joints' ranges; half of each."""
MIDDLE_SHARE = 0.5
"""Share of each side of the box that is sampled where there is no hull."""
UPRIGHT = 0.6
"""A hull whose longest axis is at least so vertical (cosine) is of a person standing, on feet or hands."""


@dataclass(frozen=True, slots=True, eq=False)
class StartCandidates:
    """poses : (N, D). family : (N,) int, equal for candidates of one attitude of the root. fixed : whether the body
    cannot move or turn as a whole.
    """

    poses: Array
    family: IntArray
    fixed: bool


def start_candidates(
    rng: np.random.Generator,
    body: BodyModel,
    hull: Hull | None,
    box: Box,
    per_family: int,
    prototypes: Array | None = None,
) -> StartCandidates:
    """Candidates of `per_family` poses for each of HEADINGS headings, and more where the hull lies.

    hull : where the body is; None or empty: anywhere in the middle of the `box`. prototypes : (K, D) known poses of
    the body: half of each family's attitudes are drawn from them.
    """
    attitudes = _attitudes(rng, body, per_family * HEADINGS, prototypes)
    root = root_parameters(body)
    if not len(root):
        return StartCandidates(attitudes, np.arange(len(attitudes)) // per_family, fixed=True)
    seen = None if hull is None or hull.empty else hull
    turned = _roots(body, seen, root)
    family = np.arange(len(turned) * per_family) // per_family
    poses = attitudes[np.arange(len(family)) % len(attitudes)].copy()
    poses[:, root] = turned[family][:, root]
    targets = _places(rng, body, box, len(poses))
    if seen is not None:
        targets[:] = seen.weights() @ seen.centres
    return StartCandidates(_moved(body, poses, root, targets), family, fixed=False)


def facing(body: BodyModel, poses: Array) -> Array:
    """(N, 3) facing direction of poses (N, D): the root's x axis as unit vectors in the world."""
    root = next(index for index, joint in enumerate(body.joints) if joint.parent < 0)
    return joint_frames(body, poses)[:, root, :, 0]


def _attitudes(rng: np.random.Generator, body: BodyModel, count: int, prototypes: Array | None) -> Array:
    """(count, D) attitudes of all joints; parameters without limits stay at rest."""
    lower, upper = (
        np.array([getattr(entry, end) for entry in body.parameters]) for end in ("lower", "upper")
    )
    bounded = np.isfinite(lower) & np.isfinite(upper)
    ranges = np.where(bounded, upper - lower, 0.0)
    spread = np.where(rng.random((count, 1)) < 0.5, NARROW, WIDE)
    drawn = body.neutral + spread * ranges * rng.standard_normal((count, len(ranges)))
    if prototypes is not None and len(prototypes):
        known = rng.random(count) < 0.5
        drawn[known] = prototypes[rng.integers(len(prototypes), size=int(known.sum()))]
    return np.clip(drawn, np.where(bounded, lower, -np.inf), np.where(bounded, upper, np.inf))


def _places(rng: np.random.Generator, body: BodyModel, box: Box, count: int) -> Array:
    """(count, 3) places of a body that stands somewhere in the middle of a box's floor."""
    places = box.lower + (box.upper - box.lower) * (0.5 + MIDDLE_SHARE * (rng.random((count, 3)) - 0.5))
    places[:, 2] = axes_of_pose(body, body.neutral).mean[2]
    return places


def _roots(body: BodyModel, hull: Hull | None, root: IntArray) -> Array:
    """(R, D) the rest pose turned about the vertical to every heading; then, where the hull lies or may be upside
    down, placed on its principal axes.
    """
    number = next(index for index, joint in enumerate(body.joints) if joint.parent < 0)
    frame = joint_frames(body, body.neutral)[0, number]
    found: list[Array] = []
    for heading in range(HEADINGS):
        turn = axis_turn(2, np.array(2.0 * np.pi * heading / HEADINGS))
        wanted = np.column_stack([turn @ frame[:, :3], frame[:, 3]])
        found.append(with_root_at(body, number, root, body.neutral, wanted))
    if hull is not None:
        found += _laid(body, hull, number)
    return np.stack([within_limits(body, pose) for pose in found])


def _laid(body: BodyModel, hull: Hull, number: int) -> list[Array]:
    """The rest pose on the hull's principal axes, where those candidates are not upright anyway."""
    rest = joint_frames(body, body.neutral)[0, number, :, :3]
    laid = root_candidates(body, hull, body.neutral, upright=False)
    turns = joint_frames(body, laid)[:, number, :, :3] @ rest.T
    return [pose for pose, turn in zip(laid, turns, strict=True) if turn[2, 2] < UPRIGHT]


def _moved(body: BodyModel, poses: Array, root: IntArray, targets: Array) -> Array:
    """Poses (N, D) moved as a whole so that the middle of each one's volume is its target (N, 3)."""
    lengths = np.array(
        [index for index in root if body.parameters[int(index)].kind == "length"], dtype=np.int64
    )
    blobs = cone_blobs(body)

    def middles(some: Array) -> Array:
        mixture = blobs.mixture(body, some)
        return np.einsum("b,nbi->ni", mixture.weights, mixture.means)

    here, moved = middles(poses), poses.copy()
    slopes: list[Array] = []
    for index in lengths:
        pushed = poses.copy()
        pushed[:, index] += 1.0
        slopes.append(middles(pushed) - here)
    steps = np.einsum("nki,ni->nk", np.linalg.pinv(np.stack(slopes, axis=2)), targets - here)
    moved[:, lengths] += steps
    return moved
