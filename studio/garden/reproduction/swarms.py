"""The swarm of Fleischmann et al. (2012) with one of its parts changed, and the swarms that it is set against.

All are one loop, Algorithm 1 with Table 1, written for these experiments: the studio's swarm has no knob for what is
changed here. It is held against the studio's own, with the same settings.

One part changed: the first stage sees the whole body's edges instead of the torso's (Table 1); f_s counts only how much
of the projected silhouette lies in the observed one (2.2); σ of the position is not divided by ten in the second stage
(2.4); velocities are not limited to 2 σ (2.3).

Others, as section 1 describes them, for their papers are not at hand. GLPSO (Krzeszowski et al. 2011): the whole pose,
then legs and arms apart. GLAPSO (Kwolek et al. 2011): the same with a fitness that is quantised, more finely from
iteration to iteration, and for each particle a leader drawn from the pool of those whose fitness is the same step.
Robertson & Trucco (2006): six stages, each of which moves all that the one before did and more; theirs are of an upper
body and see points of space. The steps of the quantisation and the division of 1000 evaluations are ours.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import numpy as np

from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.progress import report
from studio.garden.reproduction.claims import LOWER, NO_WORSE, beside
from studio.garden.reproduction.experiment import Part, each_seed, grouped, listed
from studio.garden.reproduction.fleischmann import (
    EVALUATIONS,
    FITNESS,
    PRIORS,
    SWARM,
    TWIN_20,
    last_frame,
)
from studio.garden.reproduction.tracking import curves, error_ratio, mean_number, summary_table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.tracked import Tracked, measure_tracking, measured
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.runs.search_space import search_space, session_sigma
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.likelihood.edge_silhouette import EdgeSilhouetteFrameLikelihood
from studio.search.likelihood.problem import TRUNK_FIRST, WHOLE_BODY
from studio.search.settings import changed_settings, default_settings
from studio.search.trackers.catalogue import knobs_for_evaluations
from studio.search.trackers.particle_swarm import acceleration, constriction
from studio.search.trackers.tracker import Hierarchy, SearchSpace

C_FIRST, C_LAST, LIMIT, TRIES, DIVISOR = 2.05, 2.15, 2.0, 10, 10.0
SIX = 6
IMPOSSIBLE = -10.0
"""Added to the fitness (0 to 2) of a pose that breaks a prior after all tries: any possible pose is better."""
COARSE, FINE = 0.05, 0.002
"""GLAPSO's steps of the fitness in a stage's first and last iteration."""


@dataclass(frozen=True, slots=True, eq=False)
class SwarmStage:
    """A search. freedom : (D,) factor on σ, 0 where a parameter is fixed."""

    freedom: Array
    particles: int
    iterations: int
    looks_at: int = WHOLE_BODY


def soft(tree: Hierarchy, divisor: float = DIVISOR) -> list[SwarmStage]:
    """The root, then all with the position's σ divided (2.4, Table 1)."""
    calm = np.where(tree.position, 1.0 / divisor, 1.0)
    return [SwarmStage((tree.depth == 0).astype(float), 10, 20, TRUNK_FIRST), SwarmStage(calm, 20, 40)]


