"""Chooses the frames for fitting a subject: those with the most different postures."""

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.foundations.arrays import Array, evenly_spread

MOST_LOOKED_AT = 400


def varied_frames(
    body: BodyModel, frames: NDArray[np.int64], poses: Array | None, count: int
) -> tuple[int, ...]:
    """`count` frames, ascending, whose poses (K, D) lie furthest apart; evenly spread where no poses are known.

    The first is the one nearest to the mean posture, each next the one farthest from all that were chosen (farthest-
    point sampling), by where the limbs' ends are around their middle, mm.
    """
    count = min(count, len(frames))
    if poses is None:
        parts = (np.arange(count) + 0.5) * len(frames) / count
        return tuple(int(frames[int(part)]) for part in parts)
    rows = evenly_spread(len(frames), MOST_LOOKED_AT)
    ends = limb_ends(body, poses[rows]).reshape(len(rows), -1, 3)
    ends = (ends - ends.mean(axis=1, keepdims=True)).reshape(len(rows), -1)
    chosen = [int(np.argmin(np.linalg.norm(ends - ends.mean(axis=0), axis=1)))]
    nearest = np.linalg.norm(ends - ends[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, np.linalg.norm(ends - ends[chosen[-1]], axis=1))
    return tuple(sorted(int(frames[rows[row]]) for row in chosen))
