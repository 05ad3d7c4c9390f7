"""Equations of meshes' outlines beside sums over points, with outlines made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from studio.search.likelihood.mesh_outlines import MeshOutline
from studio.search.trackers.mesh_equations import MeshEquations, _compared, _explained

Array = np.ndarray


def outline_of(seed: int, count: int = 40) -> MeshOutline:
    """Points about a circle with directions about outwards."""
    rng = np.random.default_rng(seed)
    turns = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return MeshOutline(
        20.0 + 9.0 * around + rng.normal(0, 0.2, (count, 2)),
        around,
        np.zeros(count, np.int64),
        np.zeros((count, 3)),
    )


def border_of(seed: int, count: int = 60) -> Array:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(0.0, 2.0 * np.pi, count)
    places, ways = rng.uniform(6.0, 34.0, (count, 2)), np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return np.hstack([places, ways])


def test_a_border_point_is_explained_by_the_nearest_of_twelve_that_faces_as_it_does() -> None:
    outline, border, reach = outline_of(0), border_of(1), 7.0
    rows, away, across = _explained(outline, border, reach)
    for k, (x, y, *way) in enumerate(border):
        apart = np.linalg.norm(outline.border - [x, y], axis=1)
        near = [n for n in np.argsort(apart)[:12] if apart[n] < reach and outline.outward[n] @ way >= 0.5]
        if not near:
            assert (rows[k], away[k], across[k]) == (-1, reach, 0.0)
            continue
        beyond = (outline.border[near[0]] - [x, y]) @ outline.outward[near[0]]
        assert rows[k] == near[0]
        assert across[k] == pytest.approx(beyond)
        assert away[k] == pytest.approx(abs(beyond))
    assert 5 < (rows < 0).sum() < 55


def test_nothing_explains_where_there_is_no_border_or_no_outline() -> None:
    few = outline_of(0, 3)
    assert (_explained(few, border_of(1), 50.0)[0] >= -1).all()
    nothing = MeshOutline(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros((0, 3)))
    rows, away, across = _explained(nothing, border_of(1), 4.0)
    assert (rows == -1).all()
    assert (away == 4.0).all()
    assert not across.any()
    assert [len(part) for part in _explained(outline_of(0), np.zeros((0, 4)), 4.0)] == [0, 0, 0]
    for outline, signed in ((nothing, np.ones((9, 9))), (outline_of(0), np.zeros((0, 0)))):
        assert [len(part) for part in _compared(outline, signed, np.zeros(2, np.int64), 4.0)] == [0, 0, 0]


def test_an_outlines_points_are_as_far_outside_as_the_map_says_and_half_a_pixel() -> None:
    """A map of 30 by 20 from (10, 14) on that rises by 0.5 a column and falls by 0.25 a row."""
    rows, columns = np.mgrid[0:20, 0:30]
    signed, corner, reach = 0.5 * columns - 0.25 * rows - 3.0, np.array([10, 14]), 4.0
    outline = outline_of(2)
    found, away, across = _compared(outline, signed, corner, reach)
    for n, (x, y) in enumerate(outline.border):
        u, v = x - 10.0, y - 14.0
        inside = 0.0 <= u <= 29.0 and 0.0 <= v <= 19.0
        value = np.clip(0.5 * u - 0.25 * v - 3.0 + 0.5, -reach, reach) if inside else reach
        if inside or (u < -1.0 or v < -1.0 or u > 30.0 or v > 20.0):
            assert across[n] == pytest.approx(value)
            assert away[n] == pytest.approx(abs(value))
            assert found[n] == (n if abs(value) < reach else -1)
    assert 3 < (found < 0).sum() < 35
    assert len(_compared(outline_of(0, 900), signed, corner, reach)[0]) == 300


def test_a_meshs_equations_are_the_sums_over_both_kinds_of_points() -> None:
    size, rng = 3, np.random.default_rng(0)
    outlines, borders = [outline_of(4), outline_of(5)], [border_of(6), border_of(7)]
    maps = [
        (3.0 * rng.normal(size=(30, 30)), np.array([4, 6])),
        (3.0 * rng.normal(size=(30, 30)), np.array([5, 5])),
    ]
    slopes = rng.normal(size=(2, 40, size))
    own = MeshEquations.__new__(MeshEquations)
    own._differences = np.ones(size)
    own._outlines = SimpleNamespace(
        of=lambda pose: outlines, slopes=lambda pose, view, outline, rows, differences: slopes[view, rows]
    )
    mm, scales, part = np.array([2.0, 3.0]), np.array([5.0, 7.0]), 0.1
    loss, gradient, matrix = own.of(np.zeros(size), borders, maps, mm, scales, part)
    wanted, pull, square = 0.0, np.zeros(size), np.zeros((size, size))
    for view in range(2):
        reach = 4.0 * scales[view] / mm[view]
        for weight, (rows, away, across) in (
            (1.0, _explained(outlines[view], borders[view], reach)),
            (part, _compared(outlines[view], *maps[view], reach)),
        ):
            for row, far, beyond in zip(rows, away, across, strict=True):
                ratio = (far * mm[view] / scales[view]) ** 2
                wanted += weight * scales[view] ** 2 * ratio / (1.0 + ratio)
                if row >= 0:
                    slope = mm[view] * slopes[view, row]
                    share = weight / (1.0 + ratio) ** 2
                    pull += share * mm[view] * beyond * slope
                    square += share * np.outer(slope, slope)
    assert loss == pytest.approx(wanted)
    np.testing.assert_allclose(gradient, pull)
    np.testing.assert_allclose(matrix, square)
