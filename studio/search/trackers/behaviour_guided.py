"""Particle filter guided by a learnt behaviour model (Caillette, Galata & Howard 2007, sections 3.3 and 5).

Idea: a particle filter whose particles have a motion state. Each carries the state of a probabilistic
automaton over clusters of elementary movements. A frame draws survivors by weight (SIR); each goes to a cluster that
the automaton, its pose and its movement make likely (Eq. 3); in a new cluster its joint angles are resampled
from it, in the same one they move on with the cluster's own uncertainty (Eq. 4). The root's six parameters
get Gaussian noise. Every particle is weighed once, and the best of them is the pose. What particles carry:
`guided_particles`; those that no model moves, beyond the paper: `model_free`.

Weights: the paper normalises w as it is (section 6.4). Most weights are no likelihoods in the strict sense and nearly
flat as they are, so by default w^β is used, with β such that a chosen share of the particles survives the next draw
(Deutscher & Reid 2005, Eq. 3 and 12); β stands in the record.

Without a model in the search space the tracker is a particle filter with noise of σ0; runs are not made so
(`runs.behaviour_models`).
"""

import math

import numpy as np

from studio.foundations.arrays import Array
from studio.search.trackers.annealing import Annealed, anneal, at_exponent
from studio.search.trackers.guided_particles import foresee, spread_over_clusters
from studio.search.trackers.guided_start import guided_set, without_past
from studio.search.trackers.model_free import compare_kinds
from studio.search.trackers.one_layer_filter import OneLayerFilter
from studio.search.trackers.paper_presets import CAILLETTE
from studio.search.trackers.particles import first_set, uniform_poses, unweighted
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.resampling import draw
from studio.search.trackers.settings import BehaviourSettings
from studio.search.trackers.tracker import Arrays, FilterState, ParticleSet, SearchSpace


class BehaviourGuided(OneLayerFilter[BehaviourSettings]):
    """Particles moved by the model and weighed once."""

    name = "behaviour"
    label = "Guided by behaviour"
    settings_type = BehaviourSettings
    needs_behaviour = True
    presets = (CAILLETTE,)

    def begin_frame(
        self, numbers: RandomNumbers, previous: FilterState, space: SearchSpace, settings: BehaviourSettings
    ) -> ParticleSet:
        """Survivors of the last frame, drawn by weight and moved by the model.

        Without a set to start from, roots lie anywhere between the limits, and the angles in all clusters alike.
        """
        last, count = previous.particles, settings.particles
        if last is None:
            anywhere = uniform_poses(numbers, count, space)
            if space.behaviour is None:
                return unweighted(anywhere)
            return spread_over_clusters(numbers.in_turn, space, count, anywhere, np.zeros_like(space.sigma))
        drawn = draw(numbers, np.exp(last.log_weights), count, settings.resampling)
        if space.behaviour is not None:
            return guided_set(numbers, previous, drawn, space, settings)
        return first_set(numbers, last.poses[drawn], space, settings)

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: BehaviourSettings) -> Array:
        """(S, D) means of the clusters that hold enough particles, at their mean root (section 6.3)."""
        return foresee(particles, space, settings.expected_support, settings.expected_most)

    def selected(
        self, log_weights: Array, extra: Arrays, settings: BehaviourSettings
    ) -> tuple[Annealed, float, Arrays]:
        """The weights at the peakedness that the settings select."""
        extra = without_past(compare_kinds(extra, log_weights))
        if settings.selection == "survival":
            return anneal(log_weights, settings.survival), settings.survival, extra
        return at_exponent(log_weights, 1.0), math.nan, extra
