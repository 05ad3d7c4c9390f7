"""Clicked points of the floor, as a JSON file: pixels in two cameras or more, and where the points lie, if known.

    {"points": [{"pixels": {"cam1": [812.0, 640.5], "cam2": [300.1, 588.0]}, "world": [0, 0, 0]}, ...]}

`world` (mm, Z up) is given for all points or for none.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from studio.arrays import Array
from studio.calibration.floor import floor_from_points, triangulated, world_from_points
from studio.errors import CalibrationError
from studio.foreign_files import foreign_file
from studio.geometry.camera import Camera
from studio.geometry.projection import project
from studio.geometry.rigid import transform

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
    remedy = 'Write {"points": [{"pixels": {"cam1": [x, y], "cam2": [x, y]}, "world": [x, y, z]}]}; world is optional.'
    with foreign_file(path, CalibrationError, "a list of clicked points", remedy):
        return msgspec.json.decode(path.read_bytes(), type=Clicks)


@dataclass(frozen=True, slots=True, eq=False)
class ClickedFloor:
    """new_from_old : (3, 4). points : (N, 3) the clicked points in the new world, mm. missed : camera → (N,) pixels
    between each click and its point, NaN where a camera does not have it.
    """

    new_from_old: Array
    points: Array
    missed: dict[str, Array]


def clicked_floor(clicks: Clicks, cameras: Sequence[Camera]) -> ClickedFloor:
    """The clicked points in space, and the world that they make. Raises CalibrationError, also where known lengths
    contradict.
    """
    names = sorted({name for click in clicks.points for name in click.pixels})
    pixels = {
        name: np.array([click.pixels.get(name, (np.nan, np.nan)) for click in clicks.points])
        for name in names
    }
    points = triangulated(cameras, pixels)
    known = {camera.name: camera for camera in cameras}
    missed = {
        name: np.linalg.norm(project(known[name], points)[0] - clicked, axis=1)
        for name, clicked in pixels.items()
    }
    new_from_old = _world_of(clicks, points, cameras)
    return ClickedFloor(new_from_old, transform(new_from_old, points), missed)


def _world_of(clicks: Clicks, points: Array, cameras: Sequence[Camera]) -> Array:
    known = [click.world for click in clicks.points if click.world is not None]
    if not known:
        return floor_from_points(points, cameras)
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
