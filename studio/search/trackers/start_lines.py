"""Improvement steps of the search for a start pose: whole, limb by limb, pair by pair.

Every step takes its own random numbers and changes no state but a count, so that several poses can be improved in
parallel.
"""

import dataclasses
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.search.likelihood.problem import WHOLE_BODY
from studio.search.trackers.annealed_particle_filter import AnnealedParticleFilter
from studio.search.trackers.frame_loop import FrameSearch
from studio.search.trackers.particles import unweighted
from studio.search.trackers.settings import AnnealedSettings
from studio.search.trackers.tracker import FilterState, FrameLikelihood, SearchSpace

IntArray = NDArray[np.int64]

FILTER = AnnealedParticleFilter()
LIMB_LAYERS, WHOLE_LAYERS = 5, 10
DRAWN = 6
"""Poses of a limb weighed for each one annealed; two thirds over its whole range, the others about its pose."""
NEAR = 0.12
PLACED, COMBINED = 400, 20
"""Poses tried for each limb of a pair while the other is fixed, and how many of the best are combined."""
MOST_TOGETHER = 7
"""Parameters of a limb that are drawn at once; draws of a tail of eight never lie on it."""
IMPOSSIBLE = 1e6
OPPOSITE_LINES = 2
"""Lines that face the other way than the best one and are kept whatever they weigh."""
MARGIN_SCALE = 0.03
"""Log weight a camera by which the right one of two attitudes usually wins (see `initialisation.facing_odds`)."""
COMFORT = 1.0
"""Log weight a camera of an attitude whose joints are all a whole range away from rest (`AtEase`)."""


@dataclass(frozen=True, slots=True)
class Round:
    """lines : kept at most, those of the other facing not counted. limb_particles, particles : of the searches of a
    limb and of the whole body. spread : multiplies the noise.
    """

    lines: int
    limb_particles: int
    particles: int
    spread: float

    @property
    def most(self) -> int:
        """Lines at most."""
        return self.lines + OPPOSITE_LINES


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A pose (D,) and its log weight, lower by IMPOSSIBLE where limbs are inside one another."""

    pose: Array
    value: float


@dataclass(frozen=True, slots=True, eq=False)
class AtEase:
    """A frame's likelihood with a prior towards the rest pose: COMFORT × the mean over the joints of ((angle - at rest)
    ÷ range)² is subtracted from the log weight, per camera.

    Without it arms are twisted and legs crossed wherever that explains a flaw of a mask; the joints of people in
    random poses lie 0.02 to 0.05 from rest in this measure, those of wrong poses of equal weight 0.05 to 0.1.

    Where a body says how far its root usually turns from rest (a mouse's roll, which no silhouette of a round trunk
    shows), half the square of that many deviations counts, in units of `MARGIN_SCALE`.

    rest : (D,). scale : (D,) 1 ÷ (joints × range²), 0 for what has no limits. strength : COMFORT × cameras.
    """

    problem: FrameLikelihood
    rest: Array
    scale: Array
    strength: float

    @classmethod
    def of(
        cls,
        problem: FrameLikelihood,
        space: SearchSpace,
        rest: Array,
        cameras: int,
        spread: Array | None = None,
    ) -> "AtEase":
        """A frame's likelihood with the prior for a body's limits. spread : (D,) usual deviations from rest, inf where
        none is known.
        """
        root = space.hierarchy.depth == 0
        bounded = limited(space) & ~root
        ranges = np.where(bounded, space.upper - space.lower, np.inf)
        scale = ranges**-2.0 / max(1, np.count_nonzero(bounded))
        if spread is not None:
            scale[root] = 0.5 * MARGIN_SCALE / COMFORT * spread[root] ** -2.0
        return cls(problem, rest, scale, cameras * COMFORT)

    def penalty(self, poses: Array) -> Array:
        """(N,) penalty on the log weights of poses (N, D)."""
        return self.strength * ((poses - self.rest) ** 2 @ self.scale)

    def log_likelihood(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) log weights."""
        return self.problem.log_likelihood(poses, stage) - self.penalty(poses)

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) the same."""
        return self.log_likelihood(poses, stage)

    def feasible(self, poses: Array, *, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N,) whether the body can take them."""
        return self.problem.feasible(poses, limbs_apart=limbs_apart)


