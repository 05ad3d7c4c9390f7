"""Correction of exchanged sides (left and right, front and back) over a whole clip.

Where two limbs cross, or a body is followed from a wrong start, a tracker may continue with its sides exchanged: in the
outlines of few cameras that hardly shows in a single frame. It does in many: a thigh has to begin at the wrong hip,
knees bend against their joints, feet point backwards. So a tracked clip is examined as a whole. Hypotheses: a pair of
limbs exchanged (each where its twin is, as near as its joints allow), and the whole body facing the other way with all
its limbs where their twins are. In a frame they are compared by the loss after refinement on the silhouettes; g =
log(loss as tracked / loss exchanged), cut off at ±1, is above 0 where the exchange explains more.

Over the frames the best path is found (A. Viterbi, "Error bounds for convolutional codes", 1967) that minimises

    Σ -g w [exchanged]  +  MOTION Σ log(1 + (d / σ)²)  +  CHANGE [sides change],      w = REFERENCE_FPS / fps

d : how far the pair's ends move from frame to frame along the path, σ : how far they usually do; so sides change where
limbs meet, or where the tracker jumped. For the whole body g also counts whether it walks backwards, and of an animal
each turn that it cannot make between two frames costs TURN (`impossible_turns`): one that stands up looks much the same
from its back and from its belly, and in its first frames masks that lack a foot were enough to turn it. Not every frame
is examined: some a second, those where the track jumps, and, where an exchange is not clearly ruled out, the frames
around until it is.

Measured on thirteen rendered clips, default tracker: legs of a sound pose exchanged have g below -0.03 in every frame
examined of twelve clips (-0.2 to -0.7 on the mean), in the one with clutter and a wrong calibration 0 at the most and
-0.09 on the mean; arms are below -0.06, the body turned below -0.13.
"""

import heapq
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.mirroring import Mirror, name_twins
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Indices, runs_of
from studio.foundations.errors import BodyError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, counting, no_progress
from studio.search.trackers.agreement import limb_names
from studio.search.trackers.clip_silhouettes import SilhouettesOf, rows_seen
from studio.search.trackers.impossible_turns import costs_of_turning
from studio.search.trackers.limb_resampling import has_tail
from studio.search.trackers.refinement import RefinementSettings

GRID_S, BODY_GRID_S = 0.1, 0.5
"""Seconds between frames that are always examined: for pairs, for the body as a whole."""
CLEAR = 0.05
"""An exchange with g below the negative of this is ruled out."""
MOST_GAIN = 1.0
CHANGE, MOTION = 0.3, 0.1
REFERENCE_FPS, MOST_SHARE = 30.0, 1.5
STILL_MM_S = 1000.0
"""σ is at least what a limb moves at this speed."""
JUMP = 4.0
"""Times σ: a movement that counts as a jump."""
WALKED_MM, WALKING_MM_S, BACKWARDS, WINDOW_S = 300.0, 1000.0, 0.1, 0.25
"""Least distance of a body that walks; walking speed and its share of g when backwards; the speed is measured over this
window to either side."""
NEAR_MM = 40.0
"""mm: a refined exchange that is nearer to the tracked pose than to the exchanged one, by this margin, is none."""
BETTER = 0.02
"""A pose is also tried in neighbouring frames whose g is lower by more than this."""
NOTABLY = 0.999
"""A loss below this share of another is better."""
MOST_ROUNDS = 10
TAKEN_TOGETHER = 80


@dataclass(frozen=True, slots=True)
class Exchange:
    """Frames first to last (inclusive) in which sides were exchanged. what : description."""

    first: int
    last: int
    what: str

    @property
    def words(self) -> str:
        """Text for a run's notes."""
        return f"frames {self.first} to {self.last}: {self.what}"


@dataclass(frozen=True, slots=True, eq=False)
class Kind:
    """A way of exchanging sides. limbs : indices of the drawn limbs that it moves. offered : maps a pose (D,) to the
    exchanged one.
    """

    what: str
    limbs: Indices
    offered: Callable[[Array], Array]
    whole: bool = False


@dataclass(slots=True, eq=False)
class _Examined:
    """Results for a kind. losses : (K,) of each row exchanged, NaN where not examined, inf where there is no such pose
    or nothing is seen. poses : (K, D) exchanged. wanted : by row, the limbs (P, 3) of the exchange before refinement.
    odd : (K,) whether the row was exchanged an odd number of times.
    """

    losses: Array
    poses: Array
    odd: NDArray[np.bool_]
    wanted: dict[int, Array] = field(default_factory=dict[int, Array])


