"""Steps on particles that the trackers share: start, predict, weigh and estimate."""

from typing import TypeVar

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.search.trackers.constraints import Proposals, constrain, possible
from studio.search.trackers.diffusion import Spread, noise_about
from studio.search.trackers.layer_plan import LayerPlan
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.shared_knobs import SearchSettings
from studio.search.trackers.tracker import (
    Arrays,
    Estimate,
    FilterState,
    FrameLikelihood,
    LayerRecord,
    ParticleSet,
    SearchSpace,
    Tracker,
)

CAME_FROM = "came_from"
Searching = TypeVar("Searching", bound=SearchSettings)


class WeightError(RunError):
    """Poses cannot be weighed: a weight is no finite number."""


def unweighted(poses: Array, extra: Arrays | None = None) -> ParticleSet:
    """A set (Eq. 5) in which all particles of poses (N, D) weigh the same."""
    return ParticleSet(poses, np.full(len(poses), -np.log(len(poses))), extra=extra or {})


def uniform_poses(numbers: RandomNumbers, count: int, space: SearchSpace) -> Array:
    """(count, D) poses spread evenly between the limits; raises RunError where a parameter has none."""
    bounded = np.isfinite(space.lower) & np.isfinite(space.upper)
    if not bounded.all():
        name = space.names[int(np.argmin(bounded))]
        raise RunError(
            f"A search without a start pose samples between the limits, but '{name}' has none.",
            "Give a start pose, or give every parameter of the body finite limits.",
        )
    return space.lower + numbers.shares(count, len(space.names)) * (space.upper - space.lower)


def predict(poses: Array, previous: FilterState, dynamics: str) -> Array:
    """Predict poses (N, D) for the next frame: f of Eq. 10.

    dynamics : "none" leaves them; "constant_velocity" adds the last movement of the reported pose, once there
    is one.
    """
    if dynamics == "none" or previous.estimate is None or previous.previous_estimate is None:
        return poses
    return poses + (previous.estimate - previous.previous_estimate)


def weigh(problem: FrameLikelihood, poses: Array, rules: SearchSettings) -> tuple[Array, Array]:
    """(N,) raw log w, and (N,) the same with -inf for particles that the body cannot take.

    Where the body can take none of them, or constraints are ignored, all may survive. Raises WeightError for a
    weight that is not finite.
    """
    raw = checked_values(problem.log_likelihood(poses), len(poses))
    if rules.constraints == "ignore":
        return raw, raw
    taken = possible(problem, poses, rules)
    return raw, np.where(taken, raw, -np.inf) if taken.any() else raw


def checked_values(values: Array, count: int) -> Array:
    """A likelihood's values for `count` poses as float64; raises WeightError unless there are `count` finite
    numbers."""
    raw = np.asarray(values, dtype=np.float64)
    if raw.shape != (count,) or not np.isfinite(raw).all():
        wrong = raw[~np.isfinite(raw)]
        raise WeightError(
            f"The likelihood gave {wrong[0] if wrong.size else raw.shape} for a pose.",
            "Check the calibration and the start pose, or report this as a fault of the likelihood.",
        )
    return raw


def first_set(
    numbers: RandomNumbers, predicted: Array, space: SearchSpace, rules: SearchSettings
) -> ParticleSet:
    """The unweighted set that a filter's frame begins with: predicted poses (N, D) plus B_0 (Eq. 9, 10).

    Whether limbs are apart is known only with the frame's problem: with "redraw" the poses that the particles
    came from are kept in the set, for `constrain_first`.
    """
    drawn = noise_about(predicted, space.sigma * rules.diffusion_scale).draw(numbers)
    if rules.constraints == "clamp":
        drawn = np.clip(drawn, space.lower, space.upper)
    came_from = {CAME_FROM: predicted} if rules.constraints == "redraw" else {}
    return unweighted(drawn, came_from)


def constrain_first(
    numbers: RandomNumbers,
    particles: ParticleSet,
    problem: FrameLikelihood,
    space: SearchSpace,
    rules: SearchSettings,
) -> ParticleSet:
    """A frame's first set with its impossible particles redrawn; unchanged where it does not keep their origins.

    numbers : of the first layer.
    """
    if CAME_FROM not in particles.extra:
        return particles
    extra = {name: value for name, value in particles.extra.items() if name != CAME_FROM}
    spread = noise_about(particles.extra[CAME_FROM], space.sigma * rules.diffusion_scale)
    first = constrain_drawn(numbers.beginning, spread, particles.poses, spread.centres, problem, space, rules)
    return ParticleSet(first, particles.log_weights, particles.raw_log_weights, extra)


def constrain_drawn(
    numbers: RandomNumbers,
    spread: Spread,
    drawn: Array,
    came_from: Array,
    problem: FrameLikelihood,
    space: SearchSpace,
    rules: SearchSettings,
) -> Array:
    """(N, D) poses `drawn` from a spread, with the constraints kept."""
    done = constrain(
        problem,
        space,
        rules,
        Proposals.at(drawn),
        came_from,
        lambda rows, attempt: Proposals.at(spread.draw_again(numbers, rows, attempt)),
    )
    return done.poses


def weighted_mean(particles: ParticleSet) -> Array:
    """(D,) Σ π s (Eq. 1, 8)."""
    return np.exp(particles.log_weights) @ particles.poses


def weighted_variance(particles: ParticleSet) -> Array:
    """(D,) Σ π (s - mean)²: the expected variance after resampling."""
    return np.exp(particles.log_weights) @ (particles.poses - weighted_mean(particles)) ** 2


def heaviest(particles: ParticleSet) -> int:
    """Number of the particle that weighs most; among equal ones, as in a sample of a posterior, by the likelihood."""
    most = particles.log_weights == np.max(particles.log_weights)
    return int(np.argmax(np.where(most, particles.raw_log_weights, -np.inf)))


def estimate(particles: ParticleSet, kind: str) -> Estimate:
    """The reported pose of a weighted set: its "mean" (Eq. 8) or its "mode" (Eq. 2)."""
    best = heaviest(particles)
    mean, mode = weighted_mean(particles), particles.poses[best]
    pose = mean if kind == "mean" else mode
    return Estimate(pose, mean, mode, float(particles.raw_log_weights[best]))


class ParticleFilter(Tracker[Searching]):
    """A tracker that reports its last layer's weighted set."""

    device_module = "studio.search.trackers.device_search"

    def plan_layer(
        self, layer: int, space: SearchSpace, settings: Searching, extra: Arrays
    ) -> LayerPlan | None:
        """What `step_layer` does in numbers, so that a card can do it; None where no plan says it.

        extra : the set's arrays.
        """
        return None

    def kept_of_layer(self, extra: Arrays, record: LayerRecord, settings: Searching) -> Arrays:
        """The set's arrays after a layer that a card did."""
        return extra

    def fits_device(self, layer: int, space: SearchSpace, settings: Searching, extra: Arrays) -> bool:
        """Whether there is a plan of the layer, and no pose has to be drawn again."""
        if settings.limbs_apart or settings.constraints not in ("clamp", "ignore"):
            return False
        return self.plan_layer(layer, space, settings, extra) is not None

    def end_frame(self, particles: ParticleSet, space: SearchSpace, settings: Searching) -> Estimate:
        """The weighted mean (Eq. 1, 8) or the mode (Eq. 2)."""
        return estimate(particles, settings.estimate)
