"""Particles that a behaviour model moves from one frame to the next (Caillette, Galata & Howard 2007, sections 5 and
6.3), as every tracker uses them.

A guided set carries with each particle the state of the automaton that its path has reached, and its joint angles'
movement in the last frame. The model moves the joint angles. The parameters of the root get Gaussian noise of σ0 (5.2)
and, by choice, the movement that roots had in the particle's cluster (`search.behaviour.root_motion`). A particle
that is moved without the model gets noise in every parameter. It keeps its previous movement, because noise is not
movement (counted as movement it would be added again in the next frame, and no such particle would survive). Its
state is recomputed: the model's label of its pose and movement is taken as the automaton's next symbol, as training
sequences are read (`followed`).

In the first frame of a run nothing has moved yet: there is noise only, and a particle's state and movement are drawn
from the clusters near its pose (`draw_near`): the probability of each cluster given the angles, its movement unknown,
then the movement given cluster and angles. The state's history is then only that cluster.
"""

from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array, Indices, Mask
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.prediction import propagate, start_states, states_at
from studio.search.trackers.particles import unweighted
from studio.search.trackers.shared_knobs import BEHAVIOUR, LEARNT, GuidedSettings
from studio.search.trackers.tracker import Arrays, FilterState, ParticleSet, SearchSpace

STATES, VELOCITY = "automaton_state", "velocity"
"""Arrays of a guided set: (N,) int, state of the automaton; (N, d) movement of the modelled angles, rad a frame."""

# Standard deviations beyond √d: the regression from a pose that lies farther outside a cluster is not used.
NOT_BELIEVED = 3.0
# Particles per block when states are sampled: the automaton has thousands of states, each with a probability.
AT_ONCE = 4096


@dataclass(frozen=True, slots=True, eq=False)
class GuidedParticles:
    """Particles with state and movement. poses : (N, D). states : (N,) int. velocity : (N, d). free : (N,) bool, those
    that are moved without the model.
    """

    poses: Array
    states: Indices
    velocity: Array
    free: Mask

    def at(self, rows: Indices) -> "GuidedParticles":
        """The particles of these rows."""
        return GuidedParticles(self.poses[rows], self.states[rows], self.velocity[rows], self.free[rows])


def is_guided(space: SearchSpace, prediction: str) -> bool:
    """Whether there is a model and the knob `prediction` says that it is used."""
    return space.behaviour is not None and prediction == BEHAVIOUR


def model_of(space: SearchSpace) -> BehaviourModel:
    """The space's behaviour model; it must have one."""
    assert space.behaviour is not None
    return space.behaviour


def columns_of(space: SearchSpace) -> Indices:
    """(d,) columns of the pose vector that the space's model covers."""
    return model_of(space).space.columns


def walkers_from(
    rng: np.random.Generator, previous: FilterState, rows: Indices, free: Mask, space: SearchSpace
) -> GuidedParticles:
    """The particles `rows` of the set that a frame starts from, with state and movement.

    Where they have none yet (the model was added during the run), these are drawn from the clusters near their poses,
    given the last movement of the reported pose.
    """
    last = previous.particles
    assert last is not None
    poses, carried = last.poses[rows], last.extra
    if STATES in carried:
        return GuidedParticles(poses, carried[STATES][rows], carried[VELOCITY][rows], free)
    if previous.estimate is None or previous.previous_estimate is None:
        return GuidedParticles(poses, *draw_near(rng, poses, space), free)
    columns = columns_of(space)
    movement = (previous.estimate - previous.previous_estimate)[columns] / space.steps
    velocity = np.tile(movement, (len(poses), 1))
    return GuidedParticles(
        poses, states_at(rng, model_of(space), poses[:, columns], velocity), velocity, free
    )


def propagated(
    rng: np.random.Generator, guided: GuidedParticles, space: SearchSpace, rules: GuidedSettings, sigma: Array
) -> GuidedParticles:
    """The particles propagated one frame (Eq. 3 and 4), or `steps` of the space. sigma : (D,) noise, over all of these,
    of what the model does not cover or move.
    """
    model, columns = model_of(space), columns_of(space)
    free = guided.free
    noise = rng.standard_normal(guided.poses.shape) * sigma
    poses = guided.poses + np.where(free[:, None], noise, rules.global_scale * noise)
    states, angles, velocity = guided.states, guided.poses[:, columns], guided.velocity
    for _ in range(space.steps):
        moved = propagate(
            rng, model, states, angles, velocity, rules.attenuation, rules.entering, rules.automaton_share
        )
        states, angles, velocity = moved.states, moved.values, moved.velocities
        if model.root is not None and rules.root_prediction == LEARNT:
            labels = np.maximum(model.automaton.last_symbols[states], 0)
            poses = np.where(free[:, None], poses, model.root.moved(rng, poses, labels, rules.root_spread))
    poses[:, columns] = np.where(free[:, None], poses[:, columns], angles)
    velocity = np.where(free[:, None], guided.velocity, velocity)
    alone = followed(rng, model, guided.states, poses[:, columns], velocity, space.steps)
    return GuidedParticles(poses, np.where(free, alone, states), velocity, free)