def kinds_of(body: BodyModel) -> tuple[Kind, ...]:
    """The ways in which sides of a body can be exchanged, the whole body first; () for a body without sides."""
    try:
        mirror = Mirror(body)
    except BodyError:
        return ()
    groups = [entry.limb for entry in body.parameters]
    names, bearing = list(dict.fromkeys(groups)), limb_names(body)
    found: list[Kind] = []
    if mirror.turns:
        everything = np.arange(len(bearing))
        found.append(Kind("front and back exchanged", everything, mirror.about_face, whole=True))
    for at, twin in enumerate(map(int, name_twins(names))):
        if at >= twin:
            continue
        pair = (names[at], names[twin])
        own = np.array([row for row, name in enumerate(groups) if name in pair])
        limbs = np.array([row for row, name in enumerate(bearing) if name in pair], dtype=np.int64)
        if len(limbs):
            left = pair[0] if "left" in pair[0] else pair[1]
            what = f"left and right {left.replace('left', '').strip(' _-')} exchanged"
            found.append(
                Kind(what, limbs, lambda pose, own=own, limbs=limbs: mirror.exchanged(pose, own, limbs))
            )
    return tuple(found)


def with_sides_right(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Indices,
    poses: Array,
    fps: float,
    silhouettes_of: SilhouettesOf,
    settings: RefinementSettings | None = None,
    progress: Progress = no_progress,
) -> tuple[Array, tuple[Exchange, ...]]:
    """A tracked clip with its sides put right, (K, D), and what was exchanged; other frames keep their poses.

    frames : (K,) ascending. poses : (K, D). settings : of the descents. progress : of the frames that are always
    examined; how many are beside them is not known. Raises what `silhouettes_of` and `progress` raise.
    """
    work = _Work(
        body, cameras, frames, poses, fps, silhouettes_of, settings or RefinementSettings(), progress
    )
    rounds = 0
    while rounds < MOST_ROUNDS and work.put_right():
        rounds += 1
    return work.poses, work.changes(poses)


