"""Search for misplaced limbs of a first pose, one after the other, each over its whole range.

A pose from a search of the whole body often has an arm hidden in the trunk's silhouette, where small steps change
nothing. A limb alone has few parameters: some thousand samples cover its range, and the best of them is refined.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.likelihood.shape_silhouettes import POSES

ROUNDS, NEARER = 2, 0.01
"""Passes over the limbs; fitness that a pose a whole range away from rest must gain."""
SPREADS = ((1.0, 1.0), (0.3, 0.25), (0.1, 0.25))
"""Widths of the search as shares of the limb's range, and the shares of the tries at each."""
FEWEST_PARAMETERS = 3


def lost_limbs_found(
    rng: np.random.Generator,
    fitness: Callable[[Array], Array],
    poses: Array,
    limbs: Sequence[NDArray[np.int64]],
    limits: Array,
    rest: Array,
    tries: int,
) -> Array:
    """(F, D) the poses with each limb where it fits best; among equal fits the one nearer to rest is taken.

    fitness : of (N, F, D) tried poses, (N, F), N a multiple of sixteen. limbs : each one's parameters; those with fewer
    than three or without limits stay. limits : (2, D). rest : (D,). tries : samples of a limb, 0 for none.
    """
    found, reach = poses.copy(), limits[1] - limits[0]
    free = [own for own in limbs if len(own) >= FEWEST_PARAMETERS and np.isfinite(reach[own]).all()]
    for own in ROUNDS * free:
        for spread, share in SPREADS:
            count = round(share * tries) // POSES * POSES
            if not count:
                continue
            tried = np.repeat(found[None], count, axis=0)
            drawn = rng.random((*tried.shape[:2], len(own))) - 0.5
            around = found[None][..., own] if spread < 1.0 else limits[:, own].mean(axis=0)
            tried[1:, :, own] = (around + spread * drawn * reach[own])[1:]
            tried = np.clip(tried, *limits)
            away = np.square((tried[..., own] - rest[own]) / reach[own]).mean(axis=2)
            best = np.argmax(fitness(tried) - NEARER * away, axis=0)
            found = tried[best, np.arange(len(found))]
    return found
