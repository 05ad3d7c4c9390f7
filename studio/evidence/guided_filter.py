"""The guided filter with colour (He, Sun & Tang 2013, eqs. 13 to 15; its coefficients at lower resolution: He & Sun
2015): a coarse mask ends where the picture's colour does.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Bytes, Floats

GUIDED_SMOOTHNESS = 1e-4
"""ε for colours from 0 to 1."""
GUIDED_SIDE = 384
"""Pixels: the filter's coefficients are made in a picture reduced to this side."""


def guided(picture: Bytes, share: Floats, radius: float) -> Floats:
    """(H, W) `share` filtered under the guidance of the picture's colours. radius : pixels of the picture."""
    height, width = share.shape
    factor = min(1.0, GUIDED_SIDE / max(height, width))
    size = max(2, round(width * factor)), max(2, round(height * factor))
    colours = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.float32) / 255.0
    wanted = np.asarray(cv2.resize(share, size, interpolation=cv2.INTER_AREA), np.float32)
    window = 2 * max(1, round(radius * factor)) + 1

    def mean(values: NDArray[np.floating]) -> Floats:
        return np.asarray(cv2.boxFilter(values, -1, (window, window)), np.float32)

    blue, green, red = planes = [np.ascontiguousarray(colours[..., k]) for k in range(3)]
    b, g, r = middles = [mean(plane) for plane in planes]
    level = mean(wanted)
    across = [mean(plane * wanted) - middle * level for plane, middle in zip(planes, middles, strict=True)]
    # The covariance of the colours, symmetric and positive, is solved by its factors L D L^T.
    first = mean(blue * blue) - b * b + GUIDED_SMOOTHNESS
    down, under = (mean(blue * green) - b * g) / first, (mean(blue * red) - b * r) / first
    second = mean(green * green) - g * g + GUIDED_SMOOTHNESS - down * down * first
    beside = (mean(green * red) - g * r - under * down * first) / second
    third = mean(red * red) - r * r + GUIDED_SMOOTHNESS - under * under * first - beside * beside * second
    along_green = across[1] - down * across[0]
    of_red = (across[2] - under * across[0] - beside * along_green) / third
    of_green = along_green / second - beside * of_red
    of_blue = across[0] / first - down * of_green - under * of_red
    slopes = (of_blue, of_green, of_red)
    offset = level - of_blue * b - of_green * g - of_red * r
    full = [
        np.asarray(cv2.resize(mean(part), (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
        for part in (*slopes, offset)
    ]
    out = full[3]
    for k in range(3):
        out += full[k] * np.multiply(picture[..., k], np.float32(1.0 / 255.0), dtype=np.float32)
    return out
