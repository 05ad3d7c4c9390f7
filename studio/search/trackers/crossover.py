"""Particles made from two parents (Deutscher & Reid 2005, Eq. 19).

A child takes parameters γ+1 … ε from its second parent and all others from its first, γ ≤ ε chosen at random
from 1 … L. Neighbours in the pose vector tend to stay together, so the vector keeps a limb's parameters side
by side. Cut "by limbs", γ and ε count whole limbs instead of parameters and no limb is ever torn between two
parents.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Mask
from studio.search.trackers.particle_kernels import children, places
from studio.search.trackers.tracker import SearchSpace


def cross(
    rng: np.random.Generator, first: Array, second: Array, space: SearchSpace, *, share: float, by: str
) -> tuple[Array, Mask]:
    """(N, D) children, of which about `share` × N have two parents and the others equal `first`; (N,) which have two.

    first, second : (N, D) parents, drawn independently. by : "limbs" or "parameters".
    Always uses 3 N random numbers, so that what is drawn afterwards does not depend on the share.
    """
    count = len(first)
    place: NDArray[np.int64] = limb_places(space) if by == "limbs" else np.arange(1, int(first.shape[1]) + 1)
    chosen = rng.random(count) < share
    return children(first, second, place, chosen, rng.random((count, 2)))


def limb_places(space: SearchSpace) -> NDArray[np.int64]:
    """(D,) 1, 2, … : the place of each parameter's limb in the pose vector."""
    return places(space.limb)
