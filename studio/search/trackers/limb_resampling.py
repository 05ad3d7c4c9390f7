"""Limbs of a refined pose are resampled: over their whole range, where they are doubtful.

Where the silhouettes show that a limb is off (`agreement`), that limb alone is drawn again, half about its pose and
half anywhere. The draws are ranked by their disagreement with the silhouettes beyond what clothes explain, not by
weight: a limb folded into the trunk weighs more than one that is nearly right. The best are refined, and one is taken
where the silhouettes agree with it clearly better. Where learnt colours (`limb_colours`) deny a limb, the draws are
ranked by these, too; where a source beside the silhouettes reports a limb elsewhere (`reported_limbs`), those nearest
to there are ranked. A thin limb is drawn along the lines in the pictures (`thin_limbs`).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.branches import within_limits
from studio.body.forward_kinematics import joint_frames, limb_ends
from studio.body.mirroring import name_twins
from studio.body.model import BodyModel
from studio.evidence.volume.alignment import root_parameters, with_root_at
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.agreement import GRID_MM, LEAST_AREA, Agreement, Disagreement
from studio.search.trackers.limb_colours import Gain
from studio.search.trackers.limbs_elsewhere import SURELY_SHOWN, Elsewhere, is_sure
from studio.search.trackers.refinement import Distances, Refiner
from studio.search.trackers.reported_limbs import THERE_MM, ReportedLimb, off_from
from studio.search.trackers.thin_limbs import Lines, ThinLimb
from studio.search.trackers.tracker import LIMB_LOST_SHARE

DOUBTFUL_SHARE = 0.03
"""Share of a limb's area over all views that is outside the silhouettes or left uncovered: 97 of 100 sound limbs have
less."""
DRAWS, REFINED_DRAWS, PAIRED_DRAWS, APART = 1024, 3, 4, 0.4
"""Poses drawn of a doubtful limb; how many of them are refined; to how many of them poses of its twin are drawn where
both may be wrong; radians by which these differ at least in some joint."""
SPREADS = (0.1, 0.3)
"""Half of the draws lie about the limb's pose, with these shares of its range as deviation; the others anywhere in
it."""
BETTER = 0.85
"""Share of the loss below which another pose is taken. Masks cut off by a box lower it by a tenth (a rendered walk
behind boxes: with 0.95, 117 mm instead of 40); for a lost limb the right place has a third to four fifths of the
loss."""
BETTER_CHAIN, BETTER_TURNED = 0.97, 0.95
"""The same of a chain such as a tail, which has little of the border, or where every limb of a first pose is drawn; and
of the whole body turned round."""
MOST_TOGETHER, KEPT_ALONG, DRAWS_ALONG = 7, 6, 160
"""Angles of a limb that are drawn at once: draws of a tail of eight never lie on it. Of a longer one, how many poses
are kept from joint to joint, and how many are drawn from each."""
FEWEST_ANGLES, ALL_REFINED = 3, 8
"""Where every limb is drawn, however little it disagrees: the least angles of one, and how many poses are refined."""
LEAST_GAIN = 40.0
"""By how much a limb's colours (`limb_colours`) must gain less than expected if it is resampled by them, and how much
more they must then. The loss must not grow: with 3 % more an arm is lost in 2 of 225 frames of *wood* without cam01."""
DENIED, CONFIRMED = 0.25, 0.4
"""Shares of the expected gain. A limb that shows by itself is resampled if its colours should gain twice LEAST_GAIN
and do not reach the first; only a pose that reaches the second is taken, with BETTER_CHAIN of the loss. Chosen on own
start poses of *tiles*, in one of three of which a wrong arm stayed wrong (25.7 mm → 14.7)."""
NEAREST = 200
"""Of poses drawn of a limb so many that have it nearest to where it is reported are compared with the silhouettes."""
BELIEF, NEARER = 0.1, 0.6
"""A pose is taken for its share of the loss, and BELIEF times its share of how far a limb is from where it is surely
reported, if they sum to 1 + BELIEF · NEARER at most: without a higher loss it must have the limb at NEARER of the
distance. One that has not come to where it is reported must have BETTER_CHAIN of the loss, too: before the body a
limb is as well everywhere."""
KEPT_ALONG_LINES, DRAWS_ALONG_LINES, CLIMBING_DRAWS = 24, 300, 40
NARROWER = (0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.03, 0.03, 0.02, 0.02)
"""Of a thin limb: how many poses are kept from joint to joint, how many are drawn from each, and how many from each of
the best of all joints, with these standard deviations, radians."""
SURELY_ALONG = 0.35
"""Support of a thin limb that is looked for nearby only."""
TURNED = 0.7
"""Radians by which the body of a thin limb that is not surely found is turned."""
LEAST_LINES, DENIED_LINES = 0.1, 0.5
"""What lines must say more (`thin_limbs`) for another pose than for the one found, and by how much they must say more
where its loss is twice as high."""
DENIED_DRAWS, DENIED_REFINED = 4096, 16
"""Poses drawn of such a limb, which is far from where it belongs, and how many are refined."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A refined pose (D,), its loss, and where it and the silhouettes disagree."""

    pose: Array
    loss: float
    off: Disagreement


