# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyarrow has no types.
"""Poses and points as tables and arrays: CSV, Parquet, NPZ. Gaps are empty, null or NaN; confidence goes along."""

import csv
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames
from studio.foundations.arrays import Array, read_archive
from studio.foundations.errors import ExportError
from studio.results.export.half_widths import MEANS, WITHIN, half_widths_of
from studio.results.export.marker_files import marked_points, point_notes, unit_and_point_notes
from studio.results.export.naming import Points
from studio.results.export.task import ExportTask, Written, agreed, apart
from studio.runs.notes import notes_by_frame

DEGREE_SIGNS = {"degrees": "deg", "radians": "rad"}
FIRST_COLUMNS = ("frame", "time [s]", "state", "confidence")
ROWS_A_STEP = 500


def write_csv(task: ExportTask) -> Written:
    """One row a frame: number, time, state, confidence, the pose's entries, the points, their half widths if known, and
    the note on the frame where the run has notes. The heads name the units. Other layouts hold the points alone.
    """
    points, places = marked_points(task)
    if task.options.layout in LAYOUTS:
        return _write_points(task, points, places, LAYOUTS[task.options.layout])
    motion, options = task.motion, task.options
    poses = np.where(motion.known[:, None], motion.poses, np.nan)
    angle = motion.body.angles
    shown = poses.copy()
    shown[:, angle] *= 180.0 / math.pi if options.angles == "degrees" else 1.0
    shown[:, ~angle] /= task.axes.mm
    signs = [DEGREE_SIGNS[options.angles] if turned else options.unit for turned in angle]
    heads = [
        *FIRST_COLUMNS,
        *(f"{entry.name} [{sign}]" for entry, sign in zip(motion.body.parameters, signs, strict=True)),
        *(f"{name} {axis} [{options.unit}]" for name in points.names for axis in "xyz"),
    ]
    widths, said = half_widths_of(task, points)
    parts = [shown, task.axes.points(places).reshape(len(places), -1)]
    if widths is not None:
        heads += [f"{name} {WITHIN} [{options.unit}]" for name in points.names]
        parts.append(widths / task.axes.mm)
    remarks = notes_by_frame(task.run)
    heads += ["note"] if remarks else []
    table = np.concatenate(parts, axis=1)
    with task.place.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(heads)
        for row, values in enumerate(table):
            if row % ROWS_A_STEP == 0:
                task.step("writing", row, len(table))
            first = (f"{motion.frames[row]:.12g}", f"{motion.times[row]:.9f}", motion.states[row])
            note = [_remark(remarks, float(motion.frames[row]))] if remarks else []
            writer.writerow([*first, _cell(motion.confidence[row]), *map(_cell, values), *note])
    task.step("reading back", len(table), len(table))
    checked = _read_csv_back(task, heads, places, poses, angle)
    notes = [f"Angles in {options.angles}, lengths in {options.unit}, {options.up.upper()} up."]
    if options.up == "y":
        notes.append("The pose's entries stay those of the world, z up; the points are turned.")
    return Written((task.place,), checked, (*notes, *point_notes(task, points, "empty cells"), *said))


@dataclass(frozen=True, slots=True)
class PointTable:
    """heads, rows : of cells. first, step : column of the first point's x, and so many from point to point."""

    heads: list[list[str]]
    rows: list[list[str]]
    first: int
    step: int


def _deeplabcut(task: ExportTask, points: Points, converted: Array) -> PointTable:
    """Three rows of heads, then a row a frame."""
    names = [name for name in points.names for _ in "xyz"]
    heads = [["scorer", *["capture studio"] * len(names)], ["bodyparts", *names]]
    heads.append(["coords", *"xyz" * len(points.names)])
    numbers = (f"{frame:.12g}" for frame in task.motion.frames)
    rows = [
        [number, *map(_cell, row)]
        for number, row in zip(numbers, converted.reshape(len(converted), -1), strict=True)
    ]
    return PointTable(heads, rows, 1, 3)


def _anipose(task: ExportTask, points: Points, converted: Array) -> PointTable:
    """For each point its place, reprojection error (none here), number of cameras and score; then how anipose turned
    and moved the points (not at all), without which its readers refuse a table, and the frame.
    """
    parts = ("x", "y", "z", "error", "ncams", "score")
    turned = {f"M_{row}{column}": float(row == column) for row in range(3) for column in range(3)}
    placed = {**turned, **{f"center_{axis}": 0.0 for axis in range(3)}}
    heads = [*(f"{name}_{part}" for name in points.names for part in parts), *placed, "fnum"]
    unmoved = [_cell(value) for value in placed.values()]
    cameras = str(len(task.run.cameras()))
    rows: list[list[str]] = []
    for at, places in enumerate(converted):
        score = _cell(task.motion.confidence[at])
        cells = [cell for place in places for cell in (*map(_cell, place), "", cameras, score)]
        rows.append([*cells, *unmoved, f"{task.motion.frames[at]:.12g}"])
    return PointTable([heads], rows, 0, len(parts))


LAYOUTS = {"deeplabcut": _deeplabcut, "anipose": _anipose}


def _write_points(
    task: ExportTask, points: Points, places: Array, layout: Callable[[ExportTask, Points, Array], PointTable]
) -> Written:
    table = layout(task, points, task.axes.points(places))
    task.step("writing", 0, 2)
    with task.place.open("w", newline="", encoding="utf-8") as stream:
        csv.writer(stream).writerows(table.heads + table.rows)
    task.step("reading back", 1, 2)
    with task.place.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))[len(table.heads) :]
    columns = [table.first + table.step * at + axis for at in range(len(points.names)) for axis in range(3)]
    numbers = [[float(row[column] or math.nan) for column in columns] for row in rows]
    read = task.axes.points_back(np.array(numbers).reshape(places.shape))
    checked = agreed(task.place, apart(read, places))
    return Written((task.place,), checked, unit_and_point_notes(task, points, "empty cells"))


