"""What hides a part of a line: intervals and samples against tests of every point."""

import numpy as np
import pytest
from made_outlines import convex_corners, outlines_of
from weighting_scene import inside_outline

from studio.search.likelihood.occlusion_kernels import hidden_interval, limb_boxes, may_hide, sample_bits
from studio.search.likelihood.visible_edges import hidden_samples

MIDDLE = np.array([60.0, 40.0])


@pytest.mark.parametrize("seed", range(6))
def test_a_line_is_hidden_where_its_points_lie_in_the_outline(seed: int) -> None:
    rng = np.random.default_rng(seed)
    way = np.linspace(0.0, 1.0, 2001)
    met = 0
    for outline in convex_corners(rng, (40,), MIDDLE, 60.0):
        begin, end = outline.mean(axis=0) + rng.uniform(-60.0, 60.0, (2, 2))
        inside = np.flatnonzero(inside_outline(begin + way[:, None] * (end - begin), outline))
        side, near = np.array([*begin, *end], np.float32), outline.astype(np.float32).ravel()
        first, last = hidden_interval(tuple(side), tuple(near))
        if not len(inside):
            assert last - first < 1e-3
            continue
        met += 1
        np.testing.assert_allclose([first, last], way[inside[[0, -1]]], atol=1e-3)
    assert met > 10


def test_a_line_beside_an_edge_is_hidden_within_alone() -> None:
    square = np.array([10, 10, 10, 30, 20, 30, 20, 10], np.float32)
    for near in (square, square.reshape(4, 2)[::-1].ravel()):
        for x, hidden in ((10.5, True), (9.5, False), (19.5, True), (20.5, False)):
            first, last = hidden_interval(tuple(np.array([x, 0, x, 40], np.float32)), tuple(near))
            assert (last >= first) == hidden
            if hidden:
                np.testing.assert_allclose([first, last], [0.25, 0.75])
        first, last = hidden_interval(tuple(np.array([12, 20, 18, 20], np.float32)), tuple(near))
        assert (first, last) == (0.0, 1.0)


@pytest.mark.parametrize("samples", [16, 32, 64])
def test_the_bits_are_those_of_samples_within_the_interval(samples: int) -> None:
    rng = np.random.default_rng(samples)
    middles = (np.arange(samples) + 0.5) / samples
    edges = [(0.0, 1.0), (2.0, 1.0), (-3.0, 0.4), (0.6, 7.0), (0.7, 0.3), (0.0, -2.0), (2.0, -3.0)]
    intervals = [*edges, *np.sort(rng.uniform(-0.2, 1.2, (60, 2)), axis=1)]
    # To the middle of a sample, which counts.
    intervals += [(middles[3], middles[5]), (middles[3], middles[3]), (middles[0], middles[-1])]
    for first, last in intervals:
        pair = np.float32(first), np.float32(last)
        hidden = (middles >= pair[0]) & (middles <= pair[1])
        assert int(sample_bits(pair, np.float32(samples))) == sum(1 << int(k) for k in np.flatnonzero(hidden))


@pytest.mark.parametrize("samples", [16, 64])
def test_samples_are_hidden_by_any_nearer_limb_that_is_seen(samples: int) -> None:
    rng = np.random.default_rng(samples)
    shape = (32, 2, 4)
    corners = convex_corners(rng, shape, MIDDLE, 70.0).astype(np.float32).astype(float)
    seen, depth = rng.choice([-1.0, 0.0, 1.0], shape, p=[0.2, 0.4, 0.4]), rng.uniform(900.0, 1100.0, shape)
    lines = np.array([[0, 0, 1], [0, 3, 2], [2, 1, 2], [3, 0, 3], [1, 2, 0]])
    bits = hidden_samples(outlines_of(corners, seen, depth), lines, samples)
    assert bits.shape == (2, 2, 5, 16)
    along = ((np.arange(samples) + 0.5) / samples)[:, None]
    apart = total = 0
    for pose, view, number in np.ndindex(32, 2, 5):
        limb, first, last = lines[number]
        ends = corners[pose, view, limb]
        points = ends[first] + along * (ends[last] - ends[first])
        hidden = np.zeros(samples, dtype=bool)
        for other in range(4):
            nearer = depth[pose, view, other] < depth[pose, view, limb]
            if other != limb and nearer and min(seen[pose, view, other], seen[pose, view, limb]) >= 0.0:
                hidden |= inside_outline(points, corners[pose, view, other])
        word = int(bits[pose // 16, view, number, pose % 16])
        found = np.array([word >> k & 1 for k in range(samples)], dtype=bool)
        assert word >> samples == 0
        apart, total = apart + np.count_nonzero(found != hidden), total + np.count_nonzero(hidden)
    assert total > 20 * samples
    assert apart <= 0.001 * total, "a sample to the last bit on an outline"


def test_the_box_of_a_limb_holds_its_corners_and_says_what_may_hide_it() -> None:
    rng = np.random.default_rng(5)
    corners = convex_corners(rng, (16, 1, 6), MIDDLE, 60.0).astype(np.float32)
    depth = rng.uniform(900.0, 1100.0, (16, 1, 6)).astype(np.float32)
    outlines = outlines_of(corners.astype(float), np.ones((16, 1, 6)), depth.astype(float))
    boxes = np.zeros((6, 80), np.float32)
    limb_boxes(outlines, 0, 0, boxes)
    least, largest = corners[:, 0].min(axis=2), corners[:, 0].max(axis=2)
    wanted = np.stack(
        [least[..., 0], largest[..., 0], least[..., 1], largest[..., 1], depth[:, 0]], axis=2
    )  # (16, L, 5)
    assert (boxes.reshape(6, 5, 16) == wanted.transpose(1, 2, 0)).all()
    met = set[bool]()
    for limb, other in np.ndindex(6, 6):
        over = (least[:, limb] <= largest[:, other]) & (least[:, other] <= largest[:, limb])
        wanted_here = bool((over.all(axis=1) & (depth[:, 0, other] < depth[:, 0, limb])).any())
        assert may_hide(boxes[limb], boxes[other]) == wanted_here
        met.add(wanted_here)
    assert met == {False, True}
