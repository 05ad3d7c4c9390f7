"""Points from the world of one calibration into that of another one of the same pictures.

Two calibrations of the same cameras have different worlds, and errors of their own: a rigid motion between them is off
by millimetres. Where a point is seen does not depend on either. So each point is projected with its own cameras, and
the pixels are triangulated with the others.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.sight import sees

FEWEST_CAMERAS = 2
MOST_OFF = 0.01
"""Share of a picture's longer side: the largest median distance of the carried points from where they were seen."""
LEAST_SEEN = 0.5
"""Share of the points that two cameras or more must see."""


def carried(points: Array, own: Sequence[Camera], others: Sequence[Camera]) -> tuple[Array, float]:
    """(..., 3) points of the world of `own` in the world of `others`, mm, NaN where fewer than two cameras see them;
    and the median distance, pixels, between where they were seen and where they are seen now.

    Cameras belong together by name. Raises CalibrationError where the calibrations have too few cameras in common, or
    the points are not in the pictures.
    """
    known = {camera.name: camera for camera in others}
    pairs = [(camera, known[camera.name]) for camera in own if camera.name in known]
    if len(pairs) < FEWEST_CAMERAS:
        raise CalibrationError(
            f"The calibrations have {len(pairs)} cameras in common (there: {', '.join(c.name for c in own)}; here:"
            f" {', '.join(known)}).",
            "Give a calibration of the same cameras, with the same names.",
        )
    flat = points.reshape(-1, 3)
    finite = np.isfinite(flat).all(axis=1)
    given = flat[finite]
    seen = np.stack([sees(camera, given) for camera, _ in pairs])
    enough = np.asarray(seen.sum(axis=0) >= FEWEST_CAMERAS)
    if not len(given) or enough.mean() < LEAST_SEEN:
        raise CalibrationError(
            f"Only {np.count_nonzero(enough)} of {len(given)} points are seen by two cameras of their calibration.",
            "Check that the points are in its world, and their unit (x_mm, x_cm or x_m in the header).",
        )
    pixels = [project(camera, given)[0] for camera, _ in pairs]
    placed = _triangulated([camera for _, camera in pairs], pixels, seen)
    off = np.stack(
        [
            np.where(visible, np.linalg.norm(project(camera, placed)[0] - where, axis=1), np.nan)
            for (_, camera), where, visible in zip(pairs, pixels, seen, strict=True)
        ]
    )[:, enough]
    missed = float(np.nanmedian(off))
    if missed > MOST_OFF * max(max(camera.width, camera.height) for _, camera in pairs):
        raise CalibrationError(
            f"The two calibrations place the points {missed:.0f} pixels apart.",
            "Check that both are of these cameras, in the same place, with pictures of the same size.",
        )
    positions = np.full_like(flat, np.nan)
    positions[np.flatnonzero(finite)[enough]] = placed[enough]
    return positions.reshape(points.shape), missed


def _triangulated(cameras: Sequence[Camera], pixels: Sequence[Array], seen: NDArray[np.bool_]) -> Array:
    """(N, 3) points of their pixels (N, 2) a camera; seen : (V, N) which of them count."""
    rows: list[Array] = []
    for camera, where, visible in zip(cameras, pixels, seen, strict=True):
        flat = cv2.undistortPoints(
            np.where(visible[:, None], where, 0.0)[:, None], camera.matrix, camera.distortion
        )[:, 0]
        pose = np.column_stack([camera.rotation, camera.translation])
        lines = flat[:, :, None] * pose[2] - pose[None, :2]
        rows.append(np.where(visible[:, None, None], lines, 0.0))
    solved = np.linalg.svd(np.concatenate(rows, axis=1))[2][:, -1]
    return solved[:, :3] / np.where(solved[:, 3:] == 0.0, np.nan, solved[:, 3:])
