"""TRC files: named markers over time, as motion capture tools exchange them.

A TRC is tab-separated text: three lines of header (rates, counts, unit), one of marker names (one for
every three columns), one of axis labels, then rows `Frame#  Time  X1 Y1 Z1  X2 ...`. Its axes are Y up;
the studio's world is Z up: (X, Y, Z)_world = (z, x, y)_trc. Files of others may mean another axis
(`marker_meaning`). A missing marker is three cells that are blank, `nan` and the like, exactly 0, or one number of
nines (9999999). Numbers may have a decimal comma.
"""

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio.body.motion_files.marker_meaning import turned_up
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError, TruthError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.geometry.reach import FARTHEST_MM, REACH_HINT

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
MISSING = ("", "nan", "-nan", "na", "n/a", "none", "null", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind",
           "-", "--", "---", "*", "missing")  # fmt: skip
"""What stands in the cells of a missing marker, lower case."""
NINES = 10.0 ** np.arange(4, 9) - 1.0
"""What stands for a place that is not known, in all three coordinates, with either sign."""
UNIT_WORDS = {
    "millimeter": "mm", "millimeters": "mm", "millimetre": "mm", "millimetres": "mm",
    "centimeter": "cm", "centimeters": "cm", "centimetre": "cm", "centimetres": "cm",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m",
}  # fmt: skip
TRC_FROM_WORLD = (1, 2, 0)
HEADER_LINES = 5
FIRST_COLUMNS = 2
HEADER_FIELDS = (
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"
)


@dataclass(frozen=True, slots=True, eq=False)
class MarkerMotion:
    """Markers over time.

    names : M marker names.
    times : (F,) seconds, rising.
    positions : (F, M, 3) mm, world z up; NaN where a marker is missing.
    unit : of the file ("m" or "mm").
    rate : rows per second as the header says.
    notes : what was assumed, sentences.
    """

    names: tuple[str, ...]
    times: Array
    positions: Array
    unit: str = "m"
    rate: float = 60.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Header:
    names: tuple[str, ...]
    unit: str
    rate: float
    rows: int


def read_trc(path: Path, up: str = "y") -> MarkerMotion:
    """The motion in a TRC file. up : the axis of the file that points up (x, y, z, -x, -y, -z); "" for as the markers
    show it, y where they do not.

    Raises TruthError naming file, line and column for anything that is not a complete, finite table.
    """
    with foreign_file(path, TruthError, "a TRC file", "Export it again."):
        return _motion(path, read_foreign_text(path).splitlines(), up)


def read_marker_names(path: Path) -> tuple[str, ...]:
    """The names of a TRC file's markers, from its header alone. Raises TruthError."""
    with foreign_file(path, TruthError, "a TRC file", "Export it again."):
        return _header(path, read_foreign_text(path).splitlines()[:HEADER_LINES]).names


def _motion(path: Path, lines: list[str], up: str) -> MarkerMotion:
    header = _header(path, lines)
    rows = [
        _row(path, number, line, header.names)
        for number, line in enumerate(lines[HEADER_LINES:], HEADER_LINES + 1)
        if line.strip()
    ]
    if len(rows) < max(header.rows, 1):
        raise TruthError(
            f"'{path.name}' has {len(rows)} rows and its header says {header.rows}.",
            "The file was cut short: export it again.",
        )
    table = np.array(rows)
    times = table[:, 0]
    if np.any(np.diff(times) <= 0.0):
        at = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise TruthError(
            f"In '{path.name}' the time of row {at + 1} ({times[at]:g} s) does not rise.",
            "Sort the rows by time and remove repeated ones.",
        )
    positions, zeros = without_zeros(path, table[:, 1:].reshape(len(rows), len(header.names), 3))
    read = MarkerMotion(header.names, times, positions * MM_PER_UNIT[header.unit], header.unit, header.rate)
    motion = turned_up(path, read, up, usual="y")
    motion = replace(motion, notes=(*zeros, *motion.notes))
    check_reach(path, motion, TruthError)
    return motion


def without_zeros(path: Path, positions: Array) -> tuple[Array, tuple[str, ...]]:
    """(F, M, 3) with NaN for three exact zeros, which is how Vicon, Motive and many converters write a marker that was
    not seen, and for the same number of nines three times; and a note of how many there were.

    positions : in the file's unit.
    """
    zero = np.asarray((positions == 0.0).all(axis=2))
    alike = (positions == positions[..., :1]).all(axis=2)
    nines = np.asarray(alike & np.isin(np.abs(positions[..., 0]), NINES))
    unseen = zero | nines
    if not unseen.any():
        return positions, ()
    value = "0 0 0" if zero.any() else f"{positions[nines][0, 0]:.10g} three times"
    note = f"'{path.name}' has {value} for a marker {int(unseen.sum())} times: taken for missing."
    return np.where(unseen[..., None], np.nan, positions), (note,)


def check_reach(path: Path, motion: MarkerMotion, wrong: type[StudioError]) -> None:
    """Raises `wrong` naming file, row and marker where a coordinate is infinite or farther away than a place can be."""
    beyond = np.isinf(motion.positions) | (np.abs(motion.positions) > FARTHEST_MM)
    if beyond.any():
        row, marker, axis = (int(at[0]) for at in np.nonzero(beyond))
        value = motion.positions[row, marker, axis]
        raise wrong(
            f"In '{path.name}' marker '{motion.names[marker]}' is at {value:g} mm in row {row + 1}.",
            REACH_HINT,
        )


