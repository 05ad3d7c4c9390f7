"""Files that hold a true motion, by their ending."""

from collections.abc import Callable, Mapping
from pathlib import Path

from studio.errors import TruthError
from studio.motion_files.points_csv import read_points
from studio.motion_files.trc import MarkerMotion, read_trc

READERS: Mapping[str, Callable[[Path, float], MarkerMotion]] = {
    ".trc": lambda path, fps: read_trc(path),
    ".csv": read_points,
}
"""Ending → reader of a file and the footage's frames per second. A TRC is in the session's world, a CSV in its own."""
ANY_WORLD = (".csv",)
"""Endings of files whose world is their own."""


def read_truth(path: Path, fps: float) -> MarkerMotion:
    """The true motion in a file. fps : of the footage. Raises TruthError, for another ending too."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise TruthError(
            f"'{path.name}' is no truth that can be read.", f"Give a {' or '.join(READERS)} file."
        )
    return reader(path, fps)
