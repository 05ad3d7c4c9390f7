"""Online learning: a run's well tracked frames are added to its behaviour model (named as future work in Caillette et
al. 2007, section 8).

Every `interval` frames the model is updated (a lesson) with all that the run has tracked so far:

1. Frames are well tracked whose log-weight is not far below the run's median, and whose pose agrees with the pictures
   (`well_tracked`): beside the rest of a run that is lost throughout, every frame looks well tracked. Stretches are
   smoothed over `SMOOTHING_S`, as training material is, since a tracker's jitter would be taken for movement.
2. Frames that no cluster explains (`novel`) are clustered by Figueiredo & Jain's EM in the model's own reduced space.
   New clusters are appended; existing ones keep their number, mean and covariance.
3. All stretches are labelled with the clusters now known, and the automaton is learnt again from these labels and those
   of the training; so a run also updates the order in which known movements follow each other.

A lesson is a function of the model before it, the run's poses so far and its seed, so a resumed run has
the same model. As clusters keep their numbers, a particle's state is the same history in the next automaton
(`translated`).
"""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from studio.foundations.arrays import Array, Indices, Mask, median_and_spread, runs_of
from studio.search.behaviour.automaton import Automaton
from studio.search.behaviour.figueiredo_jain import FLOOR, Search, fit_mixture, parameters_of
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.model import BehaviourModel, automaton_of
from studio.search.behaviour.model_learning import cluster_floor
from studio.search.behaviour.prototypes import Prototypes
from studio.search.behaviour.reduction import full_clusters
from studio.search.behaviour.root_motion import RootMotion, gaussians_of
from studio.search.trackers.guided_particles import STATES
from studio.search.trackers.guided_start import CAME_FROM_STATES
from studio.search.trackers.guided_swarm import BEFORE_STATE, LEADER_STATE
from studio.search.trackers.random_numbers import keyed_generator
from studio.search.trackers.tracker import FilterState

# By K: poses (K, D), log-weights (K,) and overlaps with the masks (K,), NaN where unknown, of a run's first K frames.
Tracked = Callable[[int], tuple[Array, Array, Array]]

SOURCE = "tracked"
SMOOTHING_S = 0.06
SHORTEST_S = 0.3
# Robust standard deviations below the median from which on a frame is not well tracked.
TOO_LOW = 3.0
# Mean squared deviation, in a cluster's variances, above which it does not explain a frame.
NOT_EXPLAINED = 6.0
MOST_NEW_CLUSTERS, PATIENCE = 20, 5


def well_tracked(log_weights: Array, overlaps: Array, least: float = 0.0) -> Mask:
    """(K,) frames whose log-weight (K,) is not far below the median, by the median absolute deviation, and whose
    overlap (K,) with the masks is not known to be below `least`.
    """
    median, spread = median_and_spread(log_weights)
    return (log_weights >= median - TOO_LOW * spread) & ~(overlaps < least)


def stretches(poses: Array, good: Mask, model: BehaviourModel) -> list[Array]:
    """The well-tracked stretches of a run as recordings (F, D) at the rate that the model was learnt at, smoothed.

    poses : (K, D) at the model's rate. good : (K,) frames that are well tracked. Stretches under `SHORTEST_S` are left
    out.
    """
    found: list[Array] = []
    for begin, end in runs_of(good):
        if end - begin < max(2.0, SHORTEST_S * model.fps):
            continue
        smooth = np.array(poses[begin:end])
        values = model.space.continuous(smooth)
        smooth[:, model.space.columns] = scipy.ndimage.gaussian_filter1d(
            values, SMOOTHING_S * model.fps, axis=0, mode="nearest"
        )
        found.append(_at_learnt_rate(smooth, model))
    return found


def novel(model: BehaviourModel, features: Array) -> Mask:
    """(n,) features (n, 2 d), at the model's rate, that none of its clusters explains."""
    least = np.full(len(features), np.inf)
    for mean, whitener in zip(model.dynamics.means, model.dynamics.whiteners, strict=True):
        away = (features - mean) @ whitener.T
        least = np.minimum(least, (away * away).mean(axis=1))
    return least > NOT_EXPLAINED


def updated_model(
    base: BehaviourModel,
    known: BehaviourModel,
    poses: Array,
    good: Mask,
    rng: np.random.Generator,
) -> BehaviourModel:
    """The model after one more lesson.

    base : the model that the run began with. known : the model after the lesson before (`base` at the first). poses (K,
    D) : of the run so far, in order, at the models' rate. good : (K,) which are well tracked. Returns `known` where
    nothing was.
    """
    recordings = stretches(poses, good, known)
    if not recordings:
        return known
    now = known.at_rate(known.making.learnt_fps)
    features = [now.space.features(recording) for recording in recordings]
    now = _with_new_clusters(now, recordings, np.concatenate(features), rng)
    labels = tuple(now.mixture.labels(now.reduction.reduced(part)) for part in features)
    everything = (*base.making.labels, *labels)
    automaton = automaton_of(everything, now.clusters, now.making.settings)
    making = dataclasses.replace(
        now.making,
        sources=(*_sources_of(base), *(SOURCE for _ in labels)),
        frames=base.making.frames + sum(len(part) for part in labels),
        labels=everything,
        entropy_train=automaton.entropy(everything),
        entropy_test=float("nan"),
    )
    return dataclasses.replace(now, automaton=automaton, making=making).at_rate(known.fps)


