"""The contract of every tracker, and the values that pass between its methods.

A tracker is immutable: everything that changes in a run is an argument, so moving a slider is calling the same
function with another argument. A swarm's iteration, a filter's annealing level and Condensation's single step
are all "layers", counted from 0 in the order they are run (the paper's layer m of M is our layer M - m).
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.foundations.knobs import Value, knobs_of
from studio.search.behaviour.model import BehaviourModel
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.trackers.random_numbers import RandomNumbers

Arrays = dict[str, NDArray[Any]]
"""What a tracker keeps of each particle, by name."""

TRACKED, LOST, NO_EVIDENCE, RECOVERED = "tracked", "lost", "no evidence", "recovered"
LIMB_LOST = "limb lost"
TRACKING_STATES = (TRACKED, LOST, NO_EVIDENCE, RECOVERED, LIMB_LOST)
"""State of a frame. Lost: its pose does not explain the pictures. No evidence: no body is visible, the pose is held.
Recovered: tracked again by a search for the body, having been lost. Limb lost: the body is followed, but one of its
limbs is probably elsewhere (`FrameResult.limbs_lost`)."""

LIMB_LOST_SHARE = 0.06
"""Disagreeing share of a limb's area beyond which the silhouettes contradict it."""
LIMB_LOST_PROBABILITY = 0.15
"""Probability beyond which a limb is reported lost (`limb_certainty`)."""


@dataclass(frozen=True, slots=True, eq=False)
class Hierarchy:
    """Structure of the pose vector, for searches that take a part of it at a time; all arrays are (D,).

    depth : int, 0 for the root's parameters, 1 for what is nearest to it (trunk, head, hips, shoulders), 2 for
    the rest of each limb. position : bool, the root's lengths. subspace : int, 0, 1, … in the order of the tree:
    position, orientation, then every limb's nearer and farther part. pair : int, parameters of arms or legs have
    the number of their kind (both legs the same), all others -1.
    """

    depth: NDArray[np.int64]
    position: NDArray[np.bool_]
    subspace: NDArray[np.int64]
    pair: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class SearchSpace:
    """The pose vector's limits, noise and structure, and the behaviour model.

    names : D parameter names.
    lower, upper : (D,) limits, ±inf where unbounded.
    sigma : (D,) σ0, the standard deviation of the diffusion from one frame to the next (mm, rad).
    limb : (D,) int, equal numbers belong to one limb and are neighbours (crossover by whole limbs).
    hierarchy : the body's tree (a swarm's partitions).
    behaviour : the behaviour model at the footage's rate; None where a run has none.
    steps : frames since the last one that was tracked (a live run drops some); sigma is for all of them, the model
        takes each.
    scale : of the body beside a person (`scale_of`).
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    sigma: Array
    limb: NDArray[np.int64]
    hierarchy: Hierarchy
    behaviour: BehaviourModel | None = None
    steps: int = 1
    scale: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class ParticleSet:
    """N particles.

    poses : (N, D).
    log_weights : (N,) natural logs of normalised weights (equal if unweighted).
    raw_log_weights : (N,) the problem's own log w of the same poses where they were weighed, else empty.
    extra : arrays that only this particle's tracker reads (velocities of a swarm), kept in checkpoints.
    """

    poses: Array
    log_weights: Array
    raw_log_weights: Array = field(default_factory=lambda: np.zeros(0))
    extra: Arrays = field(default_factory=dict[str, NDArray[Any]])


NO_PARENT = -1
"""In place of a parent that there is none of."""
HIDDEN = "hidden "
"""Prefix of the names of a camera's hidden areas in `FilterState.memory`."""
MOVED = "moved "
"""The same of how the limbs moved (`limb_certainty`)."""


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """State that one frame passes to the next; also the start of a run.

    particles : the weighted set at the end of the frame; None = start uniformly over the space's limits.
    estimate, previous_estimate : (D,) the last two reported poses (dynamics, Eq. 10); None where there is none yet.
    memory : the likelihood's state (`search.likelihood.problem.FittedToPoses`), and under names that begin with HIDDEN
        the occluded areas (`hidden_areas`), with MOVED the limbs' movement (`limb_certainty`); trackers pass them on
        unread.
    """

    particles: ParticleSet | None
    estimate: Array | None = None
    previous_estimate: Array | None = None
    memory: Mapping[str, Array] = field(default_factory=dict[str, Array])


