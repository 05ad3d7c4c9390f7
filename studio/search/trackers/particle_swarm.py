"""Particle swarm optimisation with soft search space partitioning (Fleischmann, Austvoll & Kwolek 2012).

Idea: particles move through the pose space, each attracted to the best pose p_i that it has found and to the best
pose p_g that any has found; a constriction χ damps their velocity. A frame is divided into stages (see
`partitions`), each a swarm of its own that starts from the best pose of the one before.

Symbols (Algorithm 1, Eq. 2 and 3): x_i, v_i, position and velocity of particle i; f, the fitness, which is
maximised; N, iterations of a stage, k the one at hand; c = c1 = c2; φ = c1 + c2; χ; ε1, ε2, uniform in 0 … 1, one
for each parameter; σ, the expected movement from frame to frame times the stage's freedom; x̂, the pose a stage
starts from.

Where the paper leaves a choice: k = 1 is the swarm as it was sampled, so that N iterations weigh N times the
particles, which is how Table 1 adds up to 1000. p_g is updated after every iteration, not after every particle, so
that a swarm is weighed at once. Poses that the body cannot take: see `constraints`; where such a particle is weighed
all the same, a possible pose is always better than an impossible one. Without a start pose the first stage is
spread over the limits and moves everything, as there is nothing yet that could be kept.

Beyond the paper, x̂ may be predicted by a behaviour model (`guided_swarm`). A layer is one iteration. Its record:
variance_weighed, of the positions; variance_resampled, of the particles' bests (what is kept); variance_diffused, of
the positions after the move, or of the next stage's sampled swarm. β and α have no meaning and are NaN; all particles
weigh the same.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.search.likelihood.problem import WHOLE_BODY
from studio.search.trackers.constraints import Mask, Proposals, constrain, possible
from studio.search.trackers.counted_numbers import OF_VELOCITIES
from studio.search.trackers.guided_particles import foresee, is_guided
from studio.search.trackers.guided_swarm import BEFORE, handed_on, leader_arrived, predicted_starts
from studio.search.trackers.model_free import FREE, compare_kinds, share_in
from studio.search.trackers.particle_kernels import moments
from studio.search.trackers.particles import checked_values, predict, uniform_poses, unweighted
from studio.search.trackers.partitions import Stage, evaluations, layer_count, moment_of, stages_of
from studio.search.trackers.random_numbers import RandomNumbers, place_of_try
from studio.search.trackers.swarm_settings import PRESETS, VARIANTS, SwarmSettings
from studio.search.trackers.tracker import (
    Arrays,
    Estimate,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)

# Arrays of a set: (N, D), (N, D), (N,), (N,), (D,), (1,), (1,), (D,) or (N, D), (D,).
VELOCITIES, BEST_POSES, BEST_VALUES, BEST_POSSIBLE = (
    "velocities",
    "best_poses",
    "best_values",
    "best_possible",
)
LEADER, LEADER_VALUE, LEADER_POSSIBLE = "leader", "leader_value", "leader_possible"
START, FREEDOM = "start", "freedom"

# Table 1: 10 particles × 20 iterations, then 20 × 40.
STAGE1_ITERATIONS, STAGE2_ITERATIONS = 20, 40
# A particle alone has no others to learn from.
SMALLEST_SWARM = 2


class ParticleSwarm(Tracker[SwarmSettings]):
    """One frame in the iterations of all stages; evaluations = Σ particles × iterations."""

    name = "swarm"
    label = "Particle swarm"
    settings_type = SwarmSettings
    size_knobs = (("stage1_particles", "stage1_iterations"), ("stage2_particles", "stage2_iterations"))
    device_module = "studio.search.trackers.device_swarm"
    score = ("Best fitness", "f")
    variants = VARIANTS
    presets = PRESETS

    def layer_count(self, settings: SwarmSettings) -> int:
        """Iterations N of all stages together."""
        return layer_count(settings)

    def evaluations(self, settings: SwarmSettings) -> int:
        """Poses weighed in all stages together."""
        return evaluations(settings)

    def evaluation_knobs(self, evaluations: int, layers: int) -> dict[str, int]:
        """Table 1 in proportion: n1 and n2 with 20 n1 + 40 n2 as close to the total as can be, n2 as close to 2 n1.

        The paper gives the table for 1000 evaluations only; our choice keeps the iterations and scales the particles
        of both stages, so that every multiple of 20 is met exactly.
        """
        twenties = round(evaluations / STAGE1_ITERATIONS)
        first = max(round(twenties / 5), SMALLEST_SWARM)
        # The remainder must be divisible by two, as the second stage has twice the iterations.
        first += (twenties - first) % 2
        return {
            "stage1_particles": first,
            "stage1_iterations": STAGE1_ITERATIONS,
            "stage2_particles": (twenties - first) // 2,
            "stage2_iterations": STAGE2_ITERATIONS,
        }

    def least_evaluations(self, layers: int) -> int:
        """The smallest swarm in both stages."""
        return SMALLEST_SWARM * (STAGE1_ITERATIONS + STAGE2_ITERATIONS)

    def begin_frame(
        self, numbers: RandomNumbers, previous: FilterState, space: SearchSpace, settings: SwarmSettings
    ) -> ParticleSet:
        """The first stage's swarm, sampled about x̂: x ← N(x̂, Σ), v ← U(-σ, σ)."""
        first = stages_of(space.hierarchy, settings)[0]
        last = previous.particles
        if last is None:
            freedom = np.ones(len(space.names))
            sigma = space.sigma * settings.diffusion_scale
            spread = uniform_poses(numbers, first.particles, space)
            drawn = Proposals(spread, _start_velocities(numbers, len(spread), sigma, settings))
            return _new_swarm(drawn, spread.mean(axis=0), freedom)
        sigma = space.sigma * settings.diffusion_scale * first.freedom
        starts, arrays = predict_pose(previous, settings), {}
        if is_guided(space, settings.prediction) and previous.estimate is not None:
            pose = previous.estimate
            starts, arrays = predicted_starts(
                numbers.in_turn, previous, pose, first.particles, space, settings
            )
        drawn = _sampled(numbers, starts, sigma, first.particles, settings)
        return _new_swarm(drawn, starts, first.freedom, arrays)

    def step_layer(
        self,
        numbers: RandomNumbers,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: SwarmSettings,
    ) -> tuple[ParticleSet, LayerRecord]:
        """Weigh the swarm, update the bests, and move it; at a stage's end sample the next stage's swarm."""
        stages = stages_of(space.hierarchy, settings)
        now = moment_of(stages, layer)
        stage = stages[now.number]
        if layer == 0:
            particles = _constrain_sampled(numbers.beginning, particles, problem, space, settings)
        seen = seen_in(stage, particles.extra[FREEDOM])
        values = checked_values(problem.fitness(particles.poses, seen), len(particles.poses))
        allowed = possible(problem, particles.poses, settings)
        free, extra = share_in(particles.extra), _with_bests(particles, values, allowed)
        if FREE in extra:
            extra = compare_kinds(extra, np.where(allowed, values, -np.inf) if allowed.any() else values)
            del extra[FREE]
        weighed = ParticleSet(particles.poses, particles.log_weights, values, extra)
        if now.iteration < stage.iterations:
            c = acceleration(now.iteration + 1, stage.iterations, settings.c_first, settings.c_last)
            following = _moved(numbers, weighed, c, problem, space, settings)
        elif now.number + 1 < len(stages):
            following = _next_swarm(numbers, extra, stages[now.number + 1], problem, space, settings)
        else:
            following = weighed
        record = _record(layer, weighed, allowed, following, free)
        if following is weighed and is_guided(space, settings.prediction):
            following = replace(weighed, extra=leader_arrived(numbers.in_turn, extra[LEADER], extra, space))
        return following, record

    def fits_device(self, layer: int, space: SearchSpace, settings: SwarmSettings, extra: Arrays) -> bool:
        """Whether no behaviour model guides the particles, and only joint limits make a pose impossible."""
        rules = settings.constraints
        limits_alone = rules == "ignore" or (rules in ("clamp", "redraw") and not settings.limbs_apart)
        return limits_alone and FREE not in extra and not is_guided(space, settings.prediction)

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: SwarmSettings) -> Array:
        """(S, D) poses that the first stage's swarm expects: one unless a behaviour model guides it (`foresee`)."""
        return foresee(particles, space)

    def end_frame(self, particles: ParticleSet, space: SearchSpace, settings: SwarmSettings) -> Estimate:
        """p_g of the last stage, or the mean of its p_i."""
        leader, mean = particles.extra[LEADER], particles.extra[BEST_POSES].mean(axis=0)
        pose = leader if settings.estimate == "mode" else mean
        return Estimate(pose, mean, leader, float(particles.extra[LEADER_VALUE][0]))


