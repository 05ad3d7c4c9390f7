"""Experiments whose trials are tracked footage: the trials, their outcomes by contender, curves and tables.

Trials of the same attempt are the same trial whichever experiment asks for it, so figures that look at one set of
runs from several sides share them.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.tracked import Attempt, track
from studio.comparison.trials import Trial, kept_as

Array = NDArray[np.float64]
T = TypeVar("T")


def tracking_trial(group: str, attempt: Attempt) -> Trial:
    """The trial of an attempt. group : contender and setting in words, the same for all its seeds."""
    return Trial(f"{group}, seed {attempt.seed}", attempt.plain())


@kept_as("tracking_trials.measure_tracking")
def measure_tracking(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track; the fields of `Tracked`."""
    return asdict(track(Attempt.of_plain(arguments), shelf))


def group_of(trial: Trial) -> str:
    """The contender and setting of a trial made by `tracking_trial`."""
    return trial.label.rpartition(", seed ")[0]
