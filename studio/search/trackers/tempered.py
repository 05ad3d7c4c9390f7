"""Tempered sequential Monte Carlo: a frame's last cloud is a sample of the posterior that the tracker states.

The posterior of a frame's pose x is p(x) w(x)^T: the prior p of `frame_prior`, the likelihood w, and its scale T, which
the knob `likelihood_scale` states, because neighbouring pixels do not err independently and w counts each of them. A
ladder of exponents 0 = t_0 < t_1 < … ≤ T leads there (Neal 2001; Del Moral, Doucet & Jasra 2006, section 3.3):

1. The first layer's set is drawn from the prior.
2. A layer raises the exponent by the δ with which a chosen share of the particles stays effective. All weigh the same
   before, so that the conditional effective sample size (Zhou, Johansen & Aston 2016, Eq. 16) is the survival
   diagnostic of Deutscher & Reid (2005, Eq. 11), and δ is the β of Eq. 12. Survivors are drawn by w^δ. The mean of
   w^δ is a factor of the evidence, ∫ p(x) w(x)^t dx.
3. Where the annealed filter adds noise, each survivor is proposed one move and takes it with the probability of
   Metropolis and Hastings, so that the set remains a sample of p w^t; the next layer weighs what was proposed. A move
   is one of three kinds, by chance alone:
   - a step of the whole body, mean + √(1 - s²) (x - mean) + s times noise with the set's mean and covariance. It is
     reversible for the normal density that has these, so that a posterior which is nearly normal takes even s = 1,
     however many parameters there are (Kantas, Beskos & Jasra 2014, section 4.2). Of a normal posterior of 34
     parameters it left means 0.12 deviations off after 50 layers of 400, a walk without the pull to the mean 0.5;
   - a walk of one limb with the set's covariance;
   - an exchange of neighbouring limbs between two particles (cut as in Eq. 19), both or neither.
   s and the walk's width grow and shrink by the share that was taken in the layer before. Mean and covariance are those
   of the weighted set, in which fewer particles stand twice than among the survivors; that they are of the set itself
   shifts results by some parameters / particles.
4. Layers that are left at the end of the ladder move the set only. A last layer that has not reached the end takes the
   rest of the way as weights.

On a card all of this stays there (`device_tempered`), with limbs kept apart alone left to the processor.

A record's `beta` is δ, so that weights, effective particles and survivors read as those of an annealed layer; its
`temper` is t, its `log_evidence` that of t + δ, its `acceptance` the share of proposals taken into its set.

References: R. M. Neal, Annealed importance sampling, Statistics and Computing 11 (2001). P. Del Moral, A. Doucet,
A. Jasra, Sequential Monte Carlo samplers, JRSS B 68 (2006). Y. Zhou, A. M. Johansen, J. A. D. Aston, Toward automatic
model comparison, JCGS 25 (2016). N. Kantas, A. Beskos, A. Jasra, Sequential Monte Carlo methods for high-dimensional
inverse problems, SIAM/ASA JUQ 2 (2014). G. O. Roberts, J. S. Rosenthal, Optimal scaling, Statistical Science 16 (2001).
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from scipy.special import logsumexp

from studio.foundations.arrays import Array
from studio.search.trackers.annealing import Annealed, anneal, at_exponent
from studio.search.trackers.constraints import possible
from studio.search.trackers.counted_numbers import OF_CUTS, OF_KINDS, OF_MOVES
from studio.search.trackers.crossover import limb_places
from studio.search.trackers.diffusion import Spread
from studio.search.trackers.frame_prior import FramePrior
from studio.search.trackers.layer_record import layer_record
from studio.search.trackers.particle_kernels import children, moments, root_of, standardised
from studio.search.trackers.particles import (
    ParticleFilter,
    checked_values,
    unweighted,
    weigh,
    weighted_variance,
)
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.resampling import draw
from studio.search.trackers.settings import SAMPLED, TemperedSettings
from studio.search.trackers.tracker import (
    NO_PARENT,
    Arrays,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
)

BEFORE, BEFORE_RAW, BEFORE_ELIGIBLE, BEFORE_PRIOR = "before", "before_raw", "before_eligible", "before_prior"
KIND, PARTNER, BACK, LADDER = "move", "partner", "back", "ladder"
"""Names of a set's arrays: the poses (N, D) that its moves lead from, their log w (N,) twice, as of `weigh`, and logs
of their prior (N,); of each move its kind (N,), with whom limbs are exchanged (N,), else the particle itself, and how
much likelier the move is than the one back (N,), in logs of densities; `_Ladder`."""
WHOLE, ONE_LIMB, EXCHANGE = 0, 1, 2
BEST_SHARE, LEAST_CHANGE, MOST_CHANGE = 0.25, 0.5, 2.0
"""Share of moves that is best taken (Roberts & Rosenthal 2001), and how much steps may change from layer to layer."""
FIRST_STEP, WIDEST_WALK = 0.5, 2.38
"""s at first; width of a walk in one parameter, in standard deviations, divided by the root of how many it is in."""
PARTICLES_A_LAYER = 20
"""Particles for each layer where a number of evaluations is parted into both."""


class _Ladder(NamedTuple):
    """temper : t of the set that moves are proposed for. log_evidence : that of t. step : s. walk : width of a limb's
    walk, times the widest.
    """

    temper: float
    log_evidence: float
    step: float
    walk: float


class _Moved(NamedTuple):
    """A layer's set (N, D). raw, eligible : (N,) as of `weigh`. prior : (N,) logs of its density. taken : share of its
    moves that were taken; of_steps, of_walks : the same of two kinds; NaN where none were proposed.
    """

    poses: Array
    raw: Array
    eligible: Array
    prior: Array
    taken: float = np.nan
    of_steps: float = np.nan
    of_walks: float = np.nan


class TemperedFilter(ParticleFilter[TemperedSettings]):
    """One frame on a ladder of exponents; evaluations = layers × particles."""

    name = "tempered"
    label = "Tempered sequential Monte Carlo"
    settings_type = TemperedSettings
    size_knobs = (("layers", "particles"),)
    presets = SAMPLED
    device_module = "studio.search.trackers.device_tempered"

    def layer_count(self, settings: TemperedSettings) -> int:
        return settings.layers

    def evaluation_knobs(self, evaluations: int, layers: int) -> dict[str, int]:
        """PARTICLES_A_LAYER times as many particles as layers."""
        count = max(2, round(np.sqrt(evaluations / PARTICLES_A_LAYER)))
        return {"layers": count, "particles": max(2, round(evaluations / count))}

    def least_evaluations(self, layers: int) -> int:
        """Two particles in two layers."""
        return 4

    def fits_device(self, layer: int, space: SearchSpace, settings: TemperedSettings, extra: Arrays) -> bool:
        """Whether joint limits alone say which poses the body can take, and did where the set's moves lead from."""
        held = extra.get(BEFORE_ELIGIBLE, np.zeros(0))
        return not settings.limbs_apart and bool(np.isfinite(held).all())

    def begin_frame(
        self, numbers: RandomNumbers, previous: FilterState, space: SearchSpace, settings: TemperedSettings
    ) -> ParticleSet:
        prior = FramePrior.of_frame(
            previous,
            space,
            scale=settings.diffusion_scale,
            dynamics=settings.dynamics,
            bounded=_is_bounded(settings),
        )
        return unweighted(prior.draw(numbers, settings.particles), prior.arrays)

    def step_layer(
        self,
        numbers: RandomNumbers,
        particles: ParticleSet,
        layer: int,
        problem: FrameLikelihood,
        space: SearchSpace,
        settings: TemperedSettings,
    ) -> tuple[ParticleSet, LayerRecord]:
        """Take or refuse the proposed moves, climb the ladder, draw, and propose the next ones."""
        prior = FramePrior.of_arrays(particles.extra, space, bounded=_is_bounded(settings))
        if LADDER in particles.extra:
            ladder = _Ladder(*map(float, particles.extra[LADDER]))
            moved = _take_moves(numbers, particles, problem, ladder.temper, prior, settings)
            ladder = _adapt_steps(ladder, moved)
        else:
            ladder = _Ladder(0.0, 0.0, FIRST_STEP, 1.0)
            raw, eligible = weigh(problem, particles.poses, settings)
            moved = _Moved(particles.poses, raw, eligible, prior.log_density(particles.poses))
        is_last = layer == settings.layers - 1
        annealed, wanted = _raise_exponent(moved.eligible, ladder.temper, settings, is_last=is_last)
        weighted = ParticleSet(moved.poses, annealed.log_weights, moved.raw)
        climbed = _climb(ladder, annealed.beta, moved.eligible)
        if is_last:
            following, first = weighted, None
            kept = diffused = weighted_variance(weighted)
        else:
            first = np.arange(len(moved.poses))
            if annealed.beta > 0.0:
                first = draw(numbers, np.exp(annealed.log_weights), len(first), settings.resampling)
            survivors = _Moved(
                moved.poses[first], moved.raw[first], moved.eligible[first], moved.prior[first]
            )
            following = _propose_moves(numbers, survivors, weighted, climbed, space, settings)
            following.extra.update(prior.arrays)
            kept, diffused = moments(survivors.poses).variance, moments(following.poses).variance
        record = layer_record(
            layer,
            weighted,
            annealed,
            wanted,
            resampled=kept,
            diffused=diffused,
            parents=None if first is None else np.stack([first, np.full(len(first), NO_PARENT)]),
        )
        sampled = {"temper": ladder.temper, "acceptance": moved.taken, "log_evidence": climbed.log_evidence}
        return following, dataclasses.replace(record, **sampled)


