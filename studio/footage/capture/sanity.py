"""Checks of a calibration's numbers, and the orientation of its pictures.

An invalid or mirrored rotation is refused. Further checks are in `studio.footage.calibration.checks`.
"""

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

ROTATION_TOLERANCE = 1e-3
STRAIGHT_DOWN = 0.05


def check_rotation(rotation: Array, where: str) -> Array:
    """The (3, 3) rotation itself. Raises CalibrationError if it is not orthonormal or mirrors the world."""
    if rotation.shape != (3, 3) or not np.all(np.isfinite(rotation)):
        raise CalibrationError(
            f"{where}: the rotation is not 3x3 finite numbers.", "Calibrate or export again."
        )
    error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if error > ROTATION_TOLERANCE:
        raise CalibrationError(
            f"{where}: the rotation matrix is no rotation (its columns are off orthonormal by {error:.2g}).",
            "Check that the nine numbers are complete and in row order, or export the calibration again.",
        )
    if np.linalg.det(rotation) < 0.0:
        raise CalibrationError(
            f"{where}: the rotation matrix mirrors the world (its determinant is -1).",
            "Flip the sign of one axis where the calibration was made, or export it again.",
        )
    return rotation


def quarter_turns(camera: Camera) -> int:
    """How often the picture is to be turned by 90 degrees clockwise so that the world's up points upwards.

    The projection of the world's z axis at the picture's centre decides; a camera that looks straight
    up or down has no upright and is not turned.
    """
    x, y = camera.rotation[0, 2], camera.rotation[1, 2]
    if np.hypot(x, y) < STRAIGHT_DOWN:
        return 0
    turned = [(x, y), (-y, x), (-x, -y), (y, -x)]
    return int(np.argmin([downwards for _, downwards in turned]))


def common_target(cameras: tuple[Camera, ...]) -> Array | None:
    """(3,) the world point nearest to all optical axes, mm; None for a single camera or parallel axes."""
    if len(cameras) < 2:
        return None
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for camera in cameras:
        axis = camera.rotation[2]
        across = np.eye(3) - np.outer(axis, axis)
        normal += across
        right += across @ camera.centre
    if np.linalg.cond(normal) > 1e6:
        return None
    return np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
