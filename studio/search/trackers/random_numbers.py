"""The random numbers of a search, by place: the same whoever asks for them, in whatever order, here or on a card.

A place is a particle's number and which of its numbers are meant (`counted_numbers`), in a layer of a frame of a run.
Behaviour models, whose steps no card does, draw theirs in turn.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.search.trackers.counted_numbers import (
    OF_NOISE,
    OF_RUN,
    OF_TRIES,
    OF_TRY,
    count_normals,
    count_shares,
)

COUNTED = "counted"
"""Name of these random numbers in a run's record."""
BEGINNINGS = 1 << 31
"""Numbers of layers from here on are those of the sets that a frame's searches begin with."""
SEEDS = (1 << 64) - 1


@dataclass(frozen=True, eq=False)
class RandomNumbers:
    """Those of a layer. search : number of the frame's search that the layer belongs to, from 0."""

    seed: int
    frame: int
    layer: int
    search: int = 0

    @staticmethod
    def of_beginning(seed: int, frame: int, search: int = 0) -> "RandomNumbers":
        """Those of the set that a search begins with."""
        return RandomNumbers(seed, frame, BEGINNINGS + search, search)

    @property
    def beginning(self) -> "RandomNumbers":
        """Those of the set that this layer's search began with."""
        return self.of_beginning(self.seed, self.frame, self.search)

    @property
    def key(self) -> tuple[int, int, int]:
        """What a card counts them from: seed, frame and layer."""
        return self.seed & SEEDS, self.frame, self.layer

    def share_of_all(self) -> float:
        """One number in (0, 1) for the whole layer."""
        return float(self.shares(1, 1, OF_RUN)[0, 0])

    def shares(self, particles: int | Indices, size: int, place: int = OF_NOISE, *, step: int = 4) -> Array:
        """(N, size) numbers in (0, 1). particles : how many from the first on, or the numbers (N,) of some.

        place : of a particle's first four. step : from each four to the next.
        """
        numbers = np.arange(particles) if isinstance(particles, int) else particles
        shares = np.empty((len(numbers), size))
        count_shares(self._words, numbers, place, step, shares)
        return shares

    def normals(
        self, particles: int | Indices, size: int, place: int = OF_NOISE, *, step: int = 4
    ) -> NDArray[np.float32]:
        """(N, size) independent normal numbers; arguments as of `shares`."""
        numbers = np.arange(particles) if isinstance(particles, int) else particles
        normals = np.empty((len(numbers), size), np.float32)
        count_normals(self._words, numbers, place, step, normals)
        return normals

    @cached_property
    def in_turn(self) -> np.random.Generator:
        """Numbers of the same layer that are drawn in turn, for what has no places."""
        return keyed_generator(*self.key)

    @cached_property
    def _words(self) -> NDArray[np.uint64]:
        return np.array(self.key, np.uint64)


def place_of_try(attempt: int) -> int:
    """Place of a step's numbers that are drawn again; attempt 0 is the first."""
    return OF_TRIES + OF_TRY * attempt


def keyed_generator(*key: int) -> np.random.Generator:
    """Random numbers in turn that are a function of these whole numbers, none below 0."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))