class _Work:
    """State of the correction of one clip."""

    def __init__(
        self,
        body: BodyModel,
        cameras: Sequence[Camera],
        frames: Indices,
        poses: Array,
        fps: float,
        silhouettes_of: SilhouettesOf,
        settings: RefinementSettings,
        progress: Progress = no_progress,
    ) -> None:
        self.body, self.frames, self.poses, self._fps = body, frames, poses.copy(), fps
        self._progress = progress
        self._kinds = {
            kind: _Examined(np.full(len(frames), np.nan), poses.copy(), np.zeros(len(frames), np.bool_))
            for kind in kinds_of(body)
        }
        self._sight = rows_seen(body, cameras, frames, silhouettes_of, settings)
        self._here: dict[int, tuple[Array, float]] = {}
        self._share = min(REFERENCE_FPS / fps, MOST_SHARE)

    def put_right(self) -> bool:
        """Apply the best path of the kind with the largest gain; False where no kind gains."""
        kinds = list(self._kinds) if len(self.frames) else []
        always = sorted((row, at) for at, kind in enumerate(kinds) for row in self._grid(kind))
        examined = counting(self._progress, "comparing left and right", len(always))
        for row, at in always:
            self._examine(kinds[at], row)
            examined()
        best, most = None, 0.0
        for kind in kinds:
            backwards = BACKWARDS * self._backwards() if kind.whole else np.zeros(len(self.frames))
            self._examine_around(kind, backwards)
            gains = np.array([self._gain(kind, row) for row in range(len(self.frames))])
            gains = np.clip(np.where(np.isneginf(gains), np.nan, gains), -MOST_GAIN, MOST_GAIN)
            exchanged, gained = best_path(self._share * (gains + backwards), self._movements(kind))
            if gained > most and exchanged.any():
                best, most = (kind, exchanged), gained
        if best is None:
            return False
        kind, exchanged = best
        for first, after in runs_of(exchanged):
            self._take(np.arange(first, after), self._kinds[kind])
        self._kinds[kind].odd ^= exchanged
        for known in self._kinds.values():
            known.losses[exchanged], known.poses[exchanged] = np.nan, self.poses[exchanged]
        return True

    def changes(self, tracked: Array) -> tuple[Exchange, ...]:
        """The exchanges that were made. tracked : the original poses (K, D)."""
        changed = (self.poses != tracked).any(axis=1)
        marked = {kind.what: examined.odd for kind, examined in self._kinds.items()}
        marked["refitted"] = changed & ~np.any([*marked.values(), np.zeros_like(changed)], axis=0)
        found = [
            Exchange(int(self.frames[first]), int(self.frames[after - 1]), what)
            for what, rows_marked in marked.items()
            for first, after in runs_of(rows_marked)
        ]
        return tuple(sorted(found, key=lambda change: change.first))

    # ------------------------------------------------------------------ frames that are examined

    def _grid(self, kind: Kind) -> list[int]:
        """Rows that are always examined."""
        step = max(1, round((BODY_GRID_S if kind.whole else GRID_S) * self._fps))
        ends = self._ends(kind, self.poses)
        jumped = moved(ends[1:], ends[:-1]) > JUMP * usual_movement(ends, self._fps)
        jumps = np.flatnonzero(jumped).tolist()
        return sorted({*range(0, len(ends), step), len(ends) - 1, *jumps, *(row + 1 for row in jumps)})

    def _examine_around(self, kind: Kind, backwards: Array) -> None:
        """Examine the neighbours of frames in which an exchange is not clearly ruled out, the likeliest first, and try
        in each the poses of neighbours with a higher g.
        """
        examined = self._kinds[kind]
        waiting = [
            (-self._gain(kind, int(row)), int(row)) for row in np.flatnonzero(np.isfinite(examined.losses))
        ]
        waiting = [(gain, row) for gain, row in waiting if backwards[row] - gain >= -CLEAR]
        heapq.heapify(waiting)
        while waiting:
            gain, row = heapq.heappop(waiting)
            self._progress("comparing left and right in frames between", 0, 0)
            for beside in (row - 1, row + 1) if -gain == self._gain(kind, row) else ():
                if not 0 <= beside < len(self.frames):
                    continue
                known = self._gain(kind, beside)
                self._examine(kind, beside)
                if beside in examined.wanted and self._gain(kind, beside) < -gain - BETTER:
                    self._offer(kind, beside, examined.poses[row], row)
                reached = self._gain(kind, beside)
                if reached != known and reached + backwards[beside] >= -CLEAR:
                    heapq.heappush(waiting, (-reached, beside))

    def _gain(self, kind: Kind, row: int) -> float:
        """g of a row, NaN where not examined, -inf where there is no such pose."""
        there = self._kinds[kind].losses[row]
        return float(np.log(self._tracked(row)[1] / there)) if there < np.inf else -there

    def _examine(self, kind: Kind, row: int) -> None:
        examined = self._kinds[kind]
        if not np.isnan(examined.losses[row]):
            return
        examined.losses[row] = np.inf
        if self._tracked(row)[1] > 0.0:
            offered = kind.offered(self.poses[row])
            examined.wanted[row] = self._ends(kind, offered[None])
            self._offer(kind, row, offered)

    def _offer(self, kind: Kind, row: int, offered: Array, beside: int = -1) -> None:
        """Refine a proposed pose, and keep it where it is better than the known one and did not return to the tracked
        pose. beside : the row that it comes from; the tracked pose there is then also tried as the tracked pose here.
        """
        examined, tracked = self._kinds[kind], self._tracked(row)
        if beside >= 0:
            other = self._refined(row, self._tracked(beside)[0])
            self._here[row] = other if other[1] < NOTABLY * tracked[1] else tracked
        pose, loss = self._refined(row, offered)
        before, after = self._ends(kind, np.stack([self.poses[row], pose]))[:, None]
        if (
            loss < NOTABLY * examined.losses[row]
            and moved(after, examined.wanted[row]) < moved(after, before) + NEAR_MM
        ):
            examined.losses[row], examined.poses[row] = loss, pose

    def _tracked(self, row: int) -> tuple[Array, float]:
        """The tracked pose of a row, refined, and its loss."""
        if row not in self._here:
            self._here[row] = self._refined(row, self.poses[row])
        return self._here[row]

    def _refined(self, row: int, pose: Array) -> tuple[Array, float]:
        """A pose refined on a row's silhouettes, and its loss; 0 where nothing is seen."""
        refiner, silhouettes = self._sight(row)
        found = refiner.refine(pose, silhouettes).pose
        return found, self._loss(row, found)

    # ------------------------------------------------------------------ movement

    def _ends(self, kind: Kind, poses: Array) -> Array:
        """(K, P, 3) ends of the limbs of a kind, mm at a person's size (`scale_of`)."""
        ends = limb_ends(self.body, poses)[:, kind.limbs].reshape(len(poses), -1, 3)
        return ends / scale_of(self.body)

    def _movements(self, kind: Kind) -> Array:
        """(K - 1, 2, 2) cost of moving from tracked, exchanged (before) to tracked, exchanged (after)."""
        poses = self.poses, self._kinds[kind].poses
        ends = self._ends(kind, poses[0]), self._ends(kind, poses[1])
        if len(self.frames) < 2:
            return np.zeros((0, 2, 2))
        apart = np.diff(self.frames)
        costs = costs_of_moving(ends, usual_movement(ends[0], self._fps) * apart)
        if kind.whole and has_tail(self.body):
            costs += costs_of_turning(self.body, poses, apart / self._fps)
        return costs

    def _backwards(self) -> Array:
        """(K,) -1 to 1: backward speed of the body, 1 at walking speed (of a person's size); 0 where it stays in
        place.
        """
        mirror = Mirror(self.body)
        places = limb_ends(self.body, self.poses).mean(axis=(1, 2))[:, :2] / scale_of(self.body)
        count, reach = len(places), max(1, round(WINDOW_S * self._fps))
        if np.ptp(places, axis=0).max() < WALKED_MM:
            return np.zeros(count)
        rows = np.arange(count)
        first, last = np.maximum(rows - reach, 0), np.minimum(rows + reach, count - 1)
        seconds = np.maximum(self.frames[last] - self.frames[first], 1) / self._fps
        left = np.array([mirror.sideways(pose)[:2] for pose in self.poses])
        ahead = np.stack([left[:, 1], -left[:, 0]], axis=1)
        speed = ((places[last] - places[first]) * ahead).sum(axis=1) / seconds
        return np.clip(-speed / WALKING_MM_S, -1.0, 1.0)

    # ------------------------------------------------------------------ what is kept

    def _take(self, rows: Indices, examined: _Examined) -> None:
        """Take the exchanged poses of some rows, refined again from their neighbours' poses where that is better."""
        found: dict[int, tuple[Array, float]] = {}
        for first in range(0, len(rows), TAKEN_TOGETHER):
            part = rows[first : first + TAKEN_TOGETHER].tolist()
            found.update({row: (examined.poses[row], self._loss(row, examined.poses[row])) for row in part})
            known = [row - 1 for row in part[:1] if row - 1 in found]
            for order in (known + part, part[::-1]):
                for before, row in itertools.pairwise(order):
                    offered = self._refined(row, found[before][0])
                    if offered[1] < found[row][1]:
                        found[row] = offered
        for row, (pose, loss) in found.items():
            self.poses[row], self._here[row] = pose, (pose, loss)

    def _loss(self, row: int, pose: Array) -> float:
        refiner, silhouettes = self._sight(row)
        return refiner.loss_with_pull(pose, silhouettes) if any(len(v.border) for v in silhouettes) else 0.0


