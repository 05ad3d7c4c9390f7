"""A behaviour model made by hand with known dynamics: the angles of a toy space turn through four clusters."""

import dataclasses

import numpy as np
from toy_problems import toy_space

from studio.search.behaviour.feature_space import FeatureSpace
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.model import BehaviourModel, Making, automaton_of
from studio.search.behaviour.prototypes import Prototypes
from studio.search.behaviour.reduction import Reduction
from studio.search.behaviour.settings import LearningSettings
from studio.search.trackers.tracker import SearchSpace

ROOT, FPS = 3, 60.0
PERIOD, DWELL, REACH = 40, 10, 1.0
CLUSTERS = PERIOD // DWELL


def turning_angles(count: int, frames: int, begin: int = 0) -> np.ndarray:
    """(F, d) angles that turn once in PERIOD frames, neighbours a quarter turn apart."""
    phase = 2.0 * np.pi * (begin + np.arange(frames)) / PERIOD
    return REACH * np.sin(phase[:, None] + 0.5 * np.pi * np.arange(count))


def turning_poses(count: int, frames: int, begin: int = 0) -> np.ndarray:
    """(F, D) the same with a root that walks along its first parameter."""
    root = np.zeros((frames, ROOT))
    root[:, 0] = 0.05 * (begin + np.arange(frames))
    return np.concatenate([root, turning_angles(count - ROOT, frames, begin)], axis=1)


def toy_model(count: int = 9, fps: float = FPS, memory: int = 3) -> BehaviourModel:
    """The model of `turning_poses`: four Gaussians fitted to ten frames each, and the automaton of their order."""
    space = toy_feature_space(count, fps)
    recordings = [turning_poses(count, 8 * PERIOD, begin) for begin in range(0, PERIOD, 7)]
    features = np.concatenate([space.features(poses) for poses in recordings])
    owner = np.concatenate(
        [((begin + np.arange(8 * PERIOD)) % PERIOD) // DWELL for begin in range(0, PERIOD, 7)]
    )
    width = features.shape[1]
    means = np.stack([features[owner == one].mean(axis=0) for one in range(CLUSTERS)])
    # A little more than the data have, in every direction.
    covariances = np.stack([np.cov(features[owner == one].T, bias=True) for one in range(CLUSTERS)])
    covariances = covariances + np.diag(np.repeat([1e-3, 1e-5], width // 2))
    mixture = GaussianMixture(np.full(CLUSTERS, 1.0 / CLUSTERS), means, covariances)
    labels = tuple(mixture.labels(space.features(poses)) for poses in recordings)
    settings = LearningSettings(memory=memory)
    automaton = automaton_of(labels, CLUSTERS, settings)
    making = Making(settings, tuple("" for _ in labels), len(owner), labels, fps, 0.0)
    prototypes = Prototypes(
        space.poses(means[:, : width // 2]),
        means[:, width // 2 :],
        np.zeros(CLUSTERS, dtype=np.int64),
        np.zeros(CLUSTERS, dtype=np.int64),
    )
    reduction = Reduction(np.zeros(width), np.ones(width), np.eye(width), 1.0)
    return BehaviourModel(space, reduction, mixture, mixture, automaton, prototypes, making)


def toy_feature_space(count: int, fps: float = FPS) -> FeatureSpace:
    """All parameters of a toy space but the first three."""
    columns = np.arange(ROOT, count)
    return FeatureSpace(
        body="toy",
        parameters=tuple(f"x{index}" for index in range(count)),
        columns=columns,
        rest=np.zeros(count),
        turning=np.ones(len(columns), dtype=bool),
        middle=np.zeros(len(columns)),
        fps=fps,
    )


def guided_space(count: int = 9, **wanted: float) -> SearchSpace:
    """A toy space with the toy model."""
    return dataclasses.replace(toy_space(count, **wanted), behaviour=toy_model(count))
