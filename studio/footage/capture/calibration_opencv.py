"""Calibrations as OpenCV's samples write them: YAML or XML, one camera a file, or the stereo sample's pair.

`calibration.cpp` writes image_width, image_height, camera_matrix, distortion_coefficients and, optionally,
extrinsic_parameters: the board's place in each picture (a camera's place only where there is one picture).
`stereo_calib.cpp` writes intrinsics.yml (M1, D1, M2, D2) and extrinsics.yml (R, T of the second camera from the first).
Files with R and T of a camera, as the studio writes them, place it in the world.
"""

import re
from pathlib import Path

import numpy as np

from studio.footage.capture.calibration_easymocap import NO_SIZE
from studio.footage.capture.calibration_parts import FoundCameras, Intrinsics, checked_intrinsics
from studio.footage.capture.calibration_storage import STORAGE_SUFFIXES, Storage, storage_text
from studio.footage.capture.naming import natural_key
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector

MATRICES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1")
DISTORTIONS = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "dist", "D")
WIDTHS = ("image_width", "image_Width", "imageWidth", "width")
HEIGHTS = ("image_height", "image_Height", "imageHeight", "height")
ROTATIONS = ("R", "rotation_matrix", "rotation", "rvec", "rotation_vector")
TRANSLATIONS = ("T", "translation_vector", "translation", "tvec", "t")
BOARDS = "extrinsic_parameters"


def opencv_files(folder: Path) -> tuple[Path, ...]:
    """The files of a folder that hold a camera matrix by one of the samples' names, in natural order."""
    files = [
        path for path in folder.iterdir() if path.suffix.lower() in STORAGE_SUFFIXES and _is_camera(path)
    ]
    return tuple(sorted(files, key=lambda path: natural_key(path.name)))


def read_opencv(path: Path) -> FoundCameras:
    """The camera of one file, or those of a folder's files. Raises CalibrationError."""
    files = opencv_files(path) if path.is_dir() else (path,)
    parts = [_read_file(file) for file in files]
    return FoundCameras(
        tuple(camera for part in parts for camera in part.cameras),
        _common_unit(parts),
        tuple(source for part in parts for source in part.sources),
        tuple(lens for part in parts for lens in part.unposed),
        all(part.sizes_known for part in parts),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
    )


def _is_camera(path: Path) -> bool:
    text = storage_text(path)
    if text is None or not text.lstrip().startswith(("%YAML", "<?xml")):
        return False
    return re.search(rf"^\s*<?(?:{'|'.join(MATRICES)})(?:\s*:| type_id)", text, re.MULTILINE) is not None


def _read_file(path: Path) -> FoundCameras:
    storage = Storage(path)
    if storage.first("M1") and storage.first("M2"):
        return _stereo(path, storage)
    matrix = storage.first(*MATRICES)
    if not matrix:
        raise CalibrationError(
            f"{storage.where} holds no camera matrix.", "OpenCV's samples name it 'camera_matrix'."
        )
    name = storage.text("camera_name") or path.stem
    if storage.first("fisheye_model") and storage.numbers("fisheye_model").ravel()[:1].any():
        raise CalibrationError(
            f"{storage.where} is a fisheye camera, whose distortion the pinhole model cannot describe.",
            "Calibrate it with the pinhole model, or undistort its footage first.",
        )
    width, height = storage.first(*WIDTHS), storage.first(*HEIGHTS)
    size = (
        (float(storage.shaped(width, 1)[0]), float(storage.shaped(height, 1)[0]))
        if width and height
        else None
    )
    distortion = storage.first(*DISTORTIONS)
    lens = checked_intrinsics(
        storage.where,
        name,
        size,
        storage.shaped(matrix, 3, 3),
        storage.numbers(distortion).ravel() if distortion else np.zeros(5),
    )
    place = _place(storage)
    notes = () if size else (NO_SIZE,)
    if place is None:
        return FoundCameras((), "", (path,), (lens,), size is not None, notes=notes)
    camera = lens.placed(*place)
    return FoundCameras((camera,), _unit(storage), (path,), (), size is not None, notes=notes)


def _place(storage: Storage) -> tuple[Array, Array] | None:
    """R and T of the file: world to camera; None where it places no camera."""
    rotation, translation = storage.first(*ROTATIONS), storage.first(*TRANSLATIONS)
    if rotation and translation:
        return _rotation(storage, rotation), storage.shaped(translation, 3)
    if storage.first(BOARDS):
        boards = storage.numbers(BOARDS)
        if boards.size == 6:
            values = boards.reshape(6)
            return rotation_from_vector(values[:3]), values[3:]
    return None


def _rotation(storage: Storage, name: str) -> Array:
    values = storage.numbers(name)
    if values.size == 3:
        return rotation_from_vector(values.reshape(3))
    return check_rotation(storage.shaped(name, 3, 3), storage.where)


def _stereo(path: Path, inner: Storage) -> FoundCameras:
    """The stereo sample's pair: the first camera is the world."""
    lenses: list[Intrinsics] = []
    for number in (1, 2):
        distortion = inner.first(f"D{number}")
        lenses.append(
            checked_intrinsics(
                f"{inner.where}, camera {number}",
                f"cam{number}",
                None,
                inner.shaped(f"M{number}", 3, 3),
                inner.numbers(distortion).ravel() if distortion else np.zeros(5),
            )
        )
    beside = next((path.with_name(f"extrinsics{suffix}") for suffix in (path.suffix, ".yml", ".yaml", ".xml")
                   if path.with_name(f"extrinsics{suffix}").is_file()), None)  # fmt: skip
    if beside is None:
        return FoundCameras((), "", (path,), tuple(lenses), False, notes=(NO_SIZE,))
    outer = Storage(beside)
    second: Camera = lenses[1].placed(_rotation(outer, "R"), outer.shaped("T", 3))
    first = lenses[0].placed(np.eye(3), np.zeros(3))
    note = "A stereo pair: the world is the first camera's, so its z axis does not point up."
    return FoundCameras((first, second), "", (path, beside), (), False, notes=(NO_SIZE, note))


def _unit(storage: Storage) -> str:
    named = storage.text("translation_unit")
    return named if named in ("mm", "m") else ""


def _common_unit(parts: list[FoundCameras]) -> str:
    units = {part.unit for part in parts if part.cameras}
    return units.pop() if len(units) == 1 else ""
