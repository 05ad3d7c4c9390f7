"""The shape of every weighting's problem, and what some can do beside weighing."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.geometry.camera import Camera
from studio.weighting.evidence_check import check_sizes
from studio.weighting.hard_priors import HardPriors
from studio.weighting.outlines import OutlineProjector

Array = NDArray[np.float64]

# Stages of a search: what of the body a weighting may look at.
WHOLE_BODY, TRUNK_FIRST = 0, 1


class FrameProblem(Protocol):
    """One frame as a function of poses. stage : WHOLE_BODY, or TRUNK_FIRST where only root and trunk are sought."""

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


class Preparation:
    """A weighting made ready for one body, some cameras and some settings; makes the problem of any frame, and holds
    nothing that changes.
    """

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...], settings: Any) -> None:  # noqa: ANN401
        """settings : the weighting's own. Raises FootageError for a camera whose pictures are too large."""
        check_sizes(cameras)
        self.settings, self.cameras = settings, cameras
        self.projector = OutlineProjector.of_body(body, cameras)
        self.priors = HardPriors(body)


class PreparedProblem(ABC):
    """What the frames of most weightings have in common: a fitness that is the log-weight, and the body's hard
    priors.
    """

    priors: HardPriors

    @abstractmethod
    def weigh(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights. Raises BodyError for poses that are no finite (N, D)."""

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) the log-weights of poses (N, D), where the weighting defines no other fitness."""
        return self.weigh(poses, stage)

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        return self.priors.hold(poses, limbs_apart)


@runtime_checkable
class Expectant(Protocol):
    """A frame that must be told where the body is expected before it can weigh well: the blobs of Caillette, Galata &
    Howard 2007, section 6.3, which are fitted to the hull from predicted poses.

    A search calls `expecting` once, before its first weight, and weighs with what that returns; after its last weight
    it asks that for `remembered` and hands this to the next frame. Both are functions of their arguments alone, so a
    frame searched again, or gone on with in another process, gives the same result bit for bit.
    """

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> FrameProblem:
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
