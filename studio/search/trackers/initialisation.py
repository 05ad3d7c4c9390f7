"""The search for a start pose: only the body is known, and perhaps its hull.

From coarse to fine, with the annealed particle filter (Deutscher & Reid 2005) as the tool of every step. The best
candidates of each family (headings all around, so both facings) are annealed together; what a family found is a *line*.
In rounds with fewer lines and less noise a line is improved limb by limb, each limb searched over its joints' whole
ranges and tried with those of the other lines, then two like limbs together, then as a whole (`start_lines`).

Measured on 20 people in random poses (four cameras, masks by subtraction; found: mean marker error of 80 mm or less):
annealed as a whole only, none was found; limb by limb 4; with limbs kept apart 14 at the same cost (else arms hide in
the trunk); with a prior towards the rest pose 15; with pairs of limbs 16.

Front and back of a silhouette look alike, so lines that face the other way than the best one are kept to the end
even where they rank low. The confidence is computed from their best weight.
"""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.search.trackers.start_candidates import StartCandidates
from studio.search.trackers.start_lines import (
    MARGIN_SCALE,
    OPPOSITE_LINES,
    AtEase,
    Line,
    LineSteps,
    Round,
    limited,
)
from studio.search.trackers.tracker import FrameLikelihood, SearchSpace

PER_FAMILY = 200
SURVIVING = 20
"""Candidates of a family that are annealed together."""
FAMILY_LAYERS, FAMILY_PARTICLES, FAMILY_SPREAD = 8, 100, 0.6
RANGE_SHARE, MOVE, TURN = 0.15, 80.0, 0.25
"""Initial noise: a share of a joint's range; mm (of a person) and radians of the root."""
THREADS = 2
KEY = 0x57A27
"""Key of this search's random numbers."""

