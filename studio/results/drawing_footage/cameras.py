"""Cameras for synthetic footage: rigs in the room's corners or around it, cameras placed by hand, rays for the
renderer."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import distorted

CORNERS = (
    (2720.0, 2330.0, 2480.0),
    (-2650.0, 2300.0, 2530.0),
    (-2700.0, -2280.0, 2440.0),
    (2620.0, -2360.0, 2510.0),
)
CORNER_TARGET = (0.0, 0.0, 820.0)
CORNER_FOCAL = 0.78
FIVE_RADIUS, FIVE_START, FIVE_FOCAL = 3950.0, np.radians(20.0), 0.84
FIVE_HEIGHTS = (2500.0, 1900.0, 2700.0, 2100.0, 2600.0)
FIVE_TARGET = (0.0, 0.0, 900.0)
RIG_LENS = (-0.22, 0.08, 0.0006, -0.0004, 0.0)
UNDISTORT_ROUNDS = 40


def placed_camera(
    name: str,
    position: tuple[float, float, float],
    look_at: tuple[float, float, float],
    *,
    size: tuple[int, int],
    focal_px: float,
    roll: float = 0.0,
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0),
    principal: tuple[float, float] | None = None,
) -> Camera:
    """A camera at `position` (mm) looking at a point, `roll` radians clockwise about its axis.

    Raises CalibrationError when it would look straight along the vertical or at itself.
    """
    ahead = np.subtract(look_at, position).astype(float)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    if np.linalg.norm(right) < 1e-6 * max(float(np.linalg.norm(ahead)), 1e-9) or not ahead.any():
        raise CalibrationError(
            f"Camera '{name}' looks straight up, down or at itself.",
            "Move its look_at point off the vertical.",
        )
    ahead, right = ahead / np.linalg.norm(ahead), right / np.linalg.norm(right)
    down = np.cross(ahead, right)
    cosine, sine = np.cos(roll), np.sin(roll)
    rotation = np.stack([cosine * right + sine * down, -sine * right + cosine * down, ahead])
    cx, cy = principal or ((size[0] - 1) / 2.0, (size[1] - 1) / 2.0)
    matrix = np.array([[focal_px, 0.0, cx], [0.0, focal_px, cy], [0.0, 0.0, 1.0]])
    return Camera(
        name,
        size[0],
        size[1],
        matrix,
        np.array(distortion),
        rotation,
        -rotation @ np.array(position, dtype=float),
    )


def ring_camera(
    name: str, size: tuple[int, int], focal_px: float, target: Array, place: tuple[float, float, float]
) -> Camera:
    """An upright camera that looks at `target` (3,) with the distortion of a usual lens. place : its bearing (radians),
    distance and height (mm) from there.
    """
    bearing, distance, above = place
    position = target + np.array([distance * np.cos(bearing), distance * np.sin(bearing), above])
    x, y, z = (float(value) for value in position)
    middle, lens = (size[0] / 2, size[1] / 2), (-0.32, 0.14, 0.0, 0.0, 0.0)
    at = (float(target[0]), float(target[1]), float(target[2]))
    return placed_camera(name, (x, y, z), at, size=size, focal_px=focal_px, distortion=lens, principal=middle)


def corner_rig(size: tuple[int, int], rng: np.random.Generator) -> tuple[Camera, ...]:
    """Four cameras under the ceiling of the room's corners, slightly rolled, with barrel distortion as webcams have."""
    return _webcams(CORNERS, CORNER_TARGET, CORNER_FOCAL, size, rng)


def five_rig(size: tuple[int, int], rng: np.random.Generator) -> tuple[Camera, ...]:
    """Five such cameras around the hall, evenly spaced at different heights (Caillette et al. 2007 had five)."""
    angles = FIVE_START + 2.0 * np.pi * np.arange(5) / 5.0
    places = tuple(
        (FIVE_RADIUS * float(np.cos(angle)), FIVE_RADIUS * float(np.sin(angle)), height)
        for angle, height in zip(angles, FIVE_HEIGHTS, strict=True)
    )
    return _webcams(places, FIVE_TARGET, FIVE_FOCAL, size, rng)


RIGS: dict[str, Callable[[tuple[int, int], np.random.Generator], tuple[Camera, ...]]] = {
    "corners": corner_rig,
    "five": five_rig,
}


def _webcams(
    places: tuple[tuple[float, float, float], ...],
    target: tuple[float, float, float],
    focal_share: float,
    size: tuple[int, int],
    rng: np.random.Generator,
) -> tuple[Camera, ...]:
    """Cameras at the places; focal_share : focal length as a share of the picture's width, about."""
    cameras: list[Camera] = []
    for index, place in enumerate(places):
        focal = focal_share * size[0] * float(1.0 + rng.normal(0.0, 0.01))
        middle = np.array([(size[0] - 1) / 2.0, (size[1] - 1) / 2.0]) + rng.normal(0.0, 0.008, 2) * size[0]
        camera = placed_camera(
            f"cam{index + 1}",
            place,
            target,
            size=size,
            focal_px=focal,
            roll=float(rng.normal(0.0, 0.02)),
            distortion=RIG_LENS,
            principal=(float(middle[0]), float(middle[1])),
        )
        cameras.append(camera)
    return tuple(cameras)


def pixel_rays(camera: Camera, samples: int) -> NDArray[np.float32]:
    """(H * samples, W * samples, 3) unit directions in the world through a regular grid of points in every pixel.

    The lens model is inverted by fixed-point iteration (as OpenCV's undistortPoints does, to convergence).
    """
    step = 1.0 / samples
    columns = (np.arange(camera.width * samples) + 0.5) * step - 0.5
    rows = (np.arange(camera.height * samples) + 0.5) * step - 0.5
    u, v = np.meshgrid(columns, rows)
    m = camera.matrix
    yd = (v - m[1, 2]) / m[1, 1]
    xd = (u - m[0, 2] - m[0, 1] * yd) / m[0, 0]
    x, y = xd.copy(), yd.copy()
    for _ in range(UNDISTORT_ROUNDS if camera.distortion.any() else 0):
        across, down, radial = distorted(x, y, camera.distortion)
        x, y = x + (xd - across) / radial, y + (yd - down) / radial
    ahead = np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.rotation
    return (ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)).astype(np.float32)
