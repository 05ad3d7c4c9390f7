"""A small behaviour to learn in a moment: a planar arm that waves in one of two ways, each again and again."""

import numpy as np

from studio.body.catalogue import load_body
from studio.foundations.arrays import Array
from studio.foundations.knobs import changed
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.settings import LearningSettings

FPS = 25.0
SETTINGS = changed(
    LearningSettings(),
    {"most_clusters": 12, "reduced_dimensions": 4, "memory": 4, "least_probability": 0.002},
)


def waves(seed: int, frames: int = 200, kind: int = 0) -> Array:
    """(F, 4) poses of planar_arm4: a wave of about 40 frames; kind 1 is faster and the other way up."""
    rng = np.random.default_rng(seed)
    rate = 2.0 * np.pi / (40.0, 28.0)[kind] * (1.0 + 0.03 * rng.standard_normal())
    angle = rng.uniform(0.0, 2.0 * np.pi) + rate * np.arange(frames)
    sizes = np.array([[0.3, 0.5, 0.4, 0.2], [0.5, -0.4, 0.1, -0.5]])[kind]
    lags = np.array([0.0, 0.6, 1.1, 1.9])
    drift = 0.003 * np.cumsum(rng.standard_normal((frames, 4)), axis=0)
    return sizes * np.sin(angle[:, None] - lags) + drift + 0.003 * rng.standard_normal((frames, 4))


def recordings() -> list[Array]:
    """Six recordings, three of each wave."""
    return [waves(seed, kind=seed % 2) for seed in range(6)]


def toy_model(seed: int = 0, **changes: object) -> BehaviourModel:
    """The behaviour learnt from `recordings`. changes : of SETTINGS."""
    body = load_body("planar_arm4")
    settings = changed(SETTINGS, changes)
    return learn_model(recordings(), body, FPS, settings, np.random.default_rng(seed))