def start_of(pose: tuple[float, ...] | None) -> FilterState:
    """Start state of a run: one particle at the start pose, or none (pose None) for a uniform start.

    A start pose is no estimate: the way from it to the first frame's result is no velocity (Eq. 10).
    """
    return FilterState(None if pose is None else ParticleSet(np.array(pose)[None], np.zeros(1)))


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """The pose that is reported.

    pose, mean, mode : (D,).
    log_weight : the best particle's log w, or that of the refined pose.
    searched : (D,) what the search reported, where `pose` was refined after it; None where it was not.
    """

    pose: Array
    mean: Array
    mode: Array
    log_weight: float
    searched: Array | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LayerRecord:
    """Diagnostics of one layer; the frame loop fills in frame, settings_version and milliseconds.

    frame, layer : layer counts from 0.
    settings_version : of the settings in use.
    beta : exponent of Eq. 3.
    alpha_wanted, alpha_reached : survival rate (Eq. 12). All three are NaN for trackers without them (a swarm).
    variance_weighed, variance_resampled, variance_diffused : (D,) variance of every parameter over the set as it was
        weighed, after resampling (before noise), and after noise (Fig. 12 a/d, b/e, c/f). In a frame's last layer
        nothing is diffused: variance_diffused equals variance_resampled.
    best, mean : (D,) best particle, weighted mean.
    best_log_weight : raw log w of the best.
    poses : (N, D) the set as weighed.
    log_weights : (N,) raw log w, before β.
    milliseconds : time of the layer.
    model_free_share : of a frame's first layer, how many of its particles were moved without the behaviour model; NaN
        where none guides them.
    parents : (2, N') of each particle of the next layer's set, which particles of this one it was drawn from: the first
        and, where it was crossed from two, the second, else NO_PARENT; (2, 0) where nothing is drawn.
    rows : (N,) numbers of `poses` in the set where not all were kept, else (0,).
    temper, acceptance, log_evidence : of a tracker whose set is a sample of a posterior, the exponent of the likelihood
        that the set is a sample with; the share of proposed moves that were taken into it; log of the evidence with the
        exponent that the layer's weights lead to (nats). NaN for others.
    """

    frame: int = -1
    layer: int
    settings_version: int = -1
    beta: float = math.nan
    alpha_wanted: float = math.nan
    alpha_reached: float = math.nan
    variance_weighed: Array
    variance_resampled: Array
    variance_diffused: Array
    best: Array
    best_log_weight: float
    mean: Array
    poses: Array
    log_weights: Array
    milliseconds: float = 0.0
    model_free_share: float = math.nan
    parents: Indices = field(default_factory=lambda: np.zeros((2, 0), dtype=np.int64))
    rows: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    temper: float = math.nan
    acceptance: float = math.nan
    log_evidence: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """The result of one frame. evaluations : poses weighed. carried : what the next frame starts from. tracking : one
    of TRACKING_STATES. overlap : how well the silhouettes of pose and masks agree (f_s, 0 to 1), NaN where unknown.
    doubts : frames in a row, this one included, that looked lost. disagreement : by limb the share of its area in which
    silhouettes and pose disagree (`agreement.Disagreement.shares`); empty where nothing was compared. limb_loss : by
    limb the probability that it is lost (`limb_certainty`); empty also in results stored before there was one. notes :
    what the frame's numbers do not say, in sentences: weights that choose nothing, cameras that show nothing.
    """

    frame: int
    estimate: Estimate
    layers: int
    evaluations: int
    settings_version: int
    milliseconds: float
    carried: FilterState
    tracking: str = TRACKED
    overlap: float = math.nan
    doubts: int = 0
    disagreement: Mapping[str, float] = field(default_factory=dict[str, float])
    limb_loss: Mapping[str, float] = field(default_factory=dict[str, float])
    notes: tuple[str, ...] = ()

    @property
    def limbs_lost(self) -> tuple[str, ...]:
        """Limbs that are probably elsewhere; where that is not known, those that the silhouettes contradict."""
        if self.limb_loss:
            return tuple(name for name, value in self.limb_loss.items() if value > LIMB_LOST_PROBABILITY)
        return tuple(name for name, share in self.disagreement.items() if share > LIMB_LOST_SHARE)


