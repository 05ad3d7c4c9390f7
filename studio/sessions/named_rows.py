"""Small CSV files whose header names the pose vector's parameters: `start_pose.csv`, `sigma.csv` and stored poses.

Numbers are in radians and mm. `sigma.csv` has a leading column `fps`: the frame rate at which its standard
deviations from one frame to the next were measured. Files of poses have a leading column `frame`, and a start pose that
is known to be of a frame has one, too.
"""

import csv
import math
from pathlib import Path

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.csv_text import FRAME, as_csv
from studio.foundations.errors import BodyError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.geometry.reach import REACH_HINT, within_reach
from studio.sessions.atomic_files import write_text

FPS = "fps"
SEPARATORS = (",", ";", "\t")
MOST_TURNS = 2.0
"""No start pose is turned further; degrees are."""


def read_pose(path: Path, names: tuple[str, ...], frame: int | None = None) -> Array:
    """(D,) the pose in a CSV file, in the order of `names`.

    A file with several rows needs a column `frame`, from which the row of `frame` (else the first) is taken.
    Raises BodyError naming file, entry and remedy.
    """
    header, rows = _read_rows(path)
    row = rows[0]
    if len(rows) > 1:
        if FRAME not in header:
            raise BodyError(
                f"'{path.name}' has {len(rows)} rows and no column 'frame'.", "Keep one row, the start pose."
            )
        column = header.index(FRAME)
        row = next(
            (candidate for candidate in rows if frame is not None and candidate[column] == frame), rows[0]
        )
    return _ordered(path, header, row, names)


def check_radians(path: Path, body: BodyModel, pose: Array) -> None:
    """Raises BodyError for a file's pose (D,) whose angles can only be degrees."""
    for entry, value in zip(body.parameters, pose, strict=True):
        if entry.kind == "angle" and abs(value) > 2.0 * math.pi * MOST_TURNS:
            raise BodyError(
                f"'{path.name}' has {value:g} for '{entry.name}': angles are in radians, and these seem to be degrees.",
                "Multiply the angles by π/180; lengths stay in mm.",
            )


def pose_frame(path: Path) -> int | None:
    """The frame of the (first) pose in a CSV file; None if the file has no such column. Raises BodyError."""
    header, rows = _read_rows(path)
    return int(rows[0][header.index(FRAME)]) if FRAME in header else None


def named_columns(path: Path) -> tuple[str, ...]:
    """The names of a CSV file's columns. Raises BodyError."""
    return tuple(_read_rows(path)[0])


def write_pose(path: Path, names: tuple[str, ...], pose: Array, frame: int | None = None) -> None:
    """Write one pose under its parameters' names, in one step. pose : (D,) radians and mm. frame : it is of."""
    head, first = ([], []) if frame is None else ([FRAME], [str(frame)])
    write_text(path, as_csv([[*head, *names], [*first, *(repr(float(value)) for value in pose)]]))


def read_sigma(path: Path, names: tuple[str, ...], fps: float) -> Array:
    """(D,) standard deviations from frame to frame at `fps`, scaled from the rate that the file names.

    The largest movement between two frames grows with the time between them, so σ scales with 1 / fps.
    Raises BodyError.
    """
    header, rows = _read_rows(path)
    if FPS not in header:
        raise BodyError(
            f"'{path.name}' has no column 'fps'.", "Add the frame rate at which its σ were measured."
        )
    measured_at = rows[0][header.index(FPS)]
    sigma = _ordered(path, header, rows[0], names)
    if measured_at <= 0.0 or np.any(sigma < 0.0):
        raise BodyError(
            f"'{path.name}' has a negative σ or frame rate.", "Give standard deviations of 0 or more."
        )
    return sigma * (measured_at / fps)


def write_sigma(path: Path, names: tuple[str, ...], sigma: Array, fps: float) -> None:
    """Write standard deviations (rad, mm from frame to frame at `fps`) under their parameters' names."""
    write_text(path, as_csv([[FPS, *names], [repr(float(fps)), *(repr(float(value)) for value in sigma)]]))


def _read_rows(path: Path) -> tuple[list[str], list[list[float]]]:
    """Header and rows of numbers; at least one row."""
    with foreign_file(path, BodyError, "a CSV file", "Save it as comma-separated text in UTF-8."):
        text = read_foreign_text(path).splitlines()
        first = next((line for line in text if line.strip()), "")
        separator = max(SEPARATORS, key=first.count)
        lines = [line for line in csv.reader(text, delimiter=separator) if any(line)]
    header = [entry.strip() for entry in lines[0]] if lines else []
    if len(lines) < 2:
        raise BodyError(f"'{path.name}' has no row under its header.", "Give one row of numbers.")
    rows: list[list[float]] = []
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(header):
            raise BodyError(
                f"Line {number} of '{path.name}' has {len(line)} entries under {len(header)} names.",
                "Give one number for each name of the header.",
            )
        rows.append([_number(path, number, name, entry) for name, entry in zip(header, line, strict=True)])
    return header, rows


def _number(path: Path, line: int, name: str, entry: str) -> float:
    try:
        value = float(entry.replace(",", ".") if "." not in entry else entry)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BodyError(f"Line {line} of '{path.name}' has {entry!r} for '{name}'.", "Give a finite number.")
    if not within_reach(value):
        raise BodyError(f"Line {line} of '{path.name}' has {entry!r} for '{name}'.", REACH_HINT)
    return value


def _ordered(path: Path, header: list[str], row: list[float], names: tuple[str, ...]) -> Array:
    known = dict(zip(header, row, strict=True))
    missing = [name for name in names if name not in known]
    if missing:
        listed = ", ".join(missing[:4]) + (" …" if len(missing) > 4 else "")
        raise BodyError(
            f"'{path.name}' lacks {len(missing)} of the body's {len(names)} parameters: {listed}.",
            "Give a row for this body, its parameters' names in the header.",
        )
    return np.array([known[name] for name in names])
