"""A hull's silhouette against convex hulls of projected half axes, pixel by pixel."""

import itertools

import numpy as np
from posed_cones import ring
from scipy.spatial import ConvexHull

from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_silhouette import silhouette
from studio.evidence.volume.tracking_space import Box
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

BOX = Box(np.full(3, -2000.0), np.full(3, 2000.0))


def hull_of(centres: np.ndarray, edges: np.ndarray) -> Hull:
    unseen = np.zeros((len(edges), 3), np.float32)
    return Hull(centres, edges, unseen, unseen[:, None], 6, BOX)


def ahead(width: int, height: int, middle: tuple[float, float] = (9.0, 7.0)) -> Camera:
    """A camera 1 m before z = 0, which it sees a pixel a millimetre, x to the right and y down."""
    matrix = np.array([[1000.0, 0.0, middle[0]], [0.0, 1000.0, middle[1]], [0.0, 0.0, 1.0]])
    return Camera("ahead", width, height, matrix, np.zeros(5), np.eye(3), np.array([0.0, 0.0, 1000.0]))


def plain(centres: np.ndarray, edges: np.ndarray, camera: Camera) -> np.ndarray:
    """All sums of -1 to 1 times the three half axes, by the projection's slopes at each centre."""
    columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)])
    picture = np.zeros((camera.height, camera.width), np.uint8)
    for centre, edge in zip(centres, edges, strict=True):
        middle = project(camera, centre)[0]
        slopes = [project(camera, centre + step)[0] - project(camera, centre - step)[0] for step in np.eye(3)]
        axes = 0.25 * edge * np.array(slopes)
        corners = [middle + np.array(signs) @ axes for signs in itertools.product((-1, 1), repeat=3)]
        inside = (ConvexHull(corners).equations @ pixels <= 1e-6).all(axis=0)
        picture[inside.reshape(picture.shape)] = 255
        column, row = np.floor(middle + 0.5).astype(int)
        if 0 <= column < camera.width and 0 <= row < camera.height:
            picture[row, column] = 255
    return picture


def test_voxels_of_any_size_cover_their_hexagons_and_the_pixels_of_their_centres() -> None:
    camera = ring(3, 80, 60)[1]
    rng = np.random.default_rng(6)
    for _ in range(6):
        edges = np.repeat([40.0, 160.0, 420.0], [20, 5, 2])
        centres = rng.uniform([-1400.0, -1400.0, -300.0], [1400.0, 1400.0, 2300.0], (len(edges), 3))
        expected = plain(centres, edges, camera)
        found = silhouette(hull_of(centres, edges), camera)
        assert 200 < np.count_nonzero(expected) < 4000
        # The slopes are measured over two millimetres.
        assert np.count_nonzero(found != expected) <= 2


def test_a_voxel_covers_the_pixels_up_to_its_very_border() -> None:
    camera = ahead(19, 15)
    expected = np.zeros((15, 19), np.uint8)
    expected[4:11, 6:13] = 255
    found = silhouette(hull_of(np.zeros((1, 3)), np.full(1, 6.0)), camera)
    np.testing.assert_array_equal(found, expected)


def test_the_pixel_of_a_centre_is_drawn_as_far_as_the_picture_goes_and_a_voxel_behind_is_not() -> None:
    """Threads of voxels, thinner than a pixel, whose centres lie beside the pixels' own."""
    camera = ahead(6, 5, (0.0, 0.0))
    x, y = np.meshgrid(np.arange(-2.0, 9.0) + 0.3, np.arange(-2.0, 8.0) - 0.3)
    centres = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    for centre in centres:
        column, row = np.floor(centre[:2] + 0.5).astype(int)
        expected = np.zeros((5, 6), np.uint8)
        if 0 <= column < 6 and 0 <= row < 5:
            expected[row, column] = 255
        found = silhouette(hull_of(centre[None], np.full(1, 0.1)), camera)
        np.testing.assert_array_equal(found, expected)
    behind = np.array([[2.0, 2.0, -1800.0]])
    assert not silhouette(hull_of(behind, np.full(1, 4.0)), camera).any()
    both = np.concatenate([behind, [[3.0, 2.0, 0.0]]])
    assert silhouette(hull_of(both, np.full(2, 0.1)), camera)[2, 3] == 255


def test_a_voxel_that_fills_the_picture_covers_its_outermost_pixels() -> None:
    assert (silhouette(hull_of(np.zeros((1, 3)), np.full(1, 60.0)), ahead(19, 15)) == 255).all()
