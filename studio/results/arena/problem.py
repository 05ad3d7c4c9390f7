"""A frame as a black box: batches of poses in, log-likelihoods out, counted.

Bounds are the body's limits, and no farther than REACH σ0 from where the frame begins (widened, where that is needed,
to hold the heaviest known pose). A pose outside them is counted and weighs -inf, so that an optimiser that forgets them
gains nothing. The whole body is always weighed: a swarm's first stage, which in a run weighs the trunk alone, sees the
same function as everybody else.
"""

import hashlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from studio.body.model import BodyModel, Parameter
from studio.body.reader import parse_body
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array, Bytes, Indices
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.knobs import Value, changed
from studio.runs.search_space import search_space
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.problem import FrameLikelihood
from studio.search.trackers.tracker import FilterState, Hierarchy, ParticleSet, SearchSpace

REACH = 6.0
EASY, HARD = "easy", "hard"
NO_PICTURE: Bytes = np.zeros((0, 0, 3), np.uint8)
HASH_LENGTH = 16


class ArenaError(StudioError, status=422, code="arena"):
    """A problem, a racer or a race that cannot be used."""


class BudgetSpentError(StudioError, status=409, code="budget"):
    """All evaluations that a race allows are spent: it ends a racer, which need not catch it."""


class DeafError(BaseException):
    """A racer goes on asking though its evaluations are spent: no `except Exception` of its own keeps this one."""


MOST_REFUSED = 100
"""Times that a racer may ask after its evaluations are spent."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewMaps:
    """What a camera saw. mask, edges, unknown : (H, W) as in `ViewEvidence`."""

    mask: Bytes
    edges: Bytes
    unknown: Bytes | None = None


@dataclass(frozen=True, eq=False)
class FrameMaps:
    """All that a likelihood reads of a frame, without its pictures; problems of one frame share it.

    number : of the frame in its footage. body_name, body : the text of the body's file. cameras, views : in the same
    order. weighting : the likelihood's name. knobs : its own, by name.
    """

    number: int
    body_name: str
    body: str
    cameras: tuple[Camera, ...]
    views: tuple[ViewMaps, ...]
    weighting: str
    knobs: Mapping[str, Value]

    @cached_property
    def model(self) -> BodyModel:
        """The body. Raises BodyError."""
        return parse_body(self.body, self.body_name, f"{self.body_name}.toml")

    @cached_property
    def likelihood(self) -> FrameLikelihood:
        """The frame as a function of the body's poses. Raises StudioError for what is not installed or does not fit."""
        weighting = WEIGHTINGS[self.weighting]
        settings = changed(weighting.settings_type(), self.knobs)
        views = tuple(
            ViewEvidence(camera.name, NO_PICTURE, view.mask, view.edges, None, view.unknown)
            for camera, view in zip(self.cameras, self.views, strict=True)
        )
        prepared = weighting.prepare(self.model, self.cameras, settings)
        return prepared.problem(FrameEvidence(self.number, views))

    @cached_property
    def digest(self) -> bytes:
        """A digest of everything."""
        known = hashlib.sha256(repr((self.body, self.weighting, sorted(self.knobs.items()))).encode())
        for camera, view in zip(self.cameras, self.views, strict=True):
            known.update(repr((camera.name, camera.width, camera.height)).encode())
            numbers = (camera.matrix, camera.distortion, camera.rotation, camera.translation)
            for array in (*numbers, view.mask, view.edges, view.unknown):
                known.update(b"" if array is None else np.ascontiguousarray(array).tobytes())
        return known.digest()


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """What is known before the frame is looked at.

    start : (D,) the pose that the frame begins at.
    sigma : (D,) σ0, the standard deviation of how far each parameter may have moved since.
    poses, log_weights : (N, D) and (N,) the last cloud of the frame before.
    estimate, previous : (D,) the last two reported poses, None where there is none.
    """

    start: Array
    sigma: Array
    poses: Array
    log_weights: Array
    estimate: Array | None = None
    previous: Array | None = None

    def of(self, columns: Indices) -> "Prior":
        """The same of some parameters."""

        def some(pose: Array | None) -> Array | None:
            return None if pose is None else pose[columns]

        return Prior(
            self.start[columns],
            self.sigma[columns],
            self.poses[:, columns],
            self.log_weights,
            some(self.estimate),
            some(self.previous),
        )

    @property
    def state(self) -> FilterState:
        """What a tracker's search of the frame starts from."""
        return FilterState(ParticleSet(self.poses, self.log_weights), self.estimate, self.previous)


