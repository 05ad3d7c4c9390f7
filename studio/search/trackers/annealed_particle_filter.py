"""The annealed particle filter of Deutscher & Reid (2005), sections 3 and 6.

Idea: one frame is searched in M layers. Each weighs the particles, flattens the weights by an exponent β so
that a chosen share α of them survives, draws the survivors and spreads them with less and less noise, so that
the cloud moves over local maxima towards the best pose. Two additions make the paper's improved filter:
adaptive diffusion (noise in proportion to what is still uncertain, Eq. 18) and crossover (children of two
survivors, Eq. 19).

Symbols: S_{t,m}, the set of layer m, which the paper counts M … 1 and we count 0 … M - 1 in the order they
run; π, normalised weights; β, α, D see `annealing`; P, B, σ0 see `diffusion`; γ, ε see `crossover`.

Beyond the paper, a frame's first set may be predicted by a behaviour model instead of Eq. 9 and 10 (Caillette et al.
2007; see `guided_start`). Particles carry their automaton's state from frame to frame. Within a frame, where layers
draw, cross and spread them, a particle follows its first parent; at the frame's end its state is the one that follows
from its ancestor's at the end of the last frame by the cluster of its pose and movement.

Reference: J. Deutscher, I. Reid, Articulated Body Motion Capture by Stochastic Search, IJCV 61(2), 185-205.
"""

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.annealing import anneal
from studio.search.trackers.crossover import cross
from studio.search.trackers.diffusion import (
    Spread,
    noise_about,
    planned_sigma,
    proportional_noise,
    shrunk_noise,
)
from studio.search.trackers.guided_particles import STATES, foresee, is_guided
from studio.search.trackers.guided_start import arrived, constrain_set, descended, guided_set
from studio.search.trackers.layer_plan import LayerPlan, Noise
from studio.search.trackers.layer_record import layer_record
from studio.search.trackers.model_free import compare_kinds, share_in
from studio.search.trackers.particle_kernels import Moments, moments
from studio.search.trackers.particles import (
    ParticleFilter,
    constrain_drawn,
    first_set,
    predict,
    uniform_poses,
    unweighted,
    weigh,
    weighted_variance,
)
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.resampling import draw, draw_others, equal_draw
from studio.search.trackers.settings import (
    PRESETS,
    VARIANTS,
    AnnealedSettings,
    layer_survival,
    layer_survivals,
)
from studio.search.trackers.tracker import (
    NO_PARENT,
    Arrays,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)


class AnnealedParticleFilter(ParticleFilter[AnnealedSettings]):
    """One frame in M annealing layers; evaluations = layers × particles."""

    name = "annealed"
    label = "Annealed particle filter"
    settings_type = AnnealedSettings
    size_knobs = (("layers", "particles"),)
    own_knobs = Tracker.own_knobs | {
        "survival", "survival_per_layer", "crossover", "adaptive_diffusion", "diffusion_scale", "diffusion_form",
        "diffusion_fraction", "diffusion_constant", "diffusion_covariance", "diffusion_decay", "dynamics",
    }  # fmt: skip
    variants = VARIANTS
    presets = PRESETS

    def layer_count(self, settings: AnnealedSettings) -> int:
        return settings.layers

    def evaluation_knobs(self, evaluations: int, layers: int) -> dict[str, int]:
        """`layers` layers of evaluations / layers particles."""
        return {"layers": layers, "particles": round(evaluations / max(layers, 1))}

    def least_evaluations(self, layers: int) -> int:
        """Two particles in each layer."""
        return 2 * layers

    def begin_frame(
        self, numbers: RandomNumbers, previous: FilterState, space: SearchSpace, settings: AnnealedSettings
    ) -> ParticleSet:
        """Step 1, 2 and 7: the unweighted set of the first layer, the last frame's plus B_0 (Eq. 9, 10)."""
        if previous.particles is None:
            return unweighted(uniform_poses(numbers, settings.particles, space))
        carried = _carried(numbers, previous.particles, settings)
        if is_guided(space, settings.prediction):
            return guided_set(numbers, previous, carried, space, settings)
        predicted = predict(previous.particles.poses[carried], previous, settings.dynamics)
        return first_set(numbers, predicted, space, settings)

    def step_layer(
        self,
        numbers: RandomNumbers,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: AnnealedSettings,
    ) -> tuple[ParticleSet, LayerRecord]:
        """Steps 3 to 5: weigh (Eq. 3, 6, 11, 12), draw, cross (Eq. 19) and spread (Eq. 7, 13 or 18)."""
        guided = STATES in particles.extra
        if layer == 0:
            particles = constrain_set(numbers, particles, problem, space, settings)
        raw, eligible = weigh(problem, particles.poses, settings)
        free, extra = share_in(particles.extra), compare_kinds(particles.extra, eligible)
        survival = layer_survival(settings, layer)
        annealed = anneal(eligible, survival)
        weighted = ParticleSet(particles.poses, annealed.log_weights, raw, extra)
        if layer == settings.layers - 1:
            kept = weighted_variance(weighted)
            record = layer_record(
                layer, weighted, annealed, survival, resampled=kept, diffused=kept, free=free
            )
            if guided:
                extra = arrived(numbers.in_turn, particles.poses, extra, space)
            return ParticleSet(particles.poses, annealed.log_weights, raw, extra), record
        survivors, first, second = _survivors(numbers, weighted, space, settings)
        of_survivors = moments(survivors)
        spread = _spread(survivors, of_survivors, layer, space, settings)
        poses = constrain_drawn(numbers, spread, spread.draw(numbers), survivors, problem, space, settings)
        record = layer_record(
            layer,
            weighted,
            annealed,
            survival,
            resampled=of_survivors.variance,
            diffused=moments(poses).variance,
            free=free,
            parents=np.stack([first, second]),
        )
        return unweighted(poses, descended(extra, first) if guided else extra), record

    def plan_layer(
        self, layer: int, space: SearchSpace, settings: AnnealedSettings, extra: Arrays
    ) -> LayerPlan | None:
        """The layer's α, children and noise; None where a behaviour model guides the particles."""
        if STATES in extra or is_guided(space, settings.prediction):
            return None
        survival = layer_survival(settings, layer)
        noise = _noise(layer, space, settings) if layer < settings.layers - 1 else None
        return LayerPlan(survival, noise, crossed=settings.crossover)

    def expectations(self, particles: ParticleSet, space: SearchSpace, settings: AnnealedSettings) -> Array:
        """(S, D) poses that the first layer's set expects: one unless a behaviour model guides it (`foresee`)."""
        return foresee(particles, space)