def global_local(tree: Hierarchy) -> list[SwarmStage]:
    """All, then legs and arms apart."""
    kinds = [(tree.pair == kind).astype(float) for kind in range(int(tree.pair.max()) + 1)]
    whole = SwarmStage(np.ones(len(tree.depth)), 20, 40)
    return [whole, *(SwarmStage(kind, 10, 20 // len(kinds)) for kind in kinds)]


def six_stages(tree: Hierarchy) -> list[SwarmStage]:
    """Six stages, each with all that the one before moves and the next parts of the tree."""
    parts = np.array_split(np.unique(tree.subspace), SIX)
    stages: list[SwarmStage] = []
    for place, part in enumerate(parts):
        free = (tree.subspace <= part[-1]).astype(float)
        if place == 0:
            stages.append(SwarmStage(free, 10, 20, TRUNK_FIRST))
        else:
            stages.append(SwarmStage(free, 20, 8))
    return stages


@dataclass(frozen=True, slots=True)
class Swarm:
    """A swarm. stages : of a body's tree. torso_first : the first stage sees the torso's edges only. both_sides : of
    f_s. limited : velocities. pool : leaders are drawn from a pool of quantised fitness.
    """

    stages: Callable[[Hierarchy], list[SwarmStage]] = soft
    torso_first: bool = True
    both_sides: bool = True
    limited: bool = True
    pool: bool = False


STUDIO, PRINTED = "the studio's swarm", "as printed"
WHOLE_EDGES, ONE_SIDE = "the whole body's edges in the first stage", "f_s of one side"
UNDIVIDED, UNLIMITED = "position's σ not divided", "velocities not limited"
CHANGED: Mapping[str, tuple[Swarm, str]] = {
    WHOLE_EDGES: (Swarm(torso_first=False), ""),
    ONE_SIDE: (Swarm(both_sides=False), LOWER),
    UNDIVIDED: (Swarm(stages=partial(soft, divisor=1.0)), NO_WORSE),
    UNLIMITED: (Swarm(limited=False), NO_WORSE),
}
"""The swarm with one part changed, and the paper's claim on the printed one over it."""
GLPSO, GLAPSO, SIX_STAGES = "global, then local", "global, then local, annealed", "six stages"
OTHERS: Mapping[str, Swarm] = {
    GLPSO: Swarm(stages=global_local),
    GLAPSO: Swarm(stages=global_local, pool=True),
    SIX_STAGES: Swarm(stages=six_stages),
}
SWARMS: Mapping[str, Swarm] = {
    PRINTED: Swarm(),
    **{name: swarm for name, (swarm, _) in CHANGED.items()},
    **OTHERS,
}


def one_sided(problem: EdgeSilhouetteFrameLikelihood, poses: Array, stage: int) -> Array:
    """(N,) f_e, and how much of the projected silhouette lies in the observed one, of poses (N, D)."""
    edges = problem.terms(poses, stage)[1]
    areas = problem.silhouettes.areas(problem.likelihood.projector.blocks(poses), len(poses))
    projected = areas.projected + areas.outside
    inside = np.divide(areas.both, projected, out=np.zeros(areas.both.shape), where=projected > 0)
    return edges.mean(axis=1) + inside.mean(axis=1)


@dataclass(eq=False)
class SwarmSearch:
    """A swarm's search of one frame's problem. start : (D,) the pose of the frame before. evaluations : so far."""

    swarm: Swarm
    problem: EdgeSilhouetteFrameLikelihood
    rng: np.random.Generator
    evaluations: int = field(default=0)

    def fitness(self, poses: Array, stage: int) -> Array:
        """(N,) f of poses (N, D), less where a prior is broken."""
        looks_at = stage if self.swarm.torso_first else WHOLE_BODY
        self.evaluations += len(poses)
        values = (
            self.problem.fitness(poses, looks_at)
            if self.swarm.both_sides
            else one_sided(self.problem, poses, looks_at)
        )
        return np.where(self._possible(poses), values, values + IMPOSSIBLE)

    def pose(self, start: Array, space: SearchSpace) -> Array:
        """(D,) the best pose of the last stage."""
        for stage in self.swarm.stages(space.hierarchy):
            start = self._stage(start, stage, space.sigma * stage.freedom)
        return start

    def _stage(self, start: Array, stage: SwarmStage, sigma: Array) -> Array:
        rng, shape = self.rng, (stage.particles, len(start))

        def sample(rows: Indices) -> Array:
            return start + rng.normal(size=(len(rows), len(start))) * sigma

        poses, _ = self._redrawn(
            lambda rows: (sample(rows), np.zeros((len(rows), len(start)))), stage.particles
        )
        velocities = rng.uniform(-1.0, 1.0, shape) * sigma
        values = self.fitness(poses, stage.looks_at)
        bests, best_values = poses.copy(), values.copy()
        for iteration in range(2, stage.iterations + 1):
            c = acceleration(iteration, stage.iterations, C_FIRST, C_LAST)
            leaders = self._leaders(bests, best_values, (iteration - 2) / (stage.iterations - 2))

            def move(
                rows: Indices,
                c: float = c,
                poses: Array = poses,
                velocities: Array = velocities,
                leaders: Array = leaders,
            ) -> tuple[Array, Array]:
                luck = rng.uniform(size=(2, len(rows), len(start)))
                pull = c * luck[0] * (bests[rows] - poses[rows]) + c * luck[1] * (leaders[rows] - poses[rows])
                moved = constriction(c) * (velocities[rows] + pull)
                if self.swarm.limited:
                    moved = np.clip(moved, -LIMIT * sigma, LIMIT * sigma)
                return poses[rows] + moved, moved

            poses, velocities = self._redrawn(move, stage.particles)
            values = self.fitness(poses, stage.looks_at)
            better = values > best_values
            bests[better], best_values[better] = poses[better], values[better]
        return bests[int(np.argmax(best_values))]

    def _leaders(self, bests: Array, values: Array, passed: float) -> Array:
        """(N, D) each particle's leader. passed : share of the stage's iterations that are over."""
        if not self.swarm.pool:
            return np.broadcast_to(bests[int(np.argmax(values))], bests.shape)
        steps = np.floor(values / (COARSE * (FINE / COARSE) ** passed))
        pool = np.flatnonzero(steps == steps.max())
        return bests[self.rng.choice(pool, len(bests))]

    def _redrawn(self, draw: Callable[[Indices], tuple[Array, Array]], count: int) -> tuple[Array, Array]:
        """Poses and velocities, drawn again where a prior is broken, up to TRIES times."""
        poses, velocities = draw(np.arange(count))
        for _ in range(TRIES):
            wrong = np.flatnonzero(~self._possible(poses))
            if not len(wrong):
                break
            poses[wrong], velocities[wrong] = draw(wrong)
        return poses, velocities

    def _possible(self, poses: Array) -> Mask:
        return self.problem.feasible(poses, limbs_apart=True)


QUICK_LAST = 20


def swarm_trials(names: Sequence[str]) -> Callable[[Scale], tuple[Trial, ...]]:
    """Those of some swarms with every seed, 20 frames a second."""

    def arguments(scale: Scale, name: str, seed: int) -> dict[str, Any]:
        last = QUICK_LAST if scale.quick else last_frame(20, quick=False)
        if name == STUDIO:
            return SWARM.attempt(TWIN_20, seed, EVALUATIONS, last=last).plain()
        return {"swarm": name, "footage": TWIN_20, "seed": seed, "last": last}

    return lambda scale: tuple(
        trial for name in names for trial in each_seed(name, scale.seeds, partial(arguments, scale, name))
    )


@kept_as("fleischmann.swarms.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track; the fields of `Tracked`."""
    if "tracker" in arguments:
        return measure_tracking(arguments, cache)
    session, seed, last = cache.session(arguments["footage"]), int(arguments["seed"]), int(arguments["last"])
    body, cameras = session.body(), session.cameras()
    space = search_space(body, session_sigma(session, body, session.manifest.fps))
    wanted = {**knobs_for_evaluations(SWARM.tracker, EVALUATIONS), **SWARM.changes}
    settings, chosen = changed_settings(default_settings(SWARM.tracker, FITNESS), wanted), WEIGHTINGS[FITNESS]
    likelihood = chosen.prepare(body, cameras, settings.weighting)
    start = session.start_pose(body)
    assert start is not None
    pose, rng = np.array(start), np.random.default_rng((seed, 20))
    poses, evaluations = list[Array](), EVALUATIONS
    for frame in range(last):
        seen = cache.evidence(
            session, cameras, frame, settings.evidence, chosen.edge_kind, chosen.reads_pictures
        )
        problem = likelihood.problem(seen)
        assert isinstance(problem, EdgeSilhouetteFrameLikelihood)
        search = SwarmSearch(SWARMS[arguments["swarm"]], problem, rng)
        pose, evaluations = search.pose(pose, space), search.evaluations
        poses.append(pose)
        report("tracking", frame + 1, last)
    return asdict(measured(session, body, np.array(poses), np.arange(last), evaluations, 0.0))


WORDS = (
    "20 frames a second, where partitions matter most. The loop of these experiments shares no random numbers with the "
    "studio's swarm, which stands beside it."
)


def _shown(outcomes: Sequence[Outcome]) -> Mapping[str, Sequence[Tracked]]:
    return grouped(outcomes, Tracked)


def shown_parts(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The printed swarm over each with one part changed."""
    groups = _shown(outcomes)
    for name, (_, claim) in CHANGED.items():
        yield error_ratio(f"{PRINTED} over {name}", groups[PRINTED], groups[name], claim)
    yield beside(error_ratio(f"{PRINTED} over {STUDIO}", groups[PRINTED], groups[STUDIO], ""))
    yield from _common(groups)


def shown_others(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Soft partitioning beside six stages, and annealing beside none."""
    groups = _shown(outcomes)
    yield error_ratio(
        f"{PRINTED}, two stages, over {SIX_STAGES}", groups[PRINTED], groups[SIX_STAGES], NO_WORSE
    )
    yield error_ratio(f"{GLAPSO}, over {GLPSO}", groups[GLAPSO], groups[GLPSO], LOWER)
    for name in (GLPSO, GLAPSO):
        yield error_ratio(f"{PRINTED} over {name}", groups[PRINTED], groups[name], "")
    yield from _common(groups)


def _common(groups: Mapping[str, Sequence[Tracked]]) -> Iterator[Part]:
    for name, runs in groups.items():
        yield mean_number(f"mean error, {name}", runs)
    yield WORDS
    yield summary_table("Swarms at 20 frames a second", groups)
    yield curves("Error over frames", groups, 20)
    yield {"footage": TWIN_20, "weighting": FITNESS, "evaluations": EVALUATIONS, **PRIORS}


EXPERIMENTS = (
    listed(
        "fleischmann-parts",
        swarm_trials((STUDIO, PRINTED, *CHANGED)),
        measure,
        shown_parts,
        footage=(TWIN_20,),
    ),
    listed(
        "fleischmann-other-swarms",
        swarm_trials((STUDIO, PRINTED, *OTHERS)),
        measure,
        shown_others,
        footage=(TWIN_20,),
    ),
)