@dataclass(frozen=True, slots=True)
class Printed:
    """Something that a paper prints of its tracker, and what is run for it.

    printed : with its place in the paper. sets : knobs by flat name. runs : in words, where no knob says it. why : the
    reason, where what is run is not what is printed or the paper leaves it open; "" where it is the same.
    """

    printed: str
    sets: Mapping[str, Value] = field(default_factory=dict[str, Value])
    runs: str = ""
    why: str = ""


@dataclass(frozen=True, slots=True)
class Preset:
    """Ready-made settings. name : shown on screen. help : its purpose, one sentence. own : knobs by flat name.

    tracker, weighting (a likelihood), body : by name, that it is made for; "" fits any that has its knobs, and the
    session's body. printed : of a paper's whole tracker, every knob of it among them. learning : the same of its
    behaviour model, by knobs of learning.
    """

    name: str
    help: str
    own: Mapping[str, Value] = field(default_factory=dict[str, Value])
    tracker: str = ""
    weighting: str = ""
    body: str = ""
    printed: tuple[Printed, ...] = ()
    learning: tuple[Printed, ...] = ()

    @property
    def values(self) -> dict[str, Value]:
        """All its knobs by flat name."""
        return {**self.own, **{name: value for entry in self.printed for name, value in entry.sets.items()}}

    def fits(self, tracker: str, weighting: str) -> bool:
        """Whether it is made for runs with that tracker and likelihood."""
        return self.tracker in ("", tracker) and self.weighting in ("", weighting)


@dataclass(frozen=True, slots=True)
class Variant:
    """A named variant of a tracker. help : one line. changes : knobs by flat name."""

    help: str
    changes: Mapping[str, Value]


class SearchOnDevice(Protocol):
    """Searches of one frame on a card, one a run, a layer at a time, made of tracker, problem, and the runs' spaces and
    settings of the frame, one a run. evaluated : poses of each that the last layer weighed.
    """

    evaluated: int

    def begin(
        self,
        previous: Sequence[FilterState],
        numbers: Sequence[RandomNumbers],
        settings: Sequence[Any],
    ) -> None:
        """Make the first layer's sets from what the last frame left."""
        ...

    def take(self, sets: Sequence[ParticleSet]) -> None:
        """Go on from sets of the host."""
        ...

    def step(
        self, layer: int, numbers: Sequence[RandomNumbers], settings: Sequence[Any]
    ) -> list[LayerRecord]:
        """Do a layer and return its records."""
        ...

    def particles(self) -> list[ParticleSet]:
        """The sets that the next layer weighs, or the last layer's with their weights, on the host."""
        ...


PARTICLES = "particles"
"""The knob that says how many poses a layer weighs, unless a tracker says otherwise."""
S = TypeVar("S")
"""The settings of a tracker."""