def predict_pose(previous: FilterState, settings: SwarmSettings) -> Array:
    """(D,) x̂ of a frame: the pose that the last one reported, in a repeated search p_g, in a run's first the start
    pose; moved on at constant velocity where the settings say so.
    """
    last = previous.particles
    assert last is not None
    pose = previous.estimate
    if pose is None and LEADER in last.extra:
        pose = last.extra[LEADER]
    if pose is None:
        pose = last.poses[int(np.argmax(last.log_weights))]
    return predict(pose[None], previous, settings.dynamics)[0]


def seen_in(stage: Stage, freedom: Array) -> int:
    """What the problem is to look at: the whole body while a stage's freedom (D,) leaves nothing fixed."""
    return WHOLE_BODY if freedom.all() else stage.looks_at


def acceleration(iteration: int, iterations: int, c_first: float, c_last: float) -> float:
    """c1 = c2 (Eq. 2) of iteration k = 2 … N; N > 2."""
    return (c_last - c_first) / (iterations - 2) * (iteration - 2) + c_first


def constriction(c: float) -> float:
    """χ (Eq. 3) for c1 = c2 = c > 2."""
    phi = 2.0 * c
    return 2.0 / abs(2.0 - phi - math.sqrt(phi * phi - 4.0 * phi))


def _moved(
    numbers: RandomNumbers,
    swarm: ParticleSet,
    c: float,
    problem: FrameLikelihood,
    space: SearchSpace,
    settings: SwarmSettings,
) -> ParticleSet:
    """The swarm one step further: velocities (Algorithm 1, inner loop), limited to 2 σ, then positions."""
    places, extra = swarm.poses, swarm.extra
    limit = 2.0 * (space.sigma * settings.diffusion_scale * extra[FREEDOM])
    shrink = constriction(c)
    to_own, to_leader = extra[BEST_POSES] - places, extra[LEADER] - places

    def proposed(rows: Indices, attempt: int) -> Proposals:
        own, leader = to_own[rows], to_leader[rows]
        # Two parameters a counter.
        shares = numbers.shares(rows, 2 * own.shape[1], place_of_try(attempt), step=2)
        luck = shares.reshape(*own.shape, 2)
        velocities = shrink * (extra[VELOCITIES][rows] + c * luck[..., 0] * own + c * luck[..., 1] * leader)
        velocities = np.minimum(np.maximum(velocities, -limit), limit)
        return Proposals(places[rows] + velocities, velocities)

    done = constrain(problem, space, settings, proposed(np.arange(len(places)), 0), places, proposed)
    return ParticleSet(done.poses, swarm.log_weights, extra=extra | {VELOCITIES: done.velocities})


