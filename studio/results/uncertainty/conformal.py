"""Half widths that hold, from errors that are alike in neighbouring frames.

Split conformal prediction (Vovk, Gammerman & Shafer 2005, "Algorithmic learning in a random world"; Lei, G'Sell,
Rinaldo, Tibshirani & Wasserman 2018) takes frames for exchangeable, which neighbours are not: a hundred frames of a
slow error are few errors. So frames are cut into K blocks that are as long as errors resemble themselves, and the
blocks are exchangeable (Lee, Barber & Willett 2023, "Distribution-free inference with hierarchical data",
arXiv:2306.06342, HCP): each block weighs 1 / (K + 1), evenly among its frames, and as much weight lies at infinity for
the block that is not known. The half width of level p is the least that has weight p at or below it; where K is less
than p / (1 - p) there is none, as with fewer than 19 blocks for 95 %.

The mean error, the bias, is learnt from these errors, too. What is left without it, the scatter, is measured in each
block without the bias that this block has helped to learn.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
import scipy  # stats, half a second, are loaded once they are used

from studio.foundations.arrays import Array

LEVELS = (0.5, 0.8, 0.95)
LONGEST_LAG = 0.5
"""Share of the frames within which an error's likeness to itself is measured."""


def frames_alike(errors: Array) -> int:
    """How many neighbouring frames count as one: the integrated autocorrelation time of errors (T, N), signed, the
    median over the N; sums of two neighbouring lags count until one is not positive (Geyer 1992, "Practical Markov
    chain Monte Carlo", Statistical Science 7(4)). Ranks are taken, so that few large errors do not decide.
    """
    ranks: Array = scipy.stats.rankdata(errors, axis=0)
    ranks -= ranks.mean(axis=0)
    times = [_alike(one) for one in ranks.T]
    return max(1, round(float(np.median(times)))) if times else 1


def _alike(values: Array) -> float:
    count = len(values)
    power = float(values @ values)
    if power == 0.0 or count < 4:
        return float(count)
    spectrum = np.abs(np.fft.rfft(values, 2 * count)) ** 2
    correlation = np.fft.irfft(spectrum)[:count] / power
    most = max(2, int(LONGEST_LAG * count))
    pairs = correlation[: most - most % 2].reshape(-1, 2).sum(axis=1)
    end = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return max(1.0, 2.0 * float(pairs[:end].sum()) - 1.0)


def blocks_of(count: int, length: int) -> tuple[slice, ...]:
    """`count` frames in blocks of at least `length`, as even as can be."""
    edges = np.linspace(0, count, max(1, count // length) + 1).round().astype(np.int64).tolist()
    return tuple(slice(first, last) for first, last in itertools.pairwise(edges))


def blocks_for(level: float) -> int:
    """The least number of blocks from which a level has a half width."""
    return math.ceil(level / (1.0 - level) - 1e-9)


def half_widths(scores: Array, blocks: Sequence[slice], levels: Sequence[float] = LEVELS) -> Array:
    """(L, M) half widths of levels from the blocks' scores, of (T, M); infinite where so few blocks allow none."""
    sizes = [part.stop - part.start for part in blocks]
    rows = np.concatenate([scores[part] for part in blocks])
    weights = np.repeat(1.0 / (np.array(sizes) * (len(blocks) + 1)), sizes)
    order = np.argsort(rows, axis=0)
    reached, ascending = np.cumsum(weights[order], axis=0), np.take_along_axis(rows, order, axis=0)
    widths = np.full((len(levels), scores.shape[1]), np.inf)
    for row, level in zip(widths, levels, strict=True):
        enough = reached >= level - 1e-12
        has = enough[-1]
        row[has] = np.take_along_axis(ascending, np.argmax(enough, axis=0)[None], axis=0)[0, has]
    return widths


def found_coverage(scores: Array, blocks: Sequence[slice], levels: Sequence[float] = LEVELS) -> Array:
    """(L, M) share of frames within the half width that all blocks but their own give; NaN where there is none."""
    within = np.zeros((len(levels), scores.shape[1]))
    for at, own in enumerate(blocks):
        others = [*blocks[:at], *blocks[at + 1 :]]
        widths = half_widths(scores, others, levels) if others else np.full_like(within, np.inf)
        inside = np.where(np.isfinite(widths)[:, None], scores[own] <= widths[:, None], np.nan)
        within += inside.sum(axis=1)
    return within / len(scores)


def without_bias(errors: Array, blocks: Sequence[slice]) -> Array:
    """Errors (T, M, 3) without their mean, in each block without that of all other blocks."""
    total, count = errors.sum(axis=0), len(errors)
    left = np.empty_like(errors)
    for own in blocks:
        others = count - (own.stop - own.start)
        left[own] = errors[own] - (total - errors[own].sum(axis=0)) / max(others, 1)
    return left
