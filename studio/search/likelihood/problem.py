"""The interface of a frame's likelihood, and its optional extensions."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.evidence_check import check_sizes
from studio.search.likelihood.hard_priors import HardPriors
from studio.search.likelihood.outlines import OutlineProjector

if TYPE_CHECKING:
    from studio.search.likelihood.device_weighing import ProblemOnDevice

# Stages of a search: which part of the body a likelihood uses.
WHOLE_BODY, TRUNK_FIRST = 0, 1


POOLED, WHOLE = "all cameras", "likelihood"
"""Camera and term of a log-weight that is no sum over them."""


@dataclass(frozen=True, slots=True, eq=False)
class Shares:
    """Log-weights of N poses as sums. cameras : V names. terms : T names. values : (N, V, T) nats; their sum over
    cameras and terms is the log-weight.
    """

    cameras: tuple[str, ...]
    terms: tuple[str, ...]
    values: Array


class FrameLikelihood(Protocol):
    """One frame as a function of poses.

    stage : WHOLE_BODY, or TRUNK_FIRST where only root and trunk are searched.
    """

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights; -inf never, NaN never."""
        ...

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) the fitness f that a swarm maximises; the log-weight where there is no f."""
        ...

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them: limits kept and, if `limbs_apart`, no limb inside
        another.
        """
        ...


class Preparation:
    """A likelihood prepared for one body, some cameras and some settings; makes that of any frame; immutable."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...], settings: Any) -> None:  # noqa: ANN401
        """settings : the likelihood's own. Raises FootageError for a camera whose pictures are too large."""
        check_sizes(cameras)
        self.settings, self.cameras = settings, cameras
        self.projector = OutlineProjector.of_body(body, cameras)
        self.priors = HardPriors(body)


class BaseFrameLikelihood(ABC):
    """Base of most likelihoods of a frame: the fitness is the log-weight, and the body has its hard priors."""

    priors: HardPriors

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of how the frame was evaluated, in sentences."""
        return ()

    @abstractmethod
    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N, D) poses to (N,) log-weights. Raises BodyError for poses that are no finite (N, D)."""

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) the log-weights of poses (N, D), where the likelihood defines no other fitness."""
        return self.log_likelihood(poses, stage)

    def shares(self, poses: Array) -> Shares:
        """What each camera and term adds to the log-weights of poses (N, D); in one piece where the likelihood says no
        more.
        """
        return Shares((POOLED,), (WHOLE,), self.log_likelihood(poses)[:, None, None])

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N, D) poses to (N,) whether the body can take them."""
        return self.priors.hold(poses, limbs_apart=limbs_apart)


@runtime_checkable
class FittedToPoses(Protocol):
    """A frame that needs expected poses before it can weigh well: the blobs of Caillette, Galata & Howard 2007,
    section 6.3, which are fitted to the hull from predicted poses.

    A search calls `expecting` once, before its first weight, and weighs with what that returns; after its last weight
    it calls `remembered` of that and passes the result to the next frame. Both depend on their arguments only, so a
    frame searched again, or resumed in another process, gives the same result bit for bit.
    """

    def expecting(self, poses: Array, memory: Mapping[str, Array]) -> FrameLikelihood:
        """The frame given expected poses (S, D), S >= 1. memory : from `remembered` at the end of the frame before;
        empty in a run's first frame.
        """
        ...

    def remembered(self, pose: Array) -> Mapping[str, Array]:
        """Memory for the next frame's `expecting`, named arrays, given this frame's pose (D,)."""
        ...


@runtime_checkable
class WeighedOnDevice(Protocol):
    """A frame whose poses a card may weigh, so that a search can keep its particles there."""

    def on_device(self) -> "ProblemOnDevice | None":
        """The frame's likelihood there; None where the processor weighs."""
        ...

    def give_up_device(self, error: Exception) -> None:
        """Leave the work to the processor from now on. Raises StudioError where the card was asked for."""
        ...


@runtime_checkable
class QualityMeasured(Protocol):
    """A frame that measures how well its pictures can be explained by any pose (section 6.3: a poor likelihood of the
    voxels means that the tracker is lost).
    """

    @property
    def quality(self) -> float:
        """Likelihood of the pictures less that expected of a tracked body, nats per voxel: about 0 while tracked, far
        below 0 when lost, never NaN, -inf where nothing is seen.
        """
        ...

    @property
    def lost_evidence(self) -> bool:
        """Whether `quality` is below the likelihood's own threshold."""
        ...
