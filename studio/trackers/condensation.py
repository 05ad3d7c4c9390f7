"""Condensation, the baseline (Isard & Blake 1996; Deutscher & Reid 2005, sections 2.1 and 5).

A frame is one layer: survivors of the last frame are drawn by weight, moved, spread by σ0 and weighed once.

The weighting of Eq. 17 is no likelihood: with its bare exponent the weights are nearly flat and nothing is
selected. So that the comparison is fair, log w is multiplied by a scale that is chosen on the first frames:
in each of them the β is found with which a chosen share of the particles survives (Eq. 12), and their
geometric mean is used from then on. The scale in use stands in every record as `beta`, and travels with the
particles as `extra["log_scales"]`.
"""

import numpy as np

from studio.arrays import Array
from studio.trackers.annealing import Annealed, anneal, normalised, survival_rate
from studio.trackers.diffusion import noise_about
from studio.trackers.layer_record import layer_record
from studio.trackers.particles import (
    estimate,
    expected,
    first_draw,
    settled_first,
    uniform_poses,
    unweighted,
    weigh,
    weighted_variance,
)
from studio.trackers.resampling import draw
from studio.trackers.settings import CondensationSettings
from studio.trackers.tracker import (
    Estimate,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)

SCALES = "log_scales"


class Condensation(Tracker):
    """One frame in one layer; evaluations = particles."""

    name = "condensation"
    label = "Condensation"
    settings_type = CondensationSettings
    scales_likelihood = True

    def layer_count(self, settings: CondensationSettings) -> int:
        return 1

    def begin_frame(
        self,
        rng: np.random.Generator,
        previous: FilterState,
        space: SearchSpace,
        settings: CondensationSettings,
    ) -> ParticleSet:
        """Survivors of the last frame, drawn by weight, moved and spread (section 2.1, steps 1 and 2)."""
        last = previous.particles
        if last is None:
            return unweighted(uniform_poses(rng, settings.particles, space))
        drawn = draw(rng, np.exp(last.log_weights), settings.particles, settings.resampling)
        predicted = expected(last.poses[drawn], previous, settings.dynamics)
        spread = noise_about(predicted, space.sigma * settings.diffusion_scale)
        first = first_draw(spread, spread.draw(rng), space, settings)
        return ParticleSet(first.poses, first.log_weights, extra=last.extra | first.extra)

    def step_layer(
        self,
        rng: np.random.Generator,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: CondensationSettings,
    ) -> tuple[ParticleSet, LayerRecord]:
        """Weigh every particle (section 2.1, step 3) with the likelihood's scale, or choose that scale."""
        sigma = space.sigma * settings.diffusion_scale
        particles = settled_first(rng, particles, problem, space, sigma, settings)
        raw, eligible = weigh(problem, particles.poses, settings)
        scales = particles.extra.get(SCALES, np.zeros(0))
        wanted = float("nan")
        if len(scales) < settings.scale_frames:
            wanted = settings.scale_survival
            chosen = anneal(eligible, wanted)
            scales = np.append(scales, np.log(chosen.beta))
        else:
            chosen = _scaled(eligible, float(np.exp(np.mean(scales))))
        weighted = ParticleSet(particles.poses, chosen.log_weights, raw, particles.extra | {SCALES: scales})
        kept = weighted_variance(weighted)
        return weighted, layer_record(layer, weighted, chosen, wanted, resampled=kept, diffused=kept)

    def end_frame(
        self, particles: ParticleSet, space: SearchSpace, settings: CondensationSettings
    ) -> Estimate:
        """The weighted mean (Eq. 1) or the mode (Eq. 2)."""
        return estimate(particles, settings.estimate)


def _scaled(log_weights: Array, scale: float) -> Annealed:
    """Normalised weights w^scale and their survival rate."""
    weights = normalised(log_weights, scale)
    return Annealed(scale, survival_rate(weights), weights)