@dataclass(frozen=True, slots=True, eq=False)
class SeenFrame:
    """A frame's silhouettes, one a camera, with the tools that compare poses with them."""

    refiner: Refiner
    agreement: Agreement
    silhouettes: Sequence[Distances]

    def hypothesis(self, pose: Array) -> Hypothesis:
        """Loss and disagreement of a pose (D,), not refined."""
        loss = self.refiner.loss_with_pull(pose, self.silhouettes)
        return Hypothesis(pose, loss, self.agreement.of(pose, self.silhouettes))

    def refine(self, refined: Hypothesis) -> Hypothesis:
        """The hypothesis refined further."""
        return self.hypothesis(self.refiner.refine(refined.pose, self.silhouettes).pose)

    def better(self, than: Hypothesis, start: Array, share: float = BETTER) -> Hypothesis:
        """The hypothesis refined from a start (D,), if that is clearly better than `than`, with at most that share of
        its loss; else `than`.
        """
        pose = self.refiner.refine(start, self.silhouettes).pose
        if self.refiner.loss_with_pull(pose, self.silhouettes) >= share * than.loss:
            return than
        return self.hypothesis(pose)

    def best_of(
        self,
        than: Hypothesis,
        drawn: Array,
        own: Sequence[int],
        share: float = BETTER,
        most: int = REFINED_DRAWS,
    ) -> Hypothesis:
        """The best of `than` and of the refined poses among those drawn (N, D) that disagree least with the
        silhouettes. own : the angles that were drawn. share : as in `better`. most : how many are refined.
        """
        off = self.agreement.of_places(drawn, self.silhouettes)
        for start in _best_apart(drawn, off, own, most):
            than = self.better(than, start, share)
        return than


def redrawn(
    rng: np.random.Generator,
    found: Hypothesis,
    frame: SeenFrame,
    last: Array | None = None,
    *,
    turn: bool = True,
    elsewhere: Collection[str] = (),
) -> tuple[Hypothesis, int]:
    """The hypothesis with its doubtful limbs resampled, and the number of poses compared. last : (D,) pose of the last
    frame, which is tried as well. turn : whether a body whose tail is lost may be turned round. elsewhere : limbs that
    are resampled first, however little they disagree: what a lost limb leaves bare may be nearer to another one.
    """
    evaluations, tried, began_with = 0, set[str](), found
    chains = chains_of(frame.refiner.body)
    if last is not None:
        found = frame.better(found, last)
    while True:
        shares = _doubts(found.off, chains)
        doubtful = [
            name
            for name in shares
            if (shares[name] >= DOUBTFUL_SHARE or name in elsewhere) and name not in tried
        ]
        if not doubtful:
            break
        limb = max(doubtful, key=lambda name: (name in elsewhere, shares[name]))
        tried.add(limb)
        own = bent_by(frame.refiner.body, limb)
        if limb in chains:
            drawn, weighed = drawn_along(rng, frame, found.pose, own)
            found = frame.best_of(found, drawn, own, BETTER_CHAIN)
            evaluations += weighed
            if turn and found.off.shares()[limb] > LIMB_LOST_SHARE:
                found, weighed = _turned_round(rng, found, frame, own)
                evaluations += weighed
        elif len(own) > 1:
            drawn = _drawn(rng, frame.refiner, found.pose[None], own)
            found = frame.best_of(found, drawn, own)
            evaluations += len(drawn)
    shares = found.off.shares()
    limb = max(shares, key=lambda name: shares[name])
    if shares[limb] > LIMB_LOST_SHARE:
        found, more = _both_redrawn(rng, found, frame, limb)
        evaluations += more
    return found if found is began_with else frame.refine(found), evaluations


