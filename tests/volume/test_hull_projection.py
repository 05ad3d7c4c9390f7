"""Voxels in pictures: against projected points and convex hulls of projected corners."""

import dataclasses

import numpy as np
import pytest
from posed_cones import ring
from scipy.spatial import ConvexHull

from studio.geometry.camera import Camera
from studio.geometry.camera_table import camera_table, picture_limit
from studio.geometry.projection import project
from studio.volume import hull_projection as projection
from studio.volume.reconstruction import radical_inverses

CORNERS = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=float)
HEIGHTS = radical_inverses(4096)


def placed(camera: Camera, centre: np.ndarray, half: float) -> np.ndarray | None:
    place = np.empty(projection.PLACE)
    seen = projection.place_voxel(camera_table([camera], picture_limit), 0, *centre, half, place)
    return place if seen else None


def places_near(camera: Camera, half: float) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    centres = rng.uniform([-900, -900, 100], [900, 900, 1900], (40, 3))
    return [centre for centre in centres if placed(camera, centre, half) is not None]


@pytest.mark.parametrize("half", [6.0, 13.0, 100.0])
def test_centre_area_and_bounds_are_those_of_the_projected_corners(half: float) -> None:
    camera = ring(3)[1]
    for centre in places_near(camera, half):
        place = placed(camera, centre, half)
        assert place is not None
        pixels, depth = project(camera, centre + half * CORNERS)
        np.testing.assert_allclose(place[[projection.U, projection.V]], project(camera, centre)[0], atol=1e-9)
        area = ConvexHull(pixels).volume
        assert place[projection.AREA] == pytest.approx(area, rel=0.002 + 0.9 * (half / depth.min()))
        reach = np.abs(pixels - project(camera, centre)[0]).max(axis=0)
        bounds = place[[projection.BOUND_X, projection.BOUND_Y]]
        assert (bounds >= reach - 0.1).all()
        assert (bounds <= 1.15 * reach + 0.3).all()


def test_samples_lie_inside_and_spread_evenly() -> None:
    camera, centre, half = ring(3)[0], np.array([150.0, -80.0, 800.0]), 140.0
    place = placed(camera, centre, half)
    assert place is not None
    count = 4096
    samples = np.array([projection.sample_pixel(place, number, count, HEIGHTS) for number in range(count)])
    outline = ConvexHull(project(camera, centre + half * CORNERS)[0])
    distances = outline.equations[:, :2] @ samples.T + outline.equations[:, 2:]
    # Pixels are rounded: at most half a diagonal outside.
    assert distances.max() < 0.8
    columns, rows = np.meshgrid(np.arange(320), np.arange(240))
    inside = (
        outline.equations @ np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)]) < -1.0
    ).all(axis=0)
    hits = np.zeros((240, 320))
    np.add.at(hits, (samples[:, 1], samples[:, 0]), 1.0)
    found = hits.ravel()[inside]
    assert found.mean() == pytest.approx(count / outline.volume, rel=0.05)
    assert found.std() < 0.35 * found.mean()


def test_the_number_of_samples_is_the_root_of_the_area() -> None:
    place = np.zeros(projection.PLACE)
    for area, factor, expected in ((100.0, 1.0, 10), (101.0, 1.0, 11), (0.2, 1.0, 1), (100.0, 1.5, 15)):
        place[projection.AREA] = area
        assert projection.sample_count(place, factor) == expected


def test_a_single_sample_is_the_middle() -> None:
    camera = ring(3)[0]
    place = placed(camera, np.array([0.0, 0.0, 900.0]), 5.0)
    assert place is not None
    expected = np.floor(project(camera, np.array([0.0, 0.0, 900.0]))[0] + 0.5)
    np.testing.assert_array_equal(projection.sample_pixel(place, 0, 1, HEIGHTS), expected)


def test_voxels_at_or_behind_the_camera_or_where_the_lens_folds_are_not_seen() -> None:
    camera = ring(3)[0]
    assert placed(camera, camera.centre + 60.0 * camera.rotation[2], 10.0) is None
    assert placed(camera, camera.centre - 900.0 * camera.rotation[2], 10.0) is None
    folded = camera.centre + camera.rotation.T @ np.array([2.05, 0.0, 1.0]) * 1000.0
    assert placed(camera, folded, 10.0) is None
    straight = dataclasses.replace(camera, distortion=np.zeros(5))
    assert placed(straight, straight.centre + 900.0 * straight.rotation[2], 10.0) is not None