class LineSteps:
    """The steps for one frame. evaluations : poses weighed so far."""

    def __init__(self, problem: AtEase, space: SearchSpace, rest: Array) -> None:
        self.problem, self.evaluations = problem, 0
        self._counting = threading.Lock()
        self._space, self._rest = space, rest
        self._limbs = _searched_limbs(space)
        self._parts = [_in_parts(space, limb) for limb in self._limbs]
        self._pairs = _pairs(space, self._limbs)

    def improved(
        self, rng: np.random.Generator, line: Line, others: Sequence[Line], noise: Array, entry: Round
    ) -> Line:
        """The line, or a better one near it: its limbs one by one, two by two, then all of it with noise (D,). others :
        lines whose limbs are tried on it.
        """
        for number in rng.permutation(len(self._limbs)):
            for part in self._parts[int(number)]:
                line = self._with_limb(rng, line, part, others, entry.limb_particles)
        for pair in self._pairs:
            line = self._with_pair(rng, line, pair, others, entry.limb_particles)
        found = self.annealed(rng, line.pose[None], noise, entry.particles, WHOLE_LAYERS)
        return max(line, found, key=_value)

    def annealed(
        self, rng: np.random.Generator, poses: Array, noise: Array, particles: int, layers: int
    ) -> Line:
        """The best pose of an annealed search that starts from poses (N, D)."""
        settings = AnnealedSettings(
            particles=particles, layers=layers, constraints="redraw", limbs_apart=True, carry="weighted"
        )
        space = dataclasses.replace(self._space, sigma=noise, behaviour=None)
        search = FrameSearch(
            FILTER, FilterState(unweighted(poses)), space, seed=int(rng.integers(2**62)), frame=0
        )
        while not search.finished:
            search.step(self.problem, 0, settings)
        self._count(search.state.evaluations)
        last = search.state.particles
        assert last is not None
        values = last.raw_log_weights - self._impossible(last.poses)
        best = int(np.argmax(values))
        return Line(last.poses[best], float(values[best]))

    def values(self, poses: Array) -> Array:
        """(N,) log weights of poses (N, D), those of impossible ones lower by IMPOSSIBLE."""
        self._count(len(poses))
        return self.problem.log_likelihood(poses) - self._impossible(poses)

    def _with_limb(
        self, rng: np.random.Generator, line: Line, limb: IntArray, others: Sequence[Line], count: int
    ) -> Line:
        """The line with one limb searched over its whole range, or taken from another line."""
        drawn = np.repeat(line.pose[None], DRAWN * count, axis=0)
        lower, upper = self._space.lower[limb], self._space.upper[limb]
        far = len(drawn) * 2 // 3
        drawn[:far, limb] = lower + rng.random((far, len(limb))) * (upper - lower)
        near = NEAR * (upper - lower) * rng.standard_normal((len(drawn) - far, len(limb)))
        drawn[far:, limb] = np.clip(line.pose[limb] + near, lower, upper)
        for place, other in enumerate(others):
            drawn[-1 - place, limb] = other.pose[limb]
        drawn = drawn[self.problem.feasible(drawn, limbs_apart=True)]
        return self._best_of(rng, line, drawn, count) if len(drawn) > 1 else line

    def _with_pair(
        self,
        rng: np.random.Generator,
        line: Line,
        pair: tuple[IntArray, IntArray],
        others: Sequence[Line],
        count: int,
    ) -> Line:
        """The line with both arms, or both legs, resampled: where one covers the other's silhouette, neither can move
        alone.
        """
        places: list[Array] = []
        for limb, other in (pair, pair[::-1]):
            drawn = np.repeat(line.pose[None], PLACED, axis=0)
            drawn[:, other] = self._rest[other]
            lower, upper = self._space.lower[limb], self._space.upper[limb]
            drawn[:, limb] = lower + rng.random((PLACED, len(limb))) * (upper - lower)
            for place, one in enumerate((line, *others)):
                drawn[place, limb] = one.pose[limb]
            best = np.argsort(-self.values(drawn), kind="stable")[: COMBINED - 1]
            places.append(np.concatenate([line.pose[None, limb], drawn[best][:, limb]]))
        together = np.repeat(line.pose[None], COMBINED * COMBINED, axis=0)
        together[:, pair[0]] = np.repeat(places[0], COMBINED, axis=0)
        together[:, pair[1]] = np.tile(places[1], (COMBINED, 1))
        return self._best_of(rng, line, together, count)

    def _best_of(self, rng: np.random.Generator, line: Line, drawn: Array, count: int) -> Line:
        """The best of a line, of poses (N, D) that differ from it in some limbs, and of a search from the best `count`
        of these.
        """
        values = self.values(drawn)
        best = np.argsort(-values, kind="stable")[:count]
        still = np.zeros(len(line.pose))
        found = self.annealed(rng, drawn[best], still, count, LIMB_LAYERS)
        return max(line, Line(drawn[best[0]], float(values[best[0]])), found, key=_value)

    def _impossible(self, poses: Array) -> Array:
        return np.where(self.problem.feasible(poses, limbs_apart=True), 0.0, IMPOSSIBLE)

    def _count(self, evaluations: int) -> None:
        with self._counting:
            self.evaluations += evaluations


def limited(space: SearchSpace) -> NDArray[np.bool_]:
    """(D,) which parameters have limits on both sides."""
    return np.isfinite(space.lower) & np.isfinite(space.upper)


def _searched_limbs(space: SearchSpace) -> tuple[IntArray, ...]:
    """The parameters of each limb that hangs on the root and has limits."""
    bounded = limited(space)
    groups = [np.flatnonzero(space.limb == number) for number in np.unique(space.limb)]
    below = [group for group in groups if (space.hierarchy.depth[group] > 0).all()]
    return tuple(group for group in below if bounded[group].all())


def _in_parts(space: SearchSpace, limb: IntArray) -> list[IntArray]:
    """A limb's parameters in the parts that are searched one after the other: all together, of a long chain the near
    part and then the far one, where limits of the root keep the body off its back.
    """
    if len(limb) <= MOST_TOGETHER or not (limited(space) & (space.hierarchy.depth == 0)).any():
        return [limb]
    depths = space.hierarchy.depth[limb]
    return [limb[depths == depth] for depth in np.unique(depths)]


def _pairs(space: SearchSpace, limbs: tuple[IntArray, ...]) -> tuple[tuple[IntArray, IntArray], ...]:
    """The limbs that are of one kind, such as both arms, two by two."""
    kinds: dict[int, list[IntArray]] = {}
    for limb in limbs:
        kind = int(space.hierarchy.pair[limb[0]])
        if kind >= 0:
            kinds.setdefault(kind, []).append(limb)
    return tuple((same[0], same[1]) for same in kinds.values() if len(same) == 2)


def _value(line: Line) -> float:
    return line.value