def write_parquet(task: ExportTask) -> Written:
    """A row a frame and point: frame, time, name, x, y, z, conf, and half_width if known; all else is in the schema's
    metadata.
    """
    points, places = marked_points(task)
    motion, count = task.motion, len(points.names)
    widths, said = half_widths_of(task, points)
    converted = task.axes.points(places).reshape(-1, 3)
    columns = {
        "frame": pa.array(np.repeat(motion.numbers, count)),
        "time": pa.array(np.repeat(motion.times, count)),
        "name": pa.array(np.tile(np.array(points.names), len(places)).tolist()).dictionary_encode(),
        **{axis: pa.array(converted[:, at], from_pandas=True) for at, axis in enumerate("xyz")},
        "conf": pa.array(np.repeat(motion.confidence, count), from_pandas=True),
    }
    if widths is not None:
        columns["half_width"] = pa.array((widths / task.axes.mm).ravel(), from_pandas=True)
    metadata = {
        **task.source,
        "unit": task.options.unit,
        "up": task.options.up,
        "fps": f"{motion.fps:.12g}",
        "names": task.options.names,
        **({"half_width": MEANS} if widths is not None else {}),
        **_remarks(task),
    }
    table = pa.table(columns).replace_schema_metadata(metadata)
    task.step("writing", 0, 2)
    pq.write_table(table, task.place, compression="zstd")
    task.step("reading back", 1, 2)
    read = pq.read_table(task.place)
    values = np.stack([read.column(axis).to_numpy() for axis in "xyz"], axis=-1).reshape(places.shape)
    checked = agreed(task.place, apart(task.axes.points_back(values), places))
    return Written((task.place,), checked, (*point_notes(task, points, "null"), *said))


def _remark(remarks: Mapping[int, str], frame: float) -> str:
    """The note on a frame; "" between frames, where the motion is resampled."""
    return remarks.get(int(frame), "") if frame.is_integer() else ""


def _remarks(task: ExportTask) -> dict[str, str]:
    """The notes on frames, as the JSON text of an object; {} without any."""
    remarks = notes_by_frame(task.run)
    return {"notes": json.dumps(remarks)} if remarks else {}


def write_npz(task: ExportTask) -> Written:
    """Arrays by name, readable without pickles; `about` is a JSON text that says what they are."""
    points, places = marked_points(task)
    motion, axes = task.motion, task.axes
    frames = joint_frames(motion.body, motion.poses)
    frames[~motion.known] = np.nan
    poses = np.where(motion.known[:, None], motion.poses, np.nan)
    arrays: dict[str, Any] = {
        "frames": motion.numbers,
        "times": motion.times,
        "states": np.array(motion.states),
        "confidence": motion.confidence,
        "poses": poses,
        "parameters": np.array([entry.name for entry in motion.body.parameters]),
        "markers": axes.points(places),
        "marker_names": np.array(points.names),
        "joints": axes.points(frames[..., 3]),
        "joint_rotations": axes.turn @ frames[..., :3],
        "joint_names": np.array([joint.name for joint in motion.body.joints]),
        "joint_parents": np.array([joint.parent for joint in motion.body.joints]),
    }
    widths, said = half_widths_of(task, points)
    if widths is not None:
        arrays["half_widths"] = widths / axes.mm
    about = {
        **task.source,
        "unit": task.options.unit,
        "up": task.options.up,
        "fps": motion.fps,
        "poses": "radians and mm of the body's parameters, world z up, whatever unit and up say",
        "joint_rotations": "columns are the joint's axes in the file's world",
        **({"half_widths": MEANS} if widths is not None else {}),
        **_remarks(task),
    }
    task.step("writing", 0, 2)
    np.savez_compressed(task.place, about=np.array(json.dumps(about)), **arrays)
    task.step("reading back", 1, 2)
    read = read_archive(task.place, LARGEST_EXPORT)
    same = all(
        np.array_equal(read[name], value, equal_nan=value.dtype.kind == "f") for name, value in arrays.items()
    )
    difference = apart(axes.points_back(read["markers"]), places) if same else math.inf
    return Written((task.place,), agreed(task.place, difference), (*point_notes(task, points, "NaN"), *said))


LARGEST_EXPORT = 8 << 30


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(float(value))


def _read_csv_back(
    task: ExportTask, heads: list[str], places: Array, poses: Array, angle: NDArray[np.bool_]
) -> str:
    with task.place.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    if rows[0] != heads or len(rows) != len(places) + 1:
        raise ExportError(f"'{task.place.name}' reads back with other columns or rows.", "Export it again.")
    numbers = slice(len(FIRST_COLUMNS), len(heads) - (heads[-1] == "note"))
    table = np.array([[float(cell) if cell else math.nan for cell in row[numbers]] for row in rows[1:]])
    last = poses.shape[1] + places[0].size
    read = task.axes.points_back(table[:, poses.shape[1] : last].reshape(places.shape))
    angles = table[:, : poses.shape[1]][:, angle]
    angles = angles if task.options.angles == "degrees" else np.degrees(angles)
    turned = np.nan_to_num(np.abs(angles - np.degrees(poses[:, angle]))).max(initial=0.0)
    return agreed(task.place, apart(read, places), float(turned))
