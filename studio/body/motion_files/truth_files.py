"""Files that hold a true motion, by their ending."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from studio.body.motion_files.points_arrays import read_points_h5, read_points_mat, read_points_npy
from studio.body.motion_files.points_csv import read_points
from studio.body.motion_files.trc import MarkerMotion, read_trc
from studio.foundations.errors import TruthError

READERS: Mapping[str, Callable[[Path, float, str], MarkerMotion]] = {
    ".trc": lambda path, fps, up: read_trc(path, up),
    ".csv": lambda path, fps, up: read_points(path, fps),
    ".tsv": lambda path, fps, up: read_points(path, fps),
    ".h5": lambda path, fps, up: read_points_h5(path, fps),
    ".nwb": lambda path, fps, up: read_points_h5(path, fps),
    ".npy": lambda path, fps, up: read_points_npy(path, fps),
    ".mat": lambda path, fps, up: read_points_mat(path, fps),
}
"""Ending → reader of a file, the footage's frames per second and the file's axis that points up ("" as it shows). A TRC
is in the session's world, any other in its own."""
ANY_WORLD = (".csv", ".tsv", ".h5", ".nwb", ".npy", ".mat")
"""Endings of files whose world is their own."""


def read_truth(path: Path, fps: float, frame_count: int = 0, up: str = "") -> MarkerMotion:
    """The true motion in a file. fps, frame_count : of the footage, 0 where unknown. up : the axis of a TRC that points
    up, "" as its markers show it. Raises TruthError, for another ending too.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise TruthError(f"'{path.name}' is no truth that can be read.", f"Give a {', '.join(READERS)} file.")
    return _counted_from_0(path, reader(path, fps, up), fps, frame_count)


def _counted_from_0(path: Path, motion: MarkerMotion, fps: float, frame_count: int) -> MarkerMotion:
    """Rows that count the footage's frames from 1, moved a frame earlier; a note where that is unknown."""
    rows = np.flatnonzero(np.asarray(np.isfinite(motion.positions).all(axis=2)).any(axis=1))
    if not len(rows):
        return motion
    first, last = (round(float(motion.times[at]) * fps) for at in (rows[0], rows[-1]))
    if first == 0:
        return motion
    if first == 1 and last == frame_count:
        note = f"'{path.name}' counts its frames from 1 to {last}: row 1 was taken for frame 0."
        begun = motion.times >= 0.5 / fps
        return replace(
            motion,
            times=motion.times[begun] - 1.0 / fps,
            positions=motion.positions[begun],
            notes=(*motion.notes, note),
        )
    note = f"'{path.name}' begins with frame {first} (at {first / fps:.4g} s), its rows are placed by that"
    if first == 1:
        note += "; if it counts frames from 1, count them from 0"
    return replace(motion, notes=(*motion.notes, f"{note}."))
