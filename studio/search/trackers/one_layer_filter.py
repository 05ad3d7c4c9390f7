"""Filters that weigh every particle once: a frame is one layer."""

from abc import abstractmethod

from studio.foundations.arrays import Array
from studio.search.trackers.annealing import Annealed
from studio.search.trackers.guided_start import constrain_set
from studio.search.trackers.layer_record import layer_record
from studio.search.trackers.model_free import share_in
from studio.search.trackers.particles import ParticleFilter, Searching, weigh, weighted_variance
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import Arrays, FrameLikelihood, LayerRecord, ParticleSet, SearchSpace


class OneLayerFilter(ParticleFilter[Searching]):
    """One frame in one layer; evaluations = particles."""

    def layer_count(self, settings: Searching) -> int:
        return 1

    def step_layer(
        self,
        numbers: RandomNumbers,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: Searching,
    ) -> tuple[ParticleSet, LayerRecord]:
        particles = constrain_set(numbers, particles, problem, space, settings)
        raw, eligible = weigh(problem, particles.poses, settings)
        chosen, wanted, extra = self.selected(eligible, particles.extra, settings)
        weighted = ParticleSet(particles.poses, chosen.log_weights, raw, extra)
        kept = weighted_variance(weighted)
        record = layer_record(
            layer, weighted, chosen, wanted, resampled=kept, diffused=kept, free=share_in(extra)
        )
        return weighted, record

    @abstractmethod
    def selected(
        self,
        log_weights: Array,
        extra: Arrays,
        settings: Searching,
    ) -> tuple[Annealed, float, Arrays]:
        """The weights that choose the survivors, the survival rate aimed at (NaN: none), and the set's arrays.

        log_weights : (N,) log w, -inf where a pose is impossible. extra : the set's arrays before it was weighed.
        """
