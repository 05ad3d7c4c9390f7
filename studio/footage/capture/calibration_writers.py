"""Calibrations for other tools: Pose2Sim's and aniposelib's TOML, OpenCV's YAML.

Each writer follows the rules of the format's own reader; the loss where a format cannot hold a lens is reported, in
pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import tomli_w

from studio.footage.capture.calibration_parts import FoundCameras
from studio.footage.capture.naming import natural_key
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import vector_from_rotation
from studio.foundations.registry import Registry

GRID = 21
SEEN = 0.01
"""Pixels below which a difference is not worth a word."""


@dataclass(frozen=True, slots=True)
class WrittenCalibration:
    """A calibration for another tool.

    files : that were written, in the cameras' order where it is one each.
    notes : what the format cannot hold.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CalibrationFormat:
    """Another tool's format.

    name : its key.
    label : for people.
    suffix : of its files.
    unit : of the translations.
    file_name : that the tool looks for, {} in it the session's name.

    write(cameras, path) -> WrittenCalibration; raises CalibrationError. A format that the studio does not read by
    itself (`calibration_files`) brings both: recognises(path) -> whether a file is of it; read(path) -> FoundCameras,
    raising CalibrationError.
    """

    name: str
    label: str
    suffix: str
    unit: str
    write: Callable[[tuple[Camera, ...], Path], WrittenCalibration]
    recognises: Callable[[Path], bool] | None = None
    read: Callable[[Path], FoundCameras] | None = None
    file_name: str = "cameras"


def write_pose2sim(cameras: tuple[Camera, ...], path: Path) -> WrittenCalibration:
    """Pose2Sim's TOML: metres, Rodrigues vectors, exactly four distortion numbers.

    A third radial coefficient is taken up by the first two, by least squares over the picture.
    """
    document: dict[str, object] = {}
    notes: list[str] = []
    for camera in _checked(cameras):
        distortion, moved = without_k3(camera)
        if moved > SEEN:
            notes.append(
                f"Camera {camera.name}: Pose2Sim's file has no k3; k1 and k2 take its place, off by at most"
                f" {moved:.2f} px."
            )
        notes += _skew_notes(camera, "Pose2Sim")
        document[camera.name] = _table(camera, distortion[:4], camera.translation / 1000.0) | {
            "fisheye": False
        }
    document["metadata"] = {"adjusted": False, "error": 0.0}
    path.write_text(tomli_w.dumps(document), encoding="utf-8")
    return WrittenCalibration((path,), tuple(notes))


def write_aniposelib(cameras: tuple[Camera, ...], path: Path) -> WrittenCalibration:
    """aniposelib's TOML: mm, Rodrigues vectors, five distortion numbers, sections cam_0, cam_1, …

    Its reader sorts sections as text, so numbers are padded to equal length.
    """
    digits = len(str(len(cameras) - 1))
    document: dict[str, object] = {
        f"cam_{index:0{digits}d}": _table(camera, camera.distortion, camera.translation)
        for index, camera in enumerate(_checked(cameras))
    }
    document["metadata"] = {"adjusted": False, "error": 0.0}
    path.write_text(tomli_w.dumps(document), encoding="utf-8")
    return WrittenCalibration(
        (path,), tuple(note for camera in cameras for note in _skew_notes(camera, "aniposelib"))
    )


