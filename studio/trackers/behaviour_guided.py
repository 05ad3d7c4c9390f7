"""Particle filter guided by a learnt behaviour model (Caillette, Galata & Howard 2007, sections 3.3 and 5).

Idea: a particle filter whose particles have a motion state. Each carries the state of a probabilistic
automaton over clusters of elementary movements. A frame draws survivors by weight (SIR); each goes to a cluster that
the automaton, its pose and its movement make likely (Eq. 3); in a new cluster its joint angles are resampled
from it, in the same one they move on with the cluster's own uncertainty (Eq. 4). The root's six parameters
get Gaussian noise. Every particle is weighed once, and the best of them is the pose. What particles carry:
`guided_particles`; those that no model moves, beyond the paper: `model_free`.

Weights: the paper normalises w as it is (section 6.4). Most weightings are no likelihoods and nearly flat as they are,
so by default w^β is used, with β such that a chosen share of the particles survives the next draw (Deutscher & Reid
2005, Eq. 3 and 12); β stands in the record.

Without a model in the search space the tracker is a particle filter with noise of σ0; runs are not made so
(`runs.behaviour_models`).
"""

import numpy as np

from studio.arrays import Array
from studio.trackers.annealing import Annealed, anneal, normalised, survival_rate
from studio.trackers.behaviour_settings import BehaviourSettings
from studio.trackers.diffusion import noise_about
from studio.trackers.guided_particles import STATES, foreseen, spread_over_clusters
from studio.trackers.guided_start import guided_set, settled_walkers, without_past
from studio.trackers.layer_record import layer_record
from studio.trackers.model_free import judged, share_in
from studio.trackers.particles import (
    estimate,
    first_draw,
    settled_first,
    uniform_poses,
    unweighted,
    weigh,
    weighted_variance,
)
from studio.trackers.resampling import draw
from studio.trackers.tracker import (
    Estimate,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)


class BehaviourGuided(Tracker):
    """One frame in one layer; evaluations = particles."""

    name = "behaviour"
    label = "Guided by behaviour"
    settings_type = BehaviourSettings
    needs_behaviour = True

    def layer_count(self, settings: BehaviourSettings) -> int:
        return 1

    def begin_frame(
        self, rng: np.random.Generator, previous: FilterState, space: SearchSpace, settings: BehaviourSettings
    ) -> ParticleSet:
        """Survivors of the last frame, drawn by weight and moved by the model.

        Without a set to start from, roots lie anywhere between the limits, and the angles in all clusters alike.
        """
        last, count = previous.particles, settings.particles
        sigma = space.sigma * settings.diffusion_scale
        if last is None:
            anywhere = uniform_poses(rng, count, space)
            if space.behaviour is None:
                return unweighted(anywhere)
            return spread_over_clusters(rng, space, count, anywhere, np.zeros_like(sigma))
        drawn = draw(rng, np.exp(last.log_weights), count, settings.resampling)
        if space.behaviour is not None:
            return guided_set(rng, previous, drawn, space, settings)
        spread = noise_about(last.poses[drawn], sigma)
        return first_draw(spread, spread.draw(rng), space, settings)

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: BehaviourSettings) -> Array:
        """(S, D) means of the clusters that hold enough particles, at their mean root (section 6.3)."""
        return foreseen(particles, space, settings.expected_support, settings.expected_most)

    def step_layer(
        self,
        rng: np.random.Generator,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: BehaviourSettings,
    ) -> tuple[ParticleSet, LayerRecord]:
        if STATES in particles.extra:
            particles = settled_walkers(rng, particles, problem, space, settings)
        else:
            sigma = space.sigma * settings.diffusion_scale
            particles = settled_first(rng, particles, problem, space, sigma, settings)
        raw, eligible = weigh(problem, particles.poses, settings)
        chosen = _selected(eligible, settings)
        extra = without_past(judged(particles.extra, eligible))
        weighted = ParticleSet(particles.poses, chosen.log_weights, raw, extra)
        kept = weighted_variance(weighted)
        wanted = settings.survival if settings.selection == "survival" else float("nan")
        record = layer_record(
            layer, weighted, chosen, wanted, resampled=kept, diffused=kept, free=share_in(extra)
        )
        return weighted, record

    def end_frame(self, particles: ParticleSet, space: SearchSpace, settings: BehaviourSettings) -> Estimate:
        """The particle with the highest weight (section 3.3), or the weighted mean."""
        return estimate(particles, settings.estimate)


def _selected(eligible: Array, settings: BehaviourSettings) -> Annealed:
    """Normalised weights at the peakedness that the settings select."""
    if settings.selection == "survival":
        return anneal(eligible, settings.survival)
    weights = normalised(eligible, 1.0)
    return Annealed(1.0, survival_rate(weights), weights)
