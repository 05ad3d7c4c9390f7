"""Calibrations in TOML: Pose2Sim, aniposelib, FreeMoCap, Caliscope, and the studio's own canonical file.

All give a table for each camera with size, matrix, distortions, rotation (Rodrigues or 3x3) and
translation, mapping world to camera. They differ in the unit (which most do not name), in how many
distortion numbers they write, and in where the camera's name is. The canonical file adds
`quarter_turns` and `assumed_crop` and names its unit, mm.
"""

import tomllib
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import tomli_w

from studio.footage.capture.calibration_parts import AssumedCrop, FoundCameras, Intrinsics, checked_intrinsics
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.geometry.camera import Camera
from studio.foundations.typed_decoding import is_table

CANONICAL, VERSION = "capture-studio", 1


def looks_like_calibration(path: Path) -> bool:
    """Whether a TOML file holds cameras (or cannot be parsed but it, or its folder, is named after calibration)."""
    try:
        document = _document(path)
    except CalibrationError:
        return "calib" in f"{path.parent.name}/{path.name}".lower() or path.name == "cameras.toml"
    return bool(_camera_tables(document))


def read_toml(path: Path) -> FoundCameras:
    """The cameras of a TOML calibration. Raises CalibrationError naming file, camera and entry."""
    document = _document(path)
    metadata = document.get("metadata")
    metadata = metadata if is_table(metadata) else {}
    version = metadata.get("version", VERSION) if metadata.get("format") == CANONICAL else VERSION
    if not isinstance(version, int) or version > VERSION:
        raise CalibrationError(
            f"'{path.name}' has version {version}, this studio knows versions up to {VERSION}.",
            "Open it with a newer studio.",
        )
    cameras: list[Camera] = []
    crops: dict[str, AssumedCrop] = {}
    unposed: list[Intrinsics] = []
    for section, table in _camera_tables(document).items():
        name = _name(section, table)
        where = f"'{path.name}', camera {name}"
        lens = _lens(where, name, table)
        if table.get("rotation") is None or table.get("translation") is None:
            unposed.append(lens)
            continue
        turns = int(_numbers(where, table, "quarter_turns", ())) % 4 if "quarter_turns" in table else 0
        cameras.append(
            lens.placed(_rotation(where, table), _numbers(where, table, "translation", (3,)), turns)
        )
        crop = table.get("assumed_crop")
        if is_table(crop):
            crops[name] = _crop(where, crop)
    return FoundCameras(tuple(cameras), _unit(metadata), (path,), tuple(unposed), crops=crops)


def write_calibration(
    cameras: tuple[Camera, ...], path: Path, crops: dict[str, AssumedCrop] | None = None
) -> None:
    """Write the canonical file (`calibration_text`)."""
    path.write_text(calibration_text(cameras, crops), encoding="utf-8")


def calibration_text(cameras: tuple[Camera, ...], crops: dict[str, AssumedCrop] | None = None) -> str:
    """The canonical file: mm, rotation as matrix rows, names as sections' `name`."""
    document: dict[str, object] = {}
    for index, camera in enumerate(cameras):
        table: dict[str, object] = {
            "name": camera.name,
            "size": [camera.width, camera.height],
            "matrix": camera.matrix.tolist(),
            "distortions": camera.distortion.tolist(),
            "rotation": camera.rotation.tolist(),
            "translation": camera.translation.tolist(),
            "quarter_turns": camera.quarter_turns,
        }
        crop = (crops or {}).get(camera.name)
        if crop is not None:
            table["assumed_crop"] = asdict(crop) | {"calibrated": list(crop.calibrated)}
        document[f"cam_{index:02d}"] = table
    document["metadata"] = {"format": CANONICAL, "version": VERSION, "unit": "mm"}
    return tomli_w.dumps(document)


def is_canonical(path: Path) -> bool:
    """Whether a file is the studio's own calibration."""
    try:
        metadata = _document(path).get("metadata", {})
    except CalibrationError:
        return False
    return is_table(metadata) and metadata.get("format") == CANONICAL


def _document(path: Path) -> dict[str, object]:
    """The file's entries. Raises CalibrationError."""
    with foreign_file(path, CalibrationError, "TOML", "Export it again."):
        return tomllib.loads(read_foreign_text(path))


def _camera_tables(document: dict[str, object]) -> dict[str, dict[str, object]]:
    """The sections that hold cameras, by name; Caliscope's lie one level down."""
    nested = document.get("cameras")
    source = nested if is_table(nested) else document
    return {key: table for key, table in source.items() if is_table(table) and "matrix" in table}


def _name(section: str, table: dict[str, object]) -> str:
    """The camera's name: its `name`, Caliscope's number, or the section."""
    name = table.get("name")
    if isinstance(name, str) and name.strip():
        return name.strip()
    number = table.get("cam_id", table.get("port"))
    return f"cam_{number}" if isinstance(number, int) else section


def _lens(where: str, name: str, table: dict[str, object]) -> Intrinsics:
    if table.get("fisheye") is True:
        raise CalibrationError(
            f"{where} is a fisheye camera, whose distortion the pinhole model cannot describe.",
            "Calibrate it with the pinhole model, or undistort its footage first.",
        )
    size = _numbers(where, table, "size" if "size" in table else "image_size", (2,))
    return checked_intrinsics(
        where,
        name,
        (float(size[0]), float(size[1])),
        _numbers(where, table, "matrix", (3, 3)),
        _numbers(where, table, "distortions", None),
    )


def _rotation(where: str, table: dict[str, object]) -> Array:
    """(3, 3) from a Rodrigues vector or from matrix rows."""
    values = _numbers(where, table, "rotation", None)
    if values.size == 3:
        return np.asarray(cv2.Rodrigues(values.reshape(3))[0], dtype=np.float64)
    return check_rotation(values, where)


def _numbers(where: str, table: dict[str, object], entry: str, shape: tuple[int, ...] | None) -> Array:
    """An entry as finite numbers of a shape (None: any)."""
    try:
        values = np.array(table[entry], dtype=np.float64)
    except KeyError:
        raise CalibrationError(f"{where} has no '{entry}'.", "Export the calibration again.") from None
    except (TypeError, ValueError, OverflowError):
        raise CalibrationError(
            f"{where}: '{entry}' is not numbers.", "Export the calibration again."
        ) from None
    if not np.all(np.isfinite(values)):
        raise CalibrationError(f"{where}: '{entry}' holds a number that is not finite.", "Calibrate again.")
    if shape is not None and values.shape != shape:
        wanted = "x".join(map(str, shape)) or "one"
        got = "x".join(map(str, values.shape))
        raise CalibrationError(f"{where}: '{entry}' has {got} numbers, not {wanted}.", "Export it again.")
    return values


def _crop(where: str, table: dict[str, object]) -> AssumedCrop:
    left, top, right, bottom = (
        float(_numbers(where, table, side, ())) for side in ("left", "top", "right", "bottom")
    )
    width, height = _numbers(where, table, "calibrated", (2,))
    scale = float(_numbers(where, table, "scale", ())) if "scale" in table else 1.0
    return AssumedCrop(left, top, right, bottom, (int(width), int(height)), scale)


def _unit(metadata: dict[str, object]) -> str:
    """The unit where a file names one: ours, and FreeMoCap's by its board."""
    if metadata.get("unit") in ("mm", "cm", "m", "in"):
        return str(metadata["unit"])
    board = metadata.get("board")
    return "mm" if is_table(board) and "square_length_mm" in board else ""
