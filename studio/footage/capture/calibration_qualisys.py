"""Qualisys Track Manager's `.qca.txt`: XML with mm and 1/64 px, cameras by their serial.

`transform` holds the camera in the world: its place x y z and its axes, r11 r12 r13 being the first one (the matrix
from camera to world, column after column). These are the axes of a camera that looks along -z; half a turn about x
makes them OpenCV's. Distortion coefficients are OpenCV's as they stand; they are *not* in 64ths (the TOML that Pose2Sim
makes of such a file divides them). `viewrotation` says how the picture is rotated for display; pixels are the sensor's.
"""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from studio.footage.capture.calibration_parts import FoundCameras, Intrinsics, checked_intrinsics
from studio.footage.capture.calibration_storage import storage_text, xml_root
from studio.footage.capture.naming import listed
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera

QUALISYS_SUFFIXES = (".qca.txt", ".qca")
SUBPIXELS = 64.0
HALF_TURN_ABOUT_X = np.diag([1.0, -1.0, -1.0])
VIEWS = ("fov_video", "fov_video_max")


def is_qualisys(path: Path) -> bool:
    """Whether a file is one by its name."""
    return path.name.lower().endswith(QUALISYS_SUFFIXES)


def read_qualisys(path: Path) -> FoundCameras:
    """The active cameras of a file. Raises CalibrationError naming file, camera and entry."""
    where = f"'{path.name}'"
    elements = list(_document(path, where).iter("camera"))
    video = [
        entry for entry in elements if entry.get("active", "1") != "0" and entry.find("intrinsic") is not None
    ]
    if not video:
        raise CalibrationError(
            f"{where} holds no calibrated camera.", "Calibrate in QTM and export it again."
        )
    names = [entry.get("serial") or entry.get("id") or f"cam{k}" for k, entry in enumerate(video, 1)]
    cameras = tuple(
        _camera(f"{where}, camera {name}", name, entry) for name, entry in zip(names, video, strict=True)
    )
    turned = [
        name
        for name, entry in zip(names, video, strict=True)
        if entry.get("viewrotation", "0") not in ("0", "")
    ]
    notes = (
        (
            f"Camera {listed(turned)} is shown turned in QTM; its footage must be as the sensor saw it, or be"
            " turned back with --rotate.",
        )
        if turned
        else ()
    )
    return FoundCameras(cameras, "mm", (path,), notes=notes)


def _document(path: Path, where: str) -> Element:
    text = storage_text(path)
    if text is None:
        raise CalibrationError(f"{where} cannot be read as text.", "Export it from QTM again.")
    return xml_root(path, text, "Export it from QTM again.")


def _camera(where: str, name: str, entry: Element) -> Camera:
    transform = entry.find("transform")
    if transform is None:
        raise CalibrationError(f"{where} has no 'transform'.", "Calibrate in QTM and export it again.")
    axes = _numbers(where, transform, *(f"r{axis}{part}" for axis in (1, 2, 3) for part in (1, 2, 3)))
    centre = _numbers(where, transform, "x", "y", "z")
    rotation = HALF_TURN_ABOUT_X @ check_rotation(axes.reshape(3, 3), where)
    return _lens(where, name, entry).placed(rotation, -rotation @ centre)


def _lens(where: str, name: str, entry: Element) -> Intrinsics:
    intrinsic = entry.find("intrinsic")
    view = next((element for tag in VIEWS if (element := entry.find(tag)) is not None), None)
    if intrinsic is None or view is None:
        raise CalibrationError(f"{where} has no 'intrinsic' or 'fov_video'.", "Export it from QTM again.")
    left, top, right, bottom = _numbers(where, view, "left", "top", "right", "bottom")
    fx, fy, cx, cy = (
        _numbers(where, intrinsic, "focalLengthU", "focalLengthV", "centerPointU", "centerPointV") / SUBPIXELS
    )
    skew = float(intrinsic.get("skew") or 0.0) / SUBPIXELS if _is_number(intrinsic.get("skew")) else 0.0
    names = [f"radialDistortion{k}" for k in (1, 2)] + [f"tangentalDistortion{k}" for k in (1, 2)]
    distortion = _numbers(where, intrinsic, *names, "radialDistortion3", missing=0.0)
    matrix = np.array([[fx, skew, cx - left], [0.0, fy, cy - top], [0.0, 0.0, 1.0]])
    return checked_intrinsics(where, name, (right - left + 1.0, bottom - top + 1.0), matrix, distortion)


def _numbers(where: str, entry: Element, *names: str, missing: float | None = None) -> Array:
    """Attributes as finite numbers. missing : the value of a missing one. Raises CalibrationError."""
    values: list[float] = []
    for name in names:
        text = entry.get(name)
        if text is None and missing is not None:
            values.append(missing)
        elif _is_number(text):
            values.append(float(text or 0.0))
        else:
            what = "is not there" if text is None else f"is '{text[:40]}', no number"
            raise CalibrationError(f"{where}: '{entry.tag}' {name} {what}.", "Export it from QTM again.")
    return np.array(values)


def _is_number(text: str | None) -> bool:
    try:
        return text is not None and bool(np.isfinite(float(text)))
    except ValueError:
        return False
