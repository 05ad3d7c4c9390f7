"""CSV files of named points over time, in whatever world they were measured.

Either a row a point, or a row a frame (as anipose writes them):

    frame,point,x_mm,y_mm,z_mm            frame,Nose_x,Nose_y,Nose_z,Tail_x,Tail_y,Tail_z
    0,Nose,95.3,7.9,546.0                 0,95.3,7.9,546.0,143.2,47.7,503.6

Separated by commas, semicolons or tabs. Other columns are ignored. Instead of frames there may be a column of seconds
(`time`); without either the rows are counted from 0. The unit stands behind x, y and z (`x_mm`, `x_cm`, `x_m`, in
rows of frames `Nose_x_mm` or `Nose x [mm]`); without one it is mm. A point that is missing has no row, blank cells or
exact zeros. Where columns are separated by semicolons or tabs, a comma in a number is a decimal one. Lines that begin
with # do not count. Tables of other programs: `points_tables`.
"""

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio.body.motion_files.points_tables import own_form
from studio.body.motion_files.trc import (
    MISSING,
    MM_PER_UNIT,
    MarkerMotion,
    check_reach,
    number_or_nan,
    without_zeros,
)
from studio.foundations.errors import NoPointsError, TruthError
from studio.foundations.foreign_files import foreign_file, read_foreign_text

