"""Lenses taken from a calibration file, to place cameras anew without new pictures for the lenses."""

from collections.abc import Sequence
from pathlib import Path

from studio.calibration.coverage import coverage_of
from studio.calibration.intrinsics import Lens
from studio.capture.calibration_files import read_intrinsics
from studio.capture.naming import match_names
from studio.errors import CalibrationError


def lenses_of_file(path: Path, names: Sequence[str]) -> dict[str, Lens]:
    """Camera → lens, matched by name; pictures, residuals and coverage are unknown. Raises CalibrationError."""
    read = {entry.name: entry for entry in read_intrinsics(path)}
    matches = match_names(list(names), list(read), "recordings", CalibrationError)
    found: dict[str, Lens] = {}
    for match in matches:
        entry = read[match.camera]
        size = (entry.width, entry.height)
        found[match.footage] = Lens(
            match.footage,
            size,
            entry.matrix,
            entry.distortion,
            float("nan"),
            0.0,
            0.0,
            f"read from {path.name}",
            (),
            coverage_of((), size),
        )
    return found
