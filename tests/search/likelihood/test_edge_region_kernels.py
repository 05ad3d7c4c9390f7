"""The samples that edges and regions are weighed by, index by index, on limbs that no body has."""

import numpy as np
import pytest
from made_outlines import convex_corners, outlines_of
from weighting_scene import on_grid

from studio.foundations.arrays import Array
from studio.search.likelihood.edge_region_kernels import (
    add_lanes,
    add_up,
    as_pairs,
    loads_only,
    record_indices,
    weight_blocks,
)
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps
from studio.search.likelihood.visible_edge_kernels import edge_blocks, record_edges

SIZES = np.array([[90, 70], [64, 101]])
LIMBS = 3


def scene() -> tuple[Array, Array, Array]:
    """Corners (32, 2, L, 4, 2), how they are seen, and outlines; the first limb lies within in all of a block's poses,
    the others leave the picture in some and are not seen in some.
    """
    rng = np.random.default_rng(5)
    corners = convex_corners(rng, (32, 2, LIMBS), SIZES[:, None] / 2.0, 40.0).astype(np.float32).astype(float)
    corners[:, :, 0] = SIZES[:, None] / 2.0 + 0.3 * (
        corners[:, :, 0] - corners[:, :, 0].mean(axis=2, keepdims=True)
    )
    corners = corners.astype(np.float32).astype(float)
    within = ((corners > -0.49) & (corners < SIZES[:, None, None] - 0.51)).all(axis=(3, 4))
    seen = within.astype(float)
    seen[:, :, 2][rng.random((32, 2)) < 0.3] = -1.0
    assert within[:, :, 0].all()
    assert not within[:, :, 1].all()
    return corners, seen, outlines_of(corners, seen, np.zeros_like(seen))


def maps_of(padding: list[int]) -> Maps:
    """Two maps of noise for each view, one after the other."""
    rng, parts, places, start = np.random.default_rng(6), [], [], 0
    for width, height in SIZES:
        row = []
        for _ in range(2):
            parts.append(np.concatenate([rng.integers(0, 256, width * height), padding]).astype(np.uint8))
            row.append(start)
            start += len(parts[-1])
        places.append([*row, width, height])
    return Maps(np.concatenate(parts), np.array(places))


def indices_of(points: Array, view: int, seen: float) -> Array:
    """Of the nearest pixels; of no pixel the number after them all."""
    width, height = SIZES[view]
    x, y = np.floor(points + 0.5).astype(int).T
    there = (x >= 0) & (x < width) & (y >= 0) & (y < height) & (seen >= 0.0)
    return np.where(there, y * width + x, width * height)


@pytest.mark.parametrize(("edge_chunks", "region_chunks"), [(1, 2), (4, 1)])
def test_samples_are_the_nearest_pixels_along_the_lines(edge_chunks: int, region_chunks: int) -> None:
    corners, seen, outlines = scene()
    rng = np.random.default_rng(7)
    hidden = rng.integers(0, 2**32, (2, 2, LIMBS, 2, LANES), dtype=np.uint64) << np.uint64(16)
    hidden &= np.uint64(2 ** (16 * edge_chunks) - 1)
    shape = (2, 2, LANES, LIMBS)
    edges, region = (
        np.zeros((*shape, edge_chunks, 2, 16), np.uint32),
        np.zeros((*shape, region_chunks, 3, 16), np.uint32),
    )
    maps = maps_of([255, 0])
    record_indices(outlines, hidden, maps.views, edges, region)
    along = [(np.arange(16 * chunks) + 0.5) / (16 * chunks) for chunks in (edge_chunks, region_chunks)]
    apart = total = 0
    costs, counted = np.zeros((2, 2, LANES, 2)), np.zeros((2, 2, LANES))
    for pose, view, limb in np.ndindex(32, 2, LIMBS):
        block, lane, outline = pose // 16, pose % 16, corners[pose, view, limb]
        found = edges[block, view, lane, limb]
        for side in range(2):
            points = on_grid(outline, along[0], np.array([float(side)]))
            wanted = indices_of(points, view, seen[pose, view, limb])
            word = int(hidden[block, view, limb, side, lane])
            bits = np.array([word >> k & 1 for k in range(len(points))], dtype=bool)
            wanted[bits] = SIZES[view].prod() + 1
            read = found[:, side].ravel()
            apart, total = apart + np.count_nonzero(read != wanted), total + len(points)
            costs[block, view, lane, 0] += maps.values[maps.views[view, 0] + read].astype(float).sum()
            counted[block, view, lane] += np.count_nonzero(~bits)
        for strip in range(3):
            points = on_grid(outline, along[1], np.array([(2 * strip + 1) / 6]))
            wanted = indices_of(points, view, seen[pose, view, limb])
            read = region[block, view, lane, limb, :, strip].ravel()
            apart, total = apart + np.count_nonzero(read != wanted), total + len(points)
            costs[block, view, lane, 1] += maps.values[maps.views[view, 1] + read].astype(float).sum()
    assert apart <= 0.001 * total, "a sample to the last bit between two pixels"
    # Eq. 14 and 15 of these samples, and Eq. 17.
    wanted = costs / 255.0
    wanted[..., 0] /= counted
    wanted[..., 1] /= LIMBS * 3 * 16 * region_chunks
    terms, weights = np.full((2, LANES, 2, 2), -1.0), np.full((2, LANES), 5.0)
    given = edge_chunks, region_chunks, maps, np.array([0.7, 1.9])
    weight_blocks(0, 2, 27, outlines, hidden, *given, terms, weights)
    found = terms.reshape(32, 2, 2)
    np.testing.assert_allclose(found[:27], wanted.transpose(0, 2, 1, 3).reshape(32, 2, 2)[:27], rtol=1e-12)
    assert (found[27:] == -1.0).all()
    np.testing.assert_allclose(weights.ravel()[:27], -(found @ [0.7, 1.9]).sum(axis=1)[:27])
    # Where all is hidden the edges are the worst.
    weight_blocks(
        1, 2, 32, outlines, np.full_like(hidden, 2 ** (16 * edge_chunks) - 1), *given, terms, weights
    )
    assert (terms[1, :, :, 0] == 1.0).all()
    np.testing.assert_array_equal(terms[0], found[:16].reshape(terms[0].shape))


