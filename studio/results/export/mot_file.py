"""The pose over time as an OpenSim motion file (`.mot`): a column a parameter of the body, degrees and metres.

OpenSim's storage format: a name, `version`, `nRows`, `nColumns`, `inDegrees`, a line `endheader`, then columns parted
by tabs, the first one time in seconds. Angles go on past 180 degrees rather than jump. A storage cannot say "missing":
frames without a pose hold the one in between, as in BVH.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import ExportError
from studio.foundations.foreign_files import read_text
from studio.results.export.task import ExportTask, Written, agreed

MM_PER_M = 1000.0
END = "endheader"


@dataclass(frozen=True, slots=True, eq=False)
class MotFile:
    """A storage that was read. header : its entries by name, the first line as "name". columns : names after time.
    times : (K,) s. values : (K, C) as they stand there.
    """

    header: dict[str, str]
    columns: tuple[str, ...]
    times: Array
    values: Array


def write_mot(task: ExportTask) -> Written:
    """The body's parameters as coordinates. Raises ExportError where the file does not read back."""
    motion = task.motion
    angle = motion.body.angles
    values = motion.poses.copy()
    values[:, angle] = np.degrees(np.unwrap(values[:, angle], axis=0))
    values[:, ~angle] /= MM_PER_M
    columns = ("time", *(entry.name for entry in motion.body.parameters))
    table = np.column_stack([motion.times, values])
    name = "_".join((task.run.session_name, task.run.name, task.options.track))
    head = [name, "version=1", f"nRows={len(table)}", f"nColumns={len(columns)}", "inDegrees=yes", "", END]
    task.step("writing", 0, 2)
    rows = ["\t".join(f"{value:.9f}" for value in row) for row in table]
    task.place.write_text("\n".join([*head, "\t".join(columns), *rows, ""]), encoding="utf-8")
    task.step("reading back", 1, 2)
    read = read_mot(task.place)
    if read.columns != columns[1:] or read.values.shape != values.shape:
        raise ExportError(
            f"'{task.place.name}' holds other columns or rows than were written.", "Export it again."
        )
    off = np.abs(read.values - values)
    checked = agreed(
        task.place, float(off[:, ~angle].max(initial=0.0)) * MM_PER_M, float(off[:, angle].max(initial=0.0))
    )
    notes = (
        f"Coordinates of body '{motion.body.name}', angles in degrees, lengths in m, world z up: an OpenSim model of"
        " other coordinates needs them renamed, or inverse kinematics on the TRC.",
        *task.gaps_in_words("{count} frames have no pose of their own and hold the one in between."),
    )
    return Written((task.place,), checked, notes)


def read_mot(path: Path) -> MotFile:
    """An OpenSim storage in degrees. Raises ExportError where it is none."""
    lines = read_text(path).splitlines()
    try:
        end = next(at for at, line in enumerate(lines) if line.strip().lower() == END)
        header = {"name": lines[0]} | dict(line.split("=", 1) for line in lines[1:end] if "=" in line)
        columns = lines[end + 1].split("\t")
        table = np.array([line.split("\t") for line in lines[end + 2 :] if line.strip()], dtype=np.float64)
        if table.shape != (int(header["nRows"]), int(header["nColumns"])) or len(columns) != table.shape[1]:
            raise ValueError("rows and columns are not as many as its head says")
        if columns[0] != "time" or header["inDegrees"] != "yes":
            raise ValueError("it does not begin with time, or is not in degrees")
    except (StopIteration, IndexError, KeyError, ValueError) as error:
        raise ExportError(f"'{path.name}' is no OpenSim motion file ({error}).", "Export it again.") from None
    return MotFile(header, tuple(columns[1:]), table[:, 0], table[:, 1:])
