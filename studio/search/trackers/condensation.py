"""Condensation, the baseline (Isard & Blake 1996; Deutscher & Reid 2005, sections 2.1 and 5).

A frame is one layer: survivors of the last frame are drawn by weight, moved, spread by σ0 and weighed once.

The weight of Eq. 17 is no likelihood in the strict sense: with its bare exponent the weights are nearly flat and
nothing is selected. So that the comparison is fair, log w is multiplied by a scale that is chosen on the first frames:
in each of them the β is found with which a chosen share of the particles survives (Eq. 12), and their geometric mean is
used from then on. The scale in use stands in every record as `beta`, and travels with the particles as
`extra["log_scales"]`.
"""

import math

import numpy as np

from studio.foundations.arrays import Array
from studio.search.trackers.annealing import Annealed, anneal, at_exponent
from studio.search.trackers.layer_plan import LayerPlan
from studio.search.trackers.one_layer_filter import OneLayerFilter
from studio.search.trackers.particles import first_set, predict, uniform_poses, unweighted
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.resampling import draw
from studio.search.trackers.settings import CondensationSettings
from studio.search.trackers.tracker import (
    Arrays,
    FilterState,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)

SCALES = "log_scales"


class Condensation(OneLayerFilter[CondensationSettings]):
    """Survivors drawn by weight, moved, spread and weighed once."""

    name = "condensation"
    label = "Condensation"
    settings_type = CondensationSettings
    scales_likelihood = True
    own_knobs = Tracker.own_knobs | {"scale_survival", "scale_frames", "diffusion_scale", "dynamics"}

    def begin_frame(
        self,
        numbers: RandomNumbers,
        previous: FilterState,
        space: SearchSpace,
        settings: CondensationSettings,
    ) -> ParticleSet:
        """Survivors of the last frame, drawn by weight, moved and spread (section 2.1, steps 1 and 2)."""
        last = previous.particles
        if last is None:
            return unweighted(uniform_poses(numbers, settings.particles, space))
        drawn = draw(numbers, np.exp(last.log_weights), settings.particles, settings.resampling)
        predicted = predict(last.poses[drawn], previous, settings.dynamics)
        first = first_set(numbers, predicted, space, settings)
        return ParticleSet(first.poses, first.log_weights, extra=last.extra | first.extra)

    def plan_layer(
        self, layer: int, space: SearchSpace, settings: CondensationSettings, extra: Arrays
    ) -> LayerPlan | None:
        """The likelihood's scale, or the share that is to survive while it is chosen."""
        scales = extra.get(SCALES, np.zeros(0))
        if len(scales) >= settings.scale_frames:
            return LayerPlan(math.nan, None, beta=float(np.exp(np.mean(scales))))
        return LayerPlan(settings.scale_survival, None)

    def kept_of_layer(self, extra: Arrays, record: LayerRecord, settings: CondensationSettings) -> Arrays:
        """With the scale that the layer chose."""
        scales = extra.get(SCALES, np.zeros(0))
        if len(scales) >= settings.scale_frames:
            return extra
        return extra | {SCALES: np.append(scales, np.log(record.beta))}

    def selected(
        self, log_weights: Array, extra: Arrays, settings: CondensationSettings
    ) -> tuple[Annealed, float, Arrays]:
        """Weights (section 2.1, step 3) with the likelihood's scale, or those that choose that scale."""
        scales = extra.get(SCALES, np.zeros(0))
        if len(scales) >= settings.scale_frames:
            return at_exponent(log_weights, float(np.exp(np.mean(scales)))), math.nan, extra
        chosen = anneal(log_weights, settings.scale_survival)
        scales = np.append(scales, np.log(chosen.beta))
        return chosen, settings.scale_survival, extra | {SCALES: scales}