def recoloured(
    rng: np.random.Generator,
    found: Hypothesis,
    frame: SeenFrame,
    elsewhere: Mapping[str, Elsewhere],
    gains_of: Callable[[Array, str], Gain],
) -> tuple[Hypothesis, int]:
    """The hypothesis with limbs resampled where the picture has not their colours, and the number of poses compared.
    A limb that shows by itself must have colours that plainly say so, and be plainly better elsewhere: most such limbs
    are right, and an arm beside the head never gains what is expected. One that shows where little changed is left to
    the silhouettes: drawn by colours *hard* is at 52 mm instead of 33. gains_of : of poses (N, D) and a limb.
    """
    evaluations, chains = 0, chains_of(frame.refiner.body)
    for limb, one in elsewhere.items():
        own, shows = bent_by(frame.refiner.body, limb), one.shown >= SURELY_SHOWN
        if limb in chains or len(own) < FEWEST_ANGLES or (shows and not is_sure(one)):
            continue
        now = gains_of(found.pose[None], limb)
        if not _contradicted(now, shows):
            continue
        drawn = _drawn(rng, frame.refiner, found.pose[None], own, DENIED_DRAWS if shows else DRAWS)
        gains, most = gains_of(drawn, limb).gain, now.gain[0] + LEAST_GAIN
        if gains.max() < most:
            continue
        evaluations += len(drawn)
        off = frame.agreement.of_places(drawn, frame.silhouettes) - GRID_MM**2 * gains
        allowed = (BETTER_CHAIN if shows else 1.0) * found.loss
        for start in _best_apart(drawn, off, own, DENIED_REFINED if shows else REFINED_DRAWS):
            pose = frame.refiner.refine(start, frame.silhouettes).pose
            if frame.refiner.loss_with_pull(pose, frame.silhouettes) > allowed:
                continue
            then = gains_of(pose[None], limb)
            if then.gain[0] >= (max(most, CONFIRMED * then.expected[0]) if shows else most):
                found, most = frame.hypothesis(pose), then.gain[0]
    return found, evaluations


def drawn_where_reported(
    rng: np.random.Generator, found: Hypothesis, frame: SeenFrame, reported: Mapping[str, ReportedLimb]
) -> tuple[Hypothesis, int]:
    """The hypothesis with limbs nearer to where they are reported, if the silhouettes agree with it about as well,
    and the number of poses compared.
    """
    evaluations, body = 0, frame.refiner.body
    for limb, one in reported.items():
        own = bent_by(frame.refiner.body, limb)
        if len(own) < FEWEST_ANGLES:
            continue
        drawn = _drawn(rng, frame.refiner, found.pose[None], own, DENIED_DRAWS)
        evaluations += len(drawn)
        away, belief = off_from(body, found.pose[None], one)[0], BELIEF * one.belief
        nearest = drawn[np.argsort(off_from(body, drawn, one), kind="stable")[:NEAREST]]
        disagreeing = frame.agreement.of_places(nearest, frame.silhouettes)
        before, most = found.loss, found.loss * (1.0 + NEARER * belief)
        for start in _best_apart(nearest, disagreeing, own, ALL_REFINED):
            pose = frame.refiner.refine(start, frame.silhouettes).pose
            loss = frame.refiner.loss_with_pull(pose, frame.silhouettes)
            off = off_from(body, pose[None], one)[0]
            cost = float(loss + before * belief * off / away)
            if cost <= most and (off <= THERE_MM or loss <= BETTER_CHAIN * before):
                found, most = frame.hypothesis(pose), cost
    return found, evaluations


