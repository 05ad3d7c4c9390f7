"""Limbs that a first pose has in a wrong place, looked for in all their range, one after the other.

A pose that was searched for as a whole often has an arm hidden in the trunk's silhouette, from where small steps lead
nowhere. A limb alone has few parameters: some thousand places of it cover its range, and the best of them is refined.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from studio.weighting.shape_silhouettes import POSES

Array = NDArray[np.float64]

ROUNDS, NEARER = 2, 0.01
"""How often each limb is looked for, and what of the fitness a place a whole range away from rest must gain."""
SPREADS = ((1.0, 1.0), (0.3, 0.25), (0.1, 0.25))
"""In which shares of its range, the first of which is all of it, and with which shares of the tries."""
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
    """(F, D) the poses with each limb where it fits best. Of places that fit alike the one nearer to rest is taken.

    fitness : of (N, F, D) tried poses, (N, F), N a multiple of sixteen. limbs : each one's parameters; those with fewer
    than three or without limits stay. limits : (2, D). rest : (D,). tries : places of a limb, 0 for none.
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
