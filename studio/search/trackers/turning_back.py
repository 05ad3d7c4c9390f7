"""Short stretches of a tracked clip in which an animal points backwards, turned back.

Both ends of an animal look alike but for the tail, and in some frames no camera shows that: there a search turns the
body half round, and turns it back some frames later. No animal does so between two frames. So a tracked clip is looked
at as a whole: it falls into parts wherever the body turns faster than its file allows. A short part between two others
is turned round, its limbs drawn again, frame by frame from the turned pose or that of the frame beside it, whichever
fits better. That is kept if both turns are gone with it, and if it costs less than they do, in the units of
`side_exchange`:

    Σ w log(loss turned round / loss as tracked), cut off at ±1, over the part's frames  <  2 TURN,      w = 30 / fps.

The shortest part comes first.

A search also follows an animal that whips round too late, drifts off and turns in one frame to where it is by then; one
that was started the wrong way turns soon; and at a clip's end nothing turns it back. So at each turn that is left the
pose behind it is carried back, and the one before it on to what follows, frame by frame and again for at most
LONGEST_S. The best path through what was tracked and what was carried (`best_path`) is taken, with the costs of
`side_exchange` and TURN for each impossible turn: where the carried poses join the tracked ones, or the clip begins or
ends, that turn is saved.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.branches import within_limits
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.evidence.volume.alignment import root_parameters
from studio.foundations.arrays import Array, Indices, consecutive
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.clip_silhouettes import SilhouettesOf, rows_seen
from studio.search.trackers.impossible_turns import TURN, costs_of_turning, turned_too_fast
from studio.search.trackers.limb_resampling import Hypothesis, SeenFrame, has_tail, redrawn, turned_pose
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import (
    MOST_GAIN,
    MOST_SHARE,
    NEAR_MM,
    REFERENCE_FPS,
    best_path,
    costs_of_moving,
    moved,
    usual_movement,
)

LONGEST_S = 0.25
"""Seconds of the longest part that is turned back."""
DRAWN = 0x7B4C


@dataclass(frozen=True, slots=True)
class Turn:
    """Frames first to last (inclusive) in which the body was turned round. like : as which other frames."""

    first: int
    last: int
    like: str = "before and after"

    @property
    def words(self) -> str:
        """Text for a run's notes."""
        return f"frames {self.first} to {self.last}: turned round, as the frames {self.like} point"


def with_facing_right(
    body: BodyModel,
    cameras: Sequence[Camera],
    frames: Indices,
    poses: Array,
    fps: float,
    silhouettes_of: SilhouettesOf,
    settings: RefinementSettings | None = None,
) -> tuple[Array, tuple[Turn, ...]]:
    """A tracked clip with the short stretches turned back in which its body points backwards, (K, D), and these.

    frames : (K,) ascending. poses : (K, D). settings : of the descents. Only bodies with a tail that stay off their
    backs are looked at. Raises what `silhouettes_of` raises.
    """
    if not has_tail(body) or not len(root_parameters(body)):
        return poses, ()
    mended, turns = poses.copy(), list[Turn]()
    work = _Work(body, cameras, frames, fps, silhouettes_of, settings or RefinementSettings())
    for rows in consecutive(frames):
        tried = set[int]()
        while inner := [
            part + rows.start
            for part in stretches(body, mended[rows], fps)[1:-1]
            if len(part) <= LONGEST_S * fps and int(part[0]) + rows.start not in tried
        ]:
            part = min(inner, key=len)
            tried.add(int(part[0]))
            turned = work.turned(part, mended)
            if turned is not None:
                mended[part] = turned
                turns.append(Turn(int(frames[part[0]]), int(frames[part[-1]])))
        tried.clear()
        while later := [
            part[0] + rows.start
            for part in stretches(body, mended[rows], fps)[1:]
            if int(part[0]) + rows.start not in tried
        ]:
            at = int(later[0])
            tried.add(at)
            carried = work.joined(at, rows, mended)
            if carried is not None:
                changed, mended[carried[0]], like = *carried, "after" if carried[0][0] < at else "before"
                turns.append(Turn(int(frames[changed[0]]), int(frames[changed[-1]]), like))
    return mended, tuple(sorted(turns, key=lambda turn: turn.first))


def stretches(body: BodyModel, poses: Array, fps: float) -> list[Indices]:
    """The rows of poses (K, D) of frames that follow each other, in parts between which the body turns faster than it
    can.
    """
    seconds = np.full(len(poses) - 1, 1.0 / fps)
    at = 1 + np.flatnonzero(turned_too_fast(body, poses[:-1], poses[1:], seconds))
    return np.split(np.arange(len(poses), dtype=np.int64), at)