def write_trc(path: Path, motion: MarkerMotion) -> None:
    """Write a motion, Y up, in its unit; missing markers become blank cells, one in the origin is written a last
    decimal beside it. The file appears whole or not.
    """
    count, rate = len(motion.times), f"{motion.rate:g}"
    decimals = 4 if motion.unit == "mm" else 7
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        HEADER_FIELDS,
        f"{rate}\t{rate}\t{count}\t{len(motion.names)}\t{motion.unit}\t{rate}\t1\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(motion.names),
        "\t\t" + "\t".join(f"{axis}{k}" for k in range(1, len(motion.names) + 1) for axis in "XYZ"),
    ]
    places = motion.positions[:, :, TRC_FROM_WORLD] / MM_PER_UNIT[motion.unit]
    # Three zeros would be read as a missing marker: one in the origin is a last decimal beside it.
    least = 10.0**-decimals
    places[(np.abs(places) <= least / 2).all(axis=2), 0] = least
    table = places.reshape(count, -1)
    for row, (time, values) in enumerate(zip(motion.times, table, strict=True), 1):
        cells = "\t".join("" if math.isnan(value) else f"{value:.{decimals}f}" for value in values)
        lines.append(f"{row}\t{time:.8f}\t{cells}")
    temporary = path.with_name(path.name + ".part")
    temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def _header(path: Path, lines: list[str]) -> _Header:
    if len(lines) < HEADER_LINES or not lines[0].startswith("PathFileType"):
        raise TruthError(
            f"'{path.name}' does not start with the five header lines of a TRC file.",
            "Give a TRC file whose first line begins with 'PathFileType'.",
        )
    fields = dict(zip(lines[1].strip().split("\t"), lines[2].strip().split("\t"), strict=False))
    if "\t" not in lines[2]:
        raise TruthError(
            f"'{path.name}' has no tabs in its header: the cells of a TRC are separated by tabs.",
            "Export it again: a text editor put blanks in their place.",
        )
    named = fields.get("Units", "").strip().lower()
    unit = UNIT_WORDS.get(named, named)
    if unit not in MM_PER_UNIT:
        raise TruthError(
            f"'{path.name}' line 3 gives the unit '{fields.get('Units', '')}'.", "Use one of: mm, cm, m."
        )
    rate = _header_number(path, fields, "DataRate")
    if rate <= 0.0:
        raise TruthError(f"'{path.name}' line 3 gives a DataRate of {rate:g}.", "It is rows per second.")
    names = [name.strip() for name in lines[3].split("\t")[FIRST_COLUMNS::3]]
    while names and not names[-1]:
        names.pop()
    declared = int(_header_number(path, fields, "NumMarkers"))
    twice = sorted({name for name in names if name and names.count(name) > 1})
    if twice:
        raise TruthError(
            f"'{path.name}' line 4 names marker '{twice[0]}' twice.", "Give each marker its own name."
        )
    if len(names) != declared or not names or not all(names):
        raise TruthError(
            f"'{path.name}' line 4 names {len(list(filter(None, names)))} markers and line 3 says {declared}.",
            "Give each marker its own name, one for every three columns.",
        )
    return _Header(tuple(names), unit, rate, int(_header_number(path, fields, "NumFrames")))


def number_or_nan(text: str) -> float:
    """A number as a file writes it, with a decimal point or comma; NaN where it is none."""
    try:
        return float(text.replace(",", ".") if "," in text and "." not in text else text)
    except ValueError:
        return math.nan


def _header_number(path: Path, fields: dict[str, str], name: str) -> float:
    value = number_or_nan(fields.get(name, ""))
    if not math.isfinite(value):
        raise TruthError(
            f"'{path.name}' line 3 gives no {name}.",
            "Lines 2 and 3 of a TRC name its rates, counts and unit.",
        )
    return value


def _row(path: Path, number: int, line: str, names: tuple[str, ...]) -> list[float]:
    cells = [cell.strip() for cell in line.split("\t")]
    wanted = FIRST_COLUMNS + 3 * len(names)
    while len(cells) > wanted and not cells[-1]:
        cells.pop()
    if len(cells) != wanted:
        raise TruthError(
            f"'{path.name}' line {number} has {len(cells)} columns, not {wanted}.",
            "Each row is a frame number, a time and three columns a marker.",
        )
    labels = ["Time", *(f"{name} {axis}" for name in names for axis in "XYZ")]
    values = [
        math.nan
        if cell.lower() in MISSING and column > FIRST_COLUMNS
        else _cell(path, number, column, labels, cell)
        for column, cell in enumerate(cells[1:], 2)
    ]
    for index, name in enumerate(names):
        missing = [math.isnan(value) for value in values[1 + 3 * index : 4 + 3 * index]]
        if any(missing) and not all(missing):
            raise TruthError(
                f"'{path.name}' line {number} gives only part of marker {name}.",
                "Leave all three cells of a missing marker blank.",
            )
    return values


def _cell(path: Path, number: int, column: int, labels: list[str], text: str) -> float:
    value = number_or_nan(text)
    if not math.isfinite(value):
        raise TruthError(
            f"'{path.name}' line {number}, column {column} ({labels[column - 2]}) is '{text}', not a number.",
            "Correct the time."
            if column == FIRST_COLUMNS
            else "Leave the three cells of a missing marker blank.",
        )
    return value