class Tracker(ABC, Generic[S]):
    """A stochastic search of one frame, a layer at a time, and its registry entry.

    name : its key in the catalogue.
    label : its name on screen.
    settings_type : the frozen dataclass of its knobs, with `start_repeats` among them.
    size_knobs : knobs that say how much is searched, of each stage those that are multiplied.
    needs_behaviour : it requires a behaviour model.
    scales_likelihood : it multiplies log w by its own scale (`beta` of its records).
    device_module : the module whose `DeviceSearch` (see `SearchOnDevice`) does its layers on a card; "" has none.
    own_knobs : names of knobs in which searches may differ that a card does side by side.
    score : name of the best particle's reported value, and its unit.
    variants : known changes, by label, for comparisons.
    presets : for the pages, offered where a run has all knobs that they set.

    Its methods hold nothing: the same arguments give the same result. N is the number of particles of a set, D that of
    the body's parameters.
    """

    name: str
    label: str
    settings_type: type[S]
    size_knobs: ClassVar[tuple[tuple[str, ...], ...]] = (("particles",),)
    needs_behaviour: ClassVar[bool] = False
    scales_likelihood: ClassVar[bool] = False
    device_module: ClassVar[str] = ""
    own_knobs: ClassVar[frozenset[str]] = frozenset({"estimate", "start_repeats"})
    score: ClassVar[tuple[str, str]] = ("Best weight", "log w")
    variants: ClassVar[Mapping[str, Variant]] = {}
    presets: ClassVar[tuple[Preset, ...]] = ()

    def shared_knobs(self, settings: S) -> dict[str, Value]:
        """What searches have in common that a card does side by side: all knobs but `own_knobs`."""
        known = knobs_of(settings)
        return {one.name: getattr(settings, one.name) for one in known if one.name not in self.own_knobs}

    def evaluations(self, settings: S) -> int:
        """Poses weighed in a frame; in the first frame: in each of its `start_repeats` searches."""
        return self.layer_count(settings) * getattr(settings, PARTICLES)

    def evaluation_knobs(self, evaluations: int, layers: int) -> dict[str, int]:
        """Knobs, by name, with which about so many poses are weighed a frame.

        evaluations : wanted a frame.
        layers : used where the tracker lets them be chosen.
        """
        return {"particles": round(evaluations / self.layer_count(self.settings_type()))}

    def least_evaluations(self, layers: int) -> int:
        """Fewest poses that a frame can be searched with.

        layers : as in `evaluation_knobs`.
        """
        return 2 * self.layer_count(self.settings_type())

    @abstractmethod
    def layer_count(self, settings: S) -> int:
        """Number of layers of a frame."""

    @abstractmethod
    def begin_frame(
        self, numbers: RandomNumbers, previous: FilterState, space: SearchSpace, settings: S
    ) -> ParticleSet:
        """The unweighted set that the first layer weighs: predicted (Eq. 10) and spread (Eq. 9).

        numbers : the only source of random numbers.
        previous : what the frame before left; its `particles` are None at a run's start without a pose.
        space : limits, σ0 and structure of the pose vector (mm, radians).
        settings : of the frame.
        """

    @abstractmethod
    def step_layer(
        self,
        numbers: RandomNumbers,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: S,
    ) -> tuple[ParticleSet, LayerRecord]:
        """Weigh a set and make the next one: the new set, and the record of the layer.

        numbers : the only source of random numbers.
        particles : as the layer before left them; N may change from layer to layer.
        layer : from 0 in the order they run. In the last one the weighted set itself is returned.
        problem : log-weights of poses (N, D).
        space : limits, σ0 and structure of the pose vector (mm, radians).
        settings : of the layer; a slider may have moved since the last one.
        """

    def fits_device(self, layer: int, space: SearchSpace, settings: S, extra: Arrays) -> bool:
        """Whether a card can do a layer. extra : the set's arrays."""
        return False

    @abstractmethod
    def end_frame(self, particles: ParticleSet, space: SearchSpace, settings: S) -> Estimate:
        """The pose that is reported.

        particles : the last layer's weighted set.
        """

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: S) -> Array:
        """(S, D) expected poses, the likeliest first: the set's mean where the tracker expects no several.

        particles : the unweighted set that the first layer will weigh.
        """
        return particles.poses.mean(axis=0)[None]


AnyTracker = Tracker[Any]
"""A tracker of whatever settings, as the catalogue has it."""
