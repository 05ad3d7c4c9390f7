"""What every weighting's problem shares: its shape, and the body's limits."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel

Array = NDArray[np.float64]


class FrameFunction(Protocol):
    """One frame as a function of poses: what trackers, a storey above, know as `FrameProblem`."""

    def weigh(self, poses: Array, stage: int = 0) -> Array:
        """(N, D) poses to (N,) log-weights; -inf never, NaN never."""
        ...

    def feasible(self, poses: Array) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        ...


class Limits:
    """The lower and upper limits of a body's parameters."""

    def __init__(self, body: BodyModel) -> None:
        self.lower = np.array([entry.lower for entry in body.parameters])
        self.upper = np.array([entry.upper for entry in body.parameters])

    def hold(self, poses: Array) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether every parameter lies within its limits, both included."""
        poses = np.asarray(poses, dtype=np.float64)
        return np.all((poses >= self.lower) & (poses <= self.upper), axis=1)
