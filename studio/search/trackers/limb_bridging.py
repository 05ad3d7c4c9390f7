"""Stretches of a tracked clip in which a limb is doubtful, bridged from both ends.

A limb that a search loses is often found again some frames later, so that a clip knows more than any of its frames did:
where the limb came from, and where it went. Doubtful are frames in which the tracker itself named the limb, or in which
its ends jump. Around each such stretch the limb's angles are offered as they lead from its sound beginning to its sound
end: on a straight line between them, and carried on from either of them, each refined on the frame's silhouettes. The
best path through what was tracked and what is offered minimises

    Σ w log(loss / loss as tracked)  +  MOTION Σ log(1 + (d / σ)²),      w as in `side_exchange`

with d, how far the limb's ends move from frame to frame, and σ, how far they usually do. (A. Viterbi, "Error bounds for
convolutional codes", 1967.)
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Indices, median_and_spread, runs_of
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, counting, no_progress
from studio.search.trackers.agreement import limb_names
from studio.search.trackers.clip_silhouettes import SilhouettesOf, rows_seen
from studio.search.trackers.limb_resampling import bent_by
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import (
    MOST_SHARE,
    MOTION,
    NEAR_MM,
    REFERENCE_FPS,
    moved,
    usual_movement,
)

JUMP_MM, SPREADS, TIMES, AROUND = 60.0, 8.0, 4.0, 12
"""A second difference of a limb's ends (mm a frame² at a person's size) is a jump if it is above the first, above the
median of the clip by so many robust deviations, and above so many times the median of so many frames to either side."""
GAP_S, LONGEST_S = 0.2, 2.0
"""Doubtful frames nearer than this make one stretch; longer ones have no ends that say anything."""
MARGINS = (1, 2, 4)
"""Frames before and after the doubtful ones from which a limb is tried to be bridged: it drifts before it is missed."""
LEAST_GAIN = 0.1
"""Of the path, so that what was tracked is given up."""


@dataclass(frozen=True, slots=True)
class Bridge:
    """Frames first to last (inclusive) in which a limb was put elsewhere."""

    first: int
    last: int
    limb: str

    @property
    def words(self) -> str:
        """Text for a run's notes."""
        return f"frames {self.first} to {self.last}: {self.limb} put where the frames before and after lead"


def with_limbs_bridged(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Indices,
    poses: Array,
    named: Sequence[Sequence[str]],
    fps: float,
    silhouettes_of: SilhouettesOf,
    settings: RefinementSettings | None = None,
    progress: Progress = no_progress,
    kept: Collection[str] = (),
) -> tuple[Array, tuple[Bridge, ...]]:
    """A tracked clip with its doubtful limbs bridged, (K, D), and what was changed; other frames keep their poses.

    frames : (K,) ascending. poses : (K, D). named : of each frame the limbs that the tracker called lost. settings : of
    the descents. progress : a step for each limb. kept : limbs that stay as they are bent: silhouettes lack them.
    Raises what `silhouettes_of` and `progress` raise.
    """
    work = _Work(body, cameras, frames, poses, fps, silhouettes_of, settings or RefinementSettings(), kept)
    for limb in dict.fromkeys(name for name in limb_names(body) if name not in kept):
        lost = np.array([limb in names for names in named], np.bool_)
        stretches = work.stretches(limb, lost)
        tries = sum(3 * (end - begin - 1) for one in stretches for begin, end in work.spans(*one))
        work.tried = counting(progress, f"looking again for the {limb}", tries)
        for first, after in stretches:
            work.bridge(limb, first, after)
    return work.poses, tuple(sorted(work.bridges, key=lambda bridge: (bridge.first, bridge.limb)))


