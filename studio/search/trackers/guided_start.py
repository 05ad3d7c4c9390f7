"""A frame's first set, predicted by a behaviour model, with a share of model-free particles.

Whether a pose is possible for the body is known only with the frame's problem. So the set keeps what its particles
came from, and `constrain_set` then redraws impossible ones from the same past, each by its own rule: by the model, or
by noise.
"""

from dataclasses import replace

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.constraints import Proposals, constrain
from studio.search.trackers.guided_particles import (
    STATES,
    VELOCITY,
    GuidedParticles,
    columns_of,
    draw_near,
    followed,
    model_of,
    propagated,
    walkers_from,
)
from studio.search.trackers.model_free import BEATEN, FREE, chosen_free, share_of
from studio.search.trackers.particles import CAME_FROM, constrain_first, first_set, unweighted
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.shared_knobs import GuidedSettings, SearchSettings
from studio.search.trackers.tracker import Arrays, FilterState, FrameLikelihood, ParticleSet, SearchSpace

CAME_FROM_STATES, CAME_FROM_VELOCITY = "came_from_state", "came_from_velocity"
"""Arrays of a first set, beside CAME_FROM (N, D): (N,) int and (N, d), state and movement before the frame."""
PAST = (CAME_FROM, CAME_FROM_STATES, CAME_FROM_VELOCITY)


def guided_set(
    numbers: RandomNumbers, previous: FilterState, rows: Indices, space: SearchSpace, rules: GuidedSettings
) -> ParticleSet:
    """The unweighted set of a frame that starts from the particles `rows` (N,) of the last one's.

    In a run's first frame (nothing was reported yet) particles are spread by noise alone.
    """
    assert previous.particles is not None
    if previous.estimate is None:
        first = first_set(numbers, previous.particles.poses[rows], space, rules)
        return replace(first, extra=first.extra | _draw_near(numbers.in_turn, first.poses, space))
    share = share_of(rules.model_free_share, rules.model_free_grows, previous.particles.extra)
    rng = numbers.in_turn
    free = chosen_free(rng, len(rows), share)
    past = walkers_from(rng, previous, rows, free, space)
    drawn = propagated(rng, past, space, rules, space.sigma * rules.diffusion_scale)
    following = _walking_set(drawn, past, space, rules)
    if BEATEN in previous.particles.extra:
        following.extra[BEATEN] = previous.particles.extra[BEATEN]
    return following


def constrain_set(
    numbers: RandomNumbers,
    particles: ParticleSet,
    problem: FrameLikelihood,
    space: SearchSpace,
    rules: SearchSettings,
) -> ParticleSet:
    """A first set, guided or not, with its impossible particles redrawn; what guided ones came from stays with it.

    A particle for which no possible pose is found stays where it came from, at rest.
    """
    if rules.constraints != "redraw" or CAME_FROM not in particles.extra:
        return particles
    extra, sigma = particles.extra, space.sigma * rules.diffusion_scale
    if CAME_FROM_STATES not in extra or not isinstance(rules, GuidedSettings):
        first = constrain_first(numbers, particles, problem, space, rules)
        found = _draw_near(numbers.in_turn, first.poses, space) if STATES in extra else {}
        return replace(first, extra=first.extra | found)
    past = GuidedParticles(extra[CAME_FROM], extra[CAME_FROM_STATES], extra[CAME_FROM_VELOCITY], extra[FREE])
    first = GuidedParticles(particles.poses, extra[STATES], extra[VELOCITY], extra[FREE])

    def again(rows: Indices, _attempt: int) -> Proposals:
        return _packed(propagated(numbers.in_turn, past.at(rows), space, rules, sigma))

    done = constrain(problem, space, rules, _packed(first), past.poses, again)
    states = done.velocities[:, -1].astype(np.int64) - 1
    found = {STATES: np.where(states < 0, past.states, states), VELOCITY: done.velocities[:, :-1].copy()}
    return ParticleSet(done.poses, particles.log_weights, extra=extra | found)


def without_past(extra: Arrays) -> Arrays:
    """A set's arrays without what its particles came from."""
    return {name: values for name, values in extra.items() if name not in PAST}


def descended(extra: Arrays, ancestors: Indices) -> Arrays:
    """A guided set's arrays for particles that descend from `ancestors` (N,) of it; arrays of the set as a whole stay
    unchanged.
    """
    return {
        name: values[ancestors] if name in (*PAST, STATES, VELOCITY) else values
        for name, values in extra.items()
        if name != FREE
    }


def arrived(rng: np.random.Generator, poses: Array, extra: Arrays, space: SearchSpace) -> Arrays:
    """A set's arrays at the end of its frame, for poses (N, D) that have moved since it was made.

    A particle's movement is the difference between what its first ancestor came from and its pose now; its state
    follows from that ancestor's by the cluster of pose and movement. In a run's first frame both are drawn from
    the clusters near the pose.
    """
    if CAME_FROM_STATES not in extra:
        return without_past(extra) | _draw_near(rng, poses, space)
    columns = columns_of(space)
    velocity = (poses - extra[CAME_FROM])[:, columns] / space.steps
    states = followed(rng, model_of(space), extra[CAME_FROM_STATES], poses[:, columns], velocity, space.steps)
    return without_past(extra) | {STATES: states, VELOCITY: velocity}


def _draw_near(rng: np.random.Generator, poses: Array, space: SearchSpace) -> Arrays:
    """States and movements from the clusters near poses (N, D)."""
    states, velocity = draw_near(rng, poses, space)
    return {STATES: states, VELOCITY: velocity}


def _walking_set(
    drawn: GuidedParticles, past: GuidedParticles, space: SearchSpace, rules: GuidedSettings
) -> ParticleSet:
    poses, velocity = drawn.poses, drawn.velocity
    if rules.constraints == "clamp":
        columns = columns_of(space)
        poses = np.clip(poses, space.lower, space.upper)
        velocity = np.where(poses[:, columns] == drawn.poses[:, columns], velocity, 0.0)
    carried: Arrays = {
        STATES: drawn.states,
        VELOCITY: velocity,
        FREE: drawn.free,
        CAME_FROM: past.poses,
        CAME_FROM_STATES: past.states,
        CAME_FROM_VELOCITY: past.velocity,
    }
    return unweighted(poses, carried)


def _packed(guided: GuidedParticles) -> Proposals:
    """Poses, and beside each the movement and 1 + the state: rules that stop a particle set them to zero."""
    beside = np.column_stack([guided.velocity, 1.0 + guided.states]).astype(np.float64)
    return Proposals(guided.poses, beside)
