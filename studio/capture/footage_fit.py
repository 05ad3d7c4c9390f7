"""Whether footage is what a camera was calibrated for, and the crop that makes nearly fitting footage fit.

Sizes must agree within 2 % and in orientation. Where they differ by less, the difference is taken to
have been cut off evenly on both sides (encoders drop rows and columns that do not fill a block), which
moves the principal point by half of it; the assumption is said and stored, since a crop on one side
would be off by as much.
"""

import dataclasses

import numpy as np

from studio.capture.calibration_toml import AssumedCrop
from studio.errors import CalibrationError
from studio.geometry.camera import Camera

LARGEST_DIFFERENCE = 0.02


def fit_camera(camera: Camera, width: int, height: int) -> tuple[Camera, AssumedCrop | None]:
    """The camera for pictures of width x height, and the crop that was assumed (None: sizes agree).

    Raises CalibrationError if the sizes differ by more than 2 % or in orientation.
    """
    if (width, height) == (camera.width, camera.height):
        return camera, None
    calibrated = f"{camera.width}x{camera.height}"
    if (width - height) * (camera.width - camera.height) < 0:
        raise CalibrationError(
            f"The footage of camera {camera.name} is {width}x{height} pixels and its calibration is for"
            f" {calibrated}: one is upright, the other lies on its side.",
            "Turn the footage as it was when it was calibrated, or calibrate again.",
        )
    difference = max(abs(width / camera.width - 1.0), abs(height / camera.height - 1.0))
    if difference > LARGEST_DIFFERENCE:
        raise CalibrationError(
            f"The footage of camera {camera.name} is {width}x{height} pixels and its calibration is for"
            f" {calibrated}, which differs by {difference:.1%}.",
            "Give footage of the calibrated size, or a calibration made at the footage's size.",
        )
    left, top = (camera.width - width) / 2.0, (camera.height - height) / 2.0
    matrix = camera.matrix - np.array([[0.0, 0.0, left], [0.0, 0.0, top], [0.0, 0.0, 0.0]])
    fitted = dataclasses.replace(camera, width=width, height=height, matrix=matrix)
    return fitted, AssumedCrop(left, top, left, top, (camera.width, camera.height))
