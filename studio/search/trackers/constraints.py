"""Constraints: how particles in impossible poses are handled, the same for every tracker.

A body cannot pass its joint limits and, optionally, no limb can be inside another (the two constraints of Fleischmann
et al. 2012, 2.3; the hard priors of Balan et al. 2005, see `search.likelihood.hard_priors`). Four ways to keep them:

- redraw: the random numbers of a particle's step are drawn again, from the same starting point, up to 10 times; after
  that, the particle stays where it came from (a swarm's without velocity). The paper gives only the redrawn velocity
  and the limit of 10; the rest is our choice.
- reject: the particle is weighed, but has no weight.
- clamp: a parameter beyond a limit is set on it, and its velocity to zero; a particle with limbs inside one
  another cannot be clamped and is rejected.
- ignore: nothing is checked.

Where all of a set's particles and all the poses that they came from are impossible, the constraint cannot be kept
and the set stays as it was first drawn, so that the search can continue.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from studio.foundations.arrays import Array, Indices, Mask
from studio.search.trackers.shared_knobs import SearchSettings
from studio.search.trackers.tracker import FrameLikelihood, SearchSpace

MOST_REDRAWS = 10


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Proposed moves of N particles. poses : (N, D). velocities : (N, D), or (N, 0) for particles that have none."""

    poses: Array
    velocities: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def at(cls, poses: Array) -> "Proposals":
        """Particles without velocities."""
        return cls(poses, np.zeros((len(poses), 0)))


def constrain(
    problem: FrameLikelihood,
    space: SearchSpace,
    rules: SearchSettings,
    proposed: Proposals,
    came_from: Array,
    again: Callable[[Indices, int], Proposals],
) -> Proposals:
    """The proposals with the constraints kept; those to be rejected are still among them (see `possible`).

    came_from : (N, D) where each particle started. again : new proposals for some rows, from the same starting
    points with the random numbers of an attempt, from 1.
    """
    if rules.constraints == "clamp":
        return clamp(space, proposed)
    if rules.constraints == "redraw":
        return _redrawn(problem, rules.limbs_apart, proposed, came_from, again)
    return proposed


def possible(problem: FrameLikelihood, poses: Array, rules: SearchSettings) -> Mask:
    """(N,) whether the body can take a pose; all count as such where nothing is checked."""
    if rules.constraints == "ignore":
        return np.ones(len(poses), dtype=bool)
    return problem.feasible(poses, limbs_apart=rules.limbs_apart)


def clamp(space: SearchSpace, proposed: Proposals) -> Proposals:
    """Proposals with every parameter set within its limits; a velocity that led beyond one becomes zero."""
    poses = np.clip(proposed.poses, space.lower, space.upper)
    if not proposed.velocities.size:
        return Proposals(poses, proposed.velocities)
    return Proposals(poses, np.where(poses == proposed.poses, proposed.velocities, 0.0))


def _redrawn(
    problem: FrameLikelihood,
    limbs_apart: bool,
    proposed: Proposals,
    came_from: Array,
    again: Callable[[Indices, int], Proposals],
) -> Proposals:
    """Impossible proposals drawn again at most `MOST_REDRAWS` times, then left where they came from."""
    wrong = np.flatnonzero(~problem.feasible(proposed.poses, limbs_apart=limbs_apart))
    if not wrong.size:
        return proposed
    poses, velocities = proposed.poses.copy(), proposed.velocities.copy()
    for attempt in range(1, MOST_REDRAWS + 1):
        drawn = again(wrong, attempt)
        good = problem.feasible(drawn.poses, limbs_apart=limbs_apart)
        poses[wrong[good]], velocities[wrong[good]] = drawn.poses[good], drawn.velocities[good]
        wrong = wrong[~good]
        if not wrong.size:
            return Proposals(poses, velocities)
    if len(wrong) == len(poses) and not problem.feasible(came_from, limbs_apart=limbs_apart).any():
        return proposed
    poses[wrong], velocities[wrong] = came_from[wrong], 0.0
    return Proposals(poses, velocities)
