"""A made scene for the weighting's tests, and plain NumPy twins of what the kernels do."""

import numpy as np
from looking_cameras import turned_to
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project

CENTRE = np.array([0.0, 0.0, 900.0])


def looking_at(
    name: str, centre: Array, target: Array, size: tuple[int, int] = (320, 240), focal: float = 260.0
) -> Camera:
    """A camera with a little of every kind of distortion and a skew."""
    rotation = turned_to(centre, target)
    matrix = np.array([[focal, 0.7, size[0] / 2 + 3], [0, focal * 1.02, size[1] / 2 - 2], [0, 0, 1.0]])
    distortion = np.array([-0.2, 0.06, 0.002, -0.001, 0.01])
    return Camera(name, *size, matrix, distortion, rotation, -rotation @ centre)


def four_cameras() -> tuple[Camera, ...]:
    """Around the body, of unequal sizes."""
    sizes = ((320, 240), (301, 257), (320, 240), (260, 280))
    return tuple(
        looking_at(f"c{k}", CENTRE + np.array([3200 * np.cos(a), 3200 * np.sin(a), 1300]), CENTRE, size)
        for k, (a, size) in enumerate(zip(np.deg2rad([25.0, 115.0, 200.0, 300.0]), sizes, strict=True))
    )


def smooth_evidence(cameras: tuple[Camera, ...], seed: int = 0) -> FrameEvidence:
    """Maps that vary slowly over the picture, so that a sample's value identifies its position but rounding
    to the next pixel changes little."""
    rng = np.random.default_rng(seed)
    views = []
    for camera in cameras:
        y, x = np.mgrid[: camera.height, : camera.width]
        maps = []
        for _ in range(2):
            wave = sum(np.sin(x * a + y * b + c) for a, b, c in rng.uniform(-0.05, 0.05, (4, 3)) * [1, 1, 60])
            maps.append(np.round(127.5 + 127.5 * wave / 4).astype(np.uint8))
        views.append(ViewEvidence(camera.name, np.repeat(maps[0][:, :, None], 3, axis=2), maps[0], maps[1]))
    return FrameEvidence(7, tuple(views))


def plain_evidence(cameras: tuple[Camera, ...], mask: int, edges: int) -> FrameEvidence:
    """Maps of one value each."""
    views = []
    for camera in cameras:
        shape = (camera.height, camera.width)
        picture = np.zeros((*shape, 3), np.uint8)
        views.append(
            ViewEvidence(
                camera.name, picture, np.full(shape, mask, np.uint8), np.full(shape, edges, np.uint8)
            )
        )
    return FrameEvidence(0, tuple(views))


def scattered(body: BodyModel, count: int, seed: int = 1, spread: float = 8.0) -> Array:
    """Poses around the neutral one, `spread` frames' worth of movement at 60 Hz apart."""
    step = np.array([entry.max_step for entry in body.parameters]) / 60.0
    return body.neutral + spread * step * np.random.default_rng(seed).uniform(-1, 1, (count, len(step)))


def true_corners(body: BodyModel, camera: Camera, poses: Array) -> tuple[Array, Array]:
    """Corners (N, L, 4, 2) and their depths (N, L, 4) by the kinematics' and geometry's own code, in double
    precision."""
    shapes = kinematic_tables(body).limb_shape
    return project(camera, limb_outlines(shapes, limb_frames(body, poses), camera))


def on_grid(outline: Array, along: Array, across: Array) -> Array:
    """(K, 2) points of an outline A0, A1, B1, B0 at fractions along and across."""
    a, b, c, d = outline
    s, t = (values.ravel()[:, None] for values in np.meshgrid(across, along))
    return (1 - s) * ((1 - t) * a + t * b) + s * ((1 - t) * d + t * c)


def inside_outline(points: Array, outline: Array) -> NDArray[np.bool_]:
    """Whether points (..., 2) lie in a convex outline (4, 2), by the side of each edge that they are on."""
    following = np.roll(outline, -1, axis=0)
    sides = np.stack(
        [
            (q[0] - p[0]) * (points[..., 1] - p[1]) - (q[1] - p[1]) * (points[..., 0] - p[0])
            for p, q in zip(outline, following, strict=True)
        ]
    )
    return (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)


def read(picture: NDArray[np.uint8], points: Array, outside: float) -> Array:
    """Values of the nearest pixels, `outside` where there is none."""
    x, y = np.floor(points + 0.5).astype(int).T
    height, width = picture.shape
    there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    values = picture[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)].astype(np.float64)
    return np.where(there, values, outside)
