"""Colours of a background fitted to the footage: a robust gain and offset for each.

Plates are taken with another exposure or white balance, and a room's light changes. People cover less than half of a
picture, so a least-squares line that repeatedly drops points beyond twice the median distance is that of the
background (least trimmed squares by repeated trimming, Rousseeuw 1984).
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Bytes, Floats

STRIDE = 4
DARKEST, BRIGHTEST = 4.0, 250.0
"""Grey levels outside which a camera is no longer linear."""
ROUNDS = 15
KEPT = 2.0
"""Robust deviations (1.4826 times the median distance) beyond which a pixel is not background."""
FEWEST = 256
MOST_GAIN = 2.0


def fitted_line(background: NDArray[np.uint8] | Floats, frames: Bytes) -> tuple[Floats, Floats]:
    """(3,) gain and (3,) offset of each colour that map a background to the footage's colours.

    background : (H, W, 3) BGR. frames : (K, H, W, 3) of the footage; the fit is to their median.
    """
    small = np.median(frames[:, ::STRIDE, ::STRIDE], axis=0).astype(np.float32)
    return colour_line(np.asarray(background[::STRIDE, ::STRIDE], np.float32), small)


def colour_line(background: Floats, picture: Floats) -> tuple[Floats, Floats]:
    """(3,) gain and (3,) offset, grey levels, of each colour, that map a background's pixels to those of a picture.

    Both (H, W, 3). A colour with too few usable pixels, or with a gain beyond 2 or below 1/2, is unchanged.
    """
    gains, offsets = np.ones(3, np.float32), np.zeros(3, np.float32)
    for channel in range(3):
        x = background[..., channel].ravel().astype(np.float64)
        y = picture[..., channel].ravel().astype(np.float64)
        usable = (x > DARKEST) & (x < BRIGHTEST) & (y > DARKEST) & (y < BRIGHTEST)
        if np.count_nonzero(usable) < FEWEST:
            continue
        gain, offset = _trimmed_line(x[usable], y[usable])
        if 1.0 / MOST_GAIN <= gain <= MOST_GAIN:
            gains[channel], offsets[channel] = gain, offset
    return gains, offsets


def _trimmed_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Gain and offset of y over x, fitted to the larger half that lies along one line."""
    ratio = float(np.median(y / x))
    gain, offset = ratio, 0.0
    for _ in range(ROUNDS):
        away = np.abs(gain * x + offset - y)
        kept = away <= KEPT * max(1.4826 * float(np.median(away)), 1.0)
        middle = x[kept].mean()
        spread = np.square(x[kept] - middle).sum()
        if spread < 1.0:
            return ratio, 0.0
        gain = float(((x[kept] - middle) * y[kept]).sum() / spread)
        offset = float(y[kept].mean() - gain * middle)
    return gain, offset