def followed(
    rng: np.random.Generator,
    model: BehaviourModel,
    states: Indices,
    angles: Array,
    velocity: Array,
    frames: int = 1,
) -> Indices:
    """(N,) states of particles that moved to angles (N, d) by velocity (N, d): the cluster of both is the next symbol,
    taken as often as `frames` have steps of the automaton (`steps_per_frame`, in the mean).
    """
    labels = _labelled(model, angles, velocity)
    whole = int(frames * model.steps_per_frame)
    left = frames * model.steps_per_frame - whole
    for _ in range(whole):
        states = model.automaton.next_state[states, labels]
    stepping = rng.random(len(states)) < left
    return np.where(stepping, model.automaton.next_state[states, labels], states)


def draw_near(rng: np.random.Generator, poses: Array, space: SearchSpace) -> tuple[Indices, Array]:
    """States (N,) and movements (N, d) drawn from the clusters near poses (N, D), their movement unknown."""
    model = model_of(space)
    angles = poses[:, model.space.columns]
    states = np.concatenate(
        [states_at(rng, model, angles[begin : begin + AT_ONCE]) for begin in range(0, len(angles), AT_ONCE)]
    )
    labels = model.automaton.last_symbols[states]
    labels = np.where(labels < 0, model.poses_only.labels(angles), labels)
    noise = rng.standard_normal(angles.shape)
    velocity = np.zeros(angles.shape)
    for label in np.unique(labels):
        rows = np.flatnonzero(labels == label)
        velocity[rows] = _movement_given_angles(model.dynamics, int(label), angles[rows], noise[rows])
    return states, velocity


def spread_over_clusters(
    rng: np.random.Generator, space: SearchSpace, count: int, root: Array, sigma: Array
) -> ParticleSet:
    """A set of `count` particles over all clusters, all states reset: the recovery of section 6.3.

    root : (D,) a pose, or (count, D) poses, whose parameters that the model does not know are taken; sigma : (D,)
    noise about those. Clusters are as frequent as in training; angles and movements are drawn from them, and the
    angles kept within the space's limits.
    """
    model, columns = model_of(space), columns_of(space)
    start = start_states(rng, model, count)
    around = rng.standard_normal((count, len(space.names))) * sigma
    poses = np.broadcast_to(root, around.shape) + around
    poses[:, columns] = start.values
    poses = np.clip(poses, space.lower, space.upper)
    carried: Arrays = {STATES: start.states, VELOCITY: start.velocities}
    return unweighted(poses, carried)


def foresee(particles: ParticleSet, space: SearchSpace, support: float = 0.05, most: int = 4) -> Array:
    """(S, D) poses that a set expects: the means of the clusters that hold at least a share `support` of its particles,
    the fullest first, `most` at most, at the particles' mean root (section 6.3). Never empty: where no cluster has so
    many the fullest is taken, and without a model the set's own mean.
    """
    mean = particles.poses.mean(axis=0)
    if space.behaviour is None or STATES not in particles.extra:
        return mean[None]
    model, columns = space.behaviour, space.behaviour.space.columns
    labels = _labels_of(model, particles)
    held = np.bincount(labels, minlength=model.clusters) / len(labels)
    order = np.argsort(-held, kind="stable")
    enough = [int(label) for label in order if held[label] >= support and held[label] > 0.0]
    chosen = (enough or [int(order[0])])[:most]
    poses = np.tile(mean, (len(chosen), 1))
    poses[:, columns] = model.poses_only.means[chosen]
    return np.clip(poses, space.lower, space.upper)


def _labels_of(model: BehaviourModel, particles: ParticleSet) -> Indices:
    """(N,) cluster of each particle: the last symbol of its state, or the label of its pose and movement where the
    state has no history.
    """
    labels = model.automaton.last_symbols[particles.extra[STATES]]
    unknown = np.flatnonzero(labels < 0)
    if unknown.size:
        angles = particles.poses[np.ix_(unknown, model.space.columns)]
        labels[unknown] = _labelled(model, angles, particles.extra[VELOCITY][unknown])
    return labels


def _labelled(model: BehaviourModel, angles: Array, velocity: Array) -> Indices:
    """(N,) the clusters of features."""
    return model.mixture.labels(model.reduction.reduced(np.concatenate([angles, velocity], axis=1)))


def _movement_given_angles(mixture: GaussianMixture, label: int, angles: Array, noise: Array) -> Array:
    """(N, d) movements drawn from a cluster's Gaussian given angles (N, d); noise : (N, d) independent normals."""
    half = angles.shape[1]
    mean: Array = mixture.means[label]
    covariance: Array = mixture.covariances[label]
    inner, across, outer = covariance[:half, :half], covariance[half:, :half], covariance[half:, half:]
    away = angles - mean[:half]
    inverse = np.asarray(np.linalg.pinv(inner, hermitian=True), dtype=np.float64)
    distance = np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", away, inverse, away), 1e-300))
    away = away * np.minimum(1.0, (np.sqrt(half) + NOT_BELIEVED) / distance)[:, None]
    values, vectors = np.linalg.eigh(outer - across @ inverse @ across.T)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return mean[half:] + away @ (across @ inverse).T + noise @ root