def _carried(numbers: RandomNumbers, last: ParticleSet, settings: AnnealedSettings) -> Indices:
    """(N,) indices of the particles that start this frame: all (Eq. 9), survivors drawn by π, or the mode."""
    if settings.carry == "weighted":
        return equal_draw(len(last.poses), settings.particles)
    if settings.carry == "mode":
        return np.full(settings.particles, np.argmax(last.log_weights))
    return draw(numbers, np.exp(last.log_weights), settings.particles, settings.resampling)


def _survivors(
    numbers: RandomNumbers, weighted: ParticleSet, space: SearchSpace, settings: AnnealedSettings
) -> tuple[Array, Indices, Indices]:
    """(N, D) drawn by π with replacement, some of them children of two (step 4 as section 6.2.1 amends it); (N,) the
    first parent of each, and (N,) the second, -1 where there is none.
    """
    weights, count = np.exp(weighted.log_weights), len(weighted.poses)
    parents, others = draw(numbers, weights, count, settings.resampling), draw_others(numbers, weights, count)
    first, second = weighted.poses[parents], weighted.poses[others]
    children, crossed = cross(
        numbers, first, second, space, share=settings.crossover, by=settings.crossover_by
    )
    return children, parents, np.where(crossed, others, NO_PARENT)


def _spread(
    survivors: Array, own: Moments, layer: int, space: SearchSpace, settings: AnnealedSettings
) -> Spread:
    """Survivors (N, D), whose moments these are, plus B_m: planned (Eq. 13) or by their own covariance (Eq. 18)."""
    noise = _noise(layer, space, settings)
    if noise.sigma is not None:
        return noise_about(survivors, noise.sigma)
    if settings.diffusion_form == "shrink":
        return shrunk_noise(survivors, own, settings.diffusion_fraction, settings.diffusion_covariance)
    return proportional_noise(survivors, own, settings.diffusion_constant, settings.diffusion_covariance)


def _noise(layer: int, space: SearchSpace, settings: AnnealedSettings) -> Noise:
    """B_m in numbers."""
    if not settings.adaptive_diffusion:
        survivals = layer_survivals(settings, layer + 2)
        return Noise(
            planned_sigma(space.sigma * settings.diffusion_scale, survivals, settings.diffusion_decay)
        )
    correlated = settings.diffusion_covariance == "full"
    if settings.diffusion_form == "shrink":
        fraction = settings.diffusion_fraction
        return Noise(None, fraction, float(np.sqrt(1.0 - fraction * fraction)), correlated)
    return Noise(None, float(np.sqrt(settings.diffusion_constant)), 1.0, correlated)
