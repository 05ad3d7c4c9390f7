"""Whether footage is what a camera was calibrated for, and what to assume where it nearly is.

Sizes must agree within 2 % and in orientation. Where they differ by less, one of two things happened,
and black bars show which: a picture that was shrunk as a whole to fit one side has bars along the
other; without bars, the difference was cut off evenly on both sides (encoders drop rows and columns
that do not fill a block). Either moves the principal point; the assumption is reported and stored.
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from studio.footage.capture.calibration_parts import AssumedCrop
from studio.foundations.arrays import Bytes
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

LARGEST_DIFFERENCE = 0.02
BLACK, CONTENT = 40, 60
"""A bar's brightest pixel is darker than the first, the row or column beside it brighter than the
second."""
WIDEST_BAR = 0.1
BARS_AGREE = 1.5
"""Bars are those of a shrunk picture if their widths are right within this many pixels."""

Margins = tuple[int, int, int, int]
NO_BARS: Margins = (0, 0, 0, 0)
BAR_FRAMES = 4


def fit_camera(
    camera: Camera, width: int, height: int, bars: Margins = NO_BARS
) -> tuple[Camera, AssumedCrop | None]:
    """The camera for pictures of width x height, and the crop that was assumed (None: sizes agree).

    bars : black margins of the footage, left, top, right, bottom, from `black_margins`.
    Raises CalibrationError if the sizes differ by more than 2 % or in orientation.
    """
    if (width, height) == (camera.width, camera.height):
        return camera, None
    _check_sizes(camera, width, height)
    scale = _shrunk_by(camera, width, height, bars)
    left, top = (scale * camera.width - width) / 2.0, (scale * camera.height - height) / 2.0
    # Pixel x covers x - 0.5 ... x + 0.5, so scaling happens about the corner at -0.5.
    fit = np.array(
        [[scale, 0.0, 0.5 * scale - 0.5 - left], [0.0, scale, 0.5 * scale - 0.5 - top], [0.0, 0.0, 1.0]]
    )
    fitted = dataclasses.replace(camera, width=width, height=height, matrix=fit @ camera.matrix)
    return fitted, AssumedCrop(left, top, left, top, (camera.width, camera.height), scale)


def black_margins(read: Callable[[int], Bytes], count: int) -> Margins:
    """How many columns and rows are black in a few frames spread over footage: left, top, right, bottom.

    read(k) : (H, W, 3) of frame k of `count`. A dark scene is no bar: the row or column beside a bar must hold
    something bright.
    """
    pictures = [read(count * k // BAR_FRAMES) for k in range(BAR_FRAMES)]
    brightest = np.max([picture.max(axis=2) for picture in pictures], axis=0)
    columns, rows = brightest.max(axis=0), brightest.max(axis=1)
    return _run(columns), _run(rows), _run(columns[::-1]), _run(rows[::-1])


def _run(levels: Bytes) -> int:
    """Length of the black run at the start of a line of levels, 0 if it does not end in content."""
    most = int(WIDEST_BAR * len(levels))
    bright = np.flatnonzero(levels[:most] >= BLACK)
    if len(bright) == 0:
        return 0
    end = int(bright[0])
    return end if levels[min(end + 1, len(levels) - 1)] >= CONTENT else 0


def _shrunk_by(camera: Camera, width: int, height: int, bars: Margins) -> float:
    """The scale at which the whole calibrated picture lies between the footage's black bars; 1 if it does not."""
    left, top, right, bottom = bars
    for scale in (width / camera.width, height / camera.height):
        wide, tall = (width - scale * camera.width) / 2.0, (height - scale * camera.height) / 2.0
        wanted = (wide, tall, wide, tall)
        near = all(
            abs(bar - want) < BARS_AGREE for bar, want in zip((left, top, right, bottom), wanted, strict=True)
        )
        if near and max(wanted) >= BARS_AGREE:
            return scale
    return 1.0


def _check_sizes(camera: Camera, width: int, height: int) -> None:
    """Raises CalibrationError if footage cannot be what the camera was calibrated for."""
    calibrated = f"{camera.width}x{camera.height}"
    if (width - height) * (camera.width - camera.height) < 0:
        raise CalibrationError(
            f"The footage of camera {camera.name} is {width}x{height} pixels and its calibration is for"
            f" {calibrated}: one is upright, the other lies on its side.",
            "Rotate the footage as for the calibration, or calibrate again.",
        )
    difference = max(abs(width / camera.width - 1.0), abs(height / camera.height - 1.0))
    if difference > LARGEST_DIFFERENCE:
        raise CalibrationError(
            f"The footage of camera {camera.name} is {width}x{height} pixels and its calibration is for"
            f" {calibrated}, which differs by {difference:.1%}.",
            "Give footage of the calibrated size, or a calibration made at the footage's size.",
        )
