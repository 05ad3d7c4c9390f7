"""A folder of PARSEC's bodytrack benchmark: CAM1.. with pictures, FG1.. with masks, CALIB with .cal files.

`BodyShapeParameters.txt` gives the subject's 58 dimensions, `InitialPose.txt` the 31 parameters of the
start pose and the first 31 numbers of `PoseParameters.txt` the standard deviations from frame to frame at
60 Hz (its limits belong to another branch of the angles and are not used). The start pose is kept
unchanged; `Session.start_pose` rewrites it within the body's limits. Every file but pictures and calibration may
be missing.
"""

import re
from pathlib import Path

import numpy as np

from studio.body.catalogue import load_body
from studio.body.subject import subject_from_shape
from studio.footage.capture.naming import natural_key
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.sessions.importers.folder_layout import choose_calibration
from studio.sessions.importers.plan import SourcePlan

BODY = "human31"
RATE = 60.0
SHAPE, START, PARAMETERS = "BodyShapeParameters.txt", "InitialPose.txt", "PoseParameters.txt"
SIGMA_MIN_MAX = 3


def is_bodytrack(source: Path) -> bool:
    """Whether a folder has the benchmark's layout."""
    return (source / "CALIB").is_dir() and bool(_folders(source, "CAM"))


def plan_bodytrack(source: Path, calibration: Path | str | None) -> SourcePlan:
    """The parts of such a folder. Raises BodyError for parameter files that do not fit the body."""
    body = load_body(BODY)
    count = len(body.parameters)
    shape = read_numbers(source / SHAPE)
    sigma = read_numbers(source / PARAMETERS, SIGMA_MIN_MAX * count)
    return SourcePlan(
        source=source,
        calibration=choose_calibration(source, calibration),
        footage=_folders(source, "CAM"),
        masks=_folders(source, "FG"),
        fps=RATE,
        subject=None if shape is None else subject_from_shape(body, shape),
        start_pose=read_numbers(source / START, count),
        sigma=None if sigma is None else sigma[:count],
        sigma_fps=RATE,
        layout="folder of PARSEC's bodytrack benchmark",
        notes=("A bodytrack folder: 60 frames per second are assumed; --fps overrides it.",),
    )


def _folders(source: Path, prefix: str) -> tuple[Path, ...]:
    folders = [
        path
        for path in source.iterdir()
        if path.is_dir() and re.fullmatch(rf"{prefix}\d+", path.name.upper())
    ]
    return tuple(sorted(folders, key=lambda path: natural_key(path.name)))


def read_numbers(path: Path, count: int | None = None) -> Array | None:
    """The flat list of numbers in a file, None where there is no such file.

    count : how many there must be. Raises BodyError naming the file and what is wrong with it.
    """
    if not path.is_file():
        return None
    with foreign_file(path, BodyError, "a list of numbers", "Copy the file again."):
        values = np.array([float(word) for word in read_foreign_text(path).split()])
    if not np.all(np.isfinite(values)) or (count is not None and len(values) != count):
        wanted = f"{count} finite numbers" if count is not None else "finite numbers"
        raise BodyError(
            f"'{path.name}' does not hold {wanted} but {np.count_nonzero(np.isfinite(values))}.",
            "Copy the file again.",
        )
    return values
