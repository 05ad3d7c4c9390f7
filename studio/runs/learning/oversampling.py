"""Oversampling of training material: further performances of a recording, each smoothed by several amounts.

Caillette et al. 2007, section 7.1: three repetitions of each exercise, oversampled with varied smoothing, made 13 000
frames of training. Further performances are made from recorded ones: tempo and angles
change slowly by a little.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.knobs import new_run_knob
from studio.runs.learning.resampling import clamped, poses_at

REACH = 4.0  # standard deviations of the smoothing that count
# Noise smoothed with a standard deviation of s swings about once in PERIODS * s.
PERIODS = 2.0 * np.pi * np.sqrt(2.0)


def smooth_noise(rng: np.random.Generator, frames: int, width: int, fps: float, period_s: float) -> Array:
    """(frames, width) normal noise of mean 0 and standard deviation 1 that swings about once in `period_s` seconds."""
    spread = max(period_s * fps / PERIODS, 1e-3)
    margin = int(np.ceil(REACH * spread))
    white = rng.standard_normal((frames + 2 * margin, width))
    smooth = scipy.ndimage.gaussian_filter1d(white, spread, axis=0, truncate=REACH)[margin : margin + frames]
    steps = np.arange(-margin, margin + 1)
    kernel = np.exp(-0.5 * (steps / spread) ** 2)
    return smooth / np.sqrt(np.sum((kernel / kernel.sum()) ** 2))


def warped_times(
    rng: np.random.Generator, frames: int, seconds: float, tempo: float, period_s: float
) -> Array:
    """(frames,) rising times from 0 to `seconds` at which a performance of `frames` frames shows a movement.

    tempo : standard deviation of the logarithm of the speed, which changes about once in `period_s` seconds.
    """
    if frames < 2:
        return np.zeros(frames)
    fps = (frames - 1) / max(seconds, 1e-9)
    speed = np.exp(tempo * smooth_noise(rng, frames, 1, fps, period_s)[:, 0])
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return passed * (seconds / passed[-1])


TEMPO_PERIOD_S, ANGLE_PERIOD_S = 4.0, 3.0
# The share of an angle's change that lasts through the whole performance, and of its spread that it grows with.
LASTING, FULL_SPREAD = 0.5, np.radians(30.0)


@dataclass(frozen=True, slots=True)
class OversamplingSettings:
    """The training material made from a recording."""

    title = "Training material"

    performances: int = new_run_knob(
        1, 1, 100, 1,
        help="Performances of every recording: the original, and others with slowly varied tempo and angles.",
    )  # fmt: skip
    smoothings: int = new_run_knob(
        5, 1, 50, 1,
        help="Copies of every performance, each smoothed more and sampled a part of a frame later; "
        "the paper varied the smoothing to have enough frames.",
    )  # fmt: skip
    widest_smoothing: float = new_run_knob(
        0.08, 0.0, 1.0, 0.01, unit="s", label="widest smoothing",
        help="Standard deviation of the strongest smoothing (a Gaussian over time); the first is none.",
    )  # fmt: skip
    tempo_change: float = new_run_knob(
        0.10, 0.0, 1.0, 0.01, label="tempo change",
        help="How much faster or slower other performances are, a share of the tempo (standard deviation).",
    )  # fmt: skip
    angle_change: float = new_run_knob(
        4.0, 0.0, 45.0, 0.5, unit="degrees", label="angle change",
        help="Change of the angles in other performances (standard deviation); joints that hardly move in the "
        "recording change less.",
    )  # fmt: skip


def oversampled(
    body: BodyModel, poses: Array, fps: float, settings: OversamplingSettings, rng: np.random.Generator
) -> list[Array]:
    """The training material of a recording (F, D): for every performance as many sequences as smoothings."""
    recordings: list[Array] = []
    for number in range(settings.performances):
        shown = poses if number == 0 else performed(body, poses, fps, settings, rng)
        recordings += smoothed_copies(body, shown, fps, settings)
    return recordings


def performed(
    body: BodyModel, poses: Array, fps: float, settings: OversamplingSettings, rng: np.random.Generator
) -> Array:
    """(G, D) another performance of poses (F, D), of another length, within the body's limits."""
    seconds = (len(poses) - 1) / fps
    longer = float(np.exp(0.5 * settings.tempo_change * rng.standard_normal()))
    frames = max(2, round(seconds * fps * longer) + 1)
    times = warped_times(rng, frames, seconds, settings.tempo_change, TEMPO_PERIOD_S)
    shown = poses_at(body, np.arange(len(poses)) / fps, poses, times)
    spread = np.minimum(shown.std(axis=0) / FULL_SPREAD, 1.0)
    size = np.radians(settings.angle_change) * (0.25 + 0.75 * spread)
    slow = smooth_noise(rng, frames, poses.shape[1], fps, ANGLE_PERIOD_S)
    change: Array = np.sqrt(1.0 - LASTING**2) * slow + LASTING * rng.standard_normal(int(poses.shape[1]))
    return clamped(body, shown, shown + np.where(body.angles, size * change, 0.0))


def smoothed_copies(body: BodyModel, poses: Array, fps: float, settings: OversamplingSettings) -> list[Array]:
    """Sequences of poses (F, D), one a smoothing: each smoothed more, and sampled a part of a frame later."""
    copies, count = list[Array](), settings.smoothings
    for number in range(count):
        width = settings.widest_smoothing * fps * number / max(count - 1, 1)
        smooth = (
            scipy.ndimage.gaussian_filter1d(poses, width, axis=0, mode="nearest") if width > 0.0 else poses
        )
        times = np.arange(len(poses)) / fps
        if number:
            smooth = poses_at(body, times, smooth, times[:-1] + number / (count * fps))
        copies.append(smooth)
    return copies
