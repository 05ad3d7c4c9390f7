"""Half widths from errors that are alike in neighbouring frames: blocks hold the promise, single frames do not."""

import itertools

import numpy as np
import pytest

from studio.results.uncertainty.conformal import (
    LEVELS,
    blocks_of,
    found_coverage,
    frames_alike,
    half_widths,
    without_bias,
)

SLOW = 0.9
"""Of an error, what is left in the next frame: 19 frames count as one."""


def slow_errors(rng: np.random.Generator, count: int, size: int = 1) -> np.ndarray:
    """(count, size, 3) errors that follow one another (AR(1))."""
    steps = rng.standard_normal((count, size, 3)) * np.sqrt(1.0 - SLOW**2)
    errors = np.empty_like(steps)
    errors[0] = rng.standard_normal((size, 3))
    for at in range(1, count):
        errors[at] = SLOW * errors[at - 1] + steps[at]
    return errors


def coverage(frames: int, level: float, length: int | None, trials: int = 300) -> float:
    """Share of later errors, independent of those learnt from, within the half width about what is left of them without
    the bias. length : of blocks; None: as measured.
    """
    rng, within = np.random.default_rng(5), 0
    for _ in range(trials):
        errors = slow_errors(rng, frames)
        blocks = blocks_of(frames, length or frames_alike(errors[:, 0]))
        scores = np.linalg.norm(without_bias(errors, blocks), axis=2)
        later = np.linalg.norm(slow_errors(rng, 1)[0] - errors.mean(axis=0), axis=1)
        within += int(later[0] <= half_widths(scores, blocks, [level])[0, 0])
    return within / trials


def test_blocks_hold_the_promise_where_single_frames_do_not() -> None:
    assert coverage(120, 0.8, 1) < 0.75
    assert coverage(120, 0.8, 19) >= 0.8
    assert coverage(300, 0.8, 1) < 0.78
    assert coverage(300, 0.8, None) >= 0.79


def of_blocks(*blocks: list[float], level: float) -> float:
    edges = np.cumsum([0, *map(len, blocks)]).tolist()
    parts = [slice(first, last) for first, last in itertools.pairwise(edges)]
    return float(half_widths(np.concatenate(blocks)[:, None], parts, [level])[0, 0])


def test_a_level_that_so_few_blocks_do_not_allow_has_no_half_width() -> None:
    known = [[float(at)] for at in range(18)]
    assert of_blocks(*known, level=0.95) == float("inf")
    assert of_blocks(*known, [18.0], level=0.95) == 18.0
    assert of_blocks([3.0], level=0.5) == 3.0


def test_each_block_weighs_the_same_however_many_frames_it_has() -> None:
    assert of_blocks([0.0] * 100, [7.0], [9.0], level=0.5) == 7.0


def test_frames_alike_are_counted() -> None:
    rng = np.random.default_rng(0)
    assert frames_alike(rng.random((2000, 5))) == 1
    assert frames_alike(slow_errors(rng, 4000)[:, 0]) == pytest.approx(19, abs=5)
    assert frames_alike(np.ones((50, 3))) == 50


def test_blocks_are_even_and_none_is_shorter_than_asked() -> None:
    blocks = blocks_of(100, 7)
    assert len(blocks) == 14
    assert (blocks[0].start, blocks[-1].stop) == (0, 100)
    assert {part.stop - part.start for part in blocks} == {7, 8}
    assert blocks_of(5, 9) == (slice(0, 5),)


def test_coverage_by_blocks_that_were_left_out_is_the_promised() -> None:
    scores = np.random.default_rng(1).random((400, 6))
    blocks = blocks_of(400, 4)
    found = found_coverage(scores, blocks)
    assert found.mean(axis=1) == pytest.approx(LEVELS, abs=0.02)
    few = found_coverage(scores, blocks[:15])
    assert np.isnan(few[2]).all()
    assert half_widths(scores, blocks).shape == (3, 6)


def test_the_bias_of_a_block_is_learnt_from_the_others() -> None:
    errors = np.zeros((4, 1, 3))
    errors[:2, 0, 0], errors[2:, 0, 0] = 2.0, 6.0
    left = without_bias(errors, (slice(0, 2), slice(2, 4)))
    assert left[:, 0, 0].tolist() == [-4.0, -4.0, 4.0, 4.0]
