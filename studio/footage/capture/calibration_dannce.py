"""DANNCE's cameras in MATLAB files: label3d's (`params` of all cameras, `camnames`), or one file a camera
(`hires_cam1_params.mat`).

MATLAB multiplies rows from the right and counts pixels from 1: K and r are the transposes of OpenCV's, and the
principal point lies one pixel further. Files of version 7.3 are HDF5 and are not read.
"""

import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from studio.footage.capture.calibration_parts import FoundCameras, checked_intrinsics
from studio.footage.capture.naming import natural_key
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import check_regular, foreign_file, read_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.isolated import isolated
from studio.foundations.typed_decoding import is_table

DANNCE_SUFFIX = ".mat"
LARGEST_FILE = 64 << 20
ONE_CAMERA = re.compile(r"(?:hires_)?(cam(?:era)?[ _-]?\d+)(?:_params)?$", re.IGNORECASE)
REMEDY = "Export it again as a .mat of version 7 or older: save(file, 'params', 'camnames', '-v7')."
ENTRIES = ("K", "RDistort", "TDistort", "r", "t")


@dataclass(frozen=True, slots=True, eq=False)
class _Params:
    """One camera as its file has it. values : by ENTRIES."""

    name: str
    values: dict[str, Array]


def dannce_files(folder: Path) -> tuple[Path, ...]:
    """The files of a folder that are named after single cameras, in natural order."""
    files = [
        path
        for path in folder.iterdir()
        if path.suffix.lower() == DANNCE_SUFFIX and path.is_file() and ONE_CAMERA.search(path.stem)
    ]
    return tuple(sorted(files, key=lambda path: natural_key(path.name)))


def is_label3d(path: Path) -> bool:
    """Whether a file is label3d's by its name."""
    return path.suffix.lower() == DANNCE_SUFFIX and any(
        word in path.stem.lower() for word in ("dannce", "label3d")
    )


def read_dannce(path: Path) -> FoundCameras:
    """The cameras of label3d's file, or of a folder of one file a camera. Raises CalibrationError naming the entry."""
    files = dannce_files(path) if path.is_dir() else (path,)
    cameras: list[Camera] = []
    for file in files:
        check_regular(file, CalibrationError)
        cameras += [_camera(file, params) for params in isolated(CalibrationError, _params_of, file)]
    return FoundCameras(tuple(cameras), "", files, sizes_known=False)


def _params_of(path: Path) -> list[_Params]:
    with foreign_file(path, CalibrationError, "a MATLAB file of cameras", REMEDY):
        # SciPy's stubs take paths alone; it reads streams as well.
        content: Any = io.BytesIO(read_file(path, LARGEST_FILE, CalibrationError))
        wanted = ["params", "camnames", *ENTRIES]
        variables = scipy.io.loadmat(content, simplify_cells=True, variable_names=wanted)
        several = "params" in variables
        entries = (
            np.atleast_1d(np.asarray(variables["params"], dtype=object)).tolist() if several else [variables]
        )
        given: list[Any] = np.atleast_1d(variables["camnames"]).tolist() if "camnames" in variables else []
        if not several:
            named = ONE_CAMERA.search(path.stem)
            given = [named[1] if named else path.stem]
        names = given if len(given) == len(entries) else [f"Camera{k}" for k in range(1, len(entries) + 1)]
        params: list[_Params] = []
        for name, entry in zip(names, entries, strict=True):
            if not is_table(entry) or not {"K", "r", "t"} <= set(entry):
                raise ValueError(f"camera {name} has no K, r and t")
            values = {key: np.array(entry[key], dtype=np.float64) for key in ENTRIES if key in entry}
            params.append(_Params(str(name), values))
    return params


def _camera(path: Path, params: _Params) -> Camera:
    where = f"'{path.name}', camera {params.name}"
    values = params.values
    radial, tangential = (values.get(key, np.zeros(2)).ravel() for key in ("RDistort", "TDistort"))
    if values["K"].shape != (3, 3) or values["r"].shape != (3, 3) or values["t"].size != 3:
        raise CalibrationError(f"{where}: K and r are not 3x3 numbers, or t not three.", "Calibrate again.")
    if not 2 <= len(radial) <= 3 or len(tangential) != 2:
        raise CalibrationError(
            f"{where}: {len(radial)} radial and {len(tangential)} tangential distortions.",
            "Calibrate with two or three radial and two tangential ones.",
        )
    matrix = values["K"].T.copy()
    matrix[:2, 2] -= 1.0
    distortion = np.array([*radial[:2], *tangential, *(radial[2:] if len(radial) > 2 else [0.0])])
    lens = checked_intrinsics(where, params.name, None, matrix, distortion)
    if not np.isfinite(values["t"]).all():
        raise CalibrationError(f"{where}: t holds a number that is not finite.", "Calibrate again.")
    return lens.placed(check_rotation(values["r"].T.copy(), where), values["t"].reshape(3))
