"""Smoothing of found poses: the Rauch-Tung-Striebel smoother with a constant-acceleration model.

Every parameter is a point whose jerk is white noise, seen with noise once a frame (H. E. Rauch, F. Tung and C. T.
Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3(8), 1965). Only the
ratio of the two noises matters, and is given as a frequency: in the middle of a long track the smoother is the
zero-phase low-pass filter 1 / (1 + (f / f_c)⁶), so f_c is where movement is halved, in Hz, the same for angles and
lengths. Time is counted in frames and noise in units of a sure measurement's, so all parameters share one recursion of
covariances.

A measurement's variance grows as its confidence falls; lost frames and those below a least confidence are no
measurements. Gaps are filled while they are short, with uncertainty that grows towards its middle; longer
gaps stay gaps, and the track is smoothed in stretches on both sides of them. Nothing is smoothed across a jump of an
angle either: there the pose is written by other angles, or the body was found again.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import SettingsError
from studio.foundations.knobs import knob
from studio.search.trackers.tracker import LOST, NO_EVIDENCE, SearchSpace

IntArray = NDArray[np.int64]
Flags = NDArray[np.bool_]

JUMP = 1.5
"""An angle that changes by more than this (radians) from one measured frame to the next has jumped."""
DIFFUSE = 1e7
"""Variance of where a stretch begins, in units of a measurement's: unknown."""
LEAST_TRUST = 0.1
"""A confidence below this share of the track's median counts as this share."""

TRANSITION = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
JERK = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
"""Transition of place, velocity and acceleration from frame to frame, and the covariance of white jerk of unit
density."""