def drawn_along_lines(
    rng: np.random.Generator,
    found: Hypothesis,
    frame: SeenFrame,
    thin: ThinLimb,
    lines: Sequence[Lines | None],
    last: Array | None = None,
) -> tuple[Hypothesis, int]:
    """The hypothesis with a thin limb along the lines in the pictures, if they say clearly more for it than the
    silhouettes say against it, and the number of poses compared. last : (D,) pose of the last frame, from whose bends
    it is looked for, too.
    """
    refiner, own = frame.refiner, thin.own
    starts = [found.pose]
    if last is not None:
        starts.append(_with(found.pose, own, last))
    weighed, bent = 0, list[int]()
    if (thin.support(found.pose, lines) or 0.0) < SURELY_ALONG:
        kept = _with(found.pose, own, refiner.neutral)[None]
        for number, joint in enumerate(_joints_of(refiner.body, own), 1):
            drawn = np.concatenate([kept, _drawn(rng, refiner, kept, joint, DRAWS_ALONG_LINES)])
            weighed, bent = weighed + len(drawn), [*bent, *joint]
            kept = np.array(_best_apart(drawn, -thin.gains(drawn, lines, number), bent, KEPT_ALONG_LINES))
        starts += list(kept)
    poses = np.array(starts)
    lower, upper = refiner.lower[own], refiner.upper[own]
    for spread in NARROWER:
        drawn = np.repeat(poses[:, None], CLIMBING_DRAWS, axis=1)
        drawn[:, :, own] += spread * rng.standard_normal((len(poses), CLIMBING_DRAWS, len(own)))
        drawn[:, :, own] = np.clip(drawn[:, :, own], lower, upper)
        drawn[:, 0] = poses
        weighed += drawn.shape[0] * drawn.shape[1]
        weights = thin.gains(drawn.reshape(-1, drawn.shape[2]), lines).reshape(drawn.shape[:2])
        poses = drawn[np.arange(len(poses)), weights.argmax(axis=1)]
    gains = thin.gains(poses, lines)
    most = float(thin.gains(found.pose[None], lines)[0]) + LEAST_LINES
    began_with = found
    for row in np.argsort(-gains, kind="stable")[:REFINED_DRAWS]:
        loss = frame.refiner.loss_with_pull(poses[row], frame.silhouettes)
        denied = max(loss - began_with.loss, 0.0) / max(began_with.loss, 1.0)
        worth = float(gains[row] - DENIED_LINES * denied)
        if worth > most:
            found, most = frame.hypothesis(poses[row]), worth
    return found, weighed


def turned_along_lines(
    rng: np.random.Generator,
    found: Hypothesis,
    frame: SeenFrame,
    thin: ThinLimb,
    lines: Sequence[Lines | None],
    lines_of: Callable[[Array], Sequence[Lines | None]],
) -> tuple[Hypothesis, int]:
    """The hypothesis, or the body turned a little about the vertical with its thin limb along lines, if both these and
    the silhouettes say more for it; and the number of poses compared. A crouching animal is round, and its tail shows
    where it points; of one that stands up no silhouette shows it, and the tail alone misleads. lines : around
    the pose found. lines_of : around a pose (D,).
    """
    began_with, weighed = found, 0
    most = float(thin.gains(found.pose[None], lines)[0]) + LEAST_LINES
    for by in (TURNED, -TURNED):
        turned = turned_pose(frame.refiner.body, began_with.pose, by)
        if turned is None:
            break
        refined = frame.hypothesis(frame.refiner.refine(turned, frame.silhouettes).pose)
        around = lines_of(refined.pose)
        other, drawn = drawn_along_lines(rng, refined, frame, thin, around)
        gain, weighed = float(thin.gains(other.pose[None], around)[0]), weighed + drawn
        if gain > most and other.loss < BETTER_TURNED * began_with.loss:
            found, most = other, gain
    return found, weighed


def _with(pose: Array, own: Sequence[int], other: Array) -> Array:
    """(D,) a pose with some angles of another one."""
    changed = pose.copy()
    changed[list(own)] = other[list(own)]
    return changed


