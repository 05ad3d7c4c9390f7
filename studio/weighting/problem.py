"""The shape of every weighting's problem, and what some can do beside weighing."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

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


@runtime_checkable
class Expectant(Protocol):
    """A frame that must be told where the body is expected before it can weigh well: the blobs of Caillette, Galata &
    Howard 2007, section 6.3, which are fitted to the hull from predicted poses.

    A search calls `expecting` once, before its first weight, and weighs with what that returns; after its last weight
    it asks that for `remembered` and hands this to the next frame. Both are functions of their arguments alone, so a
    frame searched again, or gone on with in another process, gives the same result bit for bit.
    """

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> FrameFunction:
        """The frame as seen from expected poses (S, D), S >= 1. memory : what `remembered` gave at the end of the
        frame before; empty in a run's first frame.
        """
        ...

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        """What the next frame's `expecting` is to know, named arrays, now that the frame's pose (D,) is found."""
        ...


@runtime_checkable
class SelfJudging(Protocol):
    """A frame that says how well the pictures can be explained at all, before any pose is weighed (section 6.3: a poor
    likelihood of the voxels means that the tracker is lost).
    """

    @property
    def quality(self) -> float:
        """How much better (nats per voxel) the pictures are explained than the weighting expects of a body that it is
        on; about 0 while on it, far below 0 when not, never NaN, -inf where nothing is seen.
        """
        ...

    @property
    def lost_evidence(self) -> bool:
        """Whether `quality` is below the weighting's own threshold."""
        ...
