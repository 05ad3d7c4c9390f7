"""A behaviour model of what the arm of `toy_session` does: it swings."""

import functools
from pathlib import Path

import numpy as np
from toy_session import BODY

from studio.body.catalogue import load_body
from studio.runs.behaviour_models import SUFFIX, models_folder
from studio.search.behaviour.model import BehaviourModel
from studio.search.behaviour.model_file import write_model
from studio.search.behaviour.model_learning import learn_model
from studio.search.behaviour.settings import LearningSettings

FPS = 60.0
SETTINGS = LearningSettings(most_clusters=8, reduced_dimensions=4, memory=4, least_probability=0.002)


def swings(frames: int, lag: float = 0.0, size: float = 0.25) -> np.ndarray:
    """(F, 4) poses as those of `toy_session.true_poses`, begun elsewhere."""
    time = lag + np.arange(frames)[:, None] / 12.0
    return size * np.sin(time + np.array([0.0, 0.9, 1.9, 2.8]))


@functools.cache
def arm_model() -> BehaviourModel:
    """The behaviour in five swings, a little larger and smaller than the session's."""
    rng = np.random.default_rng(3)
    recordings = []
    for lag, size in zip(range(5), np.linspace(0.2, 0.3, 5), strict=True):
        drift = 0.002 * np.cumsum(rng.standard_normal((160, 4)), axis=0)
        recordings.append(swings(160, lag, size) + drift + 0.002 * rng.standard_normal((160, 4)))
    return learn_model(recordings, load_body(BODY), FPS, SETTINGS, rng)


def keep_arm_model(root: Path, name: str = "swings") -> Path:
    """The model's file among the models of a workspace."""
    path = models_folder(root) / f"{name}{SUFFIX}"
    write_model(arm_model(), path)
    return path