def _contradicted(now: Gain, shows: bool) -> bool:
    """Whether a limb's colours say that one pose (N = 1) has it elsewhere. shows : whether it shows there by itself."""
    if shows:
        return bool(now.expected[0] >= 2.0 * LEAST_GAIN and now.gain[0] <= DENIED * now.expected[0])
    return bool(now.gain[0] <= now.expected[0] - LEAST_GAIN)


def redraw_all(rng: np.random.Generator, found: Hypothesis, frame: SeenFrame) -> Hypothesis:
    """The hypothesis with each limb resampled, then both of a pair, however little they disagree: what a folded arm
    leaves bare in one view of three may be too little to say so. A loss lower by 3 % is enough: no last frame says what
    is likely.
    """
    names = list(found.off.shares())
    twins = name_twins(names)
    for number, limb in enumerate(names):
        own = bent_by(frame.refiner.body, limb)
        if len(own) < FEWEST_ANGLES:
            continue
        drawn = _drawn(rng, frame.refiner, found.pose[None], own)
        found = frame.best_of(found, drawn, own, BETTER_CHAIN, ALL_REFINED)
        if int(twins[number]) > number:
            found = _both_redrawn(rng, found, frame, limb, BETTER_CHAIN, ALL_REFINED)[0]
    return found


def chains_of(body: BodyModel) -> list[str]:
    """Limbs that are drawn joint by joint: those of more angles than are drawn at once, of a body with a tail."""
    if not body.bounded_angles[root_parameters(body)].any():
        return []
    limbs = dict.fromkeys(entry.limb for entry in body.parameters)
    return [limb for limb in limbs if len(bent_by(body, limb)) > MOST_TOGETHER]


def thin_limbs_of(body: BodyModel, cameras: Sequence[Camera], on_floor: bool) -> dict[str, ThinLimb]:
    """By name the limbs that may be found by lines in the pictures. on_floor : whether they stay above z = 0."""
    return {limb: ThinLimb(body, cameras, limb, bent_by(body, limb), on_floor) for limb in chains_of(body)}


def _doubts(off: Disagreement, chains: Sequence[str]) -> dict[str, float]:
    """Disagreeing area by limb, as a share of its own, with what is bare in its reach. A chain that lies before the
    body disagrees with nothing, and what it leaves bare is nearest to a limb that it hangs from: all that is bare may
    be a chain's.
    """
    shares, groups = off.shares_in_reach(), np.array(off.limbs)
    for limb in chains:
        own = groups == limb
        area = np.maximum(off.area.sum(axis=0), LEAST_AREA)[own].sum()
        shares[limb] = max(shares[limb], float((off.outside[:, own].sum() + off.bare.sum()) / area))
    return shares


def _both_redrawn(
    rng: np.random.Generator,
    found: Hypothesis,
    frame: SeenFrame,
    limb: str,
    share: float = BETTER,
    most: int = REFINED_DRAWS,
) -> tuple[Hypothesis, int]:
    """The same with a lost limb and its twin resampled together: where an arm has taken the other's place, neither can
    move while the other stays. First the limb, leaving out the twin, then the twin for each of the limb's best
    poses.
    """
    refiner, agreement = frame.refiner, frame.agreement
    names = list(found.off.shares())
    twin = names[int(name_twins(names)[names.index(limb)])]
    own, others = bent_by(refiner.body, limb), bent_by(refiner.body, twin)
    if twin == limb or len(own) < 2 or len(others) < 2:
        return found, 0
    places = _drawn(rng, refiner, found.pose[None], own)
    off = agreement.of_places(places, frame.silhouettes, without=twin)
    pairs = _drawn(rng, refiner, np.array(_best_apart(places, off, own, PAIRED_DRAWS)), others)
    return frame.best_of(found, pairs, [*own, *others], share, most), len(places) + len(pairs)


def bent_by(body: BodyModel, limb: str) -> list[int]:
    """The angles with limits that bend a limb."""
    bounded = body.bounded_angles
    return [n for n, entry in enumerate(body.parameters) if entry.limb == limb and bounded[n]]


