"""The hull as a value: volume weights, containment, pieces."""

import numpy as np
import pytest
from scipy import ndimage

from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels, fill_cubes, labels_of, piece_numbers
from studio.evidence.volume.tracking_space import Box

BOX = Box(np.array([-800.0, -800.0, 0.0]), np.array([800.0, 800.0, 1600.0]))
UNIT = 1600.0 / 64


def hull_of_cells(cells: list[tuple[int, int, int, int]]) -> Hull:
    """x, y, z and side, all in voxels of the last depth."""
    rows = np.array(cells, dtype=float).reshape(-1, 4)
    edges = rows[:, 3] * UNIT
    centres = BOX.corner + rows[:, :3] * UNIT + 0.5 * edges[:, None]
    colours = np.zeros((len(rows), 3), np.float32)
    return Hull(centres, edges, colours, np.zeros((len(rows), 2, 3), np.float32), 6, BOX)


def test_volume_weights_and_top() -> None:
    hull = hull_of_cells([(0, 0, 0, 4), (4, 0, 0, 1), (8, 8, 60, 2)])
    assert hull.smallest_edge == UNIT
    assert hull.volume() == pytest.approx((64 + 1 + 8) * UNIT**3)
    np.testing.assert_allclose(hull.weights(), np.array([64, 1, 8]) / 73.0)
    assert hull.top() == pytest.approx(62 * UNIT)


def test_an_empty_hull_is_handled() -> None:
    hull = hull_of_cells([])
    assert hull.empty
    assert hull.volume() == 0.0
    assert np.isnan(hull.top())
    assert hull.weights().shape == (0,)
    assert not hull.contains(np.zeros((3, 3))).any()
    assert chosen_voxels(hull, piece_numbers(hull)[0] == 0).empty


def test_points_lie_in_voxels_of_any_size() -> None:
    cells = [(0, 0, 0, 4), (4, 0, 0, 1), (40, 50, 60, 2)]
    hull = hull_of_cells(cells)
    points = np.random.default_rng(0).uniform(-900.0, 1700.0, (4000, 3))
    points[:2000] = BOX.corner + np.random.default_rng(1).uniform(0.0, 8.0 * UNIT, (2000, 3))
    low, high = hull.centres - 0.5 * hull.edges[:, None], hull.centres + 0.5 * hull.edges[:, None]
    expected = ((points[:, None] >= low) & (points[:, None] < high)).all(axis=2).any(axis=1)
    assert 50 < expected.sum() < 1500
    np.testing.assert_array_equal(hull.contains(points), expected)
    assert hull.contains(points.reshape(40, 100, 3)).shape == (40, 100)


def test_pieces_are_numbered_by_volume_and_corners_join() -> None:
    hull = hull_of_cells([(0, 0, 0, 1), (20, 20, 20, 4), (24, 24, 24, 1), (1, 1, 1, 1), (50, 5, 5, 1)])
    numbers, volumes = piece_numbers(hull)
    np.testing.assert_array_equal(numbers, [1, 0, 0, 1, 2])
    np.testing.assert_allclose(volumes, np.array([65, 2, 1]) * UNIT**3)
    kept = chosen_voxels(hull, piece_numbers(hull)[0] == 0)
    np.testing.assert_array_equal(kept.centres, hull.centres[[1, 2]])
    assert kept.colours.shape == (2, 3)
    assert kept.view_colours.shape == (2, 2, 3)


def test_pieces_of_cells_are_those_that_scipy_finds_in_the_order_of_their_first_cells() -> None:
    for seed in range(30):
        rng = np.random.default_rng(seed)
        filled = np.zeros((9, 8, 12), np.bool_)
        filled[1:-1, 1:-1, 1:-1] = rng.random((7, 6, 10)) < rng.choice([0.05, 0.12, 0.3])
        expected, count = ndimage.label(filled, np.ones((3, 3, 3)))
        labels = labels_of(filled)
        assert labels.max() == count
        firsts = [np.flatnonzero(labels == number)[0] for number in range(1, count + 1)]
        assert firsts == sorted(firsts)
        for number in range(1, count + 1):
            assert len(np.unique(expected[labels == number])) == 1
        np.testing.assert_array_equal(labels > 0, filled)


def test_cubes_fill_their_own_cells() -> None:
    filled = np.zeros((9, 9, 9), np.bool_)
    fill_cubes(np.array([[1, 2, 3], [5, 5, 6]]), np.array([3, 1]), filled)
    expected = np.zeros_like(filled)
    expected[1:4, 2:5, 3:6] = expected[5, 5, 6] = True
    np.testing.assert_array_equal(filled, expected)