def translated(carried: FilterState, before: Automaton, after: Automaton) -> FilterState:
    """A frame's state with its automaton states mapped to those of the next automaton that have the same histories."""
    particles = carried.particles
    if particles is None or before is after:
        return carried
    extra = dict(particles.extra)
    for name in (STATES, CAME_FROM_STATES, LEADER_STATE, BEFORE_STATE):
        if name in extra:
            extra[name] = _same_histories(before, after, extra[name])
    return dataclasses.replace(carried, particles=dataclasses.replace(particles, extra=extra))


@dataclass(eq=False)
class OnlineLearner:
    """The behaviour model in use in each frame of a run with online learning.

    base : the run's model. interval : frames between lessons. seed : the run's. overlap : least, of frames that are
    learnt. Lessons are computed when a later frame's model is needed, and kept.
    """

    base: BehaviourModel
    interval: int
    seed: int
    overlap: float = 0.0

    def __post_init__(self) -> None:
        self._models = [self.base]

    def model_in(self, number: int, tracked: Tracked) -> BehaviourModel:
        """The model of a run's frame, counted from 0; tracked : of at least the frames before it."""
        lesson = number // self.interval
        while len(self._models) <= lesson:
            held = len(self._models)
            rng = keyed_generator(self.seed, held, LESSON_KEY)
            poses, log_weights, overlaps = tracked(held * self.interval)
            good = well_tracked(log_weights, overlaps, self.overlap)
            self._models.append(updated_model(self.base, self._models[-1], poses, good, rng))
        return self._models[lesson]

    def carried_into(self, number: int, carried: FilterState, tracked: Tracked) -> FilterState:
        """The state from the frame before, in terms of this frame's own model."""
        if number == 0 or number % self.interval:
            return carried
        before, after = (self.model_in(which, tracked) for which in (number - 1, number))
        return translated(carried, before.automaton, after.automaton)


LESSON_KEY = 0x1E550


def _with_new_clusters(
    model: BehaviourModel, recordings: Sequence[Array], features: Array, rng: np.random.Generator
) -> BehaviourModel:
    """The model, at its learnt rate, with added clusters for the frames that it does not explain. recordings : (F, D)
    each, n frames in all. features : (n, 2 d).
    """
    poses = np.concatenate(recordings)
    strange = np.flatnonzero(novel(model, features))
    points = model.reduction.reduced(features)
    parameters = parameters_of(points.shape[1], "full")
    if len(strange) < max(2, parameters // 2 + 1):
        return model
    most = min(MOST_NEW_CLUSTERS, max(1, 2 * len(strange) // parameters))
    floor = cluster_floor(model.making.settings, model.mixture.variances)
    found, _ = fit_mixture(points[strange], rng, Search(most=most, patience=PATIENCE, floor=floor))
    # A cluster that is no frame's likeliest one is not used as a label.
    found = found.chosen(np.unique(found.labels(points[strange])))
    shares = found.responsibilities(points[strange])
    least = FLOOR * np.maximum(features.var(axis=0).mean(), 1e-6) * np.ones(features.shape[1])
    movements = full_clusters(features[strange], shares, least)
    share = len(strange) / (model.making.frames + len(strange))
    densities = movements.log_densities(features[strange])
    best = strange[np.argmax(densities, axis=0)]
    half = model.space.dimensions
    prototypes = Prototypes(
        poses=np.concatenate([model.prototypes.poses, poses[best]]),
        derivatives=np.concatenate([model.prototypes.derivatives, movements.means[:, half:]]),
        recordings=np.concatenate(
            [model.prototypes.recordings, np.full(len(best), len(model.making.labels))]
        ),
        frames=np.concatenate([model.prototypes.frames, best]),
    )
    return dataclasses.replace(
        model,
        mixture=_joined(model.mixture, found, share),
        dynamics=_joined(model.dynamics, movements, share),
        prototypes=prototypes,
        root=model.root and _root_joined(model.root, recordings, strange, shares),
    )


def _root_joined(
    root: RootMotion, recordings: Sequence[Array], strange: Indices, shares: Array
) -> RootMotion:
    """The root motion with that of the new clusters, from frames `strange` by their shares (n, K) in the clusters."""
    changes = np.concatenate([root.frame.changes(poses) for poses in recordings])
    return root.joined(gaussians_of(changes[strange], shares))


def _joined(first: GaussianMixture, second: GaussianMixture, share: float) -> GaussianMixture:
    """Both mixtures' components; share : weight of the second's."""
    return GaussianMixture(
        np.concatenate([(1.0 - share) * first.weights, share * second.weights]),
        np.concatenate([first.means, second.means]),
        np.concatenate([first.covariances, second.covariances]),
    )


def _at_learnt_rate(poses: Array, model: BehaviourModel) -> Array:
    """Poses (F, D) at the model's rate, at the rate that it was learnt at."""
    rate = model.making.learnt_fps
    if rate == model.fps:
        return poses
    times = np.arange(len(poses)) / model.fps
    resampled = np.arange(0.0, times[-1] + 1e-9, 1.0 / rate)
    columns: list[Array] = [np.interp(resampled, times, column) for column in poses.T]
    return np.column_stack(columns)


def _sources_of(model: BehaviourModel) -> Sequence[str]:
    """The names of a model's recordings, where it has them."""
    return model.making.sources or tuple("" for _ in model.making.labels)


def _same_histories(before: Automaton, after: Automaton, states: Array) -> Indices:
    """The states (N,) in which the later automaton is after the histories that the earlier one's stand for."""
    numbers = np.asarray(states, dtype=np.int64)
    known = {int(state): after.state_after(before.contexts[int(state)]) for state in np.unique(numbers)}
    return np.array([known[int(state)] for state in numbers], dtype=np.int64).reshape(numbers.shape)