Facing = Callable[[Array], Array]
Progress = Callable[[int, int], None]
Given = TypeVar("Given")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is searched. sets : lines that each family begins. rounds : in turn."""

    sets: int
    rounds: tuple[Round, ...]


THOROUGH = Effort(
    2,
    (
        Round(24, 60, 200, 0.4),
        Round(14, 100, 200, 0.4),
        Round(10, 100, 200, 0.3),
        Round(6, 150, 200, 0.3),
        Round(4, 150, 300, 0.2),
        Round(3, 150, 300, 0.1),
    ),
)
QUICK = Effort(1, (Round(6, 60, 150, 0.4), Round(4, 100, 200, 0.3), Round(2, 150, 200, 0.2)))
"""For a lost tracker: if the pose is wrong, that is detected and the search repeated."""


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


class StartSearch:
    """One search. Call `run`.

    rest : (D,) the body's rest pose. spread : (D,) usual deviations from it, inf where none is known. facing : poses
    (N, D) to unit vectors (N, 3), where they face. cameras : views in the problem. seed : the same one gives the same
    pose, on any number of threads. progress : called with steps done and in all; it may raise to end the search.
    """

    def __init__(
        self,
        problem: FrameLikelihood,
        space: SearchSpace,
        rest: Array,
        facing: Facing,
        *,
        cameras: int,
        seed: int,
        spread: Array | None = None,
        effort: Effort = THOROUGH,
        progress: Progress | None = None,
    ) -> None:
        self._facing, self._cameras, self._seed = facing, cameras, seed
        self._effort, self._progress = effort, progress
        self._noise = first_noise(space)
        self._steps = LineSteps(AtEase.of(problem, space, rest, cameras, spread), space, rest)
        self._done = self._total = 0

    def run(self, candidates: StartCandidates, known: Array | None = None) -> FoundStart:
        """The best pose found. known : (K, D) additional candidates. Raises RunError without candidates."""
        if not len(candidates.poses):
            raise RunError("The search has no candidate pose to start from.", "Give at least one candidate.")
        groups = self._groups(candidates)
        self._total = len(groups) + sum(entry.most for entry in self._effort.rounds)
        with ThreadPoolExecutor(THREADS, thread_name_prefix="start-pose") as threads:
            spread, steps = FAMILY_SPREAD * self._noise, self._steps
            lines = self._all(
                threads,
                groups,
                lambda rng, group: steps.annealed(rng, group, spread, FAMILY_PARTICLES, FAMILY_LAYERS),
                0,
            )
            if known is not None:
                values = steps.values(known)
                lines += [Line(pose, value) for pose, value in zip(known, values, strict=True)]
            for number, entry in enumerate(self._effort.rounds):
                lines = self._round(threads, lines, entry, number + 1)
                self._done = len(groups) + sum(one.most for one in self._effort.rounds[: number + 1])
        return self._found(lines)

    def _groups(self, candidates: StartCandidates) -> list[Array]:
        """The best poses of each family, in `Effort.sets` sets."""
        values, groups = self._steps.values(candidates.poses), list[Array]()
        for family in np.unique(candidates.family):
            rows = np.flatnonzero(candidates.family == family)
            ranked = rows[np.argsort(-values[rows], kind="stable")]
            for number in range(self._effort.sets):
                chosen = ranked[number * SURVIVING : (number + 1) * SURVIVING]
                if len(chosen):
                    groups.append(candidates.poses[chosen])
        return groups

    def _round(self, threads: Executor, lines: list[Line], entry: Round, number: int) -> list[Line]:
        kept, noise = self._kept(lines, entry.lines), entry.spread * self._noise

        def improved(rng: np.random.Generator, line: Line) -> Line:
            return self._steps.improved(rng, line, kept, noise, entry)

        return self._all(threads, kept, improved, number)

    def _all(
        self,
        threads: Executor,
        given: Sequence[Given],
        step: Callable[[np.random.Generator, Given], Line],
        number: int,
    ) -> list[Line]:
        """One step for all lines of a round, in parallel, results in order; each has its own random numbers."""
        keys = [np.random.SeedSequence((self._seed, KEY, number, place)) for place in range(len(given))]
        pending = [
            threads.submit(step, np.random.default_rng(key), one)
            for key, one in zip(keys, given, strict=True)
        ]
        found: list[Line] = []
        try:
            for job in pending:
                found.append(job.result())
                self._done += 1
                if self._progress is not None:
                    self._progress(min(self._done, self._total), self._total)
        finally:
            for job in pending:
                job.cancel()
        return found

    def _kept(self, lines: list[Line], count: int) -> list[Line]:
        """The best lines, and the best of those that face the other way than the first."""
        ranked = sorted(lines, key=lambda line: -line.value)
        kept = ranked[:count]
        opposite = [line for line in ranked if self._faces_away(line.pose, ranked[0].pose)]
        return kept + [line for line in opposite[:OPPOSITE_LINES] if not any(line is one for one in kept)]

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
            log_weight=float(self._steps.problem.problem.log_likelihood(best.pose[None])[0]),
            confidence=confidence(facing_odds(margin, self._cameras)),
            margin=margin,
            rival=away[0].pose if away else None,
            agreement=1.0 - len(away) / len(ranked),
            evaluations=self._steps.evaluations,
        )


def facing_odds(margin: float, cameras: int) -> float:
    """Log odds that the body faces as the best pose does. margin : log weight to the best pose of the other facing."""
    return margin / (cameras * MARGIN_SCALE)


def confidence(odds: float) -> float:
    """The probability with these log odds."""
    return 1.0 / (1.0 + math.exp(-max(min(odds, 700.0), -700.0)))


def first_noise(space: SearchSpace) -> Array:
    """(D,) standard deviations of the noise about an uncertain pose."""
    bounded = limited(space)
    ranges = np.where(bounded, space.upper - space.lower, 0.0)
    root = space.hierarchy.depth == 0
    free = np.where(root, np.where(space.hierarchy.position, MOVE * space.scale, TURN), 10.0 * space.sigma)
    return np.where(bounded, RANGE_SHARE * ranges, free)
