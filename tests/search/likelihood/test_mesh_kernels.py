"""Triangles of meshes in pictures, against the geometry's own projection and tests of every pixel's centre."""

import numpy as np
import pytest
from pixel_centres import triangles_drawn
from scipy.spatial.transform import Rotation
from weighting_scene import looking_at

from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, outward_limit
from studio.foundations.geometry.projection import project
from studio.search.likelihood.mesh_kernels import (
    compare_silhouettes,
    draw_triangles,
    project_points,
    shares_of_corners,
)

CAMERAS = tuple(
    looking_at(f"c{k}", np.array(place), np.zeros(3), size, 60.0)
    for k, (place, size) in enumerate([((900.0, 0.0, 200.0), (80, 60)), ((-300.0, 800.0, 100.0), (61, 73))])
)


def scene(seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points (24, 3) of two joints, their joints, eight triangles, and the joints' frames (2, 3, 4)."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-300.0, 300.0, (24, 3))
    turns = Rotation.random(2, random_state=seed).as_matrix()
    frames = np.concatenate([turns, rng.uniform(-100.0, 100.0, (2, 3, 1))], axis=2)
    return points, np.repeat([0, 1], 12), np.arange(24).reshape(8, 3), frames


def in_world(points: np.ndarray, joints: np.ndarray, frames: np.ndarray) -> np.ndarray:
    return np.einsum("kij,kj->ki", frames[joints, :, :3], points) + frames[joints, :, 3]


def seen_by(camera: Camera, world: np.ndarray, shrink: float) -> np.ndarray:
    """(V, 3) pixels of the smaller picture, whose first pixel's centre is (0, 0) too, and depths."""
    pixels, depths = project(camera, world)
    return np.column_stack([(pixels + 0.5) / shrink - 0.5, depths])


@pytest.mark.parametrize("shrink", [1.0, 3.0])
def test_points_are_projected_as_the_geometry_does(shrink: float) -> None:
    points, joints, _, frames = scene()
    for row, camera in zip(camera_table(CAMERAS, outward_limit), CAMERAS, strict=True):
        found = np.zeros((24, 3))
        project_points(points, frames, joints, row, shrink, found)
        wanted = seen_by(camera, in_world(points, joints, frames), shrink)
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_a_point_too_near_or_beyond_the_lens_is_not_seen() -> None:
    lens = np.array([-0.5, 0.0, 0.0, 0.0, 0.0])
    camera = Camera("c", 64, 48, np.diag([40.0, 40.0, 1.0]), lens, np.eye(3), np.zeros(3))
    # Distortion folds back where the tangent is √(2/3).
    fold = np.sqrt(2.0 / 3.0)
    points = np.array(
        [
            [0.0, 0.0, 1.001], [0.0, 0.0, 0.999], [0.0, 0.0, -5.0],
            [100.0 * (fold - 1e-3), 0.0, 100.0], [100.0 * (fold + 1e-3), 0.0, 100.0],
            [0.0, 100.0 * (fold - 1e-3), 100.0], [0.0, 100.0 * (fold + 1e-3), 100.0],
            [60.0, 60.0, 100.0], [50.0, 50.0, 100.0],
        ]
    )  # fmt: skip
    found = np.zeros((9, 3))
    still = np.eye(4)[None, :3]
    project_points(
        points, still, np.zeros(9, np.int64), camera_table((camera,), outward_limit)[0], 1.0, found
    )
    seen = [True, False, False, True, False, True, False, False, True]
    np.testing.assert_array_equal(np.isfinite(found), np.repeat(np.array(seen)[:, None], 3, axis=1))


@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_triangle_is_at_every_pixel(seed: int) -> None:
    points, joints, triangles, frames = scene(seed)
    for camera in CAMERAS:
        seen = seen_by(camera, in_world(points, joints, frames), 1.0)
        seen[4] = np.nan
        owner, depth = (
            np.empty((camera.height, camera.width), np.int64),
            np.empty((camera.height, camera.width), np.float32),
        )
        draw_triangles(seen, triangles, owner, depth)
        wanted, away = triangles_drawn(seen, triangles, camera.width, camera.height)
        np.testing.assert_array_equal(owner, wanted)
        np.testing.assert_allclose(depth, away, rtol=1e-5)
        assert len(np.unique(owner)) > 4
        assert 1 not in owner, "one of its corners is not seen"


def test_a_triangle_holds_the_centres_on_its_border_and_flat_ones_hold_none() -> None:
    seen = np.array([[2.0, 1.0, 5.0], [6.0, 1.0, 5.0], [2.0, 5.0, 5.0], [4.0, 1.0, 5.0], [-9.0, 3.0, 1.0]])
    owner, depth = np.empty((7, 9), np.int64), np.empty((7, 9), np.float32)
    wanted = np.full((7, 9), -1)
    for y in range(1, 6):
        wanted[y, 2 : 8 - y] = 0
    for corners in ([0, 1, 2], [2, 1, 0]):
        # The second is as near, and the first is kept; the third is a line.
        draw_triangles(seen, np.array([corners, corners, [0, 3, 1]]), owner, depth)
        np.testing.assert_array_equal(owner, wanted)
        np.testing.assert_array_equal(depth, np.where(wanted == 0, 5.0, np.inf))


def test_shares_of_corners_add_up_to_their_place() -> None:
    rng = np.random.default_rng(0)
    a, b, c = rng.uniform(-5.0, 5.0, (3, 2))
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    shares = shares_of_corners(a, b, c, area, 1.3, -2.1)
    np.testing.assert_allclose(sum(shares), 1.0)
    np.testing.assert_allclose(np.array(shares) @ [a, b, c], [1.3, -2.1])


def test_silhouettes_differ_from_masks_by_the_area_of_where_they_do() -> None:
    points, joints, triangles, frames = scene(1)
    rng = np.random.default_rng(2)
    poses = np.repeat(frames[None], 4, axis=0)
    poses[:, :, :, 3] += rng.uniform(-150.0, 150.0, (4, 2, 3))
    poses[3, 0, :, 3] += CAMERAS[0].centre  # some of it is behind the first camera
    shrink = np.array([1, 2])
    sizes = np.array([[60, 80], [36, 30]])
    masks = [rng.random(tuple(size)).astype(np.float32) for size in sizes]
    found = np.zeros(4)
    compare_silhouettes(
        poses, points, joints, triangles, camera_table(CAMERAS, outward_limit), shrink,
        np.concatenate([mask.ravel() for mask in masks]), sizes, found,
    )  # fmt: skip
    wanted = np.zeros(4)
    for n, pose in enumerate(poses):
        for camera, factor, mask in zip(CAMERAS, shrink, masks, strict=True):
            seen = seen_by(camera, in_world(points, joints, pose), factor)
            inside = triangles_drawn(seen, triangles, *mask.shape[::-1])[0] >= 0
            wanted[n] += np.where(inside, 1.0 - mask, mask).sum()
    np.testing.assert_allclose(found, wanted / sum(mask.sum() for mask in masks), rtol=1e-5)
    assert np.ptp(found) > 1e-3
    # Without anything in the masks the area itself is left.
    nothing = np.zeros(sum(mask.size for mask in masks), np.float32)
    compare_silhouettes(
        poses[:1],
        points,
        joints,
        triangles,
        camera_table(CAMERAS, outward_limit),
        shrink,
        nothing,
        sizes,
        found[:1],
    )
    assert found[0] == round(found[0]) > 100
