"""Areas in which limbs and silhouettes disagree, beside loops over all points of the grid."""

import numpy as np
import pytest

from studio.search.trackers.agreement_kernels import (
    add_limb_counts,
    count_cells,
    distance_to,
    far_points,
    is_inside,
    is_near,
    mark_near,
    nearest_limbs,
    view_counts,
)
from studio.search.trackers.refinement_kernels import turning

Array = np.ndarray
FAR = 5.0
"""Pixels: whole points lie exactly so far from sides and corners (3, 4, 5)."""
BOX = np.array([[6.0, 5.0], [6.0, 15.0], [12.0, 15.0], [12.0, 5.0]])
DIAMOND = np.array([[20.0, 4.0], [26.0, 10.0], [20.0, 16.0], [14.0, 10.0]])
TIP = np.array([[4.0, 22.0], [10.0, 30.0], [10.0, 30.0], [16.0, 22.0]])
WIDE = np.array([[-6.0, 30.0], [-6.0, 36.0], [50.0, 36.0], [50.0, 30.0]])
UNSEEN = np.full((4, 2), np.nan)


def moved_by(quad: Array, x: float, y: float) -> Array:
    return quad + np.array([x, y])


LIMBS = np.stack(
    [UNSEEN, BOX, DIAMOND, moved_by(DIAMOND[::-1], 8.0, 9.0), TIP, moved_by(TIP[::-1], 18.0, -20.0)]
)


def depths(points: Array, quad: Array) -> Array:
    """(N,) how far points (N, 2) lie inside of all sides, times these sides' lengths; negative outside."""
    along = np.roll(quad, -1, axis=0) - quad
    around = np.sum(quad[:, 0] * np.roll(quad[:, 1], -1) - quad[:, 1] * np.roll(quad[:, 0], -1))
    away = points[:, None] - quad
    return (np.sign(around) * (along[:, 0] * away[..., 1] - along[:, 1] * away[..., 0])).min(axis=1)


def distances(points: Array, quads: Array) -> Array:
    """(N, L) from points (N, 2) to limbs (L, 4, 2): 0 inside, infinite where one is not seen."""
    found = np.full((len(points), len(quads)), np.inf)
    for limb in np.flatnonzero(np.isfinite(quads).all(axis=(1, 2))):
        quad, along = quads[limb], np.roll(quads[limb], -1, axis=0) - quads[limb]
        away = points[:, None] - quad
        shares = np.clip((away * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-9), 0.0, 1.0)
        apart = np.linalg.norm(away - shares[..., None] * along, axis=2).min(axis=1)
        found[:, limb] = np.where(depths(points, quad) >= 0.0, 0.0, apart)
    return found


def held(points: Array, quads: Array) -> Array:
    """(N, L) whether limbs hold points."""
    seen = np.isfinite(quads).all(axis=(1, 2))
    return seen & np.stack([depths(points, quad) >= 0.0 for quad in np.nan_to_num(quads)], axis=1)


def map_of(seed: int, height: int, width: int) -> Array:
    """Whole distances about the two bounds, 0 and FAR, both among them."""
    return np.random.default_rng(seed).integers(-3, 8, (height, width)).astype(np.float32)


def values_at(points: Array, signed: Array, corner: tuple[int, int]) -> Array:
    """(N,) distances at pixels, NaN where there is no map."""
    columns, rows = (points - corner).astype(int).T
    there = (columns >= 0) & (rows >= 0) & (columns < signed.shape[1]) & (rows < signed.shape[0])
    return np.where(there, signed[np.where(there, rows, 0), np.where(there, columns, 0)], np.nan)


def grid(size: tuple[int, int], step: int) -> Array:
    """(N, 2) its points in a picture, row by row."""
    rows, columns = np.mgrid[0 : size[1] : step, 0 : size[0] : step]
    return np.stack([columns.ravel(), rows.ravel()], axis=1)


def counted(quads: Array, signed: Array, corner: tuple[int, int], size: tuple[int, int], step: int) -> Array:
    """Counts (L, 3) of the grid's points in the picture."""
    points = grid(size, step)
    values, apart, inside = values_at(points, signed, corner), distances(points, quads), held(points, quads)
    bare = (values < 0.0) & np.isfinite(apart.min(axis=1)) & (apart.min(axis=1) > FAR)
    nearest = np.bincount(apart.argmin(axis=1)[bare], minlength=len(quads))
    return np.stack([inside.sum(axis=0), (inside & ~(values <= FAR)[:, None]).sum(axis=0), nearest], axis=1)


VIEWS = [
    ((5, 3), (40, 44), 1, (33, 30)),
    ((0, 0), (40, 40), 1, (40, 40)),
    ((4, 6), (33, 37), 2, (25, 20)),
    ((9, 4), (34, 31), 3, (24, 26)),
    ((2, 1), (12, 34), 1, (9, 33)),
]
"""Left and top of the map, width and height of the picture, pixels between points, width and height of the map."""


@pytest.mark.parametrize(("corner", "size", "step", "shape"), VIEWS)
def test_areas_are_counted_point_by_point(
    corner: tuple[int, int], size: tuple[int, int], step: int, shape: tuple[int, int]
) -> None:
    signed, counts = map_of(step, shape[1], shape[0]), np.full((len(LIMBS), 3), 9.0)
    view_counts(LIMBS, signed, corner, size, step, FAR, counts)
    np.testing.assert_array_equal(counts, counted(LIMBS, signed, corner, size, step))


