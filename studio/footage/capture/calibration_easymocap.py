"""EasyMocap's pair of files: `intri.yml` (K_x, dist_x or D_x, perhaps H_x and W_x) and `extri.yml` (R_x, Rot_x, T_x).

x is a camera's name. Written by EasyMocap line by line in OpenCV's YAML, with CRLF; metres as a rule.
"""

from pathlib import Path

import numpy as np

from studio.footage.capture.calibration_parts import FoundCameras, Intrinsics, checked_intrinsics
from studio.footage.capture.calibration_storage import Storage
from studio.footage.capture.naming import listed
from studio.footage.capture.sanity import check_rotation
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector

INTRINSICS, EXTRINSICS = "intri.yml", "extri.yml"
ROTATIONS_AGREE = 1e-3
NO_SIZE = "The calibration gives no picture size: it is taken from the footage."


def is_easymocap(folder: Path) -> bool:
    return (folder / INTRINSICS).is_file() and (folder / EXTRINSICS).is_file()


def read_easymocap(path: Path) -> FoundCameras:
    """The cameras of the pair; path : one of both, or their folder. Raises CalibrationError."""
    folder = path if path.is_dir() else path.parent
    if not (folder / INTRINSICS).is_file():
        raise CalibrationError(
            f"'{path.name}' lies without its '{INTRINSICS}'.", f"Put EasyMocap's '{INTRINSICS}' beside it."
        )
    inner = Storage(folder / INTRINSICS)
    names = [name.removeprefix("K_") for name in inner.names if name.startswith("K_")]
    if not names:
        raise CalibrationError(f"{inner.where} holds no camera.", "EasyMocap names a camera's matrix K_NAME.")
    sized = all(inner.first(f"H_{name}") and inner.first(f"W_{name}") for name in names)
    lenses = {name: _lens(inner, name, sized) for name in names}
    notes = () if sized else (NO_SIZE,)
    if not (folder / EXTRINSICS).is_file():
        return FoundCameras((), "", (folder / INTRINSICS,), tuple(lenses.values()), sized, notes=notes)
    outer = Storage(folder / EXTRINSICS)
    placed = [name for name in names if outer.first(f"R_{name}", f"Rot_{name}")]
    strange = [name[2:] for name in outer.names if name.startswith("T_") and name[2:] not in lenses]
    if strange:
        raise CalibrationError(
            f"{outer.where} places camera {listed(strange)}, which {inner.where} does not have.",
            "Take both files from the same calibration.",
        )
    return FoundCameras(
        tuple(_camera(outer, lenses[name]) for name in placed),
        "",
        (folder / INTRINSICS, folder / EXTRINSICS),
        tuple(lenses[name] for name in names if name not in placed),
        sized,
        notes=notes,
    )


def _lens(inner: Storage, name: str, sized: bool) -> Intrinsics:
    where = f"{inner.where}, camera {name}"
    distortion = inner.first(f"dist_{name}", f"D_{name}")
    size = None
    if sized:
        size = (float(inner.shaped(f"W_{name}", 1)[0]), float(inner.shaped(f"H_{name}", 1)[0]))
    values = inner.numbers(distortion).ravel() if distortion else np.zeros(5)
    return checked_intrinsics(where, name, size, inner.shaped(f"K_{name}", 3, 3), values)


def _camera(outer: Storage, lens: Intrinsics) -> Camera:
    """A lens at its place; Rot_x and R_x must agree."""
    where = f"{outer.where}, camera {lens.name}"
    rotations: list[Array] = []
    if outer.first(f"Rot_{lens.name}"):
        rotations.append(check_rotation(outer.shaped(f"Rot_{lens.name}", 3, 3), where))
    if outer.first(f"R_{lens.name}"):
        rotations.append(rotation_from_vector(outer.shaped(f"R_{lens.name}", 3)))
    if float(np.abs(rotations[0] - rotations[-1]).max()) > ROTATIONS_AGREE:
        raise CalibrationError(
            f"{where}: rotation matrix and rotation vector disagree.", "Export the files again."
        )
    # Six decimals in the file: the vector is a rotation exactly, the matrix nearly.
    return lens.placed(rotations[-1], outer.shaped(f"T_{lens.name}", 3))