def test_nothing_is_hidden_where_no_bits_are_given() -> None:
    _, _, outlines = scene()
    maps, nothing = maps_of([255, 0]), np.zeros((2, 2, LIMBS, 2, LANES), np.uint64)
    given, found = (1, 1, maps, np.ones(2)), []
    for hidden in (nothing, nothing[:0]):
        terms, weights = np.zeros((2, LANES, 2, 2)), np.zeros((2, LANES))
        weight_blocks(0, 2, 32, outlines, hidden, *given, terms, weights)
        found.append(terms)
    np.testing.assert_array_equal(*found)


def test_entries_are_added_up_pose_by_pose_and_together() -> None:
    rng = np.random.default_rng(0)
    values, base = rng.integers(0, 256, 500).astype(np.uint8), 100
    for rows in (4, 12, 32):
        indices = rng.integers(0, 400, (rows, LANES)).astype(np.uint32)
        pairs, sums = as_pairs(indices), np.arange(LANES)
        read = values[base + indices].astype(int)
        add_lanes(values, np.uint64(base), pairs.ravel(), sums)
        np.testing.assert_array_equal(sums, np.arange(LANES) + read.sum(axis=0))
        assert add_up(values, np.uint64(base), pairs) == read.sum()


def test_the_limit_of_all_loads_adds_the_same_entries() -> None:
    rng, maps = np.random.default_rng(1), maps_of([255, 0])
    indices = [rng.integers(0, 64 * 70, (2, 2, LANES, rows, 16)).astype(np.uint32) for rows in (2, 3)]
    pairs = [as_pairs(part).reshape(2, 2, LANES, -1, 8) for part in indices]
    sums = np.full((2, 2, LANES, 2), 9)
    loads_only(maps, *pairs, 3, sums)
    for block, view, lane, kind in np.ndindex(sums.shape):
        read = maps.values[maps.views[view, kind] + indices[kind][block, view, lane]].astype(int).sum()
        assert sums[block, view, lane, kind] == 9 + 3 * read


@pytest.mark.parametrize("chunks", [1, 4])
def test_visible_edges_are_the_mean_of_their_samples(chunks: int) -> None:
    corners, seen, outlines = scene()
    rng, maps, lines = (
        np.random.default_rng(8),
        maps_of([0, 0]),
        np.array([[0, 0, 1], [1, 3, 2], [2, 1, 2], [1, 0, 3]]),
    )
    hidden = rng.integers(0, 2**63, (2, 2, 4, LANES), dtype=np.uint64) & np.uint64(2 ** (16 * chunks) - 1)
    hidden[0, 0, :, 5] = 2 ** (16 * chunks) - 1
    recorded = np.zeros((2, 2, LANES, 4, chunks, 1, 16), np.uint32)
    record_edges(outlines, lines, hidden, maps.views, recorded)
    found = np.full((2, 2, LANES), -1.0)
    edge_blocks(0, 2, outlines, lines, hidden, chunks, maps, found)
    along = ((np.arange(16 * chunks) + 0.5) / (16 * chunks))[:, None]
    apart = 0
    for pose, view in np.ndindex(32, 2):
        block, lane, values = pose // 16, pose % 16, []
        for number, (limb, first, last) in enumerate(lines):
            ends = corners[pose, view, limb]
            wanted = indices_of(
                ends[first] + along * (ends[last] - ends[first]), view, seen[pose, view, limb]
            )
            word = int(hidden[block, view, number, lane])
            bits = np.array([word >> k & 1 for k in range(16 * chunks)], dtype=bool)
            wanted[bits] = SIZES[view].prod() + 1
            read = recorded[block, view, lane, number].ravel()
            apart += np.count_nonzero(read != wanted)
            values.append(maps.values[maps.views[view, 0] + read[~bits]])
        values = np.concatenate(values)
        mean = values.mean() / 255.0 if len(values) else 0.0
        assert found[block, view, lane] == pytest.approx(mean, rel=1e-12)
    assert apart <= 0.001 * recorded.size
    only = np.full_like(found, -1.0)
    edge_blocks(1, 2, outlines, lines, hidden, chunks, maps, only)
    assert (only[0] == -1.0).all()
    np.testing.assert_array_equal(only[1], found[1])
