"""Drawing survivors from a weighted set, with replacement (Deutscher & Reid 2005, section 3, step 4).

Both schemes return N' indices in which particle n is expected N' π_n times. `multinomial` draws one by one,
as the paper writes it. `systematic` (Kitagawa 1996) lays N' evenly spaced marks with one common random offset
on the cumulated weights: particle n is then drawn floor or ceil of N' π_n times, the least possible noise,
and needs no sorting. It is the default: on the test problems it leaves more distinct survivors.
"""

import numpy as np

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.counted_numbers import OF_PARENTS
from studio.search.trackers.particle_kernels import drawn
from studio.search.trackers.random_numbers import RandomNumbers


def draw(numbers: RandomNumbers, weights: Array, count: int, scheme: str) -> Indices:
    """(count,) indices into `weights` (N,), which are normalised; scheme "systematic" or "multinomial"."""
    if scheme == "systematic":
        return drawn(weights, (np.arange(count) + numbers.share_of_all()) / count)
    return drawn(weights, numbers.shares(count, 1, OF_PARENTS)[:, 0])


def draw_others(numbers: RandomNumbers, weights: Array, count: int) -> Indices:
    """(count,) indices into `weights` (N,), one by one, independent of those of `draw`: second parents."""
    return drawn(weights, numbers.shares(count, 2, OF_PARENTS)[:, 1])


def equal_draw(population: int, count: int) -> Indices:
    """(count,) indices that take each of `population` particles equally often, in order; all once when
    equal.
    """
    return (np.arange(count, dtype=np.int64) * population) // count
