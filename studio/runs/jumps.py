"""Frames in which a limb jumps: the second difference of its markers is far above its usual value.

A search that loses an arm and finds it again moves it between two frames as no arm moves. The root mean square over all
frames (jitter) hides a few of these, though a viewer notices them first. The usual value differs between limbs and
moments, so each limb is compared with its own median over the track and with the frames around.
"""

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel, limb_moving
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, consecutive, median_and_spread, runs_of
from studio.runs.tracks import Track

LEAST_MM = 25.0
"""A second difference (mm a frame², of a person: `scale_of`) below this is no jump, however still the limb is
otherwise."""
SPREADS = 8.0
"""Threshold above the median of the track, in robust standard deviations."""
TIMES = 4.0
"""Factor above the median of the frames around: a punch is quick for longer than a frame."""
AROUND = 12
"""Frames before and after that count as around it."""
ABOUT = 0.8
WHOLE = "whole body"


class Jump(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A jump of a limb into `frame`. limb : its name, or "whole body". mm : the largest second difference of its
    markers. usual_mm : the median over the track.
    """

    frame: int
    limb: str
    mm: float
    usual_mm: float

    def in_words(self) -> str:
        """ "frame 41, left arm"."""
        return f"frame {self.frame}, {self.limb}"


def jumps_of(body: BodyModel, track: Track) -> tuple[Jump, ...]:
    """The jumps of a track, ascending by frame; none for a body without markers."""
    if not body.markers:
        return ()
    points = marker_points(body, track.poses)
    limbs, least = marker_limbs(body), LEAST_MM * scale_of(body)
    by_frame: dict[int, list[Jump]] = {}
    for limb in dict.fromkeys(limbs):
        own = points[:, [at for at, name in enumerate(limbs) if name == limb]]
        for jump in _limb_jumps(limb, track.frames, own, least):
            by_frame.setdefault(jump.frame, []).append(jump)
    several = len(set(limbs)) > 2
    result: list[Jump] = []
    for _, jumps in sorted(by_frame.items()):
        if several and len(jumps) == len(set(limbs)):
            far = max(jumps, key=lambda jump: jump.mm)
            jumps = [msgspec.structs.replace(far, limb=WHOLE)]
        result += jumps
    return tuple(result)


def marker_limbs(body: BodyModel) -> tuple[str, ...]:
    """(M,) each marker's limb: the group of the parameters that move its joint, or the nearest joint above."""
    return tuple(limb_moving(body, marker.joint) or "" for marker in body.markers)


def _limb_jumps(limb: str, frames: NDArray[np.int64], points: Array, least: float) -> list[Jump]:
    """The jumps of one limb. points : (K, M, 3) its markers. least : mm, of any jump."""
    bends = np.full(len(frames), np.nan)
    for part in (part for part in consecutive(frames) if part.stop - part.start > 2):
        second = np.linalg.norm(np.diff(points[part], n=2, axis=0), axis=-1).max(axis=1)
        bends[part.start + 1 : part.stop - 1] = second
    known = bends[np.isfinite(bends)]
    if not known.size:
        return []
    usual, spread = median_and_spread(known)
    level = max(least, usual + SPREADS * spread)
    return [
        _jump(limb, frames, points, bends, run, usual)
        for run in runs_of(bends > level)
        if bends[slice(*run)].max() > TIMES * _usual_around(bends, run)
    ]


def _usual_around(bends: Array, run: tuple[int, int]) -> float:
    first, after = run
    near = np.concatenate([bends[max(0, first - AROUND) : first], bends[after : after + AROUND]])
    near = near[np.isfinite(near)]
    return float(np.median(near)) if near.size else 0.0


def _jump(
    limb: str, frames: NDArray[np.int64], points: Array, bends: Array, run: tuple[int, int], usual: float
) -> Jump:
    """The jump in a run of high second differences: into the frame with the longest step, or the first of two about
    equal steps (there and back).
    """
    first, after = run
    steps = np.linalg.norm(np.diff(points[first - 1 : after + 1], axis=0), axis=-1).max(axis=1)
    row = first + int(np.argmax(steps >= ABOUT * steps.max()))
    return Jump(int(frames[row]), limb, float(bends[first:after].max()), usual)
