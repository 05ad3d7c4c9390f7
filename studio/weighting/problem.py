"""The shape of every weighting's problem."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Stages of a search: what of the body a weighting may look at.
WHOLE_BODY, TRUNK_FIRST = 0, 1


class FrameFunction(Protocol):
    """One frame as a function of poses: what trackers, a storey above, know as `FrameProblem`."""

    def weigh(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights; -inf never, NaN never."""
        ...

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) the fitness f that a swarm maximises; the log-weight where there is no f."""
        ...

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them: limits kept and, if `limbs_apart`, no limb inside
        another.
        """
        ...
