"""The sums of the benchmark's score, sample by sample, on limbs that no body has: exact, as they are whole numbers."""

import numpy as np
import pytest
from made_outlines import convex_corners, outlines_of
from weighting_scene import on_grid

from studio.foundations.arrays import Array
from studio.search.likelihood.bodytrack_kernels import MOST_ROWS, add_samples, intervals, score_blocks
from studio.search.likelihood.edge_region_kernels import as_pairs
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps

SIZES = np.array([[190, 150], [140, 201]])
CAPACITY = 1 << 14


def scene() -> tuple[Array, Array]:
    """Corners (32, 2, 4, 4, 2) and how they are seen: the first limb lies within the picture in all of a block's poses,
    the second in some, and one in four of the others is not seen.
    """
    rng = np.random.default_rng(5)
    corners = convex_corners(rng, (32, 2, 4), SIZES[:, None] / 2.0, 110.0)
    middle = corners[:, :, 0].mean(axis=2, keepdims=True)
    corners[:, :, 0] += SIZES[:, None] / 2.0 - middle
    corners = corners.astype(np.float32).astype(float)
    within = ((corners > -0.49) & (corners < SIZES[:, None, None] - 0.51)).all(axis=(3, 4))
    seen = within.astype(float)
    seen[:, :, 2:][rng.random((32, 2, 2)) < 0.25] = -1.0
    assert within[:, :, 0].all()
    return corners, seen


def noise() -> Maps:
    """Two maps of each view, each followed by a 0."""
    rng, parts, places, start = np.random.default_rng(6), [], [], 0
    for width, height in SIZES:
        row = []
        for most in (255 * 255 + 1, 2):
            parts.append(np.append(rng.integers(0, most, width * height), 0).astype(np.uint16))
            row.append(start)
            start += len(parts[-1])
        places.append([*row, width, height])
    return Maps(np.concatenate(parts), np.array(places))


def steps(way: Array, size: float) -> tuple[int, bool]:
    """Intervals on a line, and whether rounding leaves no doubt about them."""
    number = float(np.linalg.norm(way)) / size + 0.5
    return max(4, int(number)), abs(number - round(number)) > 1e-3


def samples(outline: Array) -> tuple[list[Array], list[Array], bool]:
    """Points (K, 2) on the sides and within, as the benchmark places them."""
    a, b, c, d = outline
    sure, sides, within = True, [], []
    for side, way in ((0.0, b - a), (1.0, c - d)):
        n, clear = steps(way, 5.0)
        sides.append(on_grid(outline, np.arange(n + 1) / n, np.array([side])))
        sure &= clear
    rows, clear = steps(b - a, 10.0)
    columns, other = steps(0.5 * (d + c - a - b), 10.0)
    within.append(on_grid(outline, np.arange(rows + 1) / rows, np.arange(columns) / columns))
    return sides, within, sure and clear and other


@pytest.mark.parametrize("rows", [MOST_ROWS, 8])
def test_sums_are_those_of_every_sample_inside_a_picture(rows: int) -> None:
    """Sixteen poses side by side, and one by one where there is no room for that."""
    corners, seen = scene()
    maps, sums = noise(), np.full((2, LANES, 4), -1)
    score_blocks(0, 2, outlines_of(corners, seen, np.zeros_like(seen)), maps, CAPACITY, rows, sums)
    compared = 0
    for pose in range(32):
        wanted, sure = np.zeros(4), True
        for view, limb in np.ndindex(2, 4):
            if seen[pose, view, limb] < 0.0:
                continue
            *kinds, clear = samples(corners[pose, view, limb])
            sure &= clear
            width, height = SIZES[view]
            for kind, points in enumerate(kinds):
                places = np.concatenate(points) + 0.5
                sure &= bool(np.abs(places - np.round(places)).min() > 5e-5)
                x, y = np.floor(places).astype(int).T
                there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
                values = maps.values[maps.views[view, kind] + y[there] * width + x[there]]
                wanted[2 * kind : 2 * kind + 2] += values.astype(float).sum(), there.sum()
        if sure:
            compared += 1
            np.testing.assert_array_equal(sums[pose // 16, pose % 16], wanted)
    assert compared > 15
    second = np.full_like(sums, -1)
    score_blocks(1, 2, outlines_of(corners, seen, np.zeros_like(seen)), maps, CAPACITY, rows, second)
    assert (second[0] == -1).all()
    np.testing.assert_array_equal(second[1], sums[1])


def test_what_finds_no_room_is_left_out() -> None:
    corners, seen = scene()
    outlines, maps, sums = (
        outlines_of(corners, seen, np.zeros_like(seen)),
        noise(),
        np.zeros((2, LANES, 4), np.int64),
    )
    whole = np.zeros_like(sums)
    score_blocks(0, 2, outlines, maps, CAPACITY, 8, whole)
    score_blocks(0, 2, outlines, maps, 48, 8, sums)
    assert (sums[..., 1::2] <= np.minimum(whole[..., 1::2], 2 * 48)).all()
    assert (sums <= whole).all()
    assert (sums[..., 1] > 0).any()
    assert (sums[..., 3] < whole[..., 3]).all()


def test_lines_have_four_intervals_or_one_for_each_step() -> None:
    for length, wanted in ((0.0, 4), (22.4, 4), (22.6, 5), (100.0, 20), (102.4, 20), (102.6, 21)):
        way = np.float32(0.6 * length), np.float32(-0.8 * length)
        assert intervals(*way, np.float32(5.0)) == wanted


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 40])
def test_entries_that_fill_up_add_nothing(count: int) -> None:
    rng = np.random.default_rng(count)
    values = np.append(rng.integers(1, 1000, 60), 0).astype(np.uint16)
    indices = rng.integers(0, 50, 64).astype(np.uint32)
    wanted = values[5 + indices[:count]].astype(int).sum()
    assert add_samples(values, np.uint64(5), np.uint32(55), indices, as_pairs(indices), count) == wanted
