"""A subject cut out by strokes, from picture to picture: a ball of one colour that rolls over a floor of noise."""

import cv2
import numpy as np
import pytest

from studio.evidence.stroke_cut import (
    BINS,
    NEARNESS,
    StrokeCut,
    _blurred,
    _box,
    _cells,
    _connect,
    _flow_mask,
    _graph_cut,
    _grown,
    _histograms,
    _nearness,
    _of_place,
    _reduced,
    _reduced_marks,
    _shares,
)
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


NOTHING = np.zeros((40, 60), np.uint8)


def rectangles(*boxes: tuple[int, int, int, int]) -> np.ndarray:
    """(40, 60) 255 within boxes of left, top, right, bottom (exclusive)."""
    mask = NOTHING.copy()
    for left, top, right, bottom in boxes:
        mask[top:bottom, left:right] = 255
    return mask


def test_kept_masks_alone_bring_a_cut_to_where_it_was() -> None:
    cut, again = StrokeCut(), StrokeCut()
    again.begin(picture(42), STROKES)
    cut.begin(picture(42), STROKES)
    for x in (46, 50, 54):
        mask = cut.cut(picture(x))
        cut.learn(picture(x), mask, False)
        again.learn(picture(x), mask, False)
    assert (cut.cut(picture(58)) == again.cut(picture(58))).all()


def test_strokes_in_a_later_picture_teach_its_colours_for_good() -> None:
    """The ball turns blue, which only strokes can say; it is blue again after pictures in which it was hidden."""
    blue = {x: picture(x)[..., ::-1].copy() for x in (46, 50)}
    for x, one in blue.items():
        one[~ball(x)] = picture(x)[~ball(x)]
    cut = StrokeCut()
    cut.begin(picture(42), STROKES)
    mask = cut.cut(blue[46], (stroke("inside", (40, 45), (53, 45)),))
    assert overlap(mask, ball(46)) > 0.9
    cut.learn(blue[46], mask, True)
    cut.learn(picture(200), np.zeros(ball(0).shape, np.uint8), False)
    mask = cut.cut(blue[50], expected=np.where(ball(50), np.uint8(255), np.uint8(0)))
    assert overlap(mask, ball(50)) > 0.9


def test_a_shadow_on_a_floor_that_was_seen_is_not_the_subject() -> None:
    cut = StrokeCut()
    cut.begin(picture(42), STROKES)
    for x in (46, 50, 54):
        cut.learn(picture(x), cut.cut(picture(x)), False)
    now, shadow = picture(58).astype(float), np.zeros(ball(0).shape, np.bool_)
    shadow[55:64, 66:100] = True
    shadow &= ~ball(58)
    now[shadow] *= 0.7
    mask = cut.cut(now.astype(np.uint8))
    assert overlap(mask, ball(58)) > 0.9
    assert np.count_nonzero(mask[shadow]) < 0.1 * np.count_nonzero(shadow)


def test_a_projection_says_where_a_subject_is_that_has_jumped() -> None:
    cut = StrokeCut()
    cut.begin(picture(30), (stroke("inside", (24, 45), (36, 45)), STROKES[1]))
    expected = np.where(ball(88), np.uint8(255), np.uint8(0))
    assert overlap(cut.cut(picture(88), expected=expected), ball(88)) > 0.9


def test_a_large_picture_is_cut_reduced_and_refined_to_its_own_border() -> None:
    large = cv2.resize(picture(60), (960, 720), interpolation=cv2.INTER_CUBIC)
    rows, columns = np.mgrid[:720, :960]
    truth = np.hypot(columns - 8 * 60 - 3.5, rows - 8 * 45 - 3.5) <= 8 * RADIUS + 4
    strokes = tuple(
        Stroke(
            camera="cam0", frame=0, kind=kind, width=32.0, points=tuple((8.0 * x, 8.0 * y) for x, y in points)
        )
        for kind, points in (
            ("inside", [(54, 45), (66, 45)]),
            ("outside", [(5, 8), (115, 8), (115, 80), (5, 80)]),
        )
    )
    mask = StrokeCut().begin(large, strokes)
    assert mask.shape == (720, 960)
    assert set(np.unique(mask)) == {0, 255}
    assert overlap(mask, truth) > 0.95


def test_odds_of_place_fall_by_half_a_pixel_and_have_limits() -> None:
    odds = _of_place(rectangles((20, 10, 40, 30)))
    assert odds[20, 14:20] == pytest.approx([-3.0, -2.5, -2.0, -1.5, -1.0, -0.5], abs=0.05)
    assert odds[20, 20:26] == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.5, 2.5], abs=0.05)
    assert odds[20, 2] == pytest.approx(-6.0)
    assert (_of_place(NOTHING) == -1.0).all()


