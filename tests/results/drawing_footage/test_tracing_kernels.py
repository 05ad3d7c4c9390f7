"""Pictures of simple bodies against exact silhouettes, depths and shadows."""

import numpy as np
import pytest

from studio.results.drawing_footage import flesh
from studio.results.drawing_footage.cameras import pixel_rays, placed_camera
from studio.results.drawing_footage.distance_kernels import body_distance
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.results.drawing_footage.rooms import LIGHTS
from studio.results.drawing_footage.tracing_kernels import floor_shadow, trace_person
from studio.results.drawing_footage.wardrobes import STRIPED

CAMERA = placed_camera("one", (2500.0, 300.0, 1700.0), (0.0, 0.0, 900.0), size=(96, 72), focal_px=90.0)
LABELS = np.zeros((1, 2), np.int64)


def ball(centre: tuple[float, float, float], radius: float) -> np.ndarray:
    row = np.zeros((1, flesh.COLUMNS))
    row[0, flesh.START : flesh.START + 3] = row[0, flesh.BOUND : flesh.BOUND + 3] = centre
    row[0, flesh.AXES : flesh.AXES + 9] = np.eye(3).ravel()
    row[0, [flesh.RADIUS_START, flesh.RADIUS_END, flesh.BOUND_RADIUS]] = radius
    row[0, [flesh.SCALE_X, flesh.SCALE_Y]] = 1.0
    return row


def traced(body: np.ndarray, samples: int, depth: float = 1e6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rays = pixel_rays(CAMERA, samples)
    light, coverage = np.zeros((72, 96, 3), np.float32), np.zeros((72, 96), np.float32)
    room = np.full((72, 96), depth, np.float32)
    trace_person(CAMERA.centre, rays, samples, room, body, LABELS, LIGHTS, STRIPED, light, coverage)
    return light, coverage, rays


@pytest.mark.parametrize("samples", [1, 2, 3])
def test_a_balls_silhouette_is_the_cone_of_its_tangents(samples: int) -> None:
    centre, radius = np.array([0.0, 100.0, 1000.0]), 320.0
    light, coverage, rays = traced(ball(tuple(centre), radius), samples)
    away = centre - CAMERA.centre
    angles = np.arccos(rays.astype(float) @ away / np.linalg.norm(away))
    edge = np.arcsin(radius / np.linalg.norm(away))
    slack = 1.5 / np.linalg.norm(away)  # rays that pass within TOUCH of the surface count as touching
    wanted = (angles < edge).reshape(72, samples, 96, samples).mean(axis=(1, 3))
    at_most = (angles < edge + slack).reshape(72, samples, 96, samples).mean(axis=(1, 3))
    assert np.all(coverage >= wanted - 1e-6)
    assert np.all(coverage <= at_most + 1e-6)
    assert 300 < (coverage > 0.5).sum() < 2500
    assert np.all(light[coverage == 0.0] == 0.0)
    assert light[coverage == 1.0].min() > 0.02


def test_furniture_in_front_hides_and_behind_does_not() -> None:
    body = ball((0.0, 0.0, 900.0), 300.0)
    middle = float(np.linalg.norm(CAMERA.centre - [0.0, 0.0, 900.0]))
    assert traced(body, 1, middle - 600.0)[1].max() == 0.0
    np.testing.assert_array_equal(traced(body, 1, middle + 600.0)[1], traced(body, 1)[1])


def test_the_side_to_the_lamp_is_the_brighter_one() -> None:
    light, coverage, _ = traced(ball((0.0, 0.0, 1000.0), 350.0), 2)
    rows = np.flatnonzero((coverage == 1.0).any(axis=1))
    top, bottom = rows[: len(rows) // 4], rows[-len(rows) // 4 :]
    full = coverage == 1.0
    assert light[top][full[top]].mean() > 1.3 * light[bottom][full[bottom]].mean()


def test_the_shadow_of_a_ball_lies_where_the_lamp_throws_it() -> None:
    centre, lamp = np.array([200.0, 100.0, 1200.0]), LIGHTS[0]
    key, ambient = np.ones((121, 121), np.float32), np.ones((121, 121), np.float32)
    floor_shadow(-1500.0, -1500.0, 25.0, ball(tuple(centre), 150.0), LABELS, LIGHTS, key, ambient)
    rows, columns = np.nonzero(key < 0.5)
    found = np.array([columns.mean(), rows.mean()]) * 25.0 - 1500.0
    wanted = lamp[:2] + (centre - lamp)[:2] * lamp[2] / (lamp[2] - centre[2])
    np.testing.assert_allclose(found, wanted, atol=40.0)
    assert key[0, 0] == 1.0
    assert np.all(ambient == 1.0)  # nothing is near the floor


def test_objects_on_the_floor_darken_it_around() -> None:
    key, ambient = np.ones((61, 61), np.float32), np.ones((61, 61), np.float32)
    floor_shadow(-600.0, -600.0, 20.0, ball((0.0, 0.0, 100.0), 100.0), LABELS, LIGHTS, key, ambient)
    assert ambient[30, 30] < 0.8
    assert ambient[0, 0] == 1.0


def test_tiles_leave_out_nothing_of_a_person() -> None:
    """Against the distance to the whole body along each ray, sampled densely with no piece skipped."""
    bones = skeleton_of_height(1760.0, np.random.default_rng(4))
    tables, labels = flesh.piece_tables(make_motion("walk", bones, 12, 60.0, {}), flesh.clothed_pieces(bones))
    body, camera = tables[11], CAMERA
    seen_from = camera.centre + body[:, flesh.BOUND : flesh.BOUND + 3].mean(axis=0) - [0.0, 0.0, 900.0]
    rays = pixel_rays(camera, 1)
    light, coverage = np.zeros((72, 96, 3), np.float32), np.zeros((72, 96), np.float32)
    far = np.full((72, 96), 1e6, np.float32)
    trace_person(seen_from, rays, 1, far, body, labels, LIGHTS, STRIPED, light, coverage)
    nearest = _nearest_approach(seen_from, rays, body, labels)
    assert 150 < np.count_nonzero(coverage) < 2000
    assert np.all(coverage[nearest < -1.0] == 1.0)
    assert np.all(coverage[nearest > 8.0] == 0.0)
    assert np.count_nonzero((nearest >= -1.0) & (nearest <= 8.0)) < 0.4 * np.count_nonzero(coverage)


def _nearest_approach(
    origin: np.ndarray, rays: np.ndarray, body: np.ndarray, labels: np.ndarray
) -> np.ndarray:
    """(h, w) mm: the smallest distance to the body among points every 10 mm along each ray."""
    everything, nearest = np.arange(len(body)), np.full(rays.shape[:2], np.inf)
    depths = np.arange(1800.0, 4200.0, 10.0)
    for row, column in np.ndindex(nearest.shape):
        away = np.linalg.norm(
            np.cross(body[:, flesh.BOUND : flesh.BOUND + 3] - origin, rays[row, column].astype(float)), axis=1
        )
        if np.all(away > body[:, flesh.BOUND_RADIUS] + 30.0):
            continue
        points = origin + depths[:, None] * rays[row, column].astype(float)
        nearest[row, column] = min(
            body_distance(x, y, z, body, labels, everything, len(body)) for x, y, z in points
        )
    return nearest
