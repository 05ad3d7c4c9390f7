"""Bouguet's .cal files, as PARSEC's benchmark has them: 25 numbers a camera, mm, no picture size.

fx fy cx cy skew, k1 k2 p1 p2 k3, R by rows, T, om; om repeats R as a Rodrigues vector.
"""

import math
from pathlib import Path

import numpy as np

from studio.footage.capture.calibration_parts import FoundCameras
from studio.footage.capture.naming import natural_key
from studio.footage.capture.sanity import check_rotation
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import foreign_file, read_file, read_foreign_text
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector

BOUGUET_SUFFIX = ".cal"
BOUGUET_NUMBERS = 25
BOUGUET_SIZE = (640, 480)
ROTATIONS_AGREE = 1e-3


def bouguet_files(folder: Path) -> tuple[Path, ...]:
    """The .cal files of a folder in natural order."""
    return tuple(sorted(folder.glob(f"*{BOUGUET_SUFFIX}"), key=lambda file: natural_key(file.name)))


def read_bouguet(path: Path) -> FoundCameras:
    """One .cal file, or all of a folder. Raises CalibrationError naming the file."""
    files = bouguet_files(path) if path.is_dir() else (path,)
    return FoundCameras(tuple(_read_file(file) for file in files), "", files, sizes_known=False)


def _read_file(path: Path) -> Camera:
    where = f"'{path.name}'"
    with foreign_file(path, CalibrationError, "a list of numbers", "Export it again."):
        binary = b"\0" in read_file(path)[:4096]
    if binary:
        raise CalibrationError(
            f"{where} is binary: a .cal of Motive (OptiTrack), it seems, which only Motive reads. Bouguet's is text.",
            "Export the cameras from Motive as text, or calibrate with a board; read are a Pose2Sim, aniposelib,"
            " FreeMoCap or Caliscope TOML, EasyMocap's or OpenCV's YAML, a Qualisys .qca.txt, and Bouguet .cal files.",
        )
    with foreign_file(path, CalibrationError, "a list of numbers", "Export it again."):
        values = np.array([float(word) for word in read_foreign_text(path).split()])
    if len(values) != BOUGUET_NUMBERS or not np.all(np.isfinite(values)):
        raise CalibrationError(
            f"{where} holds {np.count_nonzero(np.isfinite(values))} finite numbers, not {BOUGUET_NUMBERS}.",
            "A .cal file has fx fy cx cy skew, five distortions, nine of the rotation, T and om.",
        )
    fx, fy, cx, cy, skew = values[:5]
    if fx <= 0.0 or fy <= 0.0:
        raise CalibrationError(f"{where}: focal lengths {fx:g}, {fy:g}.", "They are positive pixels.")
    rotation = check_rotation(values[10:19].reshape(3, 3), where)
    repeated = rotation_from_vector(values[22:25])
    if not math.isclose(float(np.abs(rotation - repeated).max()), 0.0, abs_tol=ROTATIONS_AGREE):
        raise CalibrationError(
            f"{where}: rotation matrix and rotation vector disagree.", "Export the file again."
        )
    matrix = np.array([[fx, skew * fx, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(path.stem, *BOUGUET_SIZE, matrix, values[5:10], rotation, values[19:22])
