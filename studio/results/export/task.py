"""Input and output of a format's writer, and the tolerance when a file is read back."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import ExportError
from studio.foundations.progress import Progress
from studio.results.export.motion import Motion
from studio.results.export.options import Axes, ExportOptions
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

LEAST_MM, LEAST_DEGREES = 0.1, 0.01
INTERPOLATED = "{count} of {all} frames are interpolated: this format cannot say 'missing'."


@dataclass(frozen=True, slots=True, eq=False)
class ExportTask:
    """One file to be written.

    options : with "auto" made what the format has.
    place : the file, in an empty folder of its own; more files may be written beside it.
    step(words, done, total) : to be called while it is written; raises WorkCancelledError.
    """

    session: Session
    run: StoredRun
    motion: Motion
    options: ExportOptions
    place: Path
    step: Progress

    @property
    def axes(self) -> Axes:
        """The file's unit and up axis."""
        return Axes(self.options.unit, self.options.up)

    @property
    def source(self) -> dict[str, str]:
        """The source of the motion, for files that can name it."""
        return {
            "session": self.run.session_name,
            "run": self.run.name,
            "track": self.options.track,
            "body": self.motion.body.name,
        }

    def gaps_in_words(self, words: str) -> tuple[str, ...]:
        """A note on frames without a pose, if there are any.

        words : a sentence with {count} of {all} in it.
        """
        count = int((~self.motion.known).sum())
        return (words.format(count=count, all=len(self.motion.known)),) if count else ()


@dataclass(frozen=True, slots=True)
class Written:
    """files : written, the requested one first.
    checked : the result of reading back, as text.
    notes : for users of the file.
    """

    files: tuple[Path, ...]
    checked: str
    notes: tuple[str, ...] = ()


Writer = Callable[[ExportTask], Written]


def agreed(file: Path, points_mm: float, turns_degrees: float | None = None) -> str:
    """The result of reading a file back, as text. Raises ExportError if it differs.

    points_mm, turns_degrees : the largest differences between what was written and what was read.
    """
    turned = 0.0 if turns_degrees is None else turns_degrees
    if not (points_mm <= LEAST_MM and turned <= LEAST_DEGREES):
        raise ExportError(
            f"'{file.name}' differs when it is read back: {points_mm:.3g} mm and {turned:.3g} degrees apart.",
            "Export it again; if it stays so, report the run to the studio's makers.",
        )
    words = f"read back within {max(points_mm, 1e-4):.4f} mm"
    return words if turns_degrees is None else f"{words} and {max(turned, 1e-4):.4f}°"


def apart(one: Array, other: Array) -> float:
    """The largest distance of points (..., 3), infinite where they are not missing in the same places."""
    if one.shape != other.shape or not np.array_equal(np.isnan(one), np.isnan(other)):
        return float("inf")
    distances = np.linalg.norm(np.nan_to_num(one - other), axis=-1)
    return float(distances.max(initial=0.0))


def turned_apart(one: Array, other: Array) -> float:
    """The largest angle between rotations (..., 3, 3), degrees."""
    if one.shape != other.shape:
        return float("inf")
    # Of two rotations |A - B| (Frobenius) = 2 √2 sin(angle / 2), exact for small angles too.
    chord = np.linalg.norm(one - other, axis=(-2, -1)) / (2.0 * np.sqrt(2.0))
    return float(np.degrees(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0))).max(initial=0.0))
