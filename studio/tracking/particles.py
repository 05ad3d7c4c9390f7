"""What every tracker does with particles: start, predict, weigh and estimate."""

import numpy as np
from numpy.typing import NDArray

from studio.errors import RunError
from studio.tracking.tracker import Carried, Estimate, FrameProblem, ParticleSet, SearchSpace

Array = NDArray[np.float64]


def unweighted(poses: Array, extra: dict[str, Array] | None = None) -> ParticleSet:
    """A set (Eq. 5) in which all particles of poses (N, D) weigh the same."""
    return ParticleSet(poses, np.full(len(poses), -np.log(len(poses))), extra=extra or {})


def uniform_poses(rng: np.random.Generator, count: int, space: SearchSpace) -> Array:
    """(count, D) poses spread evenly between the limits; raises RunError where a parameter has none."""
    bounded = np.isfinite(space.lower) & np.isfinite(space.upper)
    if not bounded.all():
        name = space.names[int(np.argmin(bounded))]
        raise RunError(
            f"A search without a start pose begins between the limits, but '{name}' has none.",
            "Give a start pose, or give every parameter of the body finite limits.",
        )
    return space.lower + rng.random((count, len(space.names))) * (space.upper - space.lower)


def expected(poses: Array, previous: Carried, dynamics: str) -> Array:
    """Poses (N, D) moved to where the next frame is expected: f of Eq. 10.

    dynamics : "none" leaves them; "constant_velocity" adds the last movement of the reported pose, once there
    is one.
    """
    if dynamics == "none" or previous.estimate is None or previous.previous_estimate is None:
        return poses
    return poses + (previous.estimate - previous.previous_estimate)


def weigh(problem: FrameProblem, poses: Array, limits: str) -> tuple[Array, Array]:
    """(N,) raw log w, and (N,) the same with -inf for particles that the body cannot take.

    Where the body can take none of them, or limits are ignored, all may survive. Raises RunError for a weight
    that is not finite.
    """
    raw = np.asarray(problem.weigh(poses), dtype=np.float64)
    if raw.shape != (len(poses),) or not np.isfinite(raw).all():
        wrong = raw[~np.isfinite(raw)]
        raise RunError(
            f"The weighting gave {wrong[0] if wrong.size else raw.shape} for a pose.",
            "Check the calibration and the start pose, or report this as a fault of the weighting.",
        )
    if limits == "ignore":
        return raw, raw
    possible = problem.feasible(poses)
    return raw, np.where(possible, raw, -np.inf) if possible.any() else raw


def weighted_mean(particles: ParticleSet) -> Array:
    """(D,) Σ π s (Eq. 1, 8)."""
    return np.exp(particles.log_weights) @ particles.poses


def weighted_variance(particles: ParticleSet) -> Array:
    """(D,) Σ π (s - mean)²: what resampling would leave, without the noise of a draw."""
    return np.exp(particles.log_weights) @ (particles.poses - weighted_mean(particles)) ** 2


def estimate(particles: ParticleSet, kind: str) -> Estimate:
    """The reported pose of a weighted set: its "mean" (Eq. 8) or its "mode" (Eq. 2)."""
    best = int(np.argmax(particles.log_weights))
    mean, mode = weighted_mean(particles), particles.poses[best]
    pose = mean if kind == "mean" else mode
    return Estimate(pose, mean, mode, float(particles.raw_log_weights[best]))
