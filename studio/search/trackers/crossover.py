"""Particles made from two parents (Deutscher & Reid 2005, Eq. 19).

A child takes parameters γ+1 … ε from its second parent and all others from its first, γ ≤ ε chosen at random
from 1 … L. Neighbours in the pose vector tend to stay together, so the vector keeps a limb's parameters side
by side. Cut "by limbs", γ and ε count whole limbs instead of parameters and no limb is ever torn between two
parents.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Mask
from studio.search.trackers.counted_numbers import OF_CUTS, OF_PARENTS
from studio.search.trackers.particle_kernels import children, places
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import SearchSpace


def cross(
    numbers: RandomNumbers, first: Array, second: Array, space: SearchSpace, *, share: float, by: str
) -> tuple[Array, Mask]:
    """(N, D) children, of which about `share` × N have two parents and the others equal `first`; (N,) which have two.

    first, second : (N, D) parents, drawn independently. by : "limbs" or "parameters".
    """
    count = len(first)
    place: NDArray[np.int64] = limb_places(space) if by == "limbs" else np.arange(1, int(first.shape[1]) + 1)
    chosen = numbers.shares(count, 3, OF_PARENTS)[:, 2] < share
    return children(first, second, place, chosen, numbers.shares(count, 2, OF_CUTS))


def limb_places(space: SearchSpace) -> NDArray[np.int64]:
    """(D,) 1, 2, … : the place of each parameter's limb in the pose vector."""
    return places(space.limb)