@dataclass(frozen=True, slots=True, eq=False)
class KnownBest:
    """The heaviest known pose. pose : (D,). evaluations : of the search that met it. hash : of the problem with it."""

    pose: Array
    log_weight: float
    evaluations: int
    hash: str


@dataclass(frozen=True, eq=False)
class Definition:
    """What a problem is, without a count.

    name : unique in its set.
    kind : EASY or HARD.
    about : where the frame is from, in words.
    free : (D,) numbers of the body's parameters that are searched.
    held : the body's pose, whose other parameters stay.
    lower, upper : (D,) bounds.
    microseconds : processor time of an evaluation in large batches, on the machine that made the problem.
    """

    name: str
    kind: str
    about: str
    maps: FrameMaps
    free: Indices
    held: Array
    lower: Array
    upper: Array
    prior: Prior
    best: KnownBest | None = None
    microseconds: float = 0.0

    @cached_property
    def hash(self) -> str:
        """Of all that its function and its prior depend on."""
        known = hashlib.sha256(self.maps.digest)
        prior = self.prior
        arrays = (self.held, self.lower, self.upper, prior.start, prior.sigma, prior.poses, prior.log_weights)
        for array in (self.free, *arrays, prior.estimate, prior.previous):
            known.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
        return known.hexdigest()[:HASH_LENGTH]

    def hash_of(self, pose: Array, log_weight: float) -> str:
        """Of the problem with a pose (D,) and its weight."""
        text = f"{self.hash} {pose.astype('<f8').tobytes().hex()} {log_weight!r}"
        return hashlib.sha256(text.encode()).hexdigest()[:HASH_LENGTH]

    def knowing(self, pose: Array, log_weight: float, evaluations: int) -> "Definition":
        """The same with another heaviest known pose."""
        best = KnownBest(pose, log_weight, evaluations, self.hash_of(pose, log_weight))
        return replace(self, best=best)


class Improvement(NamedTuple):
    """A pose heavier than all before it, and how many were evaluated when it was, itself included."""

    evaluations: int
    log_weight: float
    pose: Array