def _next_swarm(
    numbers: RandomNumbers,
    extra: Arrays,
    stage: Stage,
    problem: FrameLikelihood,
    space: SearchSpace,
    settings: SwarmSettings,
) -> ParticleSet:
    """A stage's swarm, sampled about the best pose of the stage before."""
    start, sigma = extra[LEADER], space.sigma * settings.diffusion_scale * stage.freedom
    drawn = _sampled(numbers, start, sigma, stage.particles, settings)
    sampled = _new_swarm(drawn, start, stage.freedom, handed_on(extra))
    return _constrain_sampled(numbers, sampled, problem, space, settings)


def _constrain_sampled(
    numbers: RandomNumbers,
    swarm: ParticleSet,
    problem: FrameLikelihood,
    space: SearchSpace,
    settings: SwarmSettings,
) -> ParticleSet:
    """A sampled swarm with the constraints kept."""
    starts = np.broadcast_to(swarm.extra[START], swarm.poses.shape)
    velocities = swarm.extra[VELOCITIES]
    sigma = space.sigma * settings.diffusion_scale * swarm.extra[FREEDOM]

    def again(rows: Indices, attempt: int) -> Proposals:
        return Proposals(
            starts[rows] + _normals(numbers, rows, len(sigma), attempt) * sigma, velocities[rows]
        )

    drawn = Proposals(swarm.poses, velocities)
    # An impossible prediction is replaced by where the swarm was before.
    before = np.broadcast_to(swarm.extra[BEFORE], starts.shape) if FREE in swarm.extra else starts
    done = constrain(problem, space, settings, drawn, before, again)
    return unweighted(
        done.poses, swarm.extra | {VELOCITIES: done.velocities, BEST_POSES: np.array(done.poses)}
    )