FRAME = ("frame", "frames", "frame_number", "fnum", "frame_index", "sync_index")
TIME = ("time", "time_s", "seconds", "time [s]", "timestamp")
POINT = ("point", "name", "marker", "label", "bodypart", "keypoint", "node")
SEPARATORS = (",", ";", "\t")
COORDINATE = re.compile(r"(?:(.+?)[ _.:-]+)?([xyz])(?:[ _]*[\[(]?(mm|cm|m)[\])]?)?", re.IGNORECASE)
"""A column's point ("" in a table with a row a point), axis and unit: Nose_x, Nose_x_mm, Nose.X, "Nose x [mm]"."""
LAST_FRAME = 500_000
MOST_NUMBERS = 50_000_000
"""Frames × points at most: what a misread number of a frame would ask for fills the memory."""
SHAPE = "Give a header such as frame,point,x_mm,y_mm,z_mm, or frame,Nose_x,Nose_y,Nose_z."


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where things stand. place : of frame or time, -1 where rows are counted. timed : whether that is a time. point :
    of the name, -1 in a file with a row a frame. axes : name ("" with a row a point) → columns of x, y, z. unit : ""
    where none is named.
    """

    place: int
    timed: bool
    point: int
    axes: Mapping[str, tuple[int, int, int]]
    unit: str


def read_points(path: Path, fps: float) -> MarkerMotion:
    """The points of a CSV file in its own world, a row for every frame from 0 to its last one, NaN where missing.

    fps : frames per second, for files with times and for the times of the others. `unit` of the result is "" where the
    file names none. Raises TruthError naming file, line and column.
    """
    with foreign_file(path, TruthError, "a CSV file of points", SHAPE):
        text = read_foreign_text(path)
        lines = [line for line in text.splitlines() if not line.startswith("#")]
        first = next((line for line in lines if line.strip()), "")
        separator = max(SEPARATORS, key=first.count)
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator, strict=True)]
        return _motion(path, own_form(path, rows), fps)


def _motion(path: Path, rows: Iterable[Sequence[str]], fps: float) -> MarkerMotion:
    columns: _Columns | None = None
    positions: dict[tuple[int, str], tuple[float, float, float]] = {}
    names: dict[str, None] = {}
    width = counted = 0
    for number, row in enumerate(rows, 1):
        cells = list(row)
        while columns is not None and len(cells) > width and not cells[-1]:
            cells.pop()
        if not any(cells):
            continue
        if columns is None:
            columns, width = _columns(path, cells), len(cells)
            continue
        if len(cells) != width:
            raise TruthError(
                f"'{path.name}' line {number} has {len(cells)} columns, the header {width}.",
                "One cell a number, missing ones blank; numbers with a decimal comma need semicolons between cells.",
            )
        if columns.place < 0:
            frame, counted = counted, counted + 1
        else:
            frame = _frame(path, number, cells[columns.place], columns.timed, fps)
        for name, axes in columns.axes.items():
            point = name if columns.point < 0 else cells[columns.point]
            if not point:
                raise TruthError(f"'{path.name}' line {number} names no point.", "Name each row's point.")
            if (frame, point) in positions:
                raise TruthError(
                    f"'{path.name}' line {number} gives point '{point}' of frame {frame} a second time.",
                    "Keep one row of a point in a frame.",
                )
            names.setdefault(point)
            positions[frame, point] = _place(path, number, point, [cells[at] for at in axes])
    if columns is None or not positions:
        raise TruthError(f"'{path.name}' has no rows of points.", SHAPE)
    motion = _motion_of(path, positions, tuple(names), columns.unit, fps)
    if columns.place >= 0:
        return motion
    note = f"'{path.name}' has no column of frames: its rows were counted from 0."
    return replace(motion, notes=(*motion.notes, note))


def _motion_of(
    path: Path,
    by_frame: Mapping[tuple[int, str], tuple[float, float, float]],
    names: tuple[str, ...],
    unit: str,
    fps: float,
) -> MarkerMotion:
    count = 1 + max(frame for frame, _ in by_frame)
    if count * len(names) > MOST_NUMBERS:
        raise TruthError(
            f"'{path.name}' has {len(names)} points and {count} frames.",
            "Check the columns of frame and point: these are too many to hold.",
        )
    at = {name: index for index, name in enumerate(names)}
    positions = np.full((count, len(names), 3), np.nan)
    for (frame, name), place in by_frame.items():
        positions[frame, at[name]] = place
    positions, notes = without_zeros(path, positions)
    places = positions * MM_PER_UNIT[unit or "mm"]
    motion = MarkerMotion(names, np.arange(count) / fps, places, unit, fps, notes)
    check_reach(path, motion, TruthError)
    return motion


def _columns(path: Path, header: Sequence[str]) -> _Columns:
    names = [cell.lower() for cell in header]
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise TruthError(f"'{path.name}' has two columns '{twice[0]}'.", "Give each column its own name.")
    place = next((names.index(name) for name in (*FRAME, *TIME) if name in names), -1)
    point = next((names.index(name) for name in POINT if name in names), -1)
    if place < 0 and point >= 0:
        raise TruthError(f"'{path.name}' has no column of frames or times.", SHAPE)
    by_owner: dict[str, dict[str, tuple[int, str]]] = {}
    for column, name in enumerate(header):
        parts = COORDINATE.fullmatch(name)
        if parts is None:
            continue
        owner, axis, unit = parts[1] or "", parts[2].lower(), (parts[3] or "").lower()
        if not owner if point >= 0 else owner:
            by_owner.setdefault(owner, {})[axis] = column, unit
    if not by_owner:
        raise NoPointsError(f"'{path.name}' has no columns of coordinates.", SHAPE)
    for owner, axes in by_owner.items():
        if len(axes) != 3:
            lacking = ", ".join(axis for axis in "xyz" if axis not in axes)
            of_point = f" of point '{owner}'" if owner else ""
            raise TruthError(f"'{path.name}' has no column {lacking}{of_point}.", SHAPE)
    units = {unit for axes in by_owner.values() for _, unit in axes.values()}
    if len(units) > 1:
        raise TruthError(
            f"'{path.name}' has coordinates in {', '.join(sorted(unit or 'no unit' for unit in units))}.",
            "Give all coordinates in one unit.",
        )
    places = {owner: (axes["x"][0], axes["y"][0], axes["z"][0]) for owner, axes in by_owner.items()}
    return _Columns(place, place >= 0 and names[place] in TIME, point, places, units.pop())


def _frame(path: Path, number: int, text: str, timed: bool, fps: float) -> int:
    value = number_or_nan(text)
    at = round(value * fps) if timed and math.isfinite(value) else value
    if not (math.isfinite(at) and at == int(at) and 0 <= at <= LAST_FRAME):
        kind = "time (seconds from the first frame on)" if timed else "frame (a whole number from 0 on)"
        raise TruthError(
            f"'{path.name}' line {number}: '{text}' is no {kind}.",
            f"Number the frames as the footage has them, up to {LAST_FRAME}.",
        )
    return int(at)


def _place(path: Path, number: int, point: str, cells: Sequence[str]) -> tuple[float, float, float]:
    missing = [cell.lower() in MISSING for cell in cells]
    if all(missing):
        return math.nan, math.nan, math.nan
    values = [number_or_nan(cell) for cell in cells]
    for axis, value, cell in zip("xyz", values, cells, strict=True):
        if not math.isfinite(value):
            raise TruthError(
                f"'{path.name}' line {number}: {axis} of point '{point}' is '{cell}', not a number.",
                "Leave all three cells of a missing point blank.",
            )
    return values[0], values[1], values[2]
