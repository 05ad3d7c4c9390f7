"""The equations of outlines against silhouettes beside plain sums over points, and their parts at chosen places."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from studio.search.trackers.refinement_kernels import (
    beyond,
    box_of,
    in_another,
    is_seen,
    look_at_limbs,
    nearest_edge,
    normal_equations,
    read_map,
    turning,
)

Array = np.ndarray
SIDES = ((0, 1), (3, 2), (1, 2))
"""Corners that side A, side B and the far end go from and to."""


def box(left: float, top: float, right: float, bottom: float) -> Array:
    """A limb that hangs down from its upper side: A0, A1, B1, B0."""
    return np.array([[left, top], [left, bottom], [right, bottom], [right, top]], dtype=float)


@dataclass(frozen=True)
class View:
    """What one camera has of the limbs, as `normal_equations` takes it."""

    quads: Array
    slopes: Array
    signed: Array
    corner: tuple[int, int]
    size: tuple[int, int]
    border: Array
    mm: float
    scale: float


def distance_inside(point: Array, quad: Array) -> float:
    """How deep a point lies in a convex quadrilateral, negative outside of one of its sides."""
    along = np.roll(quad, -1, axis=0) - quad
    across = along[:, 0] * (point - quad)[:, 1] - along[:, 1] * (point - quad)[:, 0]
    depth = across / np.linalg.norm(along, axis=1)
    return float(depth.min() if depth.sum() > 0.0 else (-depth).min())


def is_border(point: Array, quads: Array, own: int) -> bool:
    """Whether no other limb has a point more than a pixel inside it."""
    return not any(distance_inside(point, quad) > 1.0 for n, quad in enumerate(quads) if n != own)


def robust(away: float, scale: float) -> tuple[float, float]:
    """Geman and McClure's loss of a distance, and the weight of its residual in the equations."""
    loss = away**2 / (1.0 + away**2 / scale**2)
    return loss, 1.0 / (1.0 + away**2 / scale**2) ** 2


def edges_of(seen: list[int], ends: Array) -> list[tuple[int, int, int]]:
    return [(limb, *corners) for limb in seen for n, corners in enumerate(SIDES) if n < 2 or ends[limb]]


def by_plain_sums(view: View, ends: Array, slack: Array, part: float) -> tuple[float, Array, Array]:
    """Loss, gradient and matrix of a view, point by point with whole arrays of slopes."""
    size = view.slopes.shape[-1]
    loss, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
    seen = [n for n, quad in enumerate(view.quads) if np.isfinite(quad).all()]
    quads = {n: view.quads[n] for n in seen}

    def others(limb: int) -> Array:
        return np.array([quad for n, quad in quads.items() if n != limb])

    def add(
        weight: float, residual: float, normal: Array, limb: int, first: int, second: int, u: float
    ) -> None:
        slope = (1.0 - u) * view.slopes[limb, first] + u * view.slopes[limb, second]
        row = view.mm * normal @ slope
        gradient[:] += weight * residual * row
        matrix[:] += weight * np.outer(row, row)

    def less(away: float, limb: int) -> float:
        return np.sign(away) * max(0.0, abs(away) - slack[limb])

    for x, y, *outward in view.border:
        point, best = np.array([x, y]), None
        nearest = 4.0 * view.scale / view.mm
        for limb, first, second in edges_of(seen, ends):
            begin, way = quads[limb][first], quads[limb][second] - quads[limb][first]
            u = float(np.clip((point - begin) @ way / (way @ way), 0.0, 1.0))
            place = begin + u * way
            normal = np.array([way[1], -way[0]]) / np.linalg.norm(way)
            # The edge's outward direction is away from the middle of its limb.
            away_from_limb = np.sign(normal @ (begin - quads[limb].mean(axis=0))) * normal
            apart = float(np.linalg.norm(place - point))
            if apart >= nearest or away_from_limb @ outward < 0.3 or not is_border(place, others(limb), -1):
                continue
            nearest, best = apart, (limb, first, second, u, normal, place)
        away = nearest * view.mm if best is None else less(nearest * view.mm, best[0])
        own, weight = robust(away, view.scale)
        loss += own
        if best is not None and away > 0.0:
            limb, first, second, u, normal, place = best
            residual = less(normal @ (place - point) * view.mm, limb)
            add(weight, residual, normal, limb, first, second, u)
    for limb, first, second in edges_of(seen, ends) if part else []:
        for u in (np.arange(12) + 0.5) / 12:
            place = (1.0 - u) * quads[limb][first] + u * quads[limb][second]
            within = (place >= 0.0).all() and (place < np.array(view.size) - 1.0).all()
            if not within or not is_border(place, others(limb), -1):
                continue
            there = place - view.corner
            if (there < 0.0).any() or (there >= np.array(view.signed.shape[::-1]) - 1.0).any():
                loss += part * view.scale**2
                continue
            value = map_coordinates(view.signed.astype(float), there[::-1, None], order=1)[0]
            column, row = np.floor(there).astype(int)
            fx, fy = there - [column, row]
            (a, b), (c, d) = view.signed[row : row + 2, column : column + 2]
            slope = np.array([(b - a) * (1 - fy) + (d - c) * fy, (c - a) * (1 - fx) + (d - b) * fx])
            away = less(value * view.mm, limb)
            own, weight = robust(away, view.scale)
            loss += part * own
            add(part * weight, away, slope, limb, first, second, u)
    return loss, gradient, matrix


