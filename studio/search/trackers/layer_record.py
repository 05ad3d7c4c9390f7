"""The record of a layer, filled in from its weighted set; what a frame's records say of weights that choose nothing."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.annealing import Annealed
from studio.search.trackers.particle_kernels import moments
from studio.search.trackers.particles import heaviest, weighted_mean
from studio.search.trackers.tracker import LayerRecord, ParticleSet


def layer_record(
    layer: int,
    weighted: ParticleSet,
    annealed: Annealed,
    wanted: float,
    *,
    resampled: Array,
    diffused: Array,
    free: float = math.nan,
    parents: Indices | None = None,
) -> LayerRecord:
    """The record of a layer.

    free : share of the particles that no behaviour model moved.
    parents : as in the record; None: nothing was drawn.
    """
    best = heaviest(weighted)
    return LayerRecord(
        layer=layer,
        beta=annealed.beta,
        alpha_wanted=wanted,
        alpha_reached=annealed.survival,
        variance_weighed=moments(weighted.poses).variance,
        variance_resampled=resampled,
        variance_diffused=diffused,
        best=weighted.poses[best],
        best_log_weight=float(weighted.raw_log_weights[best]),
        mean=weighted_mean(weighted),
        poses=weighted.poses,
        log_weights=weighted.raw_log_weights,
        model_free_share=free,
        parents=np.zeros((2, 0), dtype=np.int64) if parents is None else parents,
    )


ALONE = 1.5
"""Of an effective number of particles (D, Eq. 11) below this, one holds nearly all the weight."""


def search_notes(records: Sequence[LayerRecord]) -> tuple[str, ...]:
    """What the weights of a frame's layers do not say: that all were equal, that one particle held everything, that
    all were one pose. Sentences; none of a usual frame. The answer is defined in each case (docs of `annealing`): the
    first leaves the mean of what was drawn, the second its particle, the third its pose.
    """
    found: list[str] = []
    for sentence, holds in NOTED:
        layers = [str(record.layer + 1) for record in records if len(record.poses) > 1 and holds(record)]
        if layers:
            found.append(sentence.format(f"layer{'s' if len(layers) > 1 else ''} {', '.join(layers)}"))
    return tuple(found)


def _all_equal(record: LayerRecord) -> bool:
    return bool((record.log_weights == record.log_weights[0]).all()) and not _one_pose(record)


def _one_holds_all(record: LayerRecord) -> bool:
    """NaN of a tracker without survival rates is no number below any. Of a large set on a card some are recorded."""
    count = int(record.rows[-1]) + 1 if len(record.rows) else len(record.poses)
    return record.alpha_reached * count < ALONE


def _one_pose(record: LayerRecord) -> bool:
    return bool((record.poses == record.poses[0]).all())


NOTED: tuple[tuple[str, Callable[[LayerRecord], bool]], ...] = (
    ("All weights were equal in {}: the pictures prefer no pose.", _all_equal),
    ("One particle held all the weight in {}.", _one_holds_all),
    ("All particles were one pose in {}: nothing was searched.", _one_pose),
)
