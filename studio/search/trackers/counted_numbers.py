# pyright: standard
"""Random numbers that are counted, not drawn in turn: the same words on a processor and on a card, in any order.

Philox 4x32-10 (Salmon, Moraes, Dror & Shaw 2011): four words are a function of a counter of four words and a key of
two. The key is a run's seed; the counter says frame, layer, particle and which of the particle's words are meant, so a
layer's numbers depend on nothing that was drawn before.

A kernel of a card makes those of one particle at a time (`random_words`, `as_share`, `as_normals`), the processor those
of many (`count_shares`, `count_normals`). Shares are equal on both, bit for bit. Normal numbers differ by rounding: the
processor makes them of sums and products alone, so that they vectorise and are the same on every machine.
"""

import math

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices
from studio.foundations.numba_in_threads import EXACT, EXACT_INLINED, njit

OF_RUN, OF_PARENTS, OF_CUTS, OF_MOVES, OF_KINDS, OF_NOISE = 0, 1, 2, 3, 4, 16
"""Which of a particle's words are meant; the run's own are those of particle 0."""
OF_VELOCITIES, OF_TRIES, OF_TRY = 1 << 12, 1 << 16, 1 << 12
"""Likewise of a sampled swarm's velocities; of the tries of a step, the first of them and how many a try has."""
ROUNDS = 10
FIRST, SECOND = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
FIRST_STEP, SECOND_STEP = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
LOW, UPPER = np.uint64(0xFFFFFFFF), np.uint64(32)
EIGHT = np.uint64(8)
IN_ONE, OF_ONE = np.float32(2.0**-24), 2.0**-32
TWO_PI, MINUS_TWO, ONE = np.float32(2.0 * np.pi), np.float32(-2.0), np.float32(1.0)
WORD_EIGHT, MANTISSA, HALF_EXPONENT = np.uint32(8), np.int32(0x7FFFFF), np.int32(0x3F000000)
HALF, ROOT_HALF = np.float32(0.5), np.float32(math.sqrt(0.5))
LOG_TWO, LOG_TWO_REST = np.float32(0.693359375), np.float32(-2.12194440e-4)
LOG_SERIES = (
    np.float32(7.0376836292e-2),
    np.float32(-1.1514610310e-1),
    np.float32(1.1676998740e-1),
    np.float32(-1.2420140846e-1),
    np.float32(1.4249322787e-1),
    np.float32(-1.6668057665e-1),
    np.float32(2.0000714765e-1),
    np.float32(-2.4999993993e-1),
    np.float32(3.3333331174e-1),
)
SINE = np.float32(-1.6666654611e-1), np.float32(8.3321608736e-3), np.float32(-1.9515295891e-4)
COSINE = np.float32(4.166664568298827e-2), np.float32(-1.388731625493765e-3), np.float32(2.443315711809948e-5)
A_TURN = np.float32(2.0 * np.pi / (1 << 24))
AT_ONCE = 256
"""Particles whose words stay in the processor's cache."""


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


@njit(**EXACT)
def count_shares(key: NDArray[np.uint64], particles: Indices, place: int, step: int, shares: Array) -> None:
    """Fill shares (N, K) with numbers in (0, 1), four a counter; key (3,) : seed, frame and layer.

    particles : (N,) their numbers in the set. place, step : of the first four, and from these to the next four.
    """
    count, size = shares.shape
    blocks = (size + 3) // 4
    words = np.empty((4, AT_ONCE * blocks), np.uint32)
    for first in range(0, count, AT_ONCE):
        last = min(first + AT_ONCE, count)
        _count_words(key, particles[first:last], place, step, blocks, words)
        for n in range(first, last):
            for d in range(size):
                shares[n, d] = as_share(words[d & 3, (n - first) * blocks + (d >> 2)])


@njit(**EXACT)
def count_normals(
    key: NDArray[np.uint64], particles: Indices, place: int, step: int, normals: NDArray[np.float32]
) -> None:
    """Fill normals (N, K) with independent normal numbers, single precision; arguments as in `count_shares`."""
    count, size = normals.shape
    blocks = (size + 3) // 4
    words = np.empty((4, AT_ONCE * blocks), np.uint32)
    pairs = np.empty((4, AT_ONCE * blocks), np.float32)
    for first in range(0, count, AT_ONCE):
        last = min(first + AT_ONCE, count)
        used = (last - first) * blocks
        _count_words(key, particles[first:last], place, step, blocks, words)
        for row in (0, 2):
            _fill_normals(
                words[row, :used],
                words[row + 1, :used],
                pairs[row, :used],
                pairs[row, :used].view(np.int32),
                pairs[row + 1, :used],
            )
        for n in range(first, last):
            for d in range(size):
                normals[n, d] = pairs[d & 3, (n - first) * blocks + (d >> 2)]


@njit(**EXACT)
def _count_words(key, particles, place, step, blocks, words):
    for n in range(len(particles)):
        for k in range(blocks):
            a, b, c, d = random_words(key[0], key[1], key[2], particles[n], place + step * k)
            at = n * blocks + k
            words[0, at], words[1, at], words[2, at], words[3, at] = a, b, c, d


@njit(**EXACT)
def _fill_normals(one, other, first, bits, second):
    """`as_normals` of words (K,) into first (K,), whose bits are given, too, and second (K,).

    Logarithm, sine and cosine are the polynomials of Cephes (Moshier 1992) for single precision.
    """
    for n in range(len(one)):
        first[n] = (np.float32(one[n] >> WORD_EIGHT) + ONE) * IN_ONE
    for n in range(len(one)):
        second[n] = np.float32((bits[n] >> np.int32(23)) - np.int32(126))
        bits[n] = (bits[n] & MANTISSA) | HALF_EXPONENT
    for n in range(len(one)):
        small = first[n] < ROOT_HALF
        power = second[n] - ONE if small else second[n]
        x = first[n] + first[n] - ONE if small else first[n] - ONE
        square = x * x
        series = LOG_SERIES[0]
        for k in range(1, len(LOG_SERIES)):
            series = series * x + LOG_SERIES[k]
        beyond = series * x * square + power * LOG_TWO_REST - HALF * square
        length = math.sqrt(MINUS_TWO * (x + beyond + power * LOG_TWO))
        turn = np.int32(other[n] >> WORD_EIGHT)
        quarter = (turn + np.int32(1 << 21)) >> np.int32(22)
        angle = np.float32(turn - (quarter << np.int32(22))) * A_TURN
        square = angle * angle
        sine = angle + angle * square * (SINE[0] + square * (SINE[1] + square * SINE[2]))
        rest = square * square * (COSINE[0] + square * (COSINE[1] + square * COSINE[2]))
        cosine = ONE - HALF * square + rest
        along, across = (sine, cosine) if quarter & 1 else (cosine, sine)
        first[n] = length * (-along if quarter in (1, 2) else along)
        second[n] = length * (-across if quarter in (2, 3) else across)