def _is_bounded(settings: TemperedSettings) -> bool:
    return settings.constraints != "ignore"


def _raise_exponent(
    eligible: Array, temper: float, settings: TemperedSettings, *, is_last: bool
) -> tuple[Annealed, float]:
    """Weights w^δ of a set at t, and the share that was to survive, NaN where the ladder's end decides; the last layer
    takes what is left.
    """
    left = max(settings.likelihood_scale - temper, 0.0)
    if not is_last and left > 0.0:
        step = anneal(eligible, settings.survival)
        if step.beta < left:
            return step, settings.survival
    return at_exponent(eligible, left), np.nan


def _climb(ladder: _Ladder, delta: float, eligible: Array) -> _Ladder:
    """The ladder at t + δ, with the evidence that log Σ w^δ / N adds."""
    if delta == 0.0:
        return ladder
    gained = float(logsumexp(delta * eligible)) - math.log(len(eligible))
    return ladder._replace(temper=ladder.temper + delta, log_evidence=ladder.log_evidence + gained)


def _take_moves(
    numbers: RandomNumbers,
    particles: ParticleSet,
    problem: FrameLikelihood,
    temper: float,
    prior: FramePrior,
    settings: TemperedSettings,
) -> _Moved:
    """The set after its proposals, which `particles` are, were weighed and taken or refused.

    Where the body can take no pose of either, all may be taken.
    """
    proposed, extra = particles.poses, particles.extra
    raw = checked_values(problem.log_likelihood(proposed), len(proposed))
    allowed = possible(problem, proposed, settings)
    if not allowed.any() and not possible(problem, extra[BEFORE], settings).any():
        allowed[:] = True
    eligible = np.where(allowed, raw, -np.inf)
    densities = prior.log_density(proposed)
    partner, partnered = extra[PARTNER], extra[KIND] == EXCHANGE
    with np.errstate(invalid="ignore"):
        change = temper * (eligible - extra[BEFORE_ELIGIBLE])
        change += densities - extra[BEFORE_PRIOR] - extra[BACK]
        change = np.where(partnered, change + change[partner], change)
        shares = numbers.shares(len(proposed), 1, OF_MOVES)[:, 0]
        taken = np.log(np.where(partnered, np.minimum(shares, shares[partner]), shares)) < change
    kinds = [taken[extra[KIND] == kind] for kind in (WHOLE, ONE_LIMB)]
    return _Moved(
        np.where(taken[:, None], proposed, extra[BEFORE]),
        np.where(taken, raw, extra[BEFORE_RAW]),
        np.where(taken, eligible, extra[BEFORE_ELIGIBLE]),
        np.where(taken, densities, extra[BEFORE_PRIOR]),
        float(taken.mean()),
        *(float(one.mean()) if len(one) else np.nan for one in kinds),
    )


