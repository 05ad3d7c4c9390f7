"""The distance field against closed forms: spheres, capsules, and the absence of passing through."""

import numpy as np
import pytest

from studio.results.drawing_footage import flesh
from studio.results.drawing_footage.distance_kernels import (
    body_distance,
    body_normal,
    gather,
    light_share,
    nearest_piece,
    no_pieces,
    piece_distance,
    soft_minimum,
)
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height


def piece(
    start: tuple, end: tuple, radius: tuple[float, float], bulge: float = 0.0, scale: tuple = (1.0, 1.0)
) -> np.ndarray:
    """One row of the piece table, as `piece_tables` fills it."""
    row = np.zeros(flesh.COLUMNS)
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    length = float(np.linalg.norm(b - a))
    axis = (b - a) / length if length else np.array([0.0, 0.0, 1.0])
    x = np.cross(axis, [0.3, 0.7, 0.2])
    x /= np.linalg.norm(x)
    row[flesh.START : flesh.START + 3] = a
    row[flesh.AXES : flesh.AXES + 9] = np.stack([x, np.cross(axis, x), axis]).ravel()
    row[flesh.LENGTH], row[flesh.RADIUS_START], row[flesh.RADIUS_END] = length, *radius
    row[flesh.BULGE], row[flesh.SCALE_X], row[flesh.SCALE_Y] = bulge, *scale
    row[flesh.BOUND : flesh.BOUND + 3] = 0.5 * (a + b)
    row[flesh.BOUND_RADIUS] = 0.5 * length + max(radius) + bulge
    return row


def test_a_sphere_is_a_sphere() -> None:
    ball = piece((10.0, 20.0, 30.0), (10.0, 20.0, 30.0), (50.0, 50.0))
    for point in np.random.default_rng(1).normal(0.0, 200.0, (50, 3)):
        wanted = np.linalg.norm(point - [10.0, 20.0, 30.0]) - 50.0
        assert piece_distance(*point, ball) == pytest.approx(wanted)


def test_a_capsule_is_a_capsule() -> None:
    a, b = np.array([-100.0, 40.0, 0.0]), np.array([150.0, -60.0, 220.0])
    capsule = piece(tuple(a), tuple(b), (40.0, 40.0))
    for point in np.random.default_rng(2).normal(0.0, 300.0, (80, 3)):
        share = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        assert piece_distance(*point, capsule) == pytest.approx(
            np.linalg.norm(point - a - share * (b - a)) - 40.0
        )


def test_the_surface_of_a_bulging_elliptical_piece_follows_its_formula() -> None:
    limb = piece((0.0, 0.0, 0.0), (0.0, 0.0, 400.0), (80.0, 50.0), bulge=12.0, scale=(0.8, 1.1))
    x, y = limb[flesh.AXES : flesh.AXES + 3], limb[flesh.AXES + 3 : flesh.AXES + 6]
    for share in (0.1, 0.4, 0.9):
        early = share * (1.6 - 0.6 * share)
        radius = 80.0 - 30.0 * share + 12.0 * 4.0 * early * (1.0 - early)
        for direction, scale in ((x, 0.8), (-x, 0.8), (y, 1.1), (-y, 1.1)):
            point = direction * radius * scale + np.array([0.0, 0.0, 400.0 * share])
            assert piece_distance(*point, limb) == pytest.approx(0.0, abs=1e-9)


def test_the_soft_minimum_rounds_only_near_equality_and_never_grows() -> None:
    rng = np.random.default_rng(3)
    for a, b in rng.normal(0.0, 40.0, (100, 2)):
        melted = soft_minimum(a, b, 26.0)
        assert melted <= min(a, b)
        assert melted >= min(a, b) - 26.0 / 4.0 - 1e-12
        if abs(a - b) >= 26.0:
            assert melted == min(a, b)