def best_path(gains: Array, movements: Array) -> tuple[NDArray[np.bool_], float]:
    """(K,) whether each frame is exchanged on the best path, and its gain over no exchange.

    gains : (K,) of the exchange, NaN where there is none to be had. movements : (K - 1, 2, 2) costs of going from a
    frame to the next, by whether they are exchanged.
    """
    own = np.stack([np.zeros(len(gains)), np.where(np.isnan(gains), np.inf, -gains)], axis=1)
    change = CHANGE * np.array([[0.0, 1.0], [1.0, 0.0]])
    cost, came = own[0] + change[0], np.zeros((len(gains), 2), dtype=np.int64)
    for row in range(1, len(gains)):
        ways = cost[:, None] + change + movements[row - 1]
        came[row] = np.argmin(ways, axis=0)
        cost = ways.min(axis=0) + own[row]
    cost = cost + change[0]
    label = int(np.argmin(cost))
    gained = float(movements[:, 0, 0].sum() - cost[label])
    found = np.zeros(len(gains), dtype=np.bool_)
    for row in range(len(gains) - 1, -1, -1):
        found[row], label = label == 1, int(came[row, label])
    return found, gained


def costs_of_moving(ends: tuple[Array, Array], usual: Array) -> Array:
    """(K - 1, 2, 2) costs of moving from a row to the next, by which of two sets of limbs' ends (K, P, 3) each row has.

    usual : (K - 1,) σ times the frames between the rows.
    """
    costs = np.zeros((len(usual), 2, 2))
    for before, after in itertools.product((0, 1), repeat=2):
        costs[:, before, after] = MOTION * np.log1p((moved(ends[after][1:], ends[before][:-1]) / usual) ** 2)
    return costs


def moved(after: Array, before: Array) -> Array:
    """(...) root mean square distance of points (..., P, 3)."""
    return np.sqrt(np.square(after - before).sum(axis=-1).mean(axis=-1))


def usual_movement(ends: Array, fps: float) -> float:
    """σ, how far ends (K, P, 3) usually move in a frame, mm at a person's size."""
    distances = moved(ends[1:], ends[:-1])
    return max(float(np.median(distances)) if len(distances) else 0.0, STILL_MM_S / fps)
