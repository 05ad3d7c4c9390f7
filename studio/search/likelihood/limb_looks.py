"""The look of limbs: evidence for those that no silhouette shows, such as a leg in front of its body.

A limb's look is a strip of the picture along its outline, somewhat longer and wider than it. Where a pose is known, its
strips are kept; where none is, a strip scores the greatest of its correlations with the kept ones (from -1 to 1:
brightness and contrast do not count), and how steeply the picture changes across its two sides, as a share of how much
it usually changes nearby. Maps are those of `evidence.look_maps`.
"""

from collections.abc import Sequence

import numpy as np

from studio.foundations.arrays import Array, Floats
from studio.foundations.numba_in_threads import FAST, FAST_INLINED, njit

ALONG, ACROSS = 14, 12
"""Places of a strip along and across its limb."""
BEYOND = 0.15
"""Share of the limb's length by which a strip begins before it and ends behind it, so that its ends are seen."""
REACH, CORE = 2.2, 1.2
"""Half widths of the limb to which a strip reaches, and within which it mainly counts: a Gaussian's deviation."""
FLAT = 2.0
"""Grey levels: contrast within a strip below which its correlation counts less."""
SIDES, STEEPEST = 0.3, 1.5
"""What a unit of a side's steepness counts, beside a unit of correlation; the greatest that counts."""
UNSEEN = -1.0
"""Score of a limb behind the camera."""


def kept_looks(maps: Floats, corners: Array) -> Floats:
    """(L, ALONG, ACROSS) the strips of limbs that are known to lie at corners (L, 4, 2), ready to be compared: of no
    mean and of length 1, or less where there is little contrast. NaN corners give zeros.
    """
    looks = np.zeros((len(corners), ALONG, ACROSS), dtype=np.float32)
    read_looks(maps, np.ascontiguousarray(corners), _weights(), looks)
    return looks


def look_scores(maps: Floats, corners: Array, looks: Sequence[Floats]) -> Array:
    """(N, L) scores of limbs at corners (N, L, 4, 2), NaN where they are unseen. looks : at least one."""
    scores = np.empty(corners.shape[:2])
    score_looks(maps, np.ascontiguousarray(corners), _weights(), np.stack(looks), scores)
    return scores


def _weights() -> Array:
    """(ACROSS,) that sum to 1 over a whole strip."""
    weights = np.exp(-0.5 * (np.linspace(-REACH, REACH, ACROSS) / CORE) ** 2)
    return np.asarray(weights / (ALONG * weights.sum()), np.float64)


@njit(**FAST_INLINED)
def value_at(image: Floats, x: float, y: float) -> float:
    """An image (H, W) between its pixels; 0 outside."""
    height, width = image.shape
    if not (0.0 <= x < width - 1 and 0.0 <= y < height - 1):
        return 0.0
    column, row = np.uint32(x), np.uint32(y)
    right, down = x - column, y - row
    above = image[row, column] * (1.0 - right) + image[row, column + 1] * right
    below = image[row + 1, column] * (1.0 - right) + image[row + 1, column + 1] * right
    return float(above * (1.0 - down) + below * down)


@njit(**FAST_INLINED)
def place_on(quad: Array, along: float) -> tuple[float, float, float, float]:
    """The middle of a limb's outline (4, 2) at a share of its length, and half of its width there, both x and y."""
    left_x, left_y = (
        quad[0, 0] + along * (quad[1, 0] - quad[0, 0]),
        quad[0, 1] + along * (quad[1, 1] - quad[0, 1]),
    )
    right_x, right_y = (
        quad[3, 0] + along * (quad[2, 0] - quad[3, 0]),
        quad[3, 1] + along * (quad[2, 1] - quad[3, 1]),
    )
    half_x, half_y = 0.5 * (left_x - right_x), 0.5 * (left_y - right_y)
    return 0.5 * (left_x + right_x), 0.5 * (left_y + right_y), half_x, half_y


@njit(**FAST_INLINED)
def read_strip(image: Floats, quad: Array, weights: Array, strip: Array) -> float:
    """Fill a strip (ALONG, ACROSS), less its mean; returns its contrast, grey levels."""
    mean = 0.0
    for s in range(ALONG):
        x, y, half_x, half_y = place_on(quad, (1.0 + 2.0 * BEYOND) * (s + 0.5) / ALONG - BEYOND)
        for w in range(ACROSS):
            out = REACH * (2.0 * w / (ACROSS - 1) - 1.0)
            strip[s, w] = value_at(image, x + out * half_x, y + out * half_y)
            mean += weights[w] * strip[s, w]
    power = 0.0
    for s in range(ALONG):
        for w in range(ACROSS):
            strip[s, w] -= mean
            power += weights[w] * strip[s, w] * strip[s, w]
    return np.sqrt(power + FLAT * FLAT)


@njit(**FAST)
def read_looks(maps: Floats, corners: Array, weights: Array, looks: Floats) -> None:
    """Fill the looks (L, ALONG, ACROSS) of limbs at corners (L, 4, 2)."""
    strip = np.empty((ALONG, ACROSS))
    for limb in range(len(corners)):
        if np.isfinite(corners[limb].sum()):
            contrast = read_strip(maps[0], corners[limb], weights, strip)
            looks[limb] = strip / contrast


@njit(**FAST)
def score_looks(maps: Floats, corners: Array, weights: Array, looks: Floats, scores: Array) -> None:
    """Fill the scores (N, L) of limbs at corners (N, L, 4, 2). looks : (K, L, ALONG, ACROSS)."""
    strip = np.empty((ALONG, ACROSS))
    for n in range(len(corners)):
        for limb in range(corners.shape[1]):
            quad = corners[n, limb]
            if not np.isfinite(quad.sum()):
                scores[n, limb] = UNSEEN
                continue
            contrast = read_strip(maps[0], quad, weights, strip)
            best = -1.0
            for k in range(len(looks)):
                alike = 0.0
                for s in range(ALONG):
                    for w in range(ACROSS):
                        alike += weights[w] * strip[s, w] * looks[k, limb, s, w]
                best = max(best, alike / contrast)
            steep = 0.0
            for s in range(ALONG):
                x, y, half_x, half_y = place_on(quad, (s + 0.5) / ALONG)
                width = np.sqrt(half_x * half_x + half_y * half_y) + 1e-6
                for side in (-1.0, 1.0):
                    at_x, at_y = x + side * half_x, y + side * half_y
                    slope = value_at(maps[1], at_x, at_y) * half_x + value_at(maps[2], at_x, at_y) * half_y
                    steep += min(abs(slope) / width, STEEPEST)
            scores[n, limb] = best + SIDES * steep / ALONG