def _adapt_steps(ladder: _Ladder, moved: _Moved) -> _Ladder:
    """Wider steps where more were taken than is best, narrower ones where fewer."""
    step, walk = (
        1.0 if np.isnan(share) else float(np.clip(share / BEST_SHARE, LEAST_CHANGE, MOST_CHANGE))
        for share in (moved.of_steps, moved.of_walks)
    )
    return ladder._replace(step=min(ladder.step * step, 1.0), walk=ladder.walk * walk)


def _propose_moves(
    numbers: RandomNumbers,
    survivors: _Moved,
    weighted: ParticleSet,
    ladder: _Ladder,
    space: SearchSpace,
    settings: TemperedSettings,
) -> ParticleSet:
    """A move of each survivor of a weighted set, with what is needed to take or refuse it."""
    poses, places = survivors.poses, limb_places(space)
    shares = numbers.shares(len(poses), 3, OF_KINDS)
    order = np.argsort(shares[:, 0], kind="stable")
    pairs = order[: 2 * int(settings.crossover * len(poses) / 2.0)].reshape(-1, 2)
    partner = np.arange(len(poses))
    partner[pairs[:, 0]], partner[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    kind = np.where(shares[:, 1] < settings.limb_moves, ONE_LIMB, WHOLE)
    kind[pairs.ravel()] = EXCHANGE
    cuts = numbers.shares(len(poses), 2, OF_CUTS)
    cuts[pairs[:, 1]] = cuts[pairs[:, 0]]
    proposed, _ = children(poses, poses[partner], places, kind == EXCHANGE, cuts)

    normal = _normal_of(weighted)
    noise = normal.draw(numbers) - normal.centres
    away = poses - normal.centres
    stepped = normal.centres + np.sqrt(1.0 - ladder.step * ladder.step) * away + ladder.step * noise
    limb = places == 1 + np.floor(shares[:, 2:] * places[-1]).astype(np.int64)
    walked = poses + limb * noise * (WIDEST_WALK * ladder.walk / np.sqrt(limb.sum(axis=1, keepdims=True)))
    proposed = np.where((kind == WHOLE)[:, None], stepped, proposed)
    proposed = np.where((kind == ONE_LIMB)[:, None], walked, proposed)
    back = np.where(kind == WHOLE, _log_normal(proposed, normal) - _log_normal(poses, normal), 0.0)
    return unweighted(
        proposed,
        {
            BEFORE: poses,
            BEFORE_RAW: survivors.raw,
            BEFORE_ELIGIBLE: survivors.eligible,
            BEFORE_PRIOR: survivors.prior,
            KIND: kind,
            PARTNER: partner,
            BACK: back,
            LADDER: np.array(ladder),
        },
    )


def _normal_of(weighted: ParticleSet) -> Spread:
    """Noise about the mean of a weighted set, once a particle, with its covariance. What is equal in all particles has
    exactly none.
    """
    weights, first = np.exp(weighted.log_weights), weighted.poses[0]
    mean = weights @ weighted.poses
    # Weights sum to 1 but for rounding, of which densities of moves would take the last digit for a deviation.
    mean = np.where((weighted.poses == first).all(axis=0), first, mean)
    away = weighted.poses - mean
    deviation = np.sqrt(weights @ (away * away))
    # Scaled to unit variances first: millimetres beside radians would drown the small pivots.
    away /= np.where(deviation > 0.0, deviation, 1.0)
    return Spread(np.tile(mean, (len(away), 1)), 1.0, deviation, root_of((away.T * weights) @ away))


def _log_normal(poses: Array, normal: Spread) -> Array:
    """(N,) logs of a normal density at poses (N, D), less what is the same everywhere; directions without noise have
    no part in it.
    """
    assert normal.root is not None
    away: Array = (poses - normal.centres[0]) / np.where(normal.deviation > 0.0, normal.deviation, 1.0)
    return -0.5 * np.sum(standardised(normal.root, away) ** 2, axis=1)