class _Work:
    """State of the bridging of one clip. tried : called after each pose that is refined."""

    def __init__(
        self,
        body: BodyModel,
        cameras: Sequence[Camera],
        frames: Indices,
        poses: Array,
        fps: float,
        silhouettes_of: SilhouettesOf,
        settings: RefinementSettings,
        kept: Collection[str],
    ) -> None:
        self._body, self._frames, self._fps = body, frames, fps
        self.poses, self.bridges = poses.copy(), list[Bridge]()
        self.tried: Callable[[], None] = lambda: None
        self._names = np.array(limb_names(body))
        self._seen = rows_seen(body, cameras, frames, silhouettes_of, settings)
        self._own = {limb: bent_by(body, limb) for limb in dict.fromkeys(self._names.tolist())}
        self._kept = [angle for limb in kept for angle in self._own[limb]]

    def stretches(self, limb: str, lost: NDArray[np.bool_]) -> list[tuple[int, int]]:
        """Rows from, and after, between which a limb is doubtful. lost : (K,) whether the tracker named it."""
        if len(self._own[limb]) < 2 or len(lost) < 3:
            return []
        doubtful = lost | self._jumps(limb)
        gap = max(1, round(GAP_S * self._fps))
        joined: list[tuple[int, int]] = []
        for first, after in runs_of(doubtful):
            if joined and first - joined[-1][1] < gap:
                joined[-1] = (joined[-1][0], after)
            else:
                joined.append((first, after))
        return [one for one in joined if one[1] - one[0] <= LONGEST_S * self._fps]

    def spans(self, first: int, after: int) -> list[tuple[int, int]]:
        """Rows around a stretch between which it is bridged, one pair for each two margins; none over a gap."""
        around = [(first - before, after - 1 + behind) for before in MARGINS for behind in MARGINS]
        return [
            (begin, end)
            for begin, end in around
            if begin >= 0 and end < len(self.poses) and np.diff(self._frames[begin : end + 1]).max() <= 1
        ]

    def bridge(self, limb: str, first: int, after: int) -> None:
        """Put a limb where the best path of a stretch leads, from whichever margin gains most."""
        best, most, usual = None, LEAST_GAIN, self._usual(limb)
        for begin, end in self.spans(first, after):
            path, gained = self._path(limb, begin, end, usual)
            if gained > most:
                best, most = (begin, path), gained
        if best is None:
            return
        begin, path = best
        changed = np.flatnonzero((path != self.poses[begin : begin + len(path)]).any(axis=1)) + begin
        self.poses[begin : begin + len(path)] = path
        self.bridges.append(Bridge(int(self._frames[changed[0]]), int(self._frames[changed[-1]]), limb))

    def _path(self, limb: str, begin: int, end: int, usual: float) -> tuple[Array, float]:
        """The poses of rows `begin` to `end`, both of which stay, on the best path, and what it gains. usual : σ."""
        offers = self._offers(limb, begin, end)
        losses = np.array(
            [[self._loss(begin + row, pose) for pose in some] for row, some in enumerate(offers)]
        )
        share = min(REFERENCE_FPS / self._fps, MOST_SHARE)
        known = np.where(losses > 0.0, losses, 1.0)
        own = share * np.log(known / known[:, :1])
        ends = self._ends(limb, offers.reshape(-1, offers.shape[2])).reshape(*offers.shape[:2], -1, 3)
        # What hardly differs from what was tracked is the same place, refined further.
        own[:, 1:][moved(ends[:, 1:], ends[:, :1]) < NEAR_MM] = np.inf
        cost, came = own[0], np.zeros(own.shape, np.int64)
        straight = 0.0
        for row in range(1, len(offers)):
            motion = MOTION * np.log1p((moved(ends[row][None], ends[row - 1][:, None]) / usual) ** 2)
            straight += float(motion[0, 0])
            ways = cost[:, None] + motion
            came[row] = np.argmin(ways, axis=0)
            cost = ways.min(axis=0) + own[row]
        label = int(np.argmin(cost))
        gained = straight - float(cost[label])
        path = np.empty((len(offers), offers.shape[2]))
        for row in range(len(offers) - 1, -1, -1):
            path[row], label = offers[row, label], int(came[row, label])
        return path, gained

    def _offers(self, limb: str, begin: int, end: int) -> Array:
        """(R, 4, D) of each row what was tracked, and the limb on a line between the ends, carried on from the first,
        and from the last, refined.
        """
        own, count = self._own[limb], end - begin + 1
        offers = np.repeat(self.poses[begin : end + 1, None], 4, axis=1)
        share = np.linspace(0.0, 1.0, count)[:, None]
        line = (1.0 - share) * self.poses[begin, own] + share * self.poses[end, own]
        inner = range(1, count - 1)
        for row in inner:
            offers[row, 1] = self._refined(begin + row, limb, line[row])
            offers[row, 2] = self._refined(begin + row, limb, offers[row - 1, 2, own])
        for row in reversed(inner):
            offers[row, 3] = self._refined(begin + row, limb, offers[row + 1, 3, own])
        return offers

    def _refined(self, row: int, limb: str, angles: Array) -> Array:
        """The pose of a row with other angles of a limb, refined."""
        pose = self.poses[row].copy()
        pose[self._own[limb]] = angles
        refiner, silhouettes = self._seen(row)
        refined = refiner.refine(pose, silhouettes).pose.copy()
        refined[self._kept] = pose[self._kept]
        self.tried()
        return refined

    def _loss(self, row: int, pose: Array) -> float:
        refiner, silhouettes = self._seen(row)
        return refiner.loss_with_pull(pose, silhouettes)

    # ------------------------------------------------------------------ movement

    def _ends(self, limb: str, poses: Array) -> Array:
        """(N, P, 3) ends of a limb's parts, mm at a person's size."""
        ends = limb_ends(self._body, poses)[:, self._names == limb].reshape(len(poses), -1, 3)
        return ends / scale_of(self._body)

    def _usual(self, limb: str) -> float:
        """σ, mm a frame."""
        return usual_movement(self._ends(limb, self.poses), self._fps)

    def _jumps(self, limb: str) -> NDArray[np.bool_]:
        """(K,) rows in which a limb's ends jump."""
        ends = self._ends(limb, self.poses)
        bends = np.zeros(len(ends))
        bends[1:-1] = np.linalg.norm(np.diff(ends, n=2, axis=0), axis=2).max(axis=1)
        usual, spread = median_and_spread(bends[1:-1])
        high = bends > max(JUMP_MM, usual + SPREADS * spread)
        for row in np.flatnonzero(high):
            around = bends[max(0, row - AROUND) : row + AROUND + 1]
            high[row] = bends[row] > TIMES * np.median(around)
        return high
