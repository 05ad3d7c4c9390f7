"""The parts of the areas' kernels: spans against lines cut with edges, words against Python's whole numbers."""

import math

import numpy as np
import pytest
from made_outlines import convex_corners, outlines_of
from pixel_centres import union

from studio.foundations.arrays import Array
from studio.search.likelihood.area_kernels import (
    FIELDS,
    ROWS,
    WORD,
    area_blocks,
    areas_fitness,
    bits_from,
    body_box,
    count_bits,
    is_in_parts,
    limb_edges,
    limb_table,
    mean_in_order,
    most_words,
    outside_area,
    record_tables,
    span,
    spans_only,
    three_terms,
)
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps
from studio.search.likelihood.silhouette_areas import packed_windows

WIDTH, HEIGHT = 150, 90
FIRST_ROW, LAST_ROW, FIRST_COLUMN, LAST_COLUMN, AREA = 16, 17, 18, 19, 20


def scene(limbs: int = 3, size: float = 60.0) -> tuple[Array, Array]:
    """Corners (16, 1, L, 4, 2) of which many leave the picture, and outlines of them; the last limb of the last pose is
    not seen, and the first of the first lies beside the picture.
    """
    rng = np.random.default_rng(3)
    corners = convex_corners(rng, (16, 1, limbs), np.array([WIDTH / 2, HEIGHT / 2]), size).astype(np.float32)
    corners[0, 0, 0] += [400.0, 0.0] - corners[0, 0, 0].mean(axis=0)
    within = (corners > -0.5) & (corners < np.array([WIDTH, HEIGHT]) - 0.5)
    seen = within.all(axis=(3, 4)).astype(float)
    seen[-1, 0, -1] = -1.0
    return corners.astype(float), outlines_of(corners, seen, np.zeros_like(seen))


def scaled(corners: Array, scale: float) -> Array:
    """In a picture `scale` times as large, the top-left pixel's middle being (0, 0) in both."""
    return (corners + 0.5) * scale - 0.5


def cut(outline: Array, row: float) -> tuple[float, float]:
    """Where a convex outline (4, 2) begins and ends on a line of pixels' middles."""
    found = []
    for (px, py), (qx, qy) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if min(py, qy) <= row <= max(py, qy):
            found.append(px + (row - py) / (qy - py) * (qx - px))
    return min(found), max(found)


def area_of(outline: Array) -> float:
    x, y = outline.T
    return 0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_a_limbs_table_has_its_rows_columns_area_and_spans(scale: float) -> None:
    corners, outlines = scene()
    width, height = int(WIDTH * scale), int(HEIGHT * scale)
    for limb in range(3):
        table = np.zeros(FIELDS * LANES)
        limb_table(outlines[0, 0, limb], table, scale, float(width), float(height))
        rows = table.reshape(FIELDS, LANES)
        for lane in range(LANES):
            outline = scaled(corners[lane, 0, limb], scale)
            low, high = np.ceil(outline.min(axis=0)), np.floor(outline.max(axis=0))
            first, last = max(low[1], 0.0), min(high[1], height - 1.0)
            assert rows[AREA, lane] == pytest.approx(area_of(outline))
            beside = max(low[0], 0.0) > min(high[0], width - 1.0)
            if beside or (limb, lane) == (2, 15):
                assert rows[LAST_ROW, lane] == -1.0
                continue
            assert (rows[FIRST_ROW, lane], rows[LAST_ROW, lane]) == (first, last)
            assert rows[FIRST_COLUMN, lane] == max(low[0], 0.0)
            assert rows[LAST_COLUMN, lane] == min(high[0], width - 1.0)
            edges = limb_edges(table, lane)
            for row in range(int(last - first) + 1):
                left, right = cut(outline, first + row)
                assert span(edges, float(row)) == (math.ceil(left), math.floor(right) + 1.0)


def test_all_tables_are_those_of_single_limbs() -> None:
    _, outlines = scene()
    tables, views = np.zeros((1, 1, 3, FIELDS * LANES)), np.array([[0, 0, WIDTH, HEIGHT]])
    record_tables(outlines, 1.0, views, tables)
    for limb in range(3):
        table = np.zeros(FIELDS * LANES)
        limb_table(outlines[0, 0, limb], table, 1.0, float(WIDTH), float(HEIGHT))
        np.testing.assert_array_equal(tables[0, 0, limb], table)