def test_pieces_that_nothing_leads_to_and_specks_go_and_small_holes_close() -> None:
    body, far, speck = (5, 5, 25, 35), (40, 5, 50, 25), (28, 8, 30, 10)
    mask = rectangles(body, far, speck)
    mask[10, 10] = 0
    mask[15:25, 10:20] = 0
    moved = rectangles((8, 8, 30, 30))
    kept = _connect(mask, moved, NOTHING)
    wanted = rectangles(body)
    wanted[15:25, 10:20] = 0
    assert (kept == wanted).all()
    marks = NOTHING.copy()
    marks[9, 29], marks[10, 10] = 1, 2
    kept = _connect(mask, moved, marks)
    assert kept[9, 29]
    assert not kept[10, 10]
    # Where nothing is touched, the largest is it.
    assert (_connect(rectangles(far, body), rectangles((55, 35, 58, 38)), NOTHING) == rectangles(body)).all()
    assert not _connect(NOTHING, moved, NOTHING).any()


def test_the_cut_follows_odds_strokes_and_borders_of_the_picture() -> None:
    grey = np.full((40, 60, 3), 90, np.uint8)
    odds = np.where(rectangles((20, 10, 40, 30)) > 0, 3.0, -3.0).astype(np.float32)
    assert (_graph_cut(grey, odds, NOTHING) == rectangles((20, 10, 40, 30))).mean() > 0.995
    marks = NOTHING.copy()
    marks[12:28, 22:30], marks[0:8, 0:12] = 2, 1
    cut = _graph_cut(grey, odds, marks)
    assert not cut[12:28, 22:30].any()
    assert cut[0:8, 0:12].all()
    # Where odds say nothing, the border lies where the picture changes.
    unsure = np.zeros((40, 60), np.float32)
    unsure[:, :10], unsure[:, 50:] = 1.0, -1.0
    two = grey.copy()
    two[:, 34:] = 200
    cut = _graph_cut(two, unsure, NOTHING)
    assert cut[20, :33].all()
    assert not cut[20, 35:].any()


def test_a_mask_moves_with_its_picture() -> None:
    texture = cv2.GaussianBlur(
        np.random.default_rng(0).integers(0, 255, (60, 90)).astype(np.uint8), (0, 0), 2.0
    )
    moved = np.roll(texture, (2, 5), axis=(0, 1))
    mask = np.zeros((60, 90), np.uint8)
    mask[20:40, 30:60] = 255
    now = _flow_mask(mask, texture, moved)
    assert overlap(now, np.roll(mask, (2, 5), axis=(0, 1)) > 0) > 0.95
    assert (_flow_mask(np.zeros_like(mask), texture, moved) == 0).all()
    assert _flow_mask(mask[:15], texture[:15], moved[:15]) is not None


def test_shares_of_colours_are_blurred_and_those_under_strokes_are_six_tenths() -> None:
    counts = np.zeros((BINS, BINS, BINS), np.float32)
    counts[5, 0, 9] = 64.0
    blurred = _blurred(counts)
    assert blurred.sum() == pytest.approx(64.0)
    assert blurred[5, 0, 9] == pytest.approx(64.0 * 0.5 * 0.75 * 0.5)
    assert blurred[4, 1, 9] == pytest.approx(64.0 * 0.25 * 0.25 * 0.5)
    cells = np.array([[100, 100, 200, 200, 200, 200]], np.int32)
    mask = np.array([[255, 255, 0, 0, 0, 0]], np.uint8)
    known = np.array([[True, True, True, True, False, False]])
    assert _shares(cells[mask > 0])[[100, 200]].tolist() == [1.0, 0.0]
    strokes = np.zeros(BINS**3, np.float32)
    strokes[4 * BINS**2 + 16 * BINS + 16] = 1.0
    inside, outside = _histograms(cells, mask, known, (strokes, None))
    assert inside.sum() == pytest.approx(1.0)
    assert outside.sum() == pytest.approx(1.0)
    assert inside[3:6, 15:18, 15:18].sum() == pytest.approx(0.6)


def test_boxes_and_smaller_pictures() -> None:
    mask = rectangles((20, 10, 40, 30))
    assert _box(mask) == (20, 10, 40, 30)
    assert _box(NOTHING) == (0, 0, 60, 40)
    assert _grown((20, 10, 40, 30), (60, 40)) == (4, 0, 56, 40)
    assert _grown((100, 100, 300, 200), (640, 480)) == (50, 50, 350, 250)
    assert _grown((100, 100, 300, 200), (640, 480), 7) == (93, 93, 307, 207)
    assert _reduced(np.zeros((40, 60, 3), np.uint8), 2.0).shape == (20, 30, 3)
    assert _reduced(np.zeros((40, 60, 3), np.uint8), 1.0).shape == (40, 60, 3)
    marks = NOTHING.copy()
    marks[:2, :2], marks[4:6, 4:6], marks[8, 8] = 1, 2, 2
    small = _reduced_marks(marks, (30, 20))
    assert (small[0, 0], small[2, 2], small[4, 4]) == (1, 2, 0)
    assert not _reduced_marks(NOTHING, (30, 20)).any()
    assert _reduced_marks(marks, (60, 40)) is marks
