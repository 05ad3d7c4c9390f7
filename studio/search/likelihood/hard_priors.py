"""Hard priors: joint limits are kept, and no limb is inside another.

The two hard priors of Balan, Sigal & Black 2005 as Fleischmann et al. 2012, section 2.3, use them. Limbs are compared
in pairs by how far their axes are apart, as a share of the two radii between them (`hard_prior_kernels`): 1 where they
touch, 0 where their axes cross. A pair may come as near as its `least` share:

- Radii are those of clothes and flesh, which give way, and inverse kinematics and markers have errors. In recorded
walks, runs,
  jumps, dance and a cartwheel laid on human31, limbs come down to 0.39 of their radii (a foot at the other thigh;
  shins in trousers of 80 mm that pass each other: 0.51), trunk and head to 0.60. So arms and legs may come as near as
  LIMB_SHARE, about where bones would meet; trunk and head are wide by bones and keep TRUNK_SHARE.
- Limbs that are joined are not compared where the one begins inside the other (knee, hip, neck); an upper arm begins
  beside the trunk and is.
- Pairs that overlap at rest may come NEUTRAL_SHARE as near as they are in the rest pose, if that is nearer; pairs
  without distance at rest (collar bones that begin at one point) are not compared.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import checked_poses, joint_frames, limb_frames
from studio.body.model import BodyModel, joints_above, kinematic_tables, moving_joint
from studio.foundations.arrays import Array, Floats
from studio.foundations.errors import BodyError
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.hard_prior_kernels import hold_blocks, ratio_blocks
from studio.search.likelihood.kinematic_program import KinematicProgram, compile_program
from studio.search.likelihood.outline_kernels import LANES

IntArray = NDArray[np.int64]

LIMB_SHARE = 0.35
TRUNK_SHARE = 0.5
NEUTRAL_SHARE = 0.75
# A least share below which a pair is not compared at all.
NOTHING_LEFT = 0.02
# Bones that begin nearer to each other than so many mm begin at one place.
SAME_PLACE = 1e-6
# About half a millisecond of ten limbs.
BLOCKS_A_THREAD = 60


@dataclass(frozen=True, slots=True, eq=False)
class LimbPairs:
    """The pairs of drawn limbs that a body keeps apart.

    limbs : (P, 2) numbers of the drawn limbs. least : (P,) the share of their radii that their axes keep.
    """

    program: KinematicProgram
    limbs: IntArray
    least: Floats

    def shares(self, poses: Array) -> Floats:
        """(N, P) distance of each pair's axes in poses (N, D), as a share of the radii between them."""
        count = -(-len(poses) // LANES)
        ratios = np.empty((count, len(self.limbs), LANES), dtype=np.float32)
        parallel_blocks(ratio_blocks, count, BLOCKS_A_THREAD, poses, self.program, self.limbs, ratios)
        return ratios.transpose(0, 2, 1).reshape(-1, len(self.limbs))[: len(poses)]


class HardPriors:
    """The hard priors of a body; immutable."""

    def __init__(self, body: BodyModel) -> None:
        self.body = body
        self.limits = np.stack([body.lower, body.upper])

    def hold(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether every parameter lies within its limits, both included, and, if
        `limbs_apart`, no limb is inside another.

        Raises BodyError for poses that are no (N, D); False for a pose with a NaN or an infinity.
        """
        return self._held(poses, self.limits, limbs_apart=limbs_apart)

    def apart(self, poses: Array) -> NDArray[np.bool_]:
        """(N, D) finite poses to (N,) whether no limb is inside another, whatever the joints' limits."""
        anywhere = np.array([[-np.inf], [np.inf]]).repeat(self.limits.shape[1], axis=1)
        return self._held(poses, anywhere, limbs_apart=True)

    def _held(self, poses: Array, limits: Array, *, limbs_apart: bool) -> NDArray[np.bool_]:
        poses, pairs = checked_poses(self.body, poses), limb_pairs(self.body)
        held = np.empty(len(poses), dtype=np.bool_)
        least = pairs.least if limbs_apart else pairs.least[:0]
        given = poses, limits, pairs.program, pairs.limbs, least, held
        parallel_blocks(hold_blocks, -(-len(poses) // LANES), BLOCKS_A_THREAD, *given)
        return held


@lru_cache(maxsize=64)
def limb_pairs(body: BodyModel) -> LimbPairs:
    """The pairs that a body keeps apart, made once a body. Raises BodyError where no limb is drawn."""
    if not body.drawn:
        raise BodyError(f"Body '{body.name}' has no limb with a length.", "Give its limbs lengths.")
    parents, inside = _parents(body), _begins_inside(body)
    count = len(parents)
    every = [(one, two) for one in range(count) for two in range(one + 1, count)]
    limbs = [
        pair
        for pair in every
        if not any(parents[child] == parent and inside[child] for child, parent in (pair, pair[::-1]))
    ]
    program = compile_program(kinematic_tables(body))
    candidates = LimbPairs(
        program, np.array(limbs, np.int64).reshape(-1, 2), np.zeros(len(limbs), np.float32)
    )
    at_rest = candidates.shares(checked_poses(body, body.neutral))[0]
    solid = np.array([limb.part != "" for limb in body.drawn])
    default = np.where(solid[candidates.limbs].any(axis=1), TRUNK_SHARE, LIMB_SHARE)
    usual = NEUTRAL_SHARE * at_rest
    least = np.minimum(default, usual).astype(np.float32)
    bones = [max(moving_joint(body, limb.joint), 0) for limb in body.drawn]
    origins = joint_frames(body, body.neutral)[0, bones, :, 3][candidates.limbs]
    # Collar-bones and head begin at the base of the neck and overlap there, though flesh lies beside the bone.
    at_one_place = np.linalg.norm(origins[:, 0] - origins[:, 1], axis=1) < SAME_PLACE
    compared = (least > NOTHING_LEFT) & ~(at_one_place & (usual < default))
    return LimbPairs(program, candidates.limbs[compared], least[compared])


def _parents(body: BodyModel) -> list[int]:
    """For each drawn limb the nearest drawn limb towards the root, -1 where there is none."""
    owner: dict[int, int] = {}
    for index, limb in enumerate(body.drawn):
        owner.setdefault(limb.joint, index)
    for index, limb in enumerate(body.drawn):
        # Flesh lies on a fixed joint beside its bone's.
        owner.setdefault(moving_joint(body, limb.joint), index)
    return [
        next((owner[at] for at in joints_above(body, limb.joint) if owner.get(at, index) != index), -1)
        for index, limb in enumerate(body.drawn)
    ]


def _begins_inside(body: BodyModel) -> list[bool]:
    """For each drawn limb whether at rest its start lies within the radius of its parent limb."""
    frames, found = limb_frames(body, body.neutral)[0], list[bool]()
    for child, parent in enumerate(_parents(body)):
        if parent < 0:
            found.append(False)
            continue
        limb, frame = body.drawn[parent], frames[parent]
        x, y, z = frame[:, :3].T @ (frames[child, :, 3] - frame[:, 3])
        along = min(max(z / limb.length, 0.0), 1.0)
        radius = limb.radius_start + along * (limb.radius_end - limb.radius_start)
        away = np.hypot(np.hypot(x / limb.scale_x, y / limb.scale_y), z - along * limb.length)
        found.append(bool(away <= radius))
    return found