def test_upright_and_level_edges_are_held() -> None:
    square = np.array([[10.0, 20.0], [10.0, 30.0], [14.0, 30.0], [14.0, 20.0]])
    for corners in (square, square[::-1], np.roll(square, 1, axis=0)):
        outlines = outlines_of(np.tile(corners, (16, 1, 1, 1, 1)), np.ones((16, 1, 1)), np.zeros((16, 1, 1)))
        table = np.zeros(FIELDS * LANES)
        limb_table(outlines[0, 0, 0], table, 1.0, float(WIDTH), float(HEIGHT))
        rows = table.reshape(FIELDS, LANES)[:, 5]
        assert list(rows[FIRST_ROW:]) == [20.0, 30.0, 10.0, 14.0, 40.0]
        for row in range(11):
            assert span(limb_edges(table, 5), float(row)) == (10.0, 15.0)


def test_words_of_bits() -> None:
    for place in range(65):
        assert int(bits_from(place)) == (2**64 - 1) >> place << place
    rng = np.random.default_rng(0)
    words, silhouette = (rng.integers(0, 2**64, 40, dtype=np.uint64) for _ in range(2))
    for begin, base, rows in ((0, 0, 40), (7, 3, 11), (1, 20, 1)):
        drawn, shared = count_bits(words, begin, silhouette, base, rows)
        own = [int(word) for word in words[begin : begin + rows]]
        seen = [int(word) for word in silhouette[base : base + rows]]
        assert drawn == sum(word.bit_count() for word in own)
        assert shared == sum((one & other).bit_count() for one, other in zip(own, seen, strict=True))


def test_the_box_of_a_pose_holds_all_its_limbs() -> None:
    _, outlines = scene()
    tables = np.zeros((1, 1, 3, FIELDS * LANES))
    record_tables(outlines, 1.0, np.array([[0, 0, WIDTH, HEIGHT]]), tables)
    rows = tables.reshape(3, FIELDS, LANES)
    for lane in range(LANES):
        limbs = rows[rows[:, LAST_ROW, lane] >= rows[:, FIRST_ROW, lane], :, lane]
        wanted = (
            limbs[:, FIRST_ROW].min(), limbs[:, LAST_ROW].max(), limbs[:, FIRST_COLUMN].min(),
            limbs[:, LAST_COLUMN].max(),
        )  # fmt: skip
        assert body_box(tables[0, 0], lane) == wanted
    top, bottom, left, right = body_box(tables[0, 0, :1], 0)
    assert (top, bottom) == (0, -1)
    assert right < left


