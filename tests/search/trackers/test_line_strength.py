"""Thin lines in pictures, by direction."""

import cv2
import numpy as np
import pytest

from studio.foundations.arrays import Bytes
from studio.search.trackers.line_strength import DIRECTIONS, free_of, is_broad, line_strength

MIDDLE, SIZE = 40, 81


def drawn(degrees: float, grey: int, breadth: int = 3, seed: int = 0) -> Bytes:
    """A line through the middle of a noisy picture of grey level 100."""
    way = 60.0 * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
    picture = np.full((SIZE, SIZE, 3), 100, np.uint8)
    ends = [tuple(np.rint(MIDDLE + sign * way).astype(int).tolist()) for sign in (-1, 1)]
    cv2.line(picture, ends[0], ends[1], (grey, grey, grey), breadth)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


EMPTY = drawn(0.0, 100, seed=1)


@pytest.mark.parametrize("grey", [70, 130])
@pytest.mark.parametrize("degrees", [0.0, 45.0, 90.0, 135.0])
def test_a_line_is_plain_in_its_own_direction_darker_or_brighter(degrees: float, grey: int) -> None:
    strength = line_strength(drawn(degrees, grey), EMPTY, 3)
    own = round(degrees / 180.0 * DIRECTIONS)
    assert strength.shape == (DIRECTIONS, SIZE, SIZE)
    assert strength[own, MIDDLE, MIDDLE] > 0.95
    assert strength[(own + DIRECTIONS // 2) % DIRECTIONS, MIDDLE, MIDDLE] < 0.3


def test_what_lies_beside_a_line_counts_less_and_farther_away_nothing() -> None:
    along = line_strength(drawn(0.0, 60), EMPTY, 3)[0, :, MIDDLE]
    assert along[MIDDLE] > along[MIDDLE + 3] > along[MIDDLE + 9]
    assert along[MIDDLE + 9] < 0.3


def test_what_stands_still_and_what_has_one_edge_only_is_no_line() -> None:
    line, edge = drawn(0.0, 60), EMPTY.copy()
    edge[MIDDLE:] -= 40
    assert line_strength(line, line, 3).max() == 0.0
    assert line_strength(edge, EMPTY, 3)[0, MIDDLE - 2 : MIDDLE + 3, MIDDLE].max() < 0.3


def test_where_no_quadrilateral_lies() -> None:
    square = np.array([[2.0, 2.0], [6.0, 2.0], [6.0, 6.0], [2.0, 6.0]])
    free = free_of(np.stack([square, np.full((4, 2), np.nan)]), 10, 12)
    assert free.shape == (10, 12)
    assert not free[2:7, 2:7].any()
    assert free.sum() == 120 - 25


def test_a_mask_is_broad_where_a_line_is_not() -> None:
    mask = np.zeros((60, 60), np.uint8)
    mask[10:30, 10:30] = 255
    mask[20:23, 30:] = 255
    broad = is_broad(mask, 3)
    assert broad[15:25, 15:25].all()
    assert not broad[:, 35:].any()
