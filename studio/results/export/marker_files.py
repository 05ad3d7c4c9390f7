"""Points over time as TRC and C3D, gaps as gaps."""

from pathlib import Path

import numpy as np

from studio.body.motion_files.c3d import MOST_FRAMES as MOST_C3D_FRAMES
from studio.body.motion_files.c3d import read_c3d_points, write_c3d
from studio.body.motion_files.trc import TRC_FROM_WORLD, MarkerMotion, read_trc, write_trc
from studio.footage.capture.calibration_files import CALIBRATION_FORMATS, export_calibration, read_calibration
from studio.foundations.arrays import Array
from studio.foundations.errors import ExportError
from studio.foundations.words import counted
from studio.results.export.half_widths import half_widths_of
from studio.results.export.naming import Points, points_of
from studio.results.export.task import ExportTask, Written, agreed, apart, turned_apart

HALF_WIDTHS = "half-widths"
"""Ends the name of a second TRC."""


def marked_points(task: ExportTask) -> tuple[Points, Array]:
    """The points under the requested names, and their places (K, M, 3) mm in the world, NaN in gaps."""
    points = points_of(task.motion.body, task.options.names)
    places = points.positions(task.motion.body, task.motion.poses)
    places[~task.motion.known] = np.nan
    return points, places


def write_trc_file(task: ExportTask) -> Written:
    """Markers as TRC; missing ones are blank cells. Their half widths, where they are known, are a second file.

    Raises ExportError where it does not read back.
    """
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
    notes = unit_and_point_notes(task, points, "blank cells")
    widths, said = half_widths_of(task, points)
    if widths is None:
        return Written((task.place,), checked, (*notes, *said))
    beside = task.place.with_name(f"{task.place.stem}-{HALF_WIDTHS}{task.place.suffix}")
    alike = np.repeat(widths[..., None], 3, axis=2)
    write_trc(beside, MarkerMotion(points.names, task.motion.times, alike, unit, task.motion.fps))
    agreed(beside, apart(read_trc(beside).positions, alike))
    return Written((task.place, beside), checked, (*notes, *said, f"'{beside.name}' has them as x, y and z."))


def write_c3d_file(task: ExportTask) -> Written:
    """Markers as C3D; missing ones have residual -1. Raises ExportError for more frames than C3D counts, unless they
    are to be split, and where a file does not read back.
    """
    points, places = marked_points(task)
    count = len(places)
    if count > MOST_C3D_FRAMES and not task.options.split:
        raise ExportError(
            f"C3D counts at most {MOST_C3D_FRAMES} frames and this motion has {count}.",
            "Export fewer frames (first, last), a lower frame rate, or split it into several files (split).",
        )
    files, worst = list[Path](), 0.0
    for part, first in enumerate(range(0, count, MOST_C3D_FRAMES)):
        last = min(first + MOST_C3D_FRAMES, count)
        place = task.place
        if count > MOST_C3D_FRAMES:
            place = place.with_name(f"{place.stem}-{part + 1}{place.suffix}")
        task.step("writing", first, count)
        part_of_it = MarkerMotion(
            points.names,
            task.motion.times[first:last],
            task.axes.points(places[first:last]),
            task.options.unit,
            task.motion.fps,
        )
        write_c3d(place, part_of_it, up=task.options.up, source=task.source)
        worst = max(worst, apart(task.axes.points_back(read_c3d_points(place)), places[first:last]))
        files.append(place)
    return Written(tuple(files), agreed(files[0], worst), unit_and_point_notes(task, points, "residual -1"))


def unit_and_point_notes(task: ExportTask, points: Points, how: str) -> tuple[str, ...]:
    """`point_notes`, after how many points there are, in which unit and with which axis up."""
    lengths = f"{len(points.names)} points in {task.options.unit}, {task.options.up.upper()} up."
    return (lengths, *point_notes(task, points, how))


def point_notes(task: ExportTask, points: Points, how: str) -> tuple[str, ...]:
    """Notes for readers of a file of points. how : gaps look in it, "as {how}"."""
    gaps = task.gaps_in_words(f"{{count}} frames are missing in it, as {how}.")
    return (*gaps, *filter(None, [points.note]))


def write_cameras(task: ExportTask) -> Written:
    """Write the run's cameras with `options.calibration`, or the ending's usual writer. Raises ExportError for a writer
    that there is not, or that writes another kind of file.
    """
    fitting = [known for known, entry in CALIBRATION_FORMATS.items() if entry.suffix == task.place.suffix]
    name = task.options.calibration or fitting[0]
    if name not in fitting:
        raise ExportError(
            f"No calibration '{name[:40]}' is written as '{task.place.suffix}'.",
            f"Choose {' or '.join(fitting)}.",
        )
    cameras = task.run.cameras()
    task.step("writing", 0, 2)
    written = export_calibration(cameras, task.place, name)
    task.step("reading back", 1, 2)
    source = task.place if written.files == (task.place,) else task.place.parent
    read = {camera.name: camera for camera in read_calibration(source).cameras}
    missing = [camera.name for camera in cameras if camera.name not in read]
    if missing:
        raise ExportError(
            f"Camera '{missing[0]}' does not read back from '{task.place.name}'.",
            "Rename it, and export again.",
        )
    apart_mm = max(float(np.linalg.norm(camera.centre - read[camera.name].centre)) for camera in cameras)
    turned = max(turned_apart(camera.rotation[None], read[camera.name].rotation[None]) for camera in cameras)
    checked = agreed(task.place, apart_mm, turned)
    return Written(
        tuple(written.files), f"{counted(len(cameras), 'camera')}, {checked}", tuple(written.notes)
    )
