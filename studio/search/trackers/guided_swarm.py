"""A swarm's first places, predicted by a behaviour model (Caillette et al. 2007, section 5).

A swarm reports one pose and starts its next frame from that. So it has one history: the automaton's state and the
movement of its last leader, from which every particle of the first stage draws its own prediction; Σ is sampled around
that. A share of the particles starts from the last pose itself, as all do without a model (`model_free`). When
the frame ends, the leader's state is the one that follows from the last leader's by the cluster of its pose and
movement.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.search.trackers.guided_particles import (
    STATES,
    VELOCITY,
    columns_of,
    draw_near,
    followed,
    model_of,
    propagated,
    walkers_from,
)
from studio.search.trackers.model_free import BEATEN, FREE, chosen_free, share_of
from studio.search.trackers.shared_knobs import GuidedSettings
from studio.search.trackers.tracker import Arrays, FilterState, ParticleSet, SearchSpace

LEADER_STATE, LEADER_VELOCITY = "leader_state", "leader_velocity"
BEFORE, BEFORE_STATE = "before", "before_state"
"""Arrays of a swarm: (1,) int and (1, d) of the leader at a frame's end; (1, D) and (1,) int, the leader before."""
HANDED_ON = (BEFORE, BEFORE_STATE, BEATEN)


def predicted_starts(
    rng: np.random.Generator,
    previous: FilterState,
    pose: Array,
    count: int,
    space: SearchSpace,
    rules: GuidedSettings,
) -> tuple[Array, Arrays]:
    """(count, D) predicted poses of a swarm's particles from the last pose (D,), and the swarm's arrays."""
    assert previous.particles is not None
    carried = previous.particles.extra
    past = (
        {STATES: carried[LEADER_STATE], VELOCITY: carried[LEADER_VELOCITY]} if LEADER_STATE in carried else {}
    )
    alone = FilterState(
        ParticleSet(pose[None], np.zeros(1), extra=past), previous.estimate, previous.previous_estimate
    )
    free = chosen_free(rng, count, share_of(rules.model_free_share, rules.model_free_grows, carried))
    before = walkers_from(rng, alone, np.zeros(count, dtype=np.int64), free, space)
    expected = propagated(rng, before, space, rules, np.zeros(len(space.names)))
    arrays: Arrays = {
        STATES: expected.states,
        VELOCITY: expected.velocity,
        FREE: free,
        BEFORE: pose[None],
        BEFORE_STATE: before.states[:1],
    }
    return expected.poses, arrays | {name: carried[name] for name in (BEATEN,) if name in carried}


def handed_on(extra: Arrays) -> Arrays:
    """The arrays that a stage's swarm passes to the next stage."""
    return {name: extra[name] for name in HANDED_ON if name in extra}


def leader_arrived(rng: np.random.Generator, leader: Array, extra: Arrays, space: SearchSpace) -> Arrays:
    """A swarm's arrays at the end of a frame, with state and movement of its leader (D,); in a run's first frame they
    are drawn from the clusters near it.
    """
    kept = {
        name: values for name, values in extra.items() if name not in (BEFORE, BEFORE_STATE, STATES, VELOCITY)
    }
    if BEFORE not in extra:
        states, velocity = draw_near(rng, leader[None], space)
        return kept | {LEADER_STATE: states, LEADER_VELOCITY: velocity}
    columns = columns_of(space)
    velocity = (leader - extra[BEFORE])[:, columns] / space.steps
    state = followed(rng, model_of(space), extra[BEFORE_STATE], leader[None, columns], velocity, space.steps)
    return kept | {LEADER_STATE: state, LEADER_VELOCITY: velocity}
