"""The search for a start pose: nothing is known but the body, and perhaps where its hull is.

From coarse to fine, with the annealed particle filter (Deutscher & Reid 2005) as the tool of every step. The best
candidates of each family (headings all around, so both facings) are annealed together; what each family found is a
*line*. In rounds with fewer lines and less noise a line is improved limb by limb, each limb searched over its joints'
whole ranges and offered those of the other lines, then as a whole. Two things decide whether it succeeds, measured on
people in random poses (20 poses, four cameras, subtracted masks): limbs must not enter one another (without: 4 of 20
found, arms hide in the trunk; with: 14 of 20 at the same cost), and limbs must be searched one at a time (annealed as
a whole only, none).

Front and back of a silhouette look alike, so lines that face the other way than the best one are carried to the end
even where they rank low. Their best weight is what the confidence is made of.
"""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.errors import RunError
from studio.tracking.annealed_particle_filter import AnnealedParticleFilter
from studio.tracking.frame_loop import FrameSearch
from studio.tracking.particles import unweighted
from studio.tracking.settings import AnnealedSettings
from studio.tracking.start_candidates import StartCandidates
from studio.tracking.tracker import Carried, FrameProblem, SearchSpace
from studio.weighting.problem import WHOLE_BODY

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

FILTER = AnnealedParticleFilter()
PER_FAMILY = 200
SURVIVING = 20
"""Candidates of a family that are annealed together."""
FAMILY_LAYERS, FAMILY_PARTICLES, FAMILY_SPREAD = 8, 100, 0.6
LIMB_LAYERS, WHOLE_LAYERS = 5, 10
DRAWN = 6
"""Poses of a limb that are weighed for each that is annealed; two thirds over its whole range, the others about it."""
NEAR = 0.12
PLACED, COMBINED = 400, 20
"""Places tried for each limb of a pair while the other rests, and how many of the best are tried together."""
RANGE_SHARE, MOVE, TURN = 0.15, 80.0, 0.25
"""Noise before it shrinks: a share of a joint's range; mm and radians of the root."""
OPPOSITE_LINES = 2
MARGIN_SCALE = 0.05
"""Log weight per camera by which the right facing usually wins (see `confidence`)."""
IMPOSSIBLE = 1e6
COMFORT = 1.0
"""Log weight per camera of an attitude whose joints are all a whole range away from rest (its square root: see
`AtEase`)."""


@dataclass(frozen=True, slots=True)
class Round:
    """lines : kept at most, those of the other facing not counted. limb_particles, particles : of the searches of a
    limb and of the whole body. spread : multiplies the noise.
    """

    lines: int
    limb_particles: int
    particles: int
    spread: float


ROUNDS = (
    Round(16, 60, 200, 0.4),
    Round(10, 100, 200, 0.4),
    Round(8, 100, 200, 0.3),
    Round(6, 150, 200, 0.3),
    Round(4, 150, 300, 0.2),
    Round(3, 150, 300, 0.1),
)
QUICK = (Round(6, 60, 150, 0.4), Round(4, 100, 200, 0.3), Round(2, 150, 200, 0.2))
"""For a tracker that is lost: a wrong pose is noticed and sought again."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A pose (D,) and its log weight, lower by IMPOSSIBLE where limbs are inside one another."""

    pose: Array
    value: float


@dataclass(frozen=True, slots=True, eq=False)
class FoundStart:
    """A start pose. pose : (D,). log_weight : its own. confidence : 0 to 1, how sure it is that the body faces this
    way. margin : log weight by which it beats the best pose that faces the other way, inf where there is none. rival :
    that pose, None where there is none. agreement : share of the last lines that face as the best one does.
    evaluations : poses weighed.
    """

    pose: Array
    log_weight: float
    confidence: float
    margin: float
    rival: Array | None
    agreement: float
    evaluations: int


