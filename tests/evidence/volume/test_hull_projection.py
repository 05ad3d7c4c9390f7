"""Voxels in pictures: against projected points and convex hulls of projected corners."""

import dataclasses

import numpy as np
import pytest
from posed_cones import ring
from scipy.spatial import ConvexHull

from studio.evidence.volume import hull_projection as projection
from studio.evidence.volume.reconstruction import radical_inverses
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, picture_limit
from studio.foundations.geometry.projection import project

CORNERS = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)], dtype=float)
HEIGHTS = radical_inverses(4096)


def rows_of(camera: Camera, centre: np.ndarray, half: float) -> np.ndarray:
    """Projections (rows, 16) of a voxel, sixteen times the same."""
    rows = np.ones((projection.ROWS, projection.LANES))
    rows[projection.CENTRE : projection.CENTRE + 3] = centre[:, None]
    projection.place_voxels(camera_table([camera], picture_limit), 0, half, rows.reshape(-1))
    return rows


def placed(camera: Camera, centre: np.ndarray, half: float) -> np.ndarray | None:
    place = rows_of(camera, centre, half)[:, 5]
    return place if place[projection.SEEN] else None


def pixels_of(rows: np.ndarray, count: int) -> np.ndarray:
    """(count,) places in the picture of a voxel's samples."""
    rows[projection.COUNT] = count
    pixels = np.empty((count, projection.LANES))
    projection.sample_pixels(rows.reshape(-1), count, 320.0, 240.0, HEIGHTS, pixels.reshape(-1))
    return pixels[:, 5].astype(int)


def places_near(camera: Camera, half: float) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    centres = rng.uniform([-900, -900, 100], [900, 900, 1900], (40, 3))
    return [centre for centre in centres if placed(camera, centre, half) is not None]


@pytest.mark.parametrize("half", [6.0, 13.0, 100.0])
def test_centre_area_and_bounds_are_those_of_the_projected_corners(half: float) -> None:
    camera = ring(3)[1]
    for centre in places_near(camera, half):
        place = placed(camera, centre, half)
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
    count = 4096
    found = pixels_of(rows_of(camera, centre, half), count)
    samples = np.stack([found % 320, found // 320], axis=1)
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
    rows = np.ones((projection.ROWS, projection.LANES))
    for area, factor, expected in ((100.0, 1.0, 10), (101.0, 1.0, 11), (0.2, 1.0, 1), (100.0, 1.5, 15)):
        rows[projection.AREA, :3] = area, 4.0 * area, 100.0 * area
        rows[projection.SEEN, :3] = 1.0, 1.0, 0.0
        most = projection.count_samples(rows.reshape(-1), 3, factor)
        assert rows[projection.COUNT, 0] == expected
        assert most == rows[projection.COUNT, 1]


def test_a_single_sample_is_the_middle() -> None:
    camera = ring(3)[0]
    (pixel,) = pixels_of(rows_of(camera, np.array([0.0, 0.0, 900.0]), 5.0), 1)
    expected = np.floor(project(camera, np.array([0.0, 0.0, 900.0]))[0] + 0.5)
    assert [pixel % 320, pixel // 320] == expected.tolist()


def test_voxels_at_or_behind_the_camera_or_where_the_lens_folds_are_not_seen() -> None:
    camera = ring(3)[0]
    assert placed(camera, camera.centre + 60.0 * camera.rotation[2], 10.0) is None
    assert placed(camera, camera.centre - 900.0 * camera.rotation[2], 10.0) is None
    folded = camera.centre + camera.rotation.T @ np.array([2.05, 0.0, 1.0]) * 1000.0
    assert placed(camera, folded, 10.0) is None
    straight = dataclasses.replace(camera, distortion=np.zeros(5))
    assert placed(straight, straight.centre + 900.0 * straight.rotation[2], 10.0) is not None
