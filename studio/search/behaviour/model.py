"""A learnt behaviour: clusters of elementary movements and the automaton that orders them (Caillette et al. 2007).

Learnt by `model_learning.learn_model`, stored by `model_file`, used by `prediction`.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError
from studio.search.behaviour.automaton import Automaton
from studio.search.behaviour.automaton_learning import ContextTest, learn_automaton
from studio.search.behaviour.feature_space import FeatureSpace
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.prototypes import Prototypes
from studio.search.behaviour.reduction import Reduction
from studio.search.behaviour.root_motion import RootMotion
from studio.search.behaviour.settings import LearningSettings

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Making:
    """Origin of a model. frames : of training. sources : their names, one a recording, may be empty. labels : the
    recordings' clusters (F,), from which the automaton can be learnt again with another memory. entropy_train,
    entropy_test : Eq. 2 in nats, NaN where there is none. learnt_fps : frame rate of the recordings.
    """

    settings: LearningSettings
    sources: tuple[str, ...]
    frames: int
    labels: tuple[IntArray, ...]
    learnt_fps: float
    entropy_train: float
    entropy_test: float = math.nan


@dataclass(frozen=True, eq=False)
class BehaviourModel:
    """A behaviour model of a body.

    mixture : the clusters in the reduced space, where frames are labelled and the likelihood of Eq. 3 is taken (the
    components left out by the reduction are taken as equal in all clusters). dynamics : the same clusters as Gaussians
    of the features (x, ẋ), for Eq. 4 and sampling. prototypes : a real pose of each. root : changes of position and
    orientation in each, None for a body without root.
    """

    space: FeatureSpace
    reduction: Reduction
    mixture: GaussianMixture
    dynamics: GaussianMixture
    automaton: Automaton
    prototypes: Prototypes
    making: Making
    root: RootMotion | None = None

    @property
    def clusters(self) -> int:
        """K, the number of clusters."""
        return self.mixture.size

    @property
    def states(self) -> int:
        """Q, the number of the automaton's states."""
        return self.automaton.size

    @property
    def fps(self) -> float:
        """The frame rate that derivatives belong to."""
        return self.space.fps

    @property
    def steps_per_frame(self) -> float:
        """Steps of the automaton a frame: the rate it was learnt at over the rate it is used at."""
        return self.making.learnt_fps / self.space.fps

    @cached_property
    def poses_only(self) -> GaussianMixture:
        """The clusters as Gaussians of x alone, for poses whose derivative is not known."""
        half = self.space.dimensions
        dynamics = self.dynamics
        return GaussianMixture(
            dynamics.weights, dynamics.means[:, :half], dynamics.covariances[:, :half, :half]
        )

    def labels(self, poses: Array) -> IntArray:
        """(F,) clusters of the frames of one recording at the model's rate. poses : (F, D)."""
        return self.mixture.labels(self.reduction.reduced(self.space.features(poses)))

    def entropy(self, recordings: Sequence[Array]) -> float:
        """Ĥ of Eq. 2 (nats a frame) of recordings (F, D) at the rate the model was learnt at."""
        return self.automaton.entropy([self.labels(poses) for poses in recordings])

    def at_rate(self, fps: float) -> "BehaviourModel":
        """The model for footage at another frame rate.

        Derivatives per frame are scaled by the ratio of the rates, and the automaton takes `steps_per_frame` steps a
        frame, in the mean.
        """
        if fps == self.space.fps:
            return self
        if not (math.isfinite(fps) and fps > 0.0):
            raise BehaviourError(f"{fps:g} frames per second are no frame rate.", "Give a number above 0.")
        half, ratio = self.space.dimensions, self.space.fps / fps
        factor = np.repeat([1.0, ratio], half)
        reduction = dataclasses.replace(
            self.reduction, mean=self.reduction.mean * factor, scale=self.reduction.scale * factor
        )
        return dataclasses.replace(
            self,
            space=self.space.at_rate(fps),
            reduction=reduction,
            dynamics=self.dynamics.mapped(np.diag(factor)),
            prototypes=dataclasses.replace(self.prototypes, derivatives=self.prototypes.derivatives * ratio),
            root=self.root and self.root.at_ratio(ratio),
        )

    def with_automaton(self, settings: LearningSettings) -> "BehaviourModel":
        """The same clusters with the automaton learnt again from the training labels: another memory, ε, least
        probability or smoothing.
        """
        automaton = automaton_of(self.making.labels, self.clusters, settings)
        making = dataclasses.replace(
            self.making,
            settings=settings,
            entropy_train=automaton.entropy(self.making.labels),
            entropy_test=math.nan,
        )
        return dataclasses.replace(self, automaton=automaton, making=making)


def automaton_of(labels: Sequence[IntArray], clusters: int, settings: LearningSettings) -> Automaton:
    """The automaton of recordings of labels by the learning settings."""
    test = ContextTest(settings.memory, settings.epsilon, settings.least_probability)
    return learn_automaton(labels, clusters, test, settings.smoothing, settings.back_off)
