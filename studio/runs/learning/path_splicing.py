"""One path joined from several: for every limb the best-fitting stretches, with changes where they cost least.

A joint's angles have more than one branch, and a path that begins on one may reach the end of its range where another
continues; paths begun elsewhere are on the other.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array

Costs = Callable[[Array], Array]


def spliced(paths: list[Array], groups: list[NDArray[np.int64]], costs: Costs, jump: float) -> Array:
    """(F, D) the cheapest path that takes each group's parameters in every frame from one of the paths (F, D).

    costs(path) -> (F,) of each frame on its own. jump : cost of a step of one radian that no path makes; of a larger
    one with its square. The first path is the one to start from; groups are chosen one after the other.
    """
    best = paths[0].copy()
    for group in groups:
        own = np.stack([costs(_with(best, group, path)) for path in paths], axis=1)
        own += np.stack([_unsteady(path[:, group]) for path in paths], axis=1) * jump**2
        chosen = _cheapest(own, np.stack([path[:, group] for path in paths], axis=1), jump)
        for place in group:
            best[:, place] = np.stack([path[:, place] for path in paths], axis=1)[
                np.arange(len(best)), chosen
            ]
    return best


def _with(path: Array, group: NDArray[np.int64], other: Array) -> Array:
    changed = path.copy()
    changed[:, group] = other[:, group]
    return changed


def _unsteady(angles: Array) -> Array:
    """(F,) squared second differences of a path's angles (F, G)."""
    squares = np.zeros(len(angles))
    if len(angles) > 2:
        squares[1:-1] = (np.diff(angles, 2, axis=0) ** 2).sum(axis=1)
    return squares


def _cheapest(own: Array, angles: Array, jump: float) -> NDArray[np.int64]:
    """(F,) which path in each frame (Viterbi). own : (F, K) costs of frames. angles : (F, K, G)."""
    frames, count = own.shape
    total, before = own[0].copy(), np.zeros((frames, count), dtype=np.int64)
    for frame in range(1, frames):
        step = angles[frame] - angles[frame - 1]
        across = angles[frame][None] - angles[frame - 1][:, None]
        strange = across - 0.5 * (step[:, None] + step[None])
        change = jump**2 * (strange**2).sum(axis=2)
        reached = total[:, None] + change
        before[frame] = np.argmin(reached, axis=0)
        total = reached[before[frame], np.arange(count)] + own[frame]
    chosen = np.zeros(frames, dtype=np.int64)
    chosen[-1] = int(np.argmin(total))
    for frame in range(frames - 1, 0, -1):
        chosen[frame - 1] = before[frame, chosen[frame]]
    return chosen
