"""What a calibration's numbers must fulfil, and what reprojection errors cannot see, in words.

A rotation that is none, or a mirrored one, is refused. A world whose floor is above the cameras,
cameras that do not look at a common place, or a rig of a strange size are said in words: the file may
still be what its maker meant.
"""

import numpy as np
from numpy.typing import NDArray

from studio.errors import CalibrationError
from studio.geometry.camera import Camera

Array = NDArray[np.float64]

ROTATION_TOLERANCE = 1e-3
SMALLEST_RIG_MM, LARGEST_RIG_MM = 100.0, 100_000.0
STRAIGHT_DOWN = 0.05
FAR_FROM_AXES = 0.35
"""Cameras look at one place if their optical axes pass it within this share of their distance."""


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


def sanity_notes(cameras: tuple[Camera, ...]) -> tuple[str, ...]:
    """Doubts about a calibration, each a sentence; none for a plausible one."""
    notes: list[str] = []
    low = [camera.name for camera in cameras if camera.centre[2] < 0.0]
    if low:
        notes.append(
            f"Camera {', '.join(low)} lies under the floor (z < 0): if the floor is at z = 0, the world may"
            " be mirrored or its z axis may point down."
        )
    centres = np.array([camera.centre for camera in cameras])
    if len(cameras) > 1:
        spread = float(np.max(np.linalg.norm(centres - centres.mean(axis=0), axis=1)))
        if not SMALLEST_RIG_MM < spread < LARGEST_RIG_MM:
            notes.append(
                f"The cameras lie within {spread:.3g} mm of each other: check the calibration's unit."
            )
    target = common_target(cameras)
    if target is not None:
        away = [camera.name for camera in cameras if not _looks_at(camera, target)]
        if away:
            notes.append(
                f"Camera {', '.join(away)} does not look where the others look: check that each calibration"
                " belongs to its footage."
            )
    for camera in cameras:
        cx, cy = camera.matrix[0, 2], camera.matrix[1, 2]
        if not (0.2 < cx / camera.width < 0.8 and 0.2 < cy / camera.height < 0.8):
            notes.append(
                f"Camera {camera.name} has its principal point at ({cx:.0f}, {cy:.0f}), far from the centre"
                f" of {camera.width}x{camera.height} pixels."
            )
    return tuple(notes)


def _looks_at(camera: Camera, target: Array) -> bool:
    """Whether a point lies in front of a camera and near its optical axis."""
    seen = camera.rotation @ target + camera.translation
    return bool(seen[2] > 0.0 and np.hypot(seen[0], seen[1]) < FAR_FROM_AXES * seen[2])