@pytest.fixture(scope="module")
def person() -> tuple[np.ndarray, np.ndarray]:
    motion = make_motion("walk", skeleton_of_height(1760.0, np.random.default_rng(1)), 3, 60.0, {})
    tables, labels = flesh.piece_tables(motion, flesh.clothed_pieces(motion.skeleton))
    return tables[0], labels


def test_marching_never_passes_through(person: tuple[np.ndarray, np.ndarray]) -> None:
    """The field may not promise more room than there is: a step of SAFETY × distance stays outside."""
    pieces, labels = person
    everything = np.arange(len(pieces))
    rng = np.random.default_rng(4)
    for _ in range(200):
        point = rng.uniform([-1200.0, -1500.0, 0.0], [1200.0, 0.0, 1900.0])
        distance = body_distance(*point, pieces, labels, everything, len(pieces))
        if distance > 5.0:
            ways = rng.normal(size=(20, 3))
            ways /= np.linalg.norm(ways, axis=1, keepdims=True)
            reached = point + 0.85 * distance * ways
            left = [body_distance(*place, pieces, labels, everything, len(pieces)) for place in reached]
            assert min(left) > -1.0


def test_gathered_pieces_are_all_that_a_ray_can_touch(person: tuple[np.ndarray, np.ndarray]) -> None:
    pieces, labels = person
    everything, active = np.arange(len(pieces)), no_pieces(pieces)
    rng = np.random.default_rng(5)
    middle = pieces[:, flesh.BOUND : flesh.BOUND + 3].mean(axis=0)
    for _ in range(100):
        origin = middle + rng.normal(0.0, 1.0, 3) * 2500.0
        ahead = middle + rng.normal(0.0, 300.0, 3) - origin
        ahead /= np.linalg.norm(ahead)
        count, first, last = gather(*origin, *ahead, pieces, 12.0, active)
        for t in np.linspace(0.0, 6000.0, 200):
            point = origin + t * ahead
            full = body_distance(*point, pieces, labels, everything, len(pieces))
            if full < 0.5:
                assert first <= t <= last
                assert body_distance(*point, pieces, labels, active, count) == pytest.approx(full, abs=8.0)


def test_normals_point_outwards_along_the_steepest_rise() -> None:
    ball = piece((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (100.0, 100.0))[None]
    labels, active = np.zeros((1, 2), np.int64), np.zeros(1, np.int64)
    for way in np.random.default_rng(6).normal(size=(20, 3)):
        way /= np.linalg.norm(way)
        np.testing.assert_allclose(
            body_normal(*(100.0 * way), ball, labels, active, 1), way, atol=0.015
        )  # step / radius


def test_the_nearest_piece_gives_its_material() -> None:
    pieces = np.stack(
        [piece((0, 0, 0), (0, 0, 0), (10.0, 10.0)), piece((100, 0, 0), (100, 0, 0), (10.0, 10.0))]
    )
    assert nearest_piece(80.0, 0.0, 0.0, pieces, np.arange(2), 2) == 1
    assert nearest_piece(20.0, 0.0, 0.0, pieces, np.arange(2), 2) == 0


def test_a_ball_under_a_lamp_shades_as_in_geometry() -> None:
    """Lamp of radius 100 at 2000, ball of radius 150 at 1000: full shadow inside 200, none beyond 400 of the axis."""
    ball = piece((0.0, 0.0, 1000.0), (0.0, 0.0, 1000.0), (150.0, 150.0))[None]
    labels, active = np.zeros((1, 2), np.int64), np.zeros(1, np.int64)
    lamp = np.array([0.0, 0.0, 2000.0])
    shares = [
        light_share(x, 0.0, 0.0, lamp, 100.0, ball, labels, active) for x in (0.0, 150.0, 290.0, 430.0, 900.0)
    ]
    assert shares[0] == 0.0
    assert shares[1] < 0.15
    assert 0.2 < shares[2] < 0.8
    assert shares[3] > 0.85
    assert shares[4] == 1.0
    behind = light_share(0.0, 0.0, 1500.0, lamp, 100.0, ball, labels, active)
    assert behind == 1.0
