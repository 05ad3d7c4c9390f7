"""From recordings of poses to a behaviour model (Caillette et al. 2007, sections 3.2 and 4)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError
from studio.foundations.progress import Progress, no_progress
from studio.search.behaviour.feature_space import FeatureSpace, feature_space
from studio.search.behaviour.figueiredo_jain import FLOOR, Search, fit_mixture
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.model import BehaviourModel, Making, automaton_of
from studio.search.behaviour.prototypes import find_prototypes
from studio.search.behaviour.reduction import fit_reduction, full_clusters
from studio.search.behaviour.root_motion import learn_root_motion
from studio.search.behaviour.settings import LearningSettings

IntArray = NDArray[np.int64]


def learn_model(
    recordings: Sequence[Array],
    body: BodyModel,
    fps: float,
    settings: LearningSettings,
    rng: np.random.Generator,
    progress: Progress = no_progress,
    sources: Sequence[str] = (),
) -> BehaviourModel:
    """The behaviour in recordings of poses (F, D) on one body, all at `fps`; recordings are independent.

    progress(step in words, done, total). sources : names of the recordings, kept with the model. Raises BehaviourError
    for recordings that are empty, of another body or not finite, and for too few frames.
    """
    space = feature_space(body, fps)
    features = _features(space, recordings)
    everything = np.concatenate(features)
    reduction = fit_reduction(everything, settings.reduced_dimensions)
    points = reduction.reduced(everything)
    search = Search(
        most=settings.most_clusters,
        covariance=settings.covariance,
        patience=settings.clustering_patience,
        floor=cluster_floor(settings, points.var(axis=0)),
    )
    found, _ = fit_mixture(points, rng, search, progress)
    # A cluster that is no frame's likeliest one is not used as a label.
    mixture = found.chosen(np.unique(found.labels(points)))
    labels = _split(mixture.labels(points), [len(part) for part in features])
    shares = mixture.responsibilities(points)
    dynamics = _dynamics(everything, shares)
    automaton = automaton_of(labels, mixture.size, settings)
    making = Making(
        settings=settings,
        sources=tuple(sources),
        frames=len(everything),
        labels=labels,
        learnt_fps=float(fps),
        entropy_train=automaton.entropy(labels),
    )
    half = space.dimensions
    prototypes = find_prototypes(
        recordings, labels, dynamics.log_densities(everything), dynamics.means[:, half:]
    )
    root = learn_root_motion(body, recordings, shares)
    return BehaviourModel(space, reduction, mixture, dynamics, automaton, prototypes, making, root)


def cluster_floor(settings: LearningSettings, variances: Array) -> tuple[float, ...]:
    """The variances (p,) that every cluster has at least, of points with these variances (p,); () for none."""
    if settings.cluster_floor == 0.0:
        return ()
    return tuple(float(value) for value in settings.cluster_floor * variances)


def _features(space: FeatureSpace, recordings: Sequence[Array]) -> list[Array]:
    """The features of every recording. Raises BehaviourError naming a recording without features."""
    if not recordings:
        raise BehaviourError("There is no recording to learn from.", "Give at least one.")
    found: list[Array] = []
    for number, poses in enumerate(recordings):
        try:
            found.append(space.features(poses))
        except BehaviourError as error:
            raise BehaviourError(f"Recording {number + 1}: {error.message}", error.hint) from error
    return found


def _split(labels: IntArray, lengths: Sequence[int]) -> tuple[IntArray, ...]:
    return tuple(np.split(labels, np.cumsum(lengths)[:-1]))


def _dynamics(features: Array, shares: Array) -> GaussianMixture:
    """The clusters as Gaussians of the features, every angle and every derivative with a least variance."""
    half = features.shape[1] // 2
    variances = features.var(axis=0)
    floor = np.repeat([FLOOR * part.mean() for part in np.split(variances, [half])], half)
    return full_clusters(features, shares, np.maximum(floor, 1e-12))
