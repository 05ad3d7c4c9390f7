"""OpenCap's cameras: `Videos/Cam0/cameraIntrinsicsExtrinsics.pickle`, one a camera, named after its folder.

Lengths are mm; the world is that of the board, whose axes lie as it hung or stood. The pickle is read without running
anything of it (`foreign_pickles`).
"""

from pathlib import Path
from typing import Any

import numpy as np

from studio.footage.capture.calibration_parts import FoundCameras, checked_intrinsics
from studio.footage.capture.naming import natural_key
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import foreign_file, read_file
from studio.foundations.foreign_pickles import MOST_BYTES, read_plain_pickle
from studio.foundations.geometry.camera import Camera
from studio.foundations.typed_decoding import is_table

FILE_NAME = "cameraIntrinsicsExtrinsics.pickle"
ENTRIES = ("intrinsicMat", "distortion", "imageSize", "rotation", "translation")
REMEDY = "Of pickles only OpenCap's cameras are read: convert it where you trust it, and give a TOML."


def opencap_files(folder: Path) -> tuple[Path, ...]:
    """The pickles of cameras in the folders of a folder `Videos`, in natural order; none of another folder."""
    places = folder.glob(f"*/{FILE_NAME}") if folder.name == "Videos" else ()
    files = [path for path in places if path.is_file()]
    return tuple(sorted(files, key=lambda path: natural_key(path.parent.name)))


def read_opencap(path: Path) -> FoundCameras:
    """The cameras of a folder `Videos`, or of one pickle. Raises CalibrationError naming file and entry."""
    files = opencap_files(path) if path.is_dir() else (path,)
    cameras: list[Camera] = []
    sizes: list[bool] = []
    for file in files:
        camera, sized = _camera(file)
        cameras.append(camera)
        sizes.append(sized)
    return FoundCameras(tuple(cameras), "mm", files, sizes_known=all(sizes))


def _camera(path: Path) -> tuple[Camera, bool]:
    """A camera, and whether its file says how large its pictures are."""
    where = f"'{path.parent.name}/{path.name}'"
    with foreign_file(path, CalibrationError, "OpenCap's pickle of a camera", REMEDY):
        content: Any = read_plain_pickle(read_file(path, MOST_BYTES, CalibrationError))
        if not is_table(content) or not {"intrinsicMat", "rotation", "translation"} <= set(content):
            raise CalibrationError(f"{where} holds no placed camera.", REMEDY)
        values: dict[str, Array] = {
            name: np.array(content[name], dtype=np.float64)
            for name in ENTRIES
            if content.get(name) is not None
        }
    matrix, rotation, translation = (values[name] for name in ("intrinsicMat", "rotation", "translation"))
    distortion = values.get("distortion", np.zeros(5)).ravel()
    size = values.get("imageSize", np.zeros(0)).ravel()
    if matrix.shape != (3, 3) or rotation.shape != (3, 3) or translation.size != 3 or size.size not in (0, 2):
        raise CalibrationError(f"{where}: entries are not of a camera's shapes.", "Calibrate again.")
    if not np.isfinite(translation).all():
        raise CalibrationError(f"{where}: a number of the translation is not finite.", "Calibrate again.")
    # Height first.
    pixels = (float(size[1]), float(size[0])) if size.size else None
    lens = checked_intrinsics(where, path.parent.name, pixels, matrix, distortion)
    return lens.placed(check_rotation(rotation, where), translation.reshape(3)), pixels is not None
