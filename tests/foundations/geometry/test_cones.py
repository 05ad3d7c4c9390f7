"""Outlines against silhouettes of densely sampled cone surfaces.

Derivation of the tolerance. In the cone's frame without its scales let u = x, the camera at (0, -d, c), and
k = (r1 - r0) / length. The plane through the camera and side B has a normal whose x-y part leans from u by
psi with tan(psi) = (r0 + k c) / d, the radius extrapolated to the camera's level over the distance. A ring
of radius r then reaches beyond that plane by at most r (1 - cos psi); the scales stretch that by at most
the larger of them, and a displacement e at depth z moves a pixel by at most f e / z (1 + t), t the tangent
of the largest field angle. A ring of n samples falls short of its true extent by r (1 - cos(pi / n)).
"""

import numpy as np
import pytest

from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import rotation_from_vector

SAMPLES = 2000
FOCAL = 800.0
FIELD = 0.7


def _camera_at(centre: np.ndarray, target: np.ndarray, up: np.ndarray) -> Camera:
    forward = (target - centre) / np.linalg.norm(target - centre)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    matrix = np.array([[FOCAL, 0.0, 320.0], [0.0, FOCAL, 240.0], [0.0, 0.0, 1.0]])
    return Camera("made up", 640, 480, matrix, np.zeros(5), rotation, -rotation @ centre)


def _scene(seed: int) -> tuple[np.ndarray, np.ndarray, Camera]:
    rng = np.random.default_rng(seed)
    scales = (1.0, 1.0) if seed % 2 else tuple(rng.uniform(0.6, 1.2, 2))
    shape = np.array([rng.choice([-1.0, 1.0]) * rng.uniform(200, 500), *rng.uniform(20, 150, 2), *scales])
    frame = np.column_stack([rotation_from_vector(rng.uniform(-2, 2, 3)), rng.uniform(-300, 300, 3)])
    middle = frame[:, 3] + 0.5 * shape[0] * frame[:, 2]
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    if abs(direction @ frame[:, 2]) > 0.8:
        direction = np.cross(direction, frame[:, 2]) / np.linalg.norm(np.cross(direction, frame[:, 2]))
    centre = middle + rng.uniform(2500, 5000) * direction
    return shape, frame, _camera_at(centre, middle + rng.uniform(-200, 200, 3), rng.standard_normal(3))


def _ring(shape: np.ndarray, frame: np.ndarray, end: int) -> np.ndarray:
    angle = np.arange(SAMPLES) * 2.0 * np.pi / SAMPLES
    radius = shape[1 + end]
    local = [
        radius * shape[3] * np.cos(angle),
        radius * shape[4] * np.sin(angle),
        np.full(SAMPLES, end * shape[0]),
    ]
    return np.stack(local, axis=1) @ frame[:, :3].T + frame[:, 3]


def _allowance(shape: np.ndarray, frame: np.ndarray, camera: Camera, end: int) -> tuple[float, float]:
    """Pixels by which a ring may reach beyond a side, and by which its samples may fall short."""
    local = frame[:, :3].T @ (camera.centre - frame[:, 3])
    distance = float(np.hypot(local[0] / shape[3], local[1] / shape[4]))
    slope = (shape[2] - shape[1]) / shape[0]
    lean = np.arctan(abs(shape[1] + slope * local[2]) / distance)
    depth = (project(camera, _ring(shape, frame, end))[1]).min()
    pixels = FOCAL / depth * (1.0 + FIELD) * max(shape[3], shape[4]) * shape[1 + end]
    return pixels * (1.0 - np.cos(lean)), pixels * (1.0 - np.cos(np.pi / SAMPLES))


@pytest.mark.parametrize("seed", range(40))
def test_sides_touch_the_silhouette(seed: int) -> None:
    shape, frame, camera = _scene(seed)
    outline, _ = project(camera, limb_outlines(shape[None], frame[None, None], camera)[0, 0])
    middle = outline.mean(axis=0)
    for start, stop in ((0, 1), (3, 2)):
        along = (outline[stop] - outline[start]) / np.linalg.norm(outline[stop] - outline[start])
        outwards = np.array([along[1], -along[0]])
        outwards *= np.sign(outwards @ (outline[start] - middle))
        for end in (0, 1):
            ring, _ = project(camera, _ring(shape, frame, end))
            reach = float(((ring - outline[start]) @ outwards).max())
            beyond, short = _allowance(shape, frame, camera, end)
            assert -short - 1e-9 <= reach <= beyond + 1e-9
            assert beyond < 0.03 * np.linalg.norm(outline[0] - outline[3])


def test_a_round_cone_seen_square_on_has_its_radii_to_either_side() -> None:
    shape = np.array([[-400.0, 90.0, 60.0, 1.0, 1.0]])
    frame = np.column_stack([np.eye(3), [10.0, 20.0, 500.0]])[None, None]
    camera = _camera_at(
        np.array([3010.0, 20.0, 300.0]), np.array([10.0, 20.0, 300.0]), np.array([0.0, 0.0, 1.0])
    )
    corners = limb_outlines(shape, frame, camera)[0, 0]
    np.testing.assert_allclose(corners[:, 0], 10.0, atol=1e-9)
    np.testing.assert_allclose(corners[:, 2], [500.0, 100.0, 100.0, 500.0])
    np.testing.assert_allclose(np.abs(corners[:, 1] - 20.0), [90.0, 60.0, 60.0, 90.0])
    assert np.sign(corners[0, 1] - 20.0) == np.sign(corners[1, 1] - 20.0) == -np.sign(corners[2, 1] - 20.0)


def test_a_camera_on_the_axis_still_gives_an_outline() -> None:
    shape = np.array([[300.0, 50.0, 40.0, 1.0, 0.7]])
    frame = np.column_stack([np.eye(3), np.zeros(3)])[None, None]
    camera = _camera_at(np.array([0.0, 0.0, 4000.0]), np.zeros(3), np.array([1.0, 0.0, 0.0]))
    corners = limb_outlines(shape, frame, camera)
    assert np.isfinite(corners).all()
    np.testing.assert_allclose(
        np.hypot(corners[0, 0, :, 0], corners[0, 0, :, 1] / 0.7), [50.0, 40.0, 40.0, 50.0]
    )


def test_many_poses_and_limbs_are_each_their_own() -> None:
    scenes = [_scene(seed) for seed in range(6)]
    camera = scenes[0][2]
    shapes = np.stack([scene[0] for scene in scenes[:3]])
    frames = np.stack([[scene[1] for scene in scenes[:3]], [scene[1] for scene in scenes[3:]]])
    together = limb_outlines(shapes, frames, camera)
    assert together.shape == (2, 3, 4, 3)
    for pose in range(2):
        for limb in range(3):
            alone = limb_outlines(shapes[limb : limb + 1], frames[pose : pose + 1, limb : limb + 1], camera)
            np.testing.assert_allclose(together[pose, limb], alone[0, 0], atol=1e-9)