def write_opencv(cameras: tuple[Camera, ...], path: Path) -> WrittenCalibration:
    """OpenCV's YAML or XML (by the suffix), one file a camera with the names of OpenCV's samples, and R, T in mm.

    One camera is written to `path` itself, several to `<stem>_<camera>` beside it.
    """
    files: list[Path] = []
    for camera in _checked(cameras):
        file = (
            path if len(cameras) == 1 else path.with_name(f"{path.stem}_{_plain(camera.name)}{path.suffix}")
        )
        storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
        if not storage.isOpened():
            raise CalibrationError(
                f"'{file.name}' cannot be written as OpenCV's format.",
                "Give a path that ends in .yml or .xml.",
            )
        try:
            storage.write("camera_name", camera.name)
            storage.write("image_width", camera.width)
            storage.write("image_height", camera.height)
            storage.write("camera_matrix", camera.matrix)
            storage.write("distortion_coefficients", camera.distortion.reshape(5, 1))
            storage.write("R", camera.rotation)
            storage.write("T", camera.translation.reshape(3, 1))
            storage.write("translation_unit", "mm")
        finally:
            storage.release()
        files.append(file)
    return WrittenCalibration(
        tuple(files), tuple(note for camera in cameras for note in _skew_notes(camera, "OpenCV"))
    )


def without_k3(camera: Camera) -> tuple[Array, float]:
    """(5,) distortion with k3 = 0 that bends the picture most alike, and the largest difference, px."""
    if camera.distortion[4] == 0.0:
        return camera.distortion, 0.0
    x, y = np.meshgrid(np.linspace(0, camera.width, GRID), np.linspace(0, camera.height, GRID))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    seen = cv2.undistortPoints(points[:, None], camera.matrix, camera.distortion)
    straight = np.asarray(seen, dtype=np.float64).reshape(-1, 2)
    square = np.sum(straight**2, axis=1)
    radius = np.sqrt(square)
    powers = np.stack([square * radius, square**2 * radius], axis=1)
    k1, k2, p1, p2, k3 = camera.distortion
    bent: Array = k3 * square**3 * radius
    added = np.linalg.lstsq(powers, bent, rcond=None)[0]
    left = np.abs(powers @ added - bent)
    focal = max(camera.matrix[0, 0], camera.matrix[1, 1])
    return np.array([k1 + added[0], k2 + added[1], p1, p2, 0.0]), float(focal * left.max())


def _table(camera: Camera, distortion: Array, translation: Array) -> dict[str, object]:
    return {
        "name": camera.name,
        "size": [float(camera.width), float(camera.height)],
        "matrix": camera.matrix.tolist(),
        "distortions": distortion.tolist(),
        "rotation": vector_from_rotation(camera.rotation).ravel().tolist(),
        "translation": translation.tolist(),
    }


def _skew_notes(camera: Camera, tool: str) -> list[str]:
    skew = abs(float(camera.matrix[0, 1])) * camera.height / (2.0 * camera.matrix[1, 1])
    return (
        [f"Camera {camera.name}: {tool} passes over the skew of its axes, up to {skew:.2f} px."]
        if skew > SEEN
        else []
    )


def _checked(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """The cameras in natural order. Raises CalibrationError if there are none."""
    if not cameras:
        raise CalibrationError("There are no cameras to write.", "Calibrate or import cameras first.")
    return tuple(sorted(cameras, key=lambda camera: natural_key(camera.name)))


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in name)


def _check(form: CalibrationFormat) -> None:
    if (form.recognises is None) != (form.read is None):
        raise CalibrationError("it brings one of 'recognises' and 'read' without the other")


CALIBRATION_FORMATS: Registry[CalibrationFormat] = Registry(
    "calibration format",
    "studio.calibrations",
    CalibrationFormat,
    (
        CalibrationFormat("pose2sim", "Pose2Sim TOML", ".toml", "m", write_pose2sim, file_name="Calib_{}"),
        CalibrationFormat(
            "aniposelib", "aniposelib TOML", ".toml", "mm", write_aniposelib, file_name="calibration"
        ),
        CalibrationFormat("opencv", "OpenCV YAML, one file a camera", ".yml", "mm", write_opencv),
    ),
    _check,
)


def added_reader(path: Path) -> Callable[[Path], FoundCameras] | None:
    """What reads a file of a format that a package adds; None where none of them recognises it."""
    for form in CALIBRATION_FORMATS.values():
        if form.recognises is not None and form.recognises(path):
            return form.read
    return None
