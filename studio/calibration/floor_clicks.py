"""Clicked points of the floor, as a JSON file: pixels in two cameras or more, and where the points lie, if known.

    {"points": [{"pixels": {"cam1": [812.0, 640.5], "cam2": [300.1, 588.0]}, "world": [0, 0, 0]}, ...]}

`world` (mm, Z up) is given for all points or for none.
"""

from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.calibration.extrinsics import Rig
from studio.calibration.floor import floor_from_points, triangulated, world_from_points
from studio.errors import CalibrationError

Array = NDArray[np.float64]

LENGTHS_AGREE = 0.03


class Click(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One point. pixels : camera → x, y. world : mm, or None."""

    pixels: dict[str, tuple[float, float]]
    world: tuple[float, float, float] | None = None


class Clicks(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All points of a file."""

    points: tuple[Click, ...]


def read_clicks(path: Path) -> Clicks:
    """The points of a file. Raises CalibrationError."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Clicks)
    except (OSError, msgspec.DecodeError) as problem:
        raise CalibrationError(
            f"'{path.name}' holds no clicked points ({problem}).",
            'Write {"points": [{"pixels": {"cam1": [x, y], "cam2": [x, y]}, "world": [x, y, z]}]}; world is optional.',
        ) from None


def floor_from_clicks(clicks: Clicks, rig: Rig) -> Array:
    """(3, 4) new_from_old of the clicked floor. Raises CalibrationError, also where known lengths contradict."""
    cameras = sorted({name for click in clicks.points for name in click.pixels})
    pixels = {
        name: np.array([click.pixels.get(name, (np.nan, np.nan)) for click in clicks.points])
        for name in cameras
    }
    points = triangulated(rig.cameras, pixels)
    known = [click.world for click in clicks.points if click.world is not None]
    if not known:
        return floor_from_points(points, rig.cameras)
    if len(known) != len(points):
        raise CalibrationError(
            f"{len(known)} of {len(points)} points have a place in the world.",
            "Give it for all points or for none.",
        )
    new_from_old, ratio = world_from_points(points, np.array(known, dtype=np.float64))
    if abs(ratio - 1.0) > LENGTHS_AGREE:
        raise CalibrationError(
            f"The clicked points lie {ratio:.3f} times as far apart as their places in the world say.",
            "Measure the board's squares (the size told may be wrong) and the points' places.",
        )
    return new_from_old
