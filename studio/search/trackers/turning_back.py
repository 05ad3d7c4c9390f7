"""Short stretches of a tracked clip in which an animal points backwards, turned back.

Both ends of an animal look alike but for the tail, and in some frames no camera shows that: there a search turns the
body half round, and turns it back some frames later. No animal does so between two frames. So a tracked clip is looked
at as a whole: it falls into parts wherever the body turns faster than its file allows. A short part between two others
is turned round, its limbs drawn again, frame by frame from the turned pose or that of the frame beside it, whichever
fits better. That is kept if both turns are gone with it, and if it costs less than they do, in the units of
`side_exchange`:

    Σ w log(loss turned round / loss as tracked), cut off at ±1, over the part's frames  <  2 TURN,      w = 30 / fps.

The shortest part comes first; longer ones are left to `side_exchange`, which needs more frames to tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.branches import within_limits
from studio.body.model import BodyModel
from studio.evidence.volume.alignment import root_parameters
from studio.foundations.arrays import Array, Indices, consecutive
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.agreement import Agreement
from studio.search.trackers.clip_silhouettes import SilhouettesOf, rows_seen
from studio.search.trackers.frame_refinement import Hypothesis, SeenFrame, has_tail, redrawn, turned_pose
from studio.search.trackers.impossible_turns import TURN, turned_too_fast
from studio.search.trackers.refinement import RefinementSettings
from studio.search.trackers.side_exchange import MOST_GAIN, MOST_SHARE, REFERENCE_FPS

LONGEST_S = 0.25
"""Seconds of the longest part that is turned back."""
DRAWN = 0x7B4C


@dataclass(frozen=True, slots=True)
class Turn:
    """Frames first to last (inclusive) in which the body was turned round."""

    first: int
    last: int

    @property
    def words(self) -> str:
        """Text for a run's notes."""
        return f"frames {self.first} to {self.last}: turned round, as the frames before and after point"


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

    def _turned_in(self, row: int, pose: Array, seen: SeenFrame, beside: Array) -> Hypothesis:
        """A row's pose turned round, or that of the row beside it, refined, its limbs drawn again."""
        starts = [one for one in (turned_pose(self._body, pose), beside) if one is not None]
        refined = [
            seen.hypothesis(seen.refiner.refine(within_limits(self._body, one), seen.silhouettes).pose)
            for one in starts
        ]
        best = min(refined, key=lambda one: one.loss)
        rng = np.random.default_rng(np.random.SeedSequence((int(self._frames[row]), DRAWN)))
        return redrawn(rng, best, seen, turn=False)[0]

    def _seen(self, row: int) -> SeenFrame:
        refiner, silhouettes = self._rows(row)
        return SeenFrame(refiner, Agreement(self._body, refiner.cameras), silhouettes)
