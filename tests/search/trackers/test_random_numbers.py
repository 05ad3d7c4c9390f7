"""Counted random numbers: known answers, spread as they should be, and the same here as a card makes them."""

import numpy as np
import pytest
from scipy import stats

from studio.search.trackers.counted_numbers import OF_NOISE, as_normals, as_share, random_words
from studio.search.trackers.random_numbers import BEGINNINGS, SEEDS, RandomNumbers

# Known answers of Philox 4x32-10, from the authors' own library: counter, key, words.
KNOWN = (
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
)
NUMBERS = RandomNumbers(1 << 40 | 9, 7, 2)
PINNED = [
    ["0x1.df90920000000p-3", "-0x1.22df060000000p-1", "0x1.2016c40000000p+0"],
    ["0x1.e952d80000000p-1", "0x1.0831360000000p+1", "0x1.d4b5b00000000p-3"],
]
ROWS = np.array([0, 1, 5, 300, 299, 70_000])
"""More than are made at once lie between them."""


@pytest.mark.parametrize(("counter", "key", "expected"), KNOWN)
def test_counted_words_are_those_of_philox(counter, key, expected):
    particle, place, layer, frame = map(np.uint64, counter)
    seed = np.uint64(key[0] | key[1] << 32)
    assert random_words(seed, frame, layer, particle, place) == expected


def words_of(numbers, particle, place):
    return random_words(*map(np.uint64, (*numbers.key, particle, place)))


@pytest.mark.parametrize(("size", "step"), [(1, 4), (3, 4), (4, 4), (31, 4), (10, 2)])
def test_those_of_many_are_those_of_one_particle_at_a_time(size, step):
    shares, normals = NUMBERS.shares(ROWS, size, 40, step=step), NUMBERS.normals(ROWS, size, 40, step=step)
    for row, particle in enumerate(ROWS):
        for d in range(size):
            words = words_of(NUMBERS, particle, 40 + d // 4 * step)
            assert shares[row, d] == as_share(words[d % 4])
            pair = d % 4 // 2 * 2
            normal = as_normals(words[pair], words[pair + 1])[d % 2]
            assert normals[row, d] == pytest.approx(normal, rel=2e-6, abs=4e-7)


def test_numbers_of_all_are_those_of_each():
    assert np.array_equal(NUMBERS.normals(1000, 7)[ROWS[:5]], NUMBERS.normals(ROWS[:5], 7))
    assert NUMBERS.share_of_all() == as_share(words_of(NUMBERS, 0, 0)[0])
    assert NUMBERS.shares(0, 5).shape == (0, 5)


def test_known_normals_are_the_same_on_every_machine():
    """Of sums and products alone: no library's logarithm takes part."""
    found = RandomNumbers(3, 1, 4).normals(2, 3)
    assert [[value.hex() for value in row] for row in found.tolist()] == PINNED


def test_they_are_spread_as_they_should_be():
    shares, normals = NUMBERS.shares(20_000, 4), NUMBERS.normals(20_000, 4).astype(np.float64)
    assert 0.0 < shares.min() < shares.max() < 1.0
    assert stats.kstest(shares.ravel(), "uniform").pvalue > 1e-3
    assert stats.kstest(normals.ravel(), "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(normals.T) - np.eye(4)).max() < 4.0 / np.sqrt(len(normals))
    assert as_normals(np.uint64(0xFFFFFFFF), np.uint64(0))[0] == 0.0
    assert np.isfinite(as_normals(np.uint64(0), np.uint64(0))).all()


def test_those_in_turn_are_another_layers_in_another_layer():
    one, again = NUMBERS.in_turn.random(), RandomNumbers(1 << 40 | 9, 7, 2).in_turn.random()
    assert one == again
    assert NUMBERS.in_turn.random() != one
    assert RandomNumbers(1 << 40 | 9, 7, 3).in_turn.random() != one


def test_a_key_is_what_a_card_takes():
    assert RandomNumbers(-1, 2, 3).key == (SEEDS, 2, 3)
    assert RandomNumbers(4, 2, 9, search=1).beginning.key == (4, 2, BEGINNINGS + 1)
    assert OF_NOISE + 4096 < 1 << 16
