"""How certain a refined pose is: standard deviations of its limbs, and the probability that a limb is lost.

No single sign shows a lost limb, but three together do:

- The silhouettes contradict it (`agreement`). What it leaves bare says most. That it lies outside says little, and more
  of it says no more: something may stand in front of it.
- The silhouettes do not determine it, as with a forearm in front of the trunk or legs behind a table. The covariance of
  the least squares, (Jᵀ J / s² + prior⁻¹)⁻¹ with the refinement's normal equations, gives the standard deviation of its
  ends. The prior has a quarter of each angle's range.
- It jumped: an end is far from where it would be had it moved on as in the last frame. A limb jumps into a wrong place
  and out of it, so a jump counts for some frames.

Their logarithms are summed by a logistic regression, fitted to seven clips of the suite's choosing half (lost: a marker
of the limb more than 150 mm off): up to six seeds of the default, and, with a third and a tenth of the weight, runs
reduced to twenty or fifty evaluations, and these without redrawn limbs. Frames named at LIMB_LOST_PROBABILITY in nine
clips of that half, and by a disagreeing share of 0.06 alone:

    runs                     a limb lost, a seed   named   by share   others: named   by share
    default                          24            96 %      87 %         2.5 %        3.2 %
    20 evaluations                   17            88 %      43 %         4.7 %        4.8 %
    and no limb redrawn             104            95 %      99 %        11.2 %       13.3 %

In four clips of the reporting half (seed 0) it names 88 % of 42 frames, as the share does, and 1.6 % of 253 others, the
share 5.5 %. To ask more of a redrawn pose that jumps costs: a dance goes from 4 to 12 lost frames where such a pose
needs 0.7 of the loss instead of 0.85.

The standard deviations rank limbs; they are not calibrated. Scaled so that 68 % of the joints lie within one of them,
83 % lie within two instead of 95 %, and by clip between 49 and 96 % within one: most of an error is not noise but where
a clothed body and the cones differ, which is the same in all frames of a clip.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from studio.arrays import Array
from studio.body.forward_kinematics import limb_ends
from studio.body.scale import scale_of
from studio.trackers.agreement import LEAST_AREA, Disagreement, limb_names
from studio.trackers.refinement import Refiner, rigid_limbs
from studio.trackers.tracker import LIMB_LOST_SHARE, MOVED

RESIDUAL_MM = 40.0
"""mm: s, a residual's standard deviation; larger than that of one point of a border, as neighbouring ones agree."""
RANGE_SHARE, FREE = 0.25, 1.0
"""Standard deviation of the prior: as a share of an angle's range, and, without limits, in the refinement's units."""
STEP = 1e-3
"""Units of the parameters, for slopes."""
KEPT = 0.8
"""Share of a jump that counts in the next frame."""
LEAST_DEVIATION_MM = 0.1
"""mm: a limb that nothing moves, as a robot's foot, has none."""
MOST_OUTSIDE, LEAST_OUTSIDE, LEAST_BARE, JUMP_MM = 0.05, 0.005, 0.003, 100.0
CONSTANT, WEIGHTS = -4.64, np.array([0.98, 0.90, 2.61, 2.08])
"""Log-odds of a lost limb: of no sign, and per logarithm of outside, bare, deviation (mm) and jump."""
ENDS, JUMPS = f"{MOVED}ends", f"{MOVED}jumps"


@dataclass(frozen=True, slots=True, eq=False)
class Certainty:
    """Of G limbs, named as in the body's parameters, in mm at a person's size. deviation : (G,) largest standard
    deviation of a limb's ends. jump : (G,) its jump, or what is left of an earlier one. moved : memory for the next
    frame.
    """

    limbs: tuple[str, ...]
    deviation: Array
    jump: Array
    moved: Mapping[str, Array]

    def lost(self, off: Disagreement) -> dict[str, float]:
        """By limb the probability that it is lost. off : the pose's disagreement with the silhouettes."""
        signs, bare = self.signs(off)
        odds = np.where(bare > LIMB_LOST_SHARE, np.inf, CONSTANT + signs @ WEIGHTS)
        return dict(zip(self.limbs, (1.0 / (1.0 + np.exp(-odds))).tolist(), strict=True))

    def signs(self, off: Disagreement) -> tuple[Array, Array]:
        """(G, 4) logarithms of outside, bare, deviation and jump; (G,) share of a limb's area that it leaves bare."""
        own = (np.array(off.limbs) == np.array(self.limbs)[:, None]).astype(float)
        area = own @ np.maximum(off.area.sum(axis=0), LEAST_AREA)
        outside, bare = own @ off.outside.sum(axis=0) / area, own @ off.bare.sum(axis=0) / area
        logarithms = (
            np.log(np.minimum(outside, MOST_OUTSIDE) + LEAST_OUTSIDE),
            np.log(bare + LEAST_BARE),
            np.log(np.maximum(self.deviation, LEAST_DEVIATION_MM)),
            np.log1p(self.jump / JUMP_MM),
        )
        return np.stack(logarithms, axis=1), bare


class CertaintyOfLimbs:
    """Finds the certainty of a refiner's poses; immutable."""

    def __init__(self, refiner: Refiner) -> None:
        body = refiner.body
        self._body, self._unit, self._scale = body, refiner.unit, scale_of(body)
        names, rigid = np.array(limb_names(body)), rigid_limbs(body)
        alone = np.array([bool(rigid[names == name].all()) for name in names])
        self._judged = np.flatnonzero(~rigid | alone)
        self._owners = names[self._judged]
        self._limbs = tuple(dict.fromkeys(names.tolist()))
        reach = (refiner.upper - refiner.lower) / refiner.unit
        self._prior = np.diag(np.where(np.isfinite(reach), RANGE_SHARE * reach, FREE) ** -2.0)

    def of(self, pose: Array, matrix: Array, memory: Mapping[str, Array]) -> Certainty:
        """The certainty of a pose (D,). matrix : (D, D) of the refinement's equations there (`Refiner.loss`). memory :
        at the frame's start.
        """
        size, ahead = len(pose), STEP * np.diag(self._unit)
        poses = np.concatenate([pose[None], pose + ahead, pose - ahead])
        ends = limb_ends(self._body, poses)[:, self._judged] / self._scale
        slopes = ((ends[1 : size + 1] - ends[size + 1 :]) / (2.0 * STEP)).reshape(size, -1)
        covariance = np.linalg.inv(matrix / RESIDUAL_MM**2 + self._prior)
        variances = np.einsum("dp,dp->p", slopes, covariance @ slopes).reshape(ends.shape[1:]).sum(axis=2)
        before, jump = memory.get(ENDS, ends[:0]), KEPT * memory.get(JUMPS, np.zeros(len(self._limbs)))
        if len(before) == 2:
            off = ends[0] - (2.0 * before[1] - before[0])
            jump = np.maximum(jump, self._largest(np.linalg.norm(off, axis=2).max(axis=1)))
        moved = {ENDS: np.concatenate([before[-1:], ends[:1]]), JUMPS: jump}
        return Certainty(self._limbs, self._largest(np.sqrt(variances).max(axis=1)), jump, moved)

    def _largest(self, values: Array) -> Array:
        """(G,) the largest of each limb's values (K,), one a judged limb."""
        return np.array([values[self._owners == limb].max() for limb in self._limbs])