def equations(views: list[View], ends: Array, slack: Array, part: float) -> tuple[float, Array, Array]:
    rows, begin, border = [], 0, 0
    for view in views:
        height, width = view.signed.shape
        rows.append([begin, width, height, border, border + len(view.border), *view.corner])
        begin, border = begin + view.signed.size, border + len(view.border)
    size = views[0].slopes.shape[-1]
    matrix, gradient = np.full((size, size), 7.0), np.full(size, 7.0)
    loss = normal_equations(
        np.stack([view.quads for view in views]),
        np.stack([view.slopes for view in views]),
        ends,
        slack,
        np.concatenate([view.signed.ravel() for view in views]).astype(np.float32),
        np.array(rows),
        np.array([view.size for view in views]),
        np.concatenate([view.border for view in views]),
        np.array([view.mm for view in views]),
        np.array([view.scale for view in views]),
        part,
        matrix,
        gradient,
    )
    return loss, gradient, matrix


def drawn_view(seed: int, size: int = 9) -> View:
    """Four limbs, one the other way round, one of them unseen, that overlap; border points about them."""
    rng = np.random.default_rng(seed)
    quads = np.stack([box(8, 4, 15, 24), box(12, 18, 30, 27)[::-1], box(25, 20, 32, 37), box(2, 2, 6, 9)])
    quads = quads + rng.uniform(-1.2, 1.2, quads.shape)
    quads[3, rng.integers(4), rng.integers(2)] = np.nan
    slopes = rng.standard_normal((4, 4, 2, size))
    # Each limb has parameters that do not move it.
    slopes[:, :, :, rng.permuted(np.tile(np.arange(size) < 4, (4, 1)), axis=1)[0]] = 0.0
    slopes[0, :, :, -1] = slopes[1, :, :, 0] = 0.0
    turns = rng.uniform(0.0, 2.0 * np.pi, 60)
    border = np.column_stack([rng.uniform(0, 40, 60), rng.uniform(0, 40, 60), np.cos(turns), np.sin(turns)])
    return View(
        quads, slopes, rng.standard_normal((26, 22)).astype(np.float32) * 3, (7, 3), (31, 36), border,
        rng.uniform(2.0, 4.0), rng.uniform(5.0, 9.0),
    )  # fmt: skip


