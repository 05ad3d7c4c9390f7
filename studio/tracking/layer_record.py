"""The record of a layer, filled in from its weighted set."""

import math

import numpy as np
from numpy.typing import NDArray

from studio.tracking.annealing import Annealed
from studio.tracking.particles import weighted_mean
from studio.tracking.tracker import LayerRecord, ParticleSet

Array = NDArray[np.float64]


def layer_record(
    layer: int,
    weighted: ParticleSet,
    annealed: Annealed,
    wanted: float,
    *,
    resampled: Array,
    diffused: Array,
    free: float = math.nan,
) -> LayerRecord:
    """The record of a layer; the frame loop fills in frame, version and time. free : share of the particles that no
    behaviour model moved.
    """
    best = int(np.argmax(weighted.log_weights))
    return LayerRecord(
        frame=-1,
        layer=layer,
        settings_version=-1,
        beta=annealed.beta,
        alpha_wanted=wanted,
        alpha_reached=annealed.survival,
        variance_weighed=weighted.poses.var(axis=0),
        variance_resampled=resampled,
        variance_diffused=diffused,
        best=weighted.poses[best],
        best_log_weight=float(weighted.raw_log_weights[best]),
        mean=weighted_mean(weighted),
        poses=weighted.poses,
        log_weights=weighted.raw_log_weights,
        milliseconds=0.0,
        model_free_share=free,
    )