def _drawn(
    rng: np.random.Generator, refiner: Refiner, poses: Array, own: Sequence[int], draws: int = DRAWS
) -> Array:
    """(K · draws, D) poses from poses (K, D) with angles `own` drawn: one part about their values, one over their
    range.
    """
    lower, upper = refiner.lower[own], refiner.upper[own]
    reach, part = upper - lower, draws // (2 * len(SPREADS))
    drawn = np.repeat(poses[:, None], draws, axis=1)
    now = poses[:, None, own]
    near = [now + spread * reach * rng.standard_normal((len(poses), part, len(own))) for spread in SPREADS]
    anywhere = lower + reach * rng.random((len(poses), draws - part * len(SPREADS), len(own)))
    drawn[:, :, own] = np.clip(np.concatenate([*near, anywhere], axis=1), lower, upper)
    return drawn.reshape(-1, poses.shape[1])


def _turned_round(
    rng: np.random.Generator, found: Hypothesis, frame: SeenFrame, own: Sequence[int]
) -> tuple[Hypothesis, int]:
    """The hypothesis, or the body turned by half a turn about the vertical with its tail (angles `own`) drawn again, if
    that is better; and the number of poses compared. Both ends of an animal look alike but for the tail.
    """
    turned = turned_pose(frame.refiner.body, found.pose)
    if turned is None:
        return found, 0
    other = frame.hypothesis(frame.refiner.refine(turned, frame.silhouettes).pose)
    drawn, weighed = drawn_along(rng, frame, other.pose, own)
    other = frame.best_of(other, drawn, own, 1.0)
    return (other if other.loss < BETTER_TURNED * found.loss else found), weighed


def has_tail(body: BodyModel) -> bool:
    """Whether a limb of the body is a chain of more angles than are drawn at once, and limits of its root keep the body
    off its back: silhouettes alone do not.
    """
    return bool(chains_of(body))


def turned_pose(body: BodyModel, pose: Array, by: float = np.pi) -> Array | None:
    """(D,) a pose turned about the vertical through the middle of its trunk; None of a body that is fixed to the world.
    by : radians.
    """
    parameters = root_parameters(body)
    trunk = [number for number, limb in enumerate(body.drawn) if limb.part == "trunk"]
    if not len(parameters) or not trunk:
        return None
    root = next(number for number, joint in enumerate(body.joints) if joint.parent < 0)
    frame, middle = joint_frames(body, pose)[0, root], limb_ends(body, pose)[0, trunk].mean(axis=(0, 1))
    turn = np.array([[np.cos(by), -np.sin(by), 0.0], [np.sin(by), np.cos(by), 0.0], [0.0, 0.0, 1.0]])
    target = turn @ frame
    target[:, 3] += middle - turn @ middle
    return within_limits(body, with_root_at(body, root, parameters, pose, target))


def drawn_along(
    rng: np.random.Generator, frame: SeenFrame, pose: Array, own: Sequence[int]
) -> tuple[Array, int]:
    """(N, D) poses with a long chain drawn joint by joint from the root on, so that it follows what the silhouettes
    show of it; and the number of poses compared. What lies beyond a joint is straight while that is drawn.
    """
    refiner = frame.refiner
    straight = pose.copy()
    straight[list(own)] = refiner.neutral[list(own)]
    kept, weighed = straight[None], 0
    for joint in _joints_of(refiner.body, own):
        drawn = np.concatenate([kept, _drawn(rng, refiner, kept, joint, DRAWS_ALONG)])
        off = frame.agreement.of_places(drawn, frame.silhouettes)
        kept = np.array(_best_apart(drawn, off, joint, KEPT_ALONG))
        weighed += len(drawn)
    return kept, weighed


def _joints_of(body: BodyModel, own: Sequence[int]) -> list[list[int]]:
    """The angles `own` by the joint that they turn, parents first."""
    turned = [[angle for angle in joint.parameters if angle in own] for joint in body.joints]
    return [angles for angles in turned if angles]


def _best_apart(drawn: Array, off: Array, own: Sequence[int], most: int) -> list[Array]:
    """At most `most` of the poses drawn (N, D) that disagree least, by off (N,), and differ from one another."""
    found: list[Array] = []
    for row in np.argsort(off, kind="stable"):
        if all(np.abs(drawn[row, own] - other[own]).max() > APART for other in found):
            found.append(drawn[row])
        if len(found) == most:
            break
    return found
