"""Points over time as TRC and C3D, gaps as gaps."""

from pathlib import Path

import ezc3d
import numpy as np
from numpy.typing import NDArray

from studio.capture.trc import TRC_FROM_WORLD, MarkerMotion, read_trc, write_trc
from studio.errors import ExportError
from studio.export.axes import Axes
from studio.export.naming import Points, points_of
from studio.export.task import ExportTask, Written, agreed, apart

Array = NDArray[np.float64]

MOST_C3D_FRAMES = 65_535
RESIDUAL_SEEN, RESIDUAL_MISSING = 0.0, -1.0


def marked_points(task: ExportTask) -> tuple[Points, Array]:
    """The points under the names that were asked for, and their places (K, M, 3) mm in the world, NaN in gaps."""
    points = points_of(task.motion.body, task.options.names)
    places = points.positions(task.motion.body, task.motion.poses)
    places[~task.motion.known] = np.nan
    return points, places


def write_trc_file(task: ExportTask) -> Written:
    """Markers as TRC; missing ones are blank cells. Raises ExportError where it does not read back."""
    points, places = marked_points(task)
    unit = task.options.unit
    # The writer of TRC turns the world's z up into y up; a file with z up gets the axes turned beforehand.
    back = np.argsort(TRC_FROM_WORLD)
    written = places if task.options.up == "y" else places[..., back]
    task.step("writing", 0, 2)
    motion = MarkerMotion(points.names, task.motion.times, written, unit, task.motion.fps)
    write_trc(task.place, motion)
    task.step("reading back", 1, 2)
    read = read_trc(task.place)
    if read.names != points.names:
        raise ExportError(f"'{task.place.name}' names other points than were written.", "Export it again.")
    checked = agreed(task.place, apart(read.positions, written))
    return Written((task.place,), checked, _notes(points, task, "blank cells"))


def write_c3d_file(task: ExportTask) -> Written:
    """Markers as C3D; missing ones have residual -1. Raises ExportError for more frames than C3D counts, unless they
    are to be split, and where a file does not read back.
    """
    points, places = marked_points(task)
    count = len(places)
    if count > MOST_C3D_FRAMES and not task.options.split:
        raise ExportError(
            f"C3D counts at most {MOST_C3D_FRAMES} frames and this motion has {count}.",
            "Export fewer frames (first, last), a lower frame rate, or let it be split into several files (split).",
        )
    files, worst = [], 0.0
    for part, first in enumerate(range(0, count, MOST_C3D_FRAMES)):
        last = min(first + MOST_C3D_FRAMES, count)
        place = task.place
        if count > MOST_C3D_FRAMES:
            place = place.with_name(f"{place.stem}-{part + 1}{place.suffix}")
        task.step("writing", first, count)
        _write_c3d(place, points.names, task.axes.points(places[first:last]), task)
        worst = max(worst, apart(read_c3d_points(place, task.axes), places[first:last]))
        files.append(place)
    return Written(tuple(files), agreed(files[0], worst), _notes(points, task, "residual -1"))


def read_c3d_points(path: Path, axes: Axes) -> Array:
    """(K, M, 3) mm in the world, NaN where the residual says that a point is missing."""
    content = ezc3d.c3d(str(path))
    points = np.array(content["data"]["points"], dtype=np.float64)[:3].transpose(2, 1, 0)
    residuals = np.array(content["data"]["meta_points"]["residuals"])[0].T
    points[residuals < 0.0] = np.nan
    return axes.points_back(points)


def _write_c3d(place: Path, names: tuple[str, ...], points: Array, task: ExportTask) -> None:
    """points : (K, M, 3) in the file's unit and axes."""
    content = ezc3d.c3d()
    # A file that states no frame rate for analogue data is refused by some readers: there is none, at one sample.
    content["parameters"]["POINT"]["RATE"]["value"] = [task.motion.fps]
    content["parameters"]["POINT"]["UNITS"]["value"] = [task.options.unit]
    content["parameters"]["POINT"]["LABELS"]["value"] = list(names)
    content["parameters"]["POINT"]["DESCRIPTIONS"]["value"] = list(names)
    up = {"y": ("+Z", "+Y"), "z": ("+X", "+Z")}[task.options.up]
    content.add_parameter("POINT", "X_SCREEN", [up[0]])
    content.add_parameter("POINT", "Y_SCREEN", [up[1]])
    content.add_parameter("MANUFACTURER", "SOFTWARE", ["capture studio"])
    for name, value in task.source.items():
        content.add_parameter("STUDIO", name.upper(), [value])
    missing = np.isnan(points).any(axis=2)
    stored = np.ones((4, len(names), len(points)))
    stored[:3] = points.transpose(2, 1, 0)
    content["data"]["points"] = stored
    residuals = np.where(missing, RESIDUAL_MISSING, RESIDUAL_SEEN)
    content["data"]["meta_points"]["residuals"] = residuals.T[None]
    content.write(str(place))


def _notes(points: Points, task: ExportTask, how: str) -> tuple[str, ...]:
    count = int((~task.motion.known).sum())
    notes = [f"{len(points.names)} points in {task.options.unit}, {task.options.up.upper()} up."]
    if count:
        notes.append(f"{count} frames are missing in it, as {how}.")
    return (*notes, *([points.note] if points.note else []))