def _sampled(
    numbers: RandomNumbers, start: Array, sigma: Array, count: int, settings: SwarmSettings
) -> Proposals:
    """x ← N(x̂, Σ), v ← U(-σ, σ). start : (D,) or (count, D), x̂."""
    poses = start + _normals(numbers, np.arange(count), len(sigma), 0) * sigma
    return Proposals(poses, _start_velocities(numbers, count, sigma, settings))


def _normals(numbers: RandomNumbers, rows: Indices, size: int, attempt: int) -> NDArray[np.float32]:
    """(K, size) normal numbers of an attempt to sample some particles (K,), two a counter."""
    counters = -(-size // 2)
    normals = numbers.normals(rows, 4 * counters, place_of_try(attempt), step=2)
    return normals.reshape(len(rows), counters, 4)[:, :, :2].reshape(len(rows), -1)[:, :size]


def _start_velocities(numbers: RandomNumbers, count: int, sigma: Array, settings: SwarmSettings) -> Array:
    if settings.start_velocity != "uniform":
        return np.zeros((count, len(sigma)))
    return (2.0 * numbers.shares(count, len(sigma), OF_VELOCITIES) - 1.0) * sigma


def _new_swarm(drawn: Proposals, start: Array, freedom: Array, more: Arrays | None = None) -> ParticleSet:
    """A swarm before its first evaluation. start : (D,) or (N, D). more : further arrays."""
    count = len(drawn.poses)
    return unweighted(
        drawn.poses,
        (more or {})
        | {
            VELOCITIES: drawn.velocities,
            BEST_POSES: drawn.poses,
            BEST_VALUES: np.full(count, -np.inf),
            BEST_POSSIBLE: np.zeros(count, dtype=bool),
            LEADER: np.atleast_2d(start)[0],
            LEADER_VALUE: np.array([-np.inf]),
            LEADER_POSSIBLE: np.zeros(1, dtype=bool),
            START: start,
            FREEDOM: freedom,
        },
    )


def _with_bests(swarm: ParticleSet, values: Array, allowed: Mask) -> Arrays:
    """The set's arrays with p_i and p_g updated; a value equal to the best so far does not replace it."""
    extra = swarm.extra
    known, was_allowed = extra[BEST_VALUES], extra[BEST_POSSIBLE]
    better = np.where(allowed == was_allowed, values > known, allowed)
    best_values = np.where(better, values, known)
    best_allowed = np.where(better, allowed, was_allowed)
    best_poses = np.where(better[:, None], swarm.poses, extra[BEST_POSES])
    ranked = np.where(best_allowed, best_values, -np.inf) if best_allowed.any() else best_values
    first = int(np.argmax(ranked))
    bests = extra | {BEST_POSES: best_poses, BEST_VALUES: best_values, BEST_POSSIBLE: best_allowed}
    rank = (bool(best_allowed[first]), float(best_values[first]))
    if rank > (bool(extra[LEADER_POSSIBLE][0]), float(extra[LEADER_VALUE][0])):
        bests[LEADER] = best_poses[first]
        bests[LEADER_VALUE], bests[LEADER_POSSIBLE] = best_values[[first]], best_allowed[[first]]
    return bests


def _record(
    layer: int, weighed: ParticleSet, allowed: Mask, following: ParticleSet, free: float
) -> LayerRecord:
    """The record of a layer. free : `share_in`."""
    values = weighed.raw_log_weights
    best = int(np.argmax(np.where(allowed, values, -np.inf) if allowed.any() else values))
    kept, own = moments(weighed.extra[BEST_POSES]).variance, moments(weighed.poses)
    return LayerRecord(
        layer=layer,
        variance_weighed=own.variance,
        variance_resampled=kept,
        variance_diffused=kept if following is weighed else moments(following.poses).variance,
        best=weighed.poses[best],
        best_log_weight=float(values[best]),
        mean=own.mean,
        poses=weighed.poses,
        log_weights=values,
        model_free_share=free,
    )