@dataclass(eq=False, repr=False)
class Problem:
    """A frame for an optimiser: it is asked for poses and told their log-likelihoods, larger is better.

    definition : what it is. budget : evaluations after which BudgetSpentError is raised; None for no end. evaluations,
    seconds : spent so far. improvements : of all poses weighed, those heavier than every one before.
    """

    definition: Definition
    budget: int | None = None
    evaluations: int = 0
    seconds: float = 0.0
    improvements: list[Improvement] = field(default_factory=list[Improvement])
    weigh_whole: Callable[[Array], Array] | None = None
    """Weighs poses of the whole body, together with those of other races; None: by itself."""
    _refused: int = 0

    def __repr__(self) -> str:
        budget = "" if self.budget is None else f" of {self.budget}"
        return f"<Problem '{self.name}', {self.dimensions} parameters, {self.kind}: {self.evaluations}{budget} spent>"

    @property
    def name(self) -> str:
        return self.definition.name

    @property
    def kind(self) -> str:
        """ "easy" or "hard"."""
        return self.definition.kind

    @property
    def about(self) -> str:
        """Where the frame is from, in words."""
        return self.definition.about

    @property
    def hash(self) -> str:
        """The same for the same function, bounds and prior."""
        return self.definition.hash

    @property
    def dimensions(self) -> int:
        """D."""
        return len(self.definition.free)

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """(D,) names."""
        return tuple(entry.name for entry in self._entries)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """(D,) "mm" or "rad"."""
        return tuple("mm" if entry.kind == "length" else "rad" for entry in self._entries)

    @property
    def _entries(self) -> list[Parameter]:
        numbers: list[int] = self.definition.free.tolist()
        return [self.body.parameters[number] for number in numbers]

    @property
    def lower(self) -> Array:
        """(D,) least values."""
        return self.definition.lower

    @property
    def upper(self) -> Array:
        """(D,) largest values."""
        return self.definition.upper

    @property
    def prior(self) -> Prior:
        """Start pose, σ0 and the last cloud of the frame before."""
        return self.definition.prior

    @property
    def best(self) -> KnownBest | None:
        """The heaviest known pose."""
        return self.definition.best

    @property
    def microseconds(self) -> float:
        """Processor time of an evaluation in large batches, on the machine that made the problem."""
        return self.definition.microseconds

    @property
    def body(self) -> BodyModel:
        """The body, also where a part of it is held."""
        return self.definition.maps.model

    @property
    def cameras(self) -> tuple[Camera, ...]:
        return self.definition.maps.cameras

    @property
    def weighting(self) -> str:
        """The likelihood's name."""
        return self.definition.maps.weighting

    @cached_property
    def start_log_weight(self) -> float:
        """Of the start pose, not counted."""
        return float(self.weigh(self.prior.start[None])[0])

    @property
    def heaviest(self) -> Improvement | None:
        """The heaviest of the poses weighed so far; None before the first."""
        return self.improvements[-1] if self.improvements else None

    def again(self, budget: int | None = None) -> "Problem":
        """The same problem with nothing spent; its maps are shared."""
        return Problem(self.definition, budget)

    def log_likelihood(self, poses: ArrayLike) -> Array:
        """(N,) of poses (N, D), mm and radians; -inf outside the bounds. Each pose counts as one evaluation.

        Raises ArenaError for poses that are no finite (N, D), BudgetSpentError beyond the budget, once the poses within
        it are weighed, and DeafError to who asks MOST_REFUSED times more.
        """
        given = self._checked(poses)
        left = len(given) if self.budget is None else max(0, self.budget - self.evaluations)
        within, began = given[:left], time.perf_counter()
        weights = self.weigh(within)
        self.seconds += time.perf_counter() - began
        self._note(within, weights)
        if left < len(given):
            self._refused += 1
            if self._refused > MOST_REFUSED:
                raise DeafError
            raise BudgetSpentError(
                f"All {self.budget} evaluations of problem '{self.name}' are spent.",
                "Take `problem.heaviest`, or begin with problem.again(budget=…).",
            )
        return weights

    def weigh(self, poses: Array) -> Array:
        """(N,) of finite poses (N, D), not counted."""
        weights = np.full(len(poses), -np.inf)
        inside = np.flatnonzero(np.all((poses >= self.lower) & (poses <= self.upper), axis=1))
        if len(inside):
            weights[inside] = (self.weigh_whole or self.weigh_alone)(self.whole(poses[inside]))
        return weights

    def weigh_alone(self, poses: Array) -> Array:
        """(N,) of the whole body's poses (N, D'), which it can take."""
        return self.definition.maps.likelihood.log_likelihood(poses)

    def whole(self, poses: Array) -> Array:
        """The body's poses of poses (N, D)."""
        whole = np.repeat(self.definition.held[None], len(poses), axis=0)
        whole[:, self.definition.free] = poses
        return whole

    @cached_property
    def space(self) -> SearchSpace:
        """Bounds, σ0 and structure as a tracker takes them."""
        free, sigma = self.definition.free, np.zeros(len(self.definition.held))
        sigma[free] = self.prior.sigma
        known = search_space(self.body, sigma)
        tree = known.hierarchy
        return replace(
            known,
            names=self.parameters,
            lower=self.lower,
            upper=self.upper,
            sigma=self.prior.sigma,
            limb=known.limb[free],
            hierarchy=Hierarchy(tree.depth[free], tree.position[free], tree.subspace[free], tree.pair[free]),
        )

    def _checked(self, poses: ArrayLike) -> Array:
        try:
            given: Array = np.asarray(poses, dtype=np.float64)
        except (TypeError, ValueError):
            given = np.array([])
        if given.ndim != 2 or given.shape[-1] != self.dimensions:
            raise ArenaError(
                f"Problem '{self.name}' was given an array of shape {given.shape}.",
                f"Give poses (N, {self.dimensions}), one a row.",
            )
        wrong = np.argwhere(~np.isfinite(given))
        if len(wrong):
            row, column = wrong[0].tolist()
            raise ArenaError(
                f"Problem '{self.name}' was given {given[row, column]} for '{self.parameters[column]}'.",
                "A racer gives finite poses alone.",
            )
        return given

    def _note(self, poses: Array, weights: Array) -> None:
        highest = self.improvements[-1].log_weight if self.improvements else -np.inf
        before = np.maximum.accumulate(np.concatenate([[highest], weights]))[:-1]
        for row in np.flatnonzero(weights > before).tolist():
            self.improvements.append(
                Improvement(self.evaluations + row + 1, float(weights[row]), poses[row].copy())
            )
        self.evaluations += len(poses)