@dataclass(frozen=True, slots=True)
class SmoothingSettings:
    """The knobs of smoothing."""

    title = "Smoothing"

    smoothing_frequency: float = knob(
        6.0, 0.5, 60.0, 0.5, label="smoothed above", unit="Hz",
        help="Movement at this frequency is halved, faster is removed, slower stays; 6 Hz suits walking.",
    )  # fmt: skip
    longest_gap: float = knob(
        0.25, 0.0, 10.0, 0.05, unit="s", help="Gaps up to this long are filled, longer ones stay gaps."
    )
    least_confidence: float = knob(
        0.5, 0.0, 1.0, 0.05,
        help="Frames whose silhouettes agree less than this are no measurements; unknown agreement counts.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Smoothed:
    """A smoothed track. frames : (K,), gaps left out. poses : (K, D). spread : (K, D) standard deviation of every
    parameter, rad and mm. filled : (K,) frames without a measurement of their own. left_out : frames that were
    measured but rejected and lie in gaps too long to fill. rests : (D,) root mean square of the removed residual.
    """

    frames: IntArray
    poses: Array
    spread: Array
    filled: Flags
    left_out: IntArray
    rests: Array


def smooth(
    frames: IntArray,
    poses: Array,
    confidence: Array,
    states: tuple[str, ...],
    space: SearchSpace,
    angles: Flags,
    fps: float,
    settings: SmoothingSettings,
) -> Smoothed:
    """Smooth a track; see `Smoothed`.

    frames : (K,) ascending. poses : (K, D). confidence : (K,) 0 to 1 or NaN. states : K. angles : (D,) which
    parameters are angles. Raises SettingsError where no frame is trusted.
    """
    believed = _trusted(confidence, states, settings)
    if not believed.any():
        raise SettingsError(
            f"None of the track's {len(frames)} frames is confident enough to be smoothed.",
            "Lower the least confidence, or track the run again.",
        )
    numbers, rows = frames[believed], poses[believed].copy()
    free = angles & ~np.isfinite(space.upper - space.lower)
    rows[:, free] = np.unwrap(rows[:, free], axis=0)
    noise = _noise(confidence[believed])
    parts = [
        (numbers[part], *_smoothed_stretch(numbers[part], rows[part], noise[part], fps, settings))
        for part in _stretches(numbers, rows, angles, fps, settings)
    ]
    whole = np.concatenate([np.arange(int(part[0][0]), int(part[0][-1]) + 1) for part in parts])
    placed = np.clip(np.concatenate([part[1] for part in parts]), space.lower, space.upper)
    measured = np.isin(whole, numbers)
    rests = np.sqrt(np.mean((placed[measured] - rows) ** 2, axis=0))
    # The error of a smoothed place is smaller than a measurement's by the ratio of their deviations.
    spread = np.sqrt(np.concatenate([part[2] for part in parts]))[:, None] * rests
    return Smoothed(whole, placed, spread, ~measured, np.setdiff1d(frames, whole), rests)


def rms_second_difference(points: Array) -> float:
    """Root mean square length (mm a frame²) of the second difference in time of points (F, M, 3): how much they jitter,
    and how sharply they are accelerated. 0 for fewer than three frames.
    """
    if len(points) < 3:
        return 0.0
    squares: Array = (points[2:] - 2.0 * points[1:-1] + points[:-2]) ** 2
    lengths: Array = np.sum(squares, axis=-1)
    return float(np.sqrt(np.mean(lengths)))


def _trusted(confidence: Array, states: tuple[str, ...], settings: SmoothingSettings) -> Flags:
    lost = np.array([state in (LOST, NO_EVIDENCE) for state in states], dtype=np.bool_)
    return ~lost & ~(confidence < settings.least_confidence)


def _noise(confidence: Array) -> Array:
    """(K,) variance of each measurement in units of the usual one: 1 at the median confidence, or where unknown."""
    known = np.isfinite(confidence)
    usual = float(np.median(confidence[known])) if known.any() else 1.0
    share = np.where(known, confidence, usual) / max(usual, 1e-9)
    return 1.0 / np.maximum(share, LEAST_TRUST) ** 2


def _stretches(
    frames: IntArray, poses: Array, angles: Flags, fps: float, settings: SmoothingSettings
) -> list[slice]:
    """Rows that are smoothed together: no gap longer than may be filled, no jump (a gap that holds one stays)."""
    missing = np.diff(frames) - 1
    jumps = np.abs(np.diff(poses[:, angles], axis=0)).max(axis=1, initial=0.0) > JUMP * (missing + 1)
    breaks = np.flatnonzero((missing > settings.longest_gap * fps + 1e-9) | jumps) + 1
    edges = [0, *breaks.tolist(), len(frames)]
    return [slice(first, last) for first, last in itertools.pairwise(edges)]


def _smoothed_stretch(
    frames: IntArray, poses: Array, noise: Array, fps: float, settings: SmoothingSettings
) -> tuple[Array, Array]:
    """Places (F, D) of every frame from the first to the last, and their variances (F,) in units of a measurement's.

    frames : (K,) measured ones. noise : (K,) variances of the measurements.
    """
    density = (2.0 * math.pi * settings.smoothing_frequency / fps) ** 6
    count = int(frames[-1] - frames[0]) + 1
    row_of = np.full(count, -1)
    row_of[frames - frames[0]] = np.arange(len(frames))
    means, covariances = np.zeros((count, 3, poses.shape[1])), np.zeros((count, 3, 3))
    foreseen_means, foreseen = np.zeros_like(means), np.zeros_like(covariances)
    mean, covariance = np.zeros((3, poses.shape[1])), DIFFUSE * np.eye(3)
    mean[0] = poses[0]
    for step, row in enumerate(row_of):
        if step:
            mean = TRANSITION @ mean
            covariance = TRANSITION @ covariance @ TRANSITION.T + density * JERK
        foreseen_means[step], foreseen[step] = mean, covariance
        if row >= 0:
            gain = covariance[:, 0] / (covariance[0, 0] + noise[row])
            mean = mean + gain[:, None] * (poses[row] - mean[0])
            # Joseph's form stays symmetric and positive from a diffuse beginning on.
            kept = np.eye(3)
            kept[:, 0] -= gain
            covariance = kept @ covariance @ kept.T + noise[row] * np.outer(gain, gain)
        means[step], covariances[step] = mean, covariance
    for step in range(count - 2, -1, -1):
        later: Array = foreseen[step + 1]
        moved: Array = TRANSITION @ covariances[step]
        back = np.linalg.solve(later, moved).T
        means[step] += back @ (means[step + 1] - foreseen_means[step + 1])
        covariances[step] += back @ (covariances[step + 1] - foreseen[step + 1]) @ back.T
    return means[:, 0], np.maximum(covariances[:, 0, 0], 0.0)
