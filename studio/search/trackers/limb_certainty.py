"""How certain a refined pose is: standard deviations of its limbs, and the probability that a limb is lost.

No single sign shows a lost limb, but together they do:

- The silhouettes contradict it (`agreement`). What it leaves bare says most. That it lies outside says little, and more
  of it says no more: something may stand in front of it.
- It jumped where the silhouettes do not determine it. It jumps: an end is far from where it would be had it moved on as
  in the last frame; a limb jumps into a wrong place and out of it, so a jump counts for some frames. They do not
  determine it, as with a forearm in front of the trunk: the covariance of the least squares, (Jᵀ J / s² + prior⁻¹)⁻¹
  with the refinement's normal equations, gives its ends a large standard deviation. The prior has a quarter of each
  angle's range. Alone, neither says anything: a forearm may stay in front of the trunk for long and be right, and a
  kick jumps.

A logistic regression weighs them, fitted to clips of the suite's choosing half and to more draws of the same kinds (21
clips; lost: a marker of the limb more than 150 mm off) tracked by the default, with one to four seeds, and with a third
and a tenth of the weight by runs of fifty evaluations and by runs of twenty without redrawn limbs. What it is made of
was chosen with each clip left out in turn. Frames named at LIMB_LOST_PROBABILITY:

    runs                               a limb lost    named    others    named
    default, all but *hard*                20          95 %     2134      1.7 %
    default, *hard*, three draws          163          63 %      257       24 %
    20 evaluations, no limb redrawn       107          99 %      276       14 %
    eleven clips of the reporting half     44          77 %      779        0 %

Of the 44, which come of one seed, 34 of the 37 on *hard* are named, none of two on a walk and of five on a leap. The
rule before named an arm before the trunk on two walks of that half, which was seen before this one was chosen.

What changed in the pictures, also where masks have it for a shadow, is another witness (`limbs_elsewhere`). It names
limbs that no mask shows; beside a limb that it sees where the pose has it, what the pose leaves bare is something else,
and a jump of a limb to where it shows is a fast movement: it jumps out of a wrong place, too.

Tried without gain: the spread of the search's cloud, and how far the refinement moved the limb.

The standard deviations rank limbs; they are not calibrated. Scaled so that 68 % of the joints lie within one of them,
83 % lie within two instead of 95 %, and by clip between 49 and 96 % within one: most of an error is not noise but where
a clothed body and the cones differ, which is the same in all frames of a clip.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import rigid_limbs
from studio.body.scale import scale_of
from studio.foundations.arrays import Array
from studio.search.trackers.agreement import LEAST_AREA, Disagreement, limb_names
from studio.search.trackers.limbs_elsewhere import Elsewhere, is_shown, lost_of, without_sure
from studio.search.trackers.refinement import Refiner
from studio.search.trackers.thin_limbs import HALF_PLAIN
from studio.search.trackers.tracker import LIMB_LOST_SHARE, MOVED

RESIDUAL_MM = 40.0
"""mm: s, a residual's standard deviation; larger than that of one point of a border, as neighbouring ones agree."""
RANGE_SHARE, FREE = 0.25, 1.0
"""Standard deviation of the prior: as a share of an angle's range, and, without limits, in the refinement's units."""
STEP = 1e-3
"""Units of the parameters, for slopes."""
KEPT = 0.8
"""Share of a jump that counts in the next frame."""
DETERMINED_MM = 10.0
"""mm: a limb of this standard deviation, or a smaller one, may jump."""
MOST_OUTSIDE, LEAST_OUTSIDE, LEAST_BARE, JUMP_MM = 0.05, 0.005, 0.003, 100.0
CONSTANT, WEIGHTS = 3.90, np.array([1.37, 0.44, 1.81])
"""Log-odds of a lost limb: of no sign, and per logarithm of outside, of bare, and of jump times that of deviation."""
WITNESSED = 3.0
"""Least log-odds of a limb that the pictures show in another place."""
LINE_ODDS = 20.0
"""Log-odds of a lost thin limb, by how much less plainly than HALF_PLAIN lines run along it."""
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

    def lost(
        self,
        off: Disagreement,
        pictures: Mapping[str, Elsewhere] | None = None,
        reported: Collection[str] = (),
        lines: Mapping[str, float] | None = None,
    ) -> dict[str, float]:
        """By limb the probability that it is lost. off : the pose's disagreement with the silhouettes. pictures : by
        limb what changed in them, if that is known. reported : limbs that are reported lost (`reported_limbs`).
        lines : by thin limb how plainly lines in the pictures run along it (`thin_limbs`), which alone says whether it
        is lost.
        """
        known = pictures or {}
        signs, bare = self.signs(without_sure(off, known), known)
        odds = np.where(bare > LIMB_LOST_SHARE, np.inf, CONSTANT + signs @ WEIGHTS)
        elsewhere = {*lost_of(known), *reported}
        odds = np.where([limb in elsewhere for limb in self.limbs], np.maximum(odds, WITNESSED), odds)
        for limb, plain in (lines or {}).items():
            odds[self.limbs.index(limb)] = LINE_ODDS * (HALF_PLAIN - plain)
        return dict(zip(self.limbs, (1.0 / (1.0 + np.exp(-odds))).tolist(), strict=True))

    def signs(self, off: Disagreement, pictures: Mapping[str, Elsewhere]) -> tuple[Array, Array]:
        """(G, 3) logarithms of outside, of bare, and of jump times that of deviation; (G,) share of a limb's area that
        it leaves bare. A jump to where the pictures show the limb is none.
        """
        own = (np.array(off.limbs) == np.array(self.limbs)[:, None]).astype(float)
        area = own @ np.maximum(off.area.sum(axis=0), LEAST_AREA)
        outside, bare = own @ off.outside.sum(axis=0) / area, own @ off.bare.sum(axis=0) / area
        shown = [limb in pictures and is_shown(pictures[limb]) for limb in self.limbs]
        jump = np.where(shown, 0.0, self.jump)
        logarithms = (
            np.log(np.minimum(outside, MOST_OUTSIDE) + LEAST_OUTSIDE),
            np.log(bare + LEAST_BARE),
            np.log1p(jump / JUMP_MM) * np.log(np.maximum(self.deviation / DETERMINED_MM, 1.0)),
        )
        return np.stack(logarithms, axis=1), bare


