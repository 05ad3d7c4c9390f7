"""C3D files: labelled points over time, as optical motion capture systems write them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from studio.body.motion_files.trc import MM_PER_UNIT, MarkerMotion, check_reach
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import check_regular, foreign_file
from studio.foundations.isolated import isolated

MOST_FRAMES = 65_535
"""C3D counts them with sixteen bits."""
RESIDUAL_SEEN, RESIDUAL_MISSING = 0.0, -1.0
REMEDY = "Export it again from its original program."


def read_c3d(path: Path) -> MarkerMotion:
    """The labelled points of a C3D file as they are written, mm; NaN where a point was not seen. Read in a process of
    its own.

    The file's third axis counts as up: learning leaves out how the whole body lies. Raises StudioError for what is no
    C3D file, and for one without points, labels or a rate.
    """
    if not path.is_file():
        raise StudioError(f"'{path}' does not exist.", "Check the path.")
    check_regular(path, StudioError)
    return isolated(StudioError, _read_points, path)


def _read_points(path: Path) -> MarkerMotion:
    with foreign_file(path, StudioError, "a C3D file that can be read", REMEDY):
        content: Any = ezc3d.c3d(str(path))
        settings = content["parameters"]["POINT"]
        labels = [str(label).strip() for label in settings["LABELS"]["value"]]
        unit = str(next(iter(settings["UNITS"]["value"]), "mm")).strip().lower() or "mm"
        rate = float(settings["RATE"]["value"][0])
        points = np.array(content["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    if not points.size or len(labels) < points.shape[1]:
        raise StudioError(f"'{path.name}' has no labelled points.", REMEDY)
    if unit not in MM_PER_UNIT or not 1.0 <= rate <= 10_000.0:
        raise StudioError(
            f"'{path.name}' has the unit '{unit}' and {rate:g} frames a second.",
            "Points must be in mm, cm or m, at 1 to 10000 frames a second.",
        )
    unseen = np.isnan(points).any(axis=2) | (points == 0.0).all(axis=2)
    positions = np.where(unseen[..., None], np.nan, MM_PER_UNIT[unit] * points)
    names = tuple(labels[: points.shape[1]])
    motion = MarkerMotion(names, np.arange(len(positions)) / rate, positions, unit=unit, rate=rate)
    check_reach(path, motion, StudioError)
    return motion


def write_c3d(path: Path, motion: MarkerMotion, *, up: str, source: Mapping[str, str]) -> None:
    """Write points as C3D, as they are: `motion.positions` in its unit and the file's axes, NaN for a missing one.

    up : the file's vertical axis, "y" or "z". source : named values that go with the file.
    """
    content: Any = ezc3d.c3d()
    # A file that states no frame rate for analogue data is refused by some readers: there is none, at one sample.
    content["parameters"]["POINT"]["RATE"]["value"] = [motion.rate]
    content["parameters"]["POINT"]["UNITS"]["value"] = [motion.unit]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(motion.names)
    content["parameters"]["POINT"]["DESCRIPTIONS"]["value"] = list(motion.names)
    screen = {"y": ("+Z", "+Y"), "z": ("+X", "+Z")}[up]
    content.add_parameter("POINT", "X_SCREEN", [screen[0]])
    content.add_parameter("POINT", "Y_SCREEN", [screen[1]])
    content.add_parameter("MANUFACTURER", "SOFTWARE", ["capture studio"])
    for name, value in source.items():
        content.add_parameter("STUDIO", name.upper(), [value])
    missing = np.isnan(motion.positions).any(axis=2)
    stored = np.ones((4, len(motion.names), len(motion.positions)))
    stored[:3] = motion.positions.transpose(2, 1, 0)
    content["data"]["points"] = stored
    residuals = np.where(missing, RESIDUAL_MISSING, RESIDUAL_SEEN)
    content["data"]["meta_points"]["residuals"] = residuals.T[None]
    content.write(str(path))


def read_c3d_points(path: Path) -> Array:
    """(F, P, 3) the points of a file of `write_c3d`, in its unit and axes; NaN where the residual says missing."""
    content: Any = ezc3d.c3d(str(path))
    points = np.array(content["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    residuals = np.array(content["data"]["meta_points"]["residuals"])[0].T
    points[residuals < RESIDUAL_SEEN] = np.nan
    return points