def test_there_is_room_for_a_union_anywhere_in_a_picture() -> None:
    views = np.array([[0, 0, 65, 30], [0, 0, 20, 77]])
    for width, height in ((65, 77), (64, 16), (129, 1)):
        views[0, 2], views[1, 3] = width, height
        views[0, 3] = views[1, 2] = 1
        # A window begins at a sixteenth pixel; rows go in eights, and eight more.
        columns = max((width - 1 - left // 16 * 16) // WORD + 1 for left in range(width))
        rows = -(-height // ROWS) * ROWS + ROWS
        assert columns * rows <= most_words(views) <= 2 * (columns + 1) * (rows + ROWS)


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_areas_of_any_limbs_are_those_of_pixel_centres(scale: float) -> None:
    """Also what lies outside: a limb's area less its pixels, and the whole picture for one that is not seen."""
    corners, outlines = scene(4, 110.0)
    width, height = int(WIDTH * scale), int(HEIGHT * scale)
    silhouette = np.random.default_rng(1).random((height, width)) < 0.4
    maps, views = packed_windows([silhouette, ~silhouette]), np.repeat(outlines, 2, axis=1)
    counts, outside = np.zeros((1, 2, LANES, 2), np.int64), np.full((1, 2, LANES), -1.0)
    area_blocks(0, 1, 13, views, scale, maps, counts, outside)
    assert not counts[0, :, 13:].any()
    for lane in range(13):
        drawn = union(corners[lane, 0], width, height, scale)[0]
        for view, mask in enumerate((silhouette, ~silhouette)):
            assert tuple(counts[0, view, lane]) == (drawn.sum(), (drawn & mask).sum())
        beyond = 0.0
        for limb, outline in enumerate(corners[lane, 0]):
            pixels = union(outline[None], width, height, scale)[0].sum()
            if outlines.reshape(4, 10, LANES)[limb, 8, lane] == 0.0:
                beyond += max(area_of(scaled(outline, scale)) - pixels, 0.0)
        np.testing.assert_allclose(outside[0, :, lane], beyond, atol=1e-3)
    area_blocks(0, 1, 16, views, scale, maps, counts, outside)
    unseen = union(corners[-1, 0, :-1], width, height, scale)[0]
    assert tuple(counts[0, 0, 15]) == (unseen.sum(), (unseen & silhouette).sum())
    assert outside[0, 0, 15] >= width * height
    assert outside[0, 0, 15] - width * height <= sum(
        area_of(scaled(one, scale)) for one in corners[-1, 0, :-1]
    )


def test_what_a_limb_has_outside_is_its_area_less_its_pixels() -> None:
    corners, outlines = scene()
    table = np.zeros(FIELDS * LANES)
    limb_table(outlines[0, 0, 1], table, 1.0, float(WIDTH), float(HEIGHT))
    for lane in range(LANES):
        pixels = union(corners[lane, 0, 1:2], WIDTH, HEIGHT)[0].sum()
        wanted = max(area_of(corners[lane, 0, 1]) - pixels, 0.0)
        assert outside_area(table, lane, limb_edges(table, lane), WIDTH) == pytest.approx(wanted, abs=1e-3)


def test_the_limit_is_all_spans_and_all_bits_of_the_boxes() -> None:
    _, outlines = scene()
    mask = np.random.default_rng(1).random((HEIGHT, WIDTH)) < 0.4
    maps = packed_windows([mask])
    tables, sums = np.zeros((1, 1, 3, FIELDS * LANES)), np.full((1, 1, LANES), 7.0)
    record_tables(outlines, 1.0, maps.views, tables)
    spans_only(tables, maps, 2, sums)
    rows = tables.reshape(3, FIELDS, LANES)
    for lane in range(LANES):
        total = 0.0
        for limb in range(3):
            first, last = (int(number) for number in rows[limb, [FIRST_ROW, LAST_ROW], lane])
            if last < first:
                continue
            edges = limb_edges(tables[0, 0, limb], lane)
            for row in range((last - first) // 8 * 8 + 8):
                begin, after = span(edges, float(row))
                total += max(after - begin, 0.0)
        top, bottom, left, right = body_box(tables[0, 0], lane)
        window, height = left // 16 * 16, (bottom - top) // 8 * 8 + 8
        for begin in range(window, right + 1, 64):
            total += 64 * height + np.count_nonzero(mask[top : top + height, begin : begin + 64])
        assert sums[0, 0, lane] == pytest.approx(7.0 + 2.0 * total)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 15, 16, 17, 40])
def test_means_are_those_of_a_plain_sum_or_of_numpys(count: int) -> None:
    values = np.random.default_rng(count).normal(size=count) * 10.0 ** np.arange(count).clip(0, 12)
    assert mean_in_order(values, True) == values.mean()
    assert mean_in_order(values, False) == sum(values.tolist()) / count
    # The views of one pose, or of more than sixteen, lie one after the other.
    assert is_in_parts(count) == (count not in range(2, 17))


def test_fitness_is_the_mean_share_of_both_silhouettes() -> None:
    both, projected, observed = np.array([30, 0, 5]), np.array([40, 0, 10]), np.array([60, 0, 20])
    outside, found = np.array([10.0, 0.0, 0.5]), np.zeros(3)
    areas_fitness(both, projected, observed, outside, found)
    np.testing.assert_allclose(found, [0.5 * 30 / 50 + 0.5 * 30 / 60, 0.0, 0.5 * 5 / 10.5 + 0.5 * 5 / 20])
    rng = np.random.default_rng(0)
    edge, region = rng.random((2, 4, 3))
    terms = three_terms(
        edge, region, np.tile(both, (4, 1)), np.tile(projected, (4, 1)), observed, np.tile(outside, (4, 1)),
        np.array([1.1, 0.7, 1.3]),
    )  # fmt: skip
    wanted = 1.1 * (1.0 - edge.mean(axis=1)) + 0.7 * (1.0 - region.mean(axis=1)) + 1.3 * found.mean()
    np.testing.assert_allclose(terms, wanted)


def test_windows_hold_the_pixels_from_every_sixteenth_on() -> None:
    masks = [np.random.default_rng(k).random(shape) < 0.5 for k, shape in enumerate([(5, 70), (9, 16)])]
    packed: Maps = packed_windows(masks)
    for (base, words, width, height), mask in zip(packed.views, masks, strict=True):
        assert (height, width) == mask.shape
        for column in range(-(-width // 16)):
            for row in range(words):
                pixels = mask[row, 16 * column : 16 * column + 64] if row < height else []
                wanted = sum(1 << k for k, pixel in enumerate(pixels) if pixel)
                assert int(packed.values[base + column * words + row]) == wanted