class CertaintyOfLimbs:
    """Finds the certainty of a refiner's poses; immutable."""

    def __init__(self, refiner: Refiner) -> None:
        body = refiner.body
        self._body, self._unit, self._scale = body, refiner.unit, scale_of(body)
        names, rigid = np.array(limb_names(body)), rigid_limbs(body)
        alone = np.array([bool(rigid[names == name].all()) for name in names])
        self._measured = np.flatnonzero(~rigid | alone)
        self._owners = names[self._measured]
        self._limbs = tuple(dict.fromkeys(names.tolist()))
        reach = (refiner.upper - refiner.lower) / refiner.unit
        self._prior = np.diag(np.where(np.isfinite(reach), RANGE_SHARE * reach, FREE) ** -2.0)

    def of(self, pose: Array, matrix: Array, memory: Mapping[str, Array]) -> Certainty:
        """The certainty of a pose (D,). matrix : (D, D) of the refinement's equations there (`Refiner.loss`). memory :
        at the frame's start.
        """
        size, ahead = len(pose), STEP * np.diag(self._unit)
        poses = np.concatenate([pose[None], pose + ahead, pose - ahead])
        ends = limb_ends(self._body, poses)[:, self._measured] / self._scale
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
        """(G,) the largest of each limb's values (K,), one a limb that is measured."""
        return np.array([values[self._owners == limb].max() for limb in self._limbs])
