"""Slow random changes, as between two performances of the same movement."""

import numpy as np
import scipy

from studio.arrays import Array

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