Facing = Callable[[Array], Array]
Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, eq=False)
class AtEase:
    """A problem in which bodies would rather be at ease: COMFORT × the mean over the joints of ((angle - at rest) ÷
    range)² is taken from the log weight, a camera.

    Without it arms are found twisted and legs crossed wherever that explains a flaw of a mask; the joints of people in
    random poses lie 0.02 to 0.05 from rest in this measure, those of wrong poses of equal weight 0.05 to 0.1.
    """

    problem: FrameProblem
    rest: Array
    scale: Array
    strength: float

    def penalty(self, poses: Array) -> Array:
        """(N,) what is taken from the log weights of poses (N, D)."""
        return self.strength * ((poses - self.rest) ** 2 @ self.scale)

    def weigh(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) log weights."""
        return self.problem.weigh(poses, stage) - self.penalty(poses)

    def fitness(self, poses: Array, stage: int = WHOLE_BODY) -> Array:
        """(N,) the same."""
        return self.weigh(poses, stage)

    def feasible(self, poses: Array, limbs_apart: bool = False) -> NDArray[np.bool_]:
        """(N,) whether the body can take them."""
        return self.problem.feasible(poses, limbs_apart)


class StartSearch:
    """One search. Call `run`.

    rest : (D,) the body's rest pose. facing : poses (N, D) to unit vectors (N, 3), where they face. cameras : views in
    the problem. seed : the same one gives the same pose. progress : called with steps done and in all; it may raise to
    end the search.
    """

    def __init__(
        self,
        problem: FrameProblem,
        space: SearchSpace,
        rest: Array,
        facing: Facing,
        *,
        cameras: int,
        seed: int,
        rounds: tuple[Round, ...] = ROUNDS,
        progress: Progress | None = None,
    ) -> None:
        self._problem = _at_ease(problem, space, rest, cameras)
        self._space, self._facing, self._cameras = space, facing, cameras
        self._rng = np.random.default_rng(np.random.SeedSequence((seed, 0x57A27)))
        self._rounds, self._progress = rounds, progress
        self._done = self._steps = self._evaluations = 0
        self._noise = first_noise(space)
        self._rest = rest
        self._limbs = _searched_limbs(space)
        self._pairs = _pairs(space, self._limbs)

    def run(self, candidates: StartCandidates, known: Array | None = None) -> FoundStart:
        """The best pose that was found. Raises RunError for no candidates."""
        if not len(candidates.poses):
            raise RunError("There is no pose to begin a search with.", "Give candidates.")
        families = np.unique(candidates.family)
        self._steps = len(families) + sum(entry.lines for entry in self._rounds)
        lines = self._families(candidates, families)
        if known is not None:
            lines += [Line(pose, value) for pose, value in zip(known, self._values(known), strict=True)]
        for number, entry in enumerate(self._rounds):
            kept = self._kept(lines, entry.lines)
            lines = [self._improved(line, kept, entry) for line in kept]
            self._done = len(families) + sum(former.lines for former in self._rounds[: number + 1])
            self._tell()
        return self._found(lines)

    # ------------------------------------------------------------------ steps

    def _families(self, candidates: StartCandidates, families: IntArray) -> list[Line]:
        values = self._values(candidates.poses)
        found = []
        for family in families:
            rows = np.flatnonzero(candidates.family == family)
            best = rows[np.argsort(-values[rows], kind="stable")[:SURVIVING]]
            poses = candidates.poses[best]
            spread = FAMILY_SPREAD * self._noise
            found.append(self._annealed(poses, spread, FAMILY_PARTICLES, FAMILY_LAYERS))
            self._step()
        return found

    def _kept(self, lines: list[Line], count: int) -> list[Line]:
        """The best lines, and the best of those that face the other way than the first."""
        ranked = sorted(lines, key=lambda line: -line.value)
        kept = ranked[:count]
        opposite = [line for line in ranked if self._faces_away(line.pose, ranked[0].pose)]
        return kept + [line for line in opposite[:OPPOSITE_LINES] if not any(line is one for one in kept)]

    def _improved(self, line: Line, others: list[Line], entry: Round) -> Line:
        for number in self._rng.permutation(len(self._limbs)):
            line = self._with_limb(line, self._limbs[number], others, entry.limb_particles)
        for pair in self._pairs:
            line = self._with_pair(line, pair, others, entry.limb_particles)
        noise = entry.spread * self._noise
        found = self._annealed(line.pose[None], noise, entry.particles, WHOLE_LAYERS)
        self._step()
        return max(line, found, key=lambda one: one.value)

    def _with_limb(self, line: Line, limb: IntArray, others: list[Line], count: int) -> Line:
        """The line with one limb searched over all that it can do, or taken from another line."""
        drawn = np.repeat(line.pose[None], DRAWN * count, axis=0)
        lower, upper = self._space.lower[limb], self._space.upper[limb]
        far = len(drawn) * 2 // 3
        drawn[:far, limb] = lower + self._rng.random((far, len(limb))) * (upper - lower)
        near = NEAR * (upper - lower) * self._rng.standard_normal((len(drawn) - far, len(limb)))
        drawn[far:, limb] = np.clip(line.pose[limb] + near, lower, upper)
        for place, other in enumerate(others):
            drawn[-1 - place, limb] = other.pose[limb]
        drawn = drawn[self._problem.feasible(drawn, True)]
        if len(drawn) < 2:
            return line
        values = self._values(drawn)
        best = np.argsort(-values, kind="stable")[:count]
        found = self._annealed(drawn[best], np.zeros(len(line.pose)), count, LIMB_LAYERS)
        first = Line(drawn[best[0]], float(values[best[0]]))
        return max(line, first, found, key=lambda one: one.value)

    def _with_pair(
        self, line: Line, pair: tuple[IntArray, IntArray], others: list[Line], count: int
    ) -> Line:
        """The line with both arms, or both legs, placed anew: where one covers what belongs to the other, neither can
        move alone.
        """
        places: list[Array] = []
        for limb, other in (pair, pair[::-1]):
            drawn = np.repeat(line.pose[None], PLACED, axis=0)
            drawn[:, other] = self._rest[other]
            lower, upper = self._space.lower[limb], self._space.upper[limb]
            drawn[:, limb] = lower + self._rng.random((PLACED, len(limb))) * (upper - lower)
            for place, one in enumerate([line, *others]):
                drawn[place, limb] = one.pose[limb]
            best = np.argsort(-self._values(drawn), kind="stable")[: COMBINED - 1]
            places.append(np.concatenate([line.pose[None, limb], drawn[best][:, limb]]))
        together = np.repeat(line.pose[None], COMBINED * COMBINED, axis=0)
        together[:, pair[0]] = np.repeat(places[0], COMBINED, axis=0)
        together[:, pair[1]] = np.tile(places[1], (COMBINED, 1))
        values = self._values(together)
        best = np.argsort(-values, kind="stable")[:count]
        found = self._annealed(together[best], np.zeros(len(line.pose)), count, LIMB_LAYERS)
        return max(line, Line(together[best[0]], float(values[best[0]])), found, key=lambda one: one.value)

    def _annealed(self, poses: Array, noise: Array, particles: int, layers: int) -> Line:
        """The best pose of an annealed search from some poses."""
        settings = AnnealedSettings(
            particles=particles, layers=layers, constraints="redraw", limbs_apart=True, carry="weighted"
        )
        space = dataclasses.replace(self._space, sigma=noise, behaviour=None)
        seed = int(self._rng.integers(2**62))
        search = FrameSearch(FILTER, Carried(unweighted(poses)), space, seed=seed, frame=0)
        while not search.finished:
            search.step(self._problem, 0, settings)
        self._evaluations += search.state.evaluations
        last = search.state.particles
        assert last is not None
        possible = self._problem.feasible(last.poses, True)
        values = last.raw_log_weights - np.where(possible, 0.0, IMPOSSIBLE)
        best = int(np.argmax(values))
        return Line(last.poses[best], float(values[best]))

    # ------------------------------------------------------------------ values

    def _values(self, poses: Array) -> Array:
        """(N,) log weights, those of impossible poses lower by IMPOSSIBLE."""
        self._evaluations += len(poses)
        weights = self._problem.weigh(poses)
        return weights - np.where(self._problem.feasible(poses, True), 0.0, IMPOSSIBLE)

    def _faces_away(self, pose: Array, other: Array) -> bool:
        first, second = self._facing(np.stack([pose, other]))
        return float(first @ second) < 0.0

    def _found(self, lines: list[Line]) -> FoundStart:
        ranked = sorted(lines, key=lambda line: -line.value)
        best = ranked[0]
        away = [line for line in ranked if self._faces_away(line.pose, best.pose)]
        margin = best.value - away[0].value if away else math.inf
        return FoundStart(
            pose=best.pose,
            log_weight=best.value if best.value > -0.5 * IMPOSSIBLE else best.value + IMPOSSIBLE,
            confidence=confidence(margin, self._cameras),
            margin=margin,
            rival=away[0].pose if away else None,
            agreement=1.0 - len(away) / len(ranked),
            evaluations=self._evaluations,
        )

    def _step(self) -> None:
        self._done += 1
        self._tell()

    def _tell(self) -> None:
        if self._progress is not None:
            self._progress(min(self._done, self._steps), self._steps)


def confidence(margin: float, cameras: int) -> float:
    """How sure it is that a body faces as the best pose does, from 0.5 to 1. margin : log weight to the best pose of
    the other facing.
    """
    return 1.0 / (1.0 + math.exp(-min(margin / (cameras * MARGIN_SCALE), 700.0)))


def first_noise(space: SearchSpace) -> Array:
    """(D,) standard deviations of the noise about a pose of which little is known."""
    bounded = np.isfinite(space.lower) & np.isfinite(space.upper)
    ranges = np.where(bounded, space.upper - space.lower, 0.0)
    root = space.hierarchy.depth == 0
    free = np.where(root, np.where(space.hierarchy.position, MOVE, TURN), 10.0 * space.sigma)
    return np.where(bounded, RANGE_SHARE * ranges, free)


def _at_ease(problem: FrameProblem, space: SearchSpace, rest: Array, cameras: int) -> AtEase:
    bounded = np.isfinite(space.lower) & np.isfinite(space.upper) & (space.hierarchy.depth > 0)
    ranges = np.where(bounded, space.upper - space.lower, np.inf)
    return AtEase(problem, rest, ranges**-2.0 / max(1, np.count_nonzero(bounded)), cameras * COMFORT)


def _searched_limbs(space: SearchSpace) -> tuple[IntArray, ...]:
    """The parameters of each limb that hangs on the root and has limits."""
    bounded = np.isfinite(space.lower) & np.isfinite(space.upper)
    groups = [np.flatnonzero(space.limb == number) for number in np.unique(space.limb)]
    below = [group for group in groups if (space.hierarchy.depth[group] > 0).all()]
    return tuple(group for group in below if bounded[group].all())


def _pairs(space: SearchSpace, limbs: tuple[IntArray, ...]) -> tuple[tuple[IntArray, IntArray], ...]:
    """The limbs that are of one kind, such as both arms, two by two."""
    kinds: dict[int, list[IntArray]] = {}
    for limb in limbs:
        kind = int(space.hierarchy.pair[limb[0]])
        if kind >= 0:
            kinds.setdefault(kind, []).append(limb)
    return tuple((same[0], same[1]) for same in kinds.values() if len(same) == 2)
