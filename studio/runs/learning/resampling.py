"""Recordings at another frame rate: smooth curves through the recorded frames."""

import numpy as np
import scipy

from studio.body.model import BodyModel
from studio.foundations.arrays import Array

LONGEST_GAP_S = 0.25


def frame_times(seconds: float, fps: float) -> Array:
    """(F,) times of the frames at `fps` from 0 to `seconds`."""
    return np.arange(int(np.floor(seconds * fps + 1e-6)) + 1) / fps


def points_at(times: Array, points: Array, new_times: Array) -> Array:
    """(W, M, 3) points (F, M, 3) at the times `new_times` (W,) seconds, on cubic splines; times (F,) rising.

    A point that is missing (NaN) for longer than LONGEST_GAP_S is missing in that time.
    """
    resampled = np.full((len(new_times), *points.shape[1:]), np.nan)
    for marker in range(points.shape[1]):
        seen = np.isfinite(points[:, marker]).all(axis=1)
        if seen.sum() < 4:
            continue
        known = times[seen]
        after = np.clip(np.searchsorted(known, new_times - 1e-9), 0, len(known) - 1)
        before = np.clip(after - 1, 0, len(known) - 1)
        inside = (new_times >= known[0] - 1e-9) & (new_times <= known[-1] + 1e-9)
        near = inside & (
            (known[after] - known[before] <= LONGEST_GAP_S) | (np.abs(known[after] - new_times) < 1e-6)
        )
        resampled[near, marker] = scipy.interpolate.CubicSpline(known, points[seen, marker])(new_times[near])
    return resampled


def poses_at(body: BodyModel, times: Array, poses: Array, new_times: Array) -> Array:
    """(W, D) poses (F, D) at the times `new_times` on cubic splines, turns unwound, within the body's limits."""
    unbounded = body.angles & ~body.bounded_angles
    steady = np.where(unbounded, np.unwrap(poses, axis=0), poses)
    resampled = (
        scipy.interpolate.CubicSpline(times, steady)(new_times)
        if len(times) > 1
        else np.repeat(steady, len(new_times), axis=0)
    )
    # A tracked pose may lie outside the limits: only the curve's overshoot is clamped.
    return clamped(body, steady, resampled)


def clamped(body: BodyModel, allowed: Array, poses: Array) -> Array:
    """The poses (G, D) clamped to the body's limits, widened where `allowed` (F, D) goes beyond them."""
    lower, upper = np.minimum(body.lower, allowed.min(axis=0)), np.maximum(body.upper, allowed.max(axis=0))
    return np.clip(poses, lower, upper)