def test_limbs_that_reach_out_of_the_picture_count_as_far_as_it() -> None:
    quads, size = np.stack([WIDE, WIDE[:, ::-1].copy(), moved_by(DIAMOND, -20.0, -10.0)]), (37, 35)
    signed, counts = map_of(5, 20, 22), np.zeros((3, 3))
    for step in (1, 4):
        view_counts(quads, signed, (3, 7), size, step, FAR, counts)
        np.testing.assert_array_equal(counts, counted(quads, signed, (3, 7), size, step))


def test_bare_silhouette_is_the_first_limbs_of_those_that_are_as_near() -> None:
    """Of a line of 49 points 0 is one limb's, 18 to 30 lie between both, 24 as near to either, 48 is the other's."""
    quads, signed = np.stack([BOX, moved_by(BOX, 30.0, 0.0)]), np.full((1, 49), -1.0, np.float32)
    for order in (quads, quads[::-1].copy()):
        counts = np.zeros((2, 3))
        view_counts(order, signed, (0, 10), (60, 40), 1, FAR, counts)
        assert counts[:, 2].tolist() == [8.0, 7.0]


def test_points_are_given_to_the_first_of_the_limbs_that_are_as_near() -> None:
    points = grid((40, 44), 1).astype(float)
    assert nearest_limbs(points, LIMBS).tolist() == distances(points, LIMBS).argmin(axis=1).tolist()
    assert nearest_limbs(points, LIMBS[:1]).tolist() == [-1] * len(points)


def test_where_no_limb_is_seen_nothing_is_bare() -> None:
    counts = np.zeros((1, 3))
    view_counts(UNSEEN[None], np.full((9, 9), -1.0, np.float32), (0, 0), (9, 9), 1, FAR, counts)
    assert not counts.any()


@pytest.mark.parametrize(("corner", "size", "step", "shape"), VIEWS)
def test_far_points_are_silhouette_that_no_limb_is_near_to(
    corner: tuple[int, int], size: tuple[int, int], step: int, shape: tuple[int, int]
) -> None:
    signed = map_of(step + 7, shape[1], shape[0])
    points = grid((60, 60), step)
    bare = (values_at(points, signed, corner) < 0.0) & (distances(points, LIMBS).min(axis=1) > FAR)
    np.testing.assert_array_equal(far_points(LIMBS, signed, corner, step, FAR), points[bare])
    assert far_points(LIMBS, signed[:0], corner, step, FAR).shape == (0, 2)


def test_places_of_limbs_are_compared_by_what_they_cover_outside_and_leave_bare() -> None:
    corner, size, step = (3, 2), (40, 42), 1
    signed = map_of(3, 36, 33)
    quads = np.stack(
        [np.stack([moved_by(BOX, 9.0 * n, 3.0), moved_by(TIP, 0.0, -4.0 * n)]) for n in range(4)]
    )
    quads[3, 0] = np.nan
    points = far_points(UNSEEN[None], signed, corner, step, FAR)
    counts = np.arange(4.0)
    add_limb_counts(quads, points, signed, corner, size, step, FAR, counts)
    for place, own in enumerate(quads):
        outside = counted(own, signed, corner, size, step)[:, 1].sum()
        bare = (distances(points, own).min(axis=1) > FAR).sum()
        assert counts[place] == place + outside + bare


@pytest.mark.parametrize("quad", [BOX, DIAMOND, DIAMOND[::-1].copy(), TIP, TIP[::-1].copy()])
def test_a_point_is_inside_near_or_far(quad: Array) -> None:
    points = np.array([[x, y] for y in range(-2, 38) for x in range(-2, 36)], dtype=float)
    turn, marked = turning(quad), np.zeros(len(points), np.bool_)
    marked[::7] = True
    mark_near(points, quad, turn, FAR, marked)
    every = zip(depths(points, quad), distances(points, quad[None])[:, 0], strict=True)
    for n, ((x, y), (depth, distance)) in enumerate(zip(points, every, strict=True)):
        assert is_inside(x, y, quad, turn) == (depth >= 0.0)
        assert distance_to(x, y, quad, turn) == pytest.approx(distance)
        near = is_near(x, y, np.stack([UNSEEN, quad]), np.array([1.0, turn]), FAR)
        assert near == (distance <= FAR)
        assert marked[n] == (distance <= FAR or n % 7 == 0)


def test_nothing_is_near_a_limb_that_is_not_seen() -> None:
    near = np.zeros(1, np.bool_)
    mark_near(np.zeros((1, 2)), UNSEEN, 1.0, FAR, near)
    assert not near.any()
    assert not is_near(0.0, 0.0, UNSEEN[None], np.ones(1), FAR)


@pytest.mark.parametrize("cell", [1, 3, 4])
def test_cells_count_frames_in_which_a_limb_covers_their_middle_outside_the_silhouette(cell: int) -> None:
    corner, signed = (5, 3), map_of(cell, 24, 28)
    rng = np.random.default_rng(cell)
    before = rng.integers(1, 5, (-(-42 // cell), -(-40 // cell))).astype(float)
    quads = np.concatenate([LIMBS, WIDE[None], moved_by(DIAMOND, -18.0, -8.0)[None]])
    counts = before.copy()
    count_cells(quads, signed, corner, cell, FAR, counts)
    columns, rows = np.meshgrid(np.arange(before.shape[1]), np.arange(before.shape[0]))
    middles = np.stack([columns.ravel(), rows.ravel()], axis=1) * cell + cell // 2
    values, covered = values_at(middles, signed, corner), held(middles, quads).any(axis=1)
    expected = np.where(values <= 0.0, 0.0, before.ravel() + (covered & ~(values <= FAR)))
    np.testing.assert_array_equal(counts.ravel(), expected)
