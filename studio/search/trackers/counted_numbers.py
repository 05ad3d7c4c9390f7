# pyright: standard
"""Random numbers that are counted, not drawn in turn: the same words on a processor and on a card, in any order.

Philox 4x32-10 (Salmon, Moraes, Dror & Shaw 2011): four words are a function of a counter of four words and a key of
two. The key is a run's seed; the counter says frame, layer, particle and which of the particle's words are meant, so a
layer's numbers depend on nothing that was drawn before.
"""

import math

import numpy as np

from studio.foundations.numba_in_threads import EXACT_INLINED, njit

ROUNDS = 10
FIRST, SECOND = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
FIRST_STEP, SECOND_STEP = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
LOW, UPPER = np.uint64(0xFFFFFFFF), np.uint64(32)
EIGHT = np.uint64(8)
IN_ONE, OF_ONE = np.float32(2.0**-24), 2.0**-32
TWO_PI, MINUS_TWO, ONE = np.float32(2.0 * np.pi), np.float32(-2.0), np.float32(1.0)


@njit(**EXACT_INLINED)
def random_words(seed, frame, layer, particle, place):
    """Four words of 32 bits, each in 64, of a counter (four of 32 bits) and a seed of 64 bits."""
    a, b = np.uint64(particle) & LOW, np.uint64(place) & LOW
    c, d = np.uint64(layer) & LOW, np.uint64(frame) & LOW
    k, m = np.uint64(seed) & LOW, np.uint64(seed) >> UPPER
    for _ in range(ROUNDS):
        p, q = FIRST * a, SECOND * c
        a, b, c, d = (q >> UPPER) ^ b ^ k, q & LOW, (p >> UPPER) ^ d ^ m, p & LOW
        k, m = (k + FIRST_STEP) & LOW, (m + SECOND_STEP) & LOW
    return a, b, c, d


@njit(**EXACT_INLINED)
def as_share(word):
    """A number in (0, 1), double precision, of a word."""
    return (np.float64(word) + 0.5) * OF_ONE


@njit(**EXACT_INLINED)
def as_normals(one, other):
    """Two independent normal numbers, single precision, of two words (Box & Muller 1958); none beyond 5.8."""
    length = math.sqrt(MINUS_TWO * math.log((np.float32(one >> EIGHT) + ONE) * IN_ONE))
    turn = TWO_PI * (np.float32(other >> EIGHT) * IN_ONE)
    return np.float32(length * math.cos(turn)), np.float32(length * math.sin(turn))