class _Work:
    def __init__(
        self,
        body: BodyModel,
        cameras: Sequence[Camera],
        frames: Indices,
        fps: float,
        silhouettes_of: SilhouettesOf,
        settings: RefinementSettings,
    ) -> None:
        self._body, self._frames, self._fps = body, frames, fps
        self._rows = rows_seen(body, cameras, frames, silhouettes_of, settings)
        self._agreement = functools.cache(functools.partial(Agreement, body))

    def turned(self, rows: Indices, poses: Array) -> Array | None:
        """(R, D) the body turned round in some rows of poses (K, D), between two others; None if they do not lead
        over to these, or cost too much.
        """
        around = poses[rows[0] - 1 : rows[-1] + 2].copy()
        cost = 0.0
        for number, row in enumerate(rows.tolist(), 1):
            seen = self._seen(row)
            other = self._turned_in(row, poses[row], seen, around[number - 1])
            around[number] = other.pose
            own = seen.hypothesis(poses[row])
            if own.loss > 0.0 and other.loss > 0.0:
                cost += float(np.clip(np.log(other.loss / own.loss), -MOST_GAIN, MOST_GAIN))
        cost *= min(REFERENCE_FPS / self._fps, MOST_SHARE)
        if cost >= 2.0 * TURN or len(stretches(self._body, around, self._fps)) > 1:
            return None
        return around[1:-1]

    def joined(self, at: int, rows: slice, poses: Array) -> tuple[Indices, Array] | None:
        """Rows (R,) beside an impossible turn to row `at` of poses (K, D), and their poses (R, D), carried from the
        other side of the turn to where they join what was tracked; None where that costs more. rows : that follow each
        other.
        """
        most = max(1, round(LONGEST_S * self._fps))
        behind = range(at - 1, max(rows.start - 1, at - 1 - most), -1)
        ahead = range(at, min(rows.stop, at + most))
        ways = self._carried(poses[at], behind, poses), self._carried(poses[at - 1], ahead, poses)
        gained, changed, carried = max(ways, key=lambda way: way[0])
        return (changed, carried) if gained > 0.0 else None

    def _carried(self, beside: Array, order: range, poses: Array) -> tuple[float, Indices, Array]:
        """What is gained on the best path by a pose (D,) that is carried over rows in this order, the rows in which
        it is taken, and their poses.
        """
        nothing = 0.0, np.zeros(0, dtype=np.int64), poses[:0]
        if not order:
            return nothing
        window = np.arange(max(min(order) - 1, 0), min(max(order) + 2, len(poses)))
        carried, gains = poses[window].copy(), np.full(len(window), np.nan)
        share = min(REFERENCE_FPS / self._fps, MOST_SHARE)
        for row in order:
            seen = self._seen(row)
            here, own = row - window[0], self._refined(poses[row], seen).loss
            other = self._refined(beside, seen)
            if other.loss > own:
                other = self._redrawn(row, other, seen)
            beside, there = other.pose, other.loss
            gain = np.log(own / there) if min(own, there) > 0.0 else 0.0
            carried[here], gains[here] = beside, share * np.clip(gain, -MOST_GAIN, MOST_GAIN)
            joined = moved(self._ends(beside[None]), self._ends(poses[row][None]))[0] < NEAR_MM
            if joined or np.nansum(gains) < -2.0 * TURN:
                break
        both = poses[window], carried
        apart = np.diff(self._frames[window])
        costs = costs_of_moving(
            (self._ends(both[0]), self._ends(both[1])), usual_movement(self._ends(poses), self._fps) * apart
        )
        costs += costs_of_turning(self._body, both, apart / self._fps)
        taken, gained = best_path(gains, costs)
        return (gained, window[taken], carried[taken]) if taken.any() else nothing

    def _ends(self, poses: Array) -> Array:
        """(K, P, 3) ends of the limbs, mm at a person's size (`scale_of`)."""
        return limb_ends(self._body, poses).reshape(len(poses), -1, 3) / scale_of(self._body)

    def _turned_in(self, row: int, pose: Array, seen: SeenFrame, beside: Array) -> Hypothesis:
        """A row's pose turned round, or that of the row beside it, refined, its limbs drawn again."""
        starts = [one for one in (turned_pose(self._body, pose), beside) if one is not None]
        best = min((self._refined(one, seen) for one in starts), key=lambda one: one.loss)
        return self._redrawn(row, best, seen)

    def _refined(self, pose: Array, seen: SeenFrame) -> Hypothesis:
        return seen.hypothesis(seen.refiner.refine(within_limits(self._body, pose), seen.silhouettes).pose)

    def _redrawn(self, row: int, pose: Hypothesis, seen: SeenFrame) -> Hypothesis:
        """A row's pose with its doubtful limbs drawn again."""
        rng = np.random.default_rng(np.random.SeedSequence((int(self._frames[row]), DRAWN)))
        return redrawn(rng, pose, seen, turn=False)[0]

    def _seen(self, row: int) -> SeenFrame:
        refiner, silhouettes = self._rows(row)
        return SeenFrame(refiner, self._agreement(refiner.cameras), silhouettes)
