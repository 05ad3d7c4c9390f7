"""A subject cut out by strokes, from picture to picture: a ball of one colour that rolls over a floor of noise."""

import numpy as np
import pytest

from studio.evidence.stroke_cut import BINS, NEARNESS, StrokeCut, _cells, _nearness
from studio.evidence.strokes import Stroke
from studio.foundations.errors import FootageError

SIZE, RADIUS = (120, 90), 16


def ball(x: int, y: int = 45) -> np.ndarray:
    """(H, W) whether the ball covers a pixel."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    return np.hypot(columns - x, rows - y) <= RADIUS


def picture(x: int) -> np.ndarray:
    """(H, W, 3) BGR of a red ball before a floor of greens."""
    noise = np.random.default_rng(x).normal(0.0, 6.0, (SIZE[1], SIZE[0], 3))
    colours = np.where(ball(x)[..., None], [40.0, 50.0, 190.0], [70.0, 120.0, 60.0])
    return np.clip(colours + noise, 0, 255).astype(np.uint8)


def stroke(kind: str, *points: tuple[float, float]) -> Stroke:
    return Stroke(camera="cam0", frame=0, kind=kind, width=4.0, points=points)


STROKES = (stroke("inside", (35, 45), (48, 45)), stroke("outside", (5, 8), (115, 8), (115, 80), (5, 80)))


def overlap(mask: np.ndarray, truth: np.ndarray) -> float:
    return np.count_nonzero((mask > 0) & truth) / np.count_nonzero((mask > 0) | truth)


def test_a_ball_is_followed_and_a_copy_goes_on_by_itself() -> None:
    cut = StrokeCut()
    mask = cut.begin(picture(42), STROKES)
    assert set(np.unique(mask)) == {0, 255}
    assert overlap(mask, ball(42)) > 0.95
    beside = cut.copy()
    for x in (46, 50, 54, 58):
        mask = cut.cut(picture(x))
        assert overlap(mask, ball(x)) > 0.93, x
        cut.learn(picture(x), mask, False)
    assert overlap(beside.cut(picture(46)), ball(46)) > 0.93


def test_a_stroke_outside_takes_away_what_it_covers() -> None:
    cut = StrokeCut()
    cut.begin(picture(42), STROKES)
    half = stroke("outside", *((float(x), float(y)) for y in range(30, 61, 3) for x in (50, 57)))
    mask = cut.cut(picture(42), (half,))
    assert not mask[45, 53]
    assert mask[45, 35]


def test_colours_fall_into_bins_of_luma_and_of_both_differences_of_colour() -> None:
    """Grey in the middle of the differences, the strongest red, green, blue and yellow (BGR) at their ends."""
    colours = [(200, 200, 200), (0, 0, 255), (0, 255, 0), (255, 0, 0), (0, 255, 255)]
    cells = _cells(np.array([colours], np.uint8))[0]
    luma, red, blue = np.unravel_index(cells, (BINS, BINS, BINS))
    middle, most = BINS // 2, BINS - 1
    assert luma.tolist() == [25, 9, 18, 3, 28]
    assert red.tolist() == [middle, most, 0, 10, 21]
    assert blue.tolist() == [middle, 5, 0, most, 0]


def test_a_place_is_likelier_inside_the_nearer_it_is_to_a_stroke_inside_than_to_one_outside() -> None:
    marks = np.zeros((41, 41), np.uint8)
    marks[20, 10], marks[20, 30] = 1, 2
    odds = _nearness(marks)
    assert (odds[20, 10], odds[20, 30]) == pytest.approx((NEARNESS, -NEARNESS))
    assert odds[20, 20] == pytest.approx(0.0, abs=1e-6)
    # The picture's border is outside.
    assert np.allclose(odds[0], -NEARNESS)


def test_without_a_stroke_inside_nothing_is_cut() -> None:
    with pytest.raises(FootageError, match="No stroke is inside"):
        StrokeCut().begin(picture(42), STROKES[1:])