@pytest.mark.parametrize("part", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_equations_are_the_sums_over_border_and_outlines(seed: int, part: float) -> None:
    views = [drawn_view(2 * seed), drawn_view(2 * seed + 1)]
    ends, slack = np.array([False, True, True, True]), np.array([0.0, 3.0, 0.0, 0.0])
    loss, gradient, matrix = equations(views, ends, slack, part)
    expected = [by_plain_sums(view, ends, slack, part) for view in views]
    assert loss == pytest.approx(sum(own for own, _, _ in expected), rel=1e-9)
    np.testing.assert_allclose(gradient, sum(own for _, own, _ in expected), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(matrix, sum(own for _, _, own in expected), rtol=1e-9, atol=1e-9)


def looked_at(quads: Array) -> tuple[Array, Array, Array, Array]:
    count = len(quads)
    usable, turns = np.zeros(count, np.bool_), np.zeros(count)
    sides, boxes = np.zeros((count, 4, 3)), np.zeros((count, 4))
    look_at_limbs(quads, np.zeros((count, 4, 2, 3)), usable, turns, sides, boxes)
    return usable, turns, sides, boxes


def test_a_limb_whose_slopes_are_unknown_is_not_used() -> None:
    quads, slopes = np.stack([box(0, 0, 4, 9)] * 4), np.zeros((4, 4, 2, 3))
    slopes[1, 0, 0, 0] = slopes[2, 3, 1, 2] = np.nan
    usable, turns = np.zeros(4, np.bool_), np.zeros(4)
    look_at_limbs(quads, slopes, usable, turns, np.zeros((4, 4, 3)), np.zeros((4, 4)))
    assert usable.tolist() == [True, False, False, True]


def test_a_quadrilateral_has_a_turn_a_box_and_a_place() -> None:
    quad = np.array([[3.0, 1.0], [1.0, 6.0], [5.0, 9.0], [8.0, 2.0]])
    assert turning(quad) == -turning(quad[::-1].copy()) == -1.0
    assert turning(np.zeros((4, 2))) == -1.0
    for shift in range(4):
        assert box_of(np.roll(quad, shift, axis=0)) == (1.0, 1.0, 8.0, 9.0)
    assert is_seen(quad)
    for corner in range(4):
        for axis in range(2):
            for value in (np.nan, np.inf):
                unseen = quad.copy()
                unseen[corner, axis] = value
                assert not is_seen(unseen)


def test_what_lies_up_to_a_pixel_inside_another_limb_is_still_border() -> None:
    quads = np.stack([box(10, 10, 20, 30), box(0, 0, 50, 50)])
    usable, _, sides, boxes = looked_at(quads)
    for x, y, hidden in (
        (15.0, 20.0, True), (11.0, 20.0, False), (11.5, 20.0, True), (19.0, 20.0, False), (18.5, 20.0, True),
        (15.0, 11.0, False), (15.0, 11.5, True), (15.0, 29.0, False), (15.0, 28.5, True), (9.0, 20.0, False),
        (15.0, 35.0, False),
    ):  # fmt: skip
        assert in_another(x, y, quads, usable, sides, boxes, 1) == hidden
    # A limb hides nothing of its own, and one that is not seen hides nothing.
    assert not in_another(25.0, 40.0, quads, usable, sides, boxes, 1)
    assert in_another(25.0, 40.0, quads, usable, sides, boxes, 0)
    assert not in_another(15.0, 20.0, quads, np.array([False, True]), sides, boxes, 1)


def explained(
    point: tuple[float, float], outward: tuple[float, float], ends: bool
) -> tuple[int, int, float, float]:
    """Limb, edge, place and squared distance of what explains a point, up to six pixels away."""
    quads = np.stack([box(10, 10, 20, 30)])
    usable, turns, sides, boxes = looked_at(quads)
    return nearest_edge(*point, *outward, quads, usable, turns, sides, boxes, np.array([ends]), 6.0)


def test_an_edge_explains_what_is_near_and_faces_as_it_does() -> None:
    assert explained((7.0, 15.0), (-1.0, 0.0), False) == (0, 0, 0.25, 9.0)
    assert explained((24.0, 25.0), (1.0, 0.0), False) == (0, 1, 0.75, 16.0)
    assert explained((14.0, 32.0), (0.0, 1.0), True) == (0, 2, 0.4, 4.0)
    # Not the far end of a limb from which another hangs, nor what is as far as the reach.
    assert explained((14.0, 32.0), (0.0, 1.0), False)[0] == -1
    assert explained((4.0, 15.0), (-1.0, 0.0), False) == (-1, 0, 0.0, 36.0)
    assert explained((4.5, 15.0), (-1.0, 0.0), False)[0] == 0
    # Beyond an edge's end its corner is nearest.
    assert explained((7.0, 6.0), (-1.0, 0.0), False) == (0, 0, 0.0, 25.0)
    # Cosines of 0.3 and a little less.
    for cosine, limb in ((0.31, 0), (0.29, -1), (-1.0, -1)):
        sine = np.sqrt(1.0 - cosine**2)
        assert explained((7.0, 15.0), (-cosine, sine), False)[0] == limb
        assert explained((24.0, 15.0), (cosine, sine), False)[0] == limb


def test_a_limb_that_is_a_line_or_a_point_explains_what_its_sides_can() -> None:
    quads = np.stack([box(10, 10, 10, 10), box(10, 12, 10, 30)])
    usable, turns, sides, boxes = looked_at(quads)
    found = nearest_edge(8.0, 20.0, -1.0, 0.0, quads, usable, turns, sides, boxes, np.ones(2, bool), 9.0)
    assert found[0] == 1
    assert found[3] == 4.0


def test_a_map_is_read_between_its_pixels_and_nowhere_else() -> None:
    values = np.arange(20.0).astype(np.float32)  # A map of 4 x 3 from 5 on: 5 + x + 4 y.
    for x, y in ((0.0, 0.0), (1.25, 0.5), (2.75, 1.75), (0.0, 1.5), (2.5, 0.0)):
        there, value, across, along = read_map(x, y, values, 5, 4, 3)
        assert there
        assert (value, across, along) == (5.0 + x + 4.0 * y, 1.0, 4.0)
    for x, y in ((-0.1, 1.0), (3.0, 1.0), (1.0, -0.1), (1.0, 2.0), (9.0, 9.0)):
        assert read_map(x, y, values, 5, 4, 3) == (False, 0.0, 0.0, 0.0)


def test_a_slope_is_that_of_the_map_at_the_point() -> None:
    a, b, c, d = 1.0, 4.0, 2.0, 11.0
    values, u, v = np.array([a, b, c, d], dtype=np.float32), 0.25, 0.4
    there, value, across, along = read_map(u, v, values, 0, 2, 2)
    assert there
    assert value == pytest.approx(a + (b - a) * u + (c - a) * v + (a - b - c + d) * u * v)
    assert across == pytest.approx(b - a + (a - b - c + d) * v)
    assert along == pytest.approx(c - a + (a - b - c + d) * u)


def test_slack_is_taken_off_a_distance_of_either_sign() -> None:
    found = [beyond(distance, 2.0) for distance in (5.0, 1.5, 0.0, -1.5, -5.0)]
    assert found == [3.0, 0.0, 0.0, 0.0, -3.0]
