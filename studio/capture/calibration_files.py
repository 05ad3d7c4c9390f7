"""Calibrations as files: which ones a folder holds, reading any of them, writing the canonical one.

Everything is converted to mm. Where a format does not name its unit, the distance between cameras
tells: rigs are metres wide, so a number above 50 means mm. Names, rotations and shapes are checked; see
`sanity.py`.
"""

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from studio.capture.calibration_toml import (
    AssumedCrop,
    is_canonical,
    looks_like_calibration,
    read_toml,
    write_toml,
)
from studio.capture.naming import listed, natural_key
from studio.capture.sanity import check_rotation, quarter_turns
from studio.errors import CalibrationError
from studio.geometry.camera import Camera

BOUGUET_SUFFIX = ".cal"
BOUGUET_NUMBERS = 25
BOUGUET_SIZE = (640, 480)
MM_FROM = 50.0
ROTATIONS_AGREE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Cameras as a file places them, in mm, in natural order of their names, turned upright for display.

    label : the file's (or folder's) name. unit_note : the unit found and how, a sentence. sources : the
    files, to be kept byte for byte. sizes_known : False where the format has no picture size and
    640x480 stands in for it.
    crops : assumptions that an earlier import stored. notes : what was left out.
    """

    label: str
    cameras: tuple[Camera, ...]
    unit_note: str
    sources: tuple[Path, ...]
    sizes_known: bool = True
    crops: dict[str, AssumedCrop] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def source_text(self) -> str:
        """The imported text, files after each other."""
        return "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in self.sources)


def find_calibrations(folder: Path) -> tuple[Path, ...]:
    """Everything in a folder that can be read as a calibration: TOML files, and the folder itself for its
    .cal files.

        A session's own `cameras.toml` stands for the originals that lie beside it.
    """
    if not folder.is_dir():
        return ()
    canonical = folder / "cameras.toml"
    if is_canonical(canonical):
        return (canonical,)
    found = [
        path for path in folder.iterdir() if path.suffix.lower() == ".toml" and looks_like_calibration(path)
    ]
    if any(folder.glob(f"*{BOUGUET_SUFFIX}")):
        found.append(folder)
    return tuple(sorted(found, key=lambda path: natural_key(path.name)))


def read_calibration(path: Path) -> Calibration:
    """The cameras of a TOML file, of one .cal file, or of a folder of .cal files.

    Raises CalibrationError naming file, camera and entry: wrong shapes, numbers that are not finite, a
    rotation that is none, a fisheye camera, a name given twice.
    """
    if path.is_dir():
        files = tuple(sorted(path.glob(f"*{BOUGUET_SUFFIX}"), key=lambda file: natural_key(file.name)))
        if not files:
            raise CalibrationError(f"Folder '{path.name}' holds no .cal files.", "Name a calibration file.")
        cameras = tuple(_read_bouguet(file) for file in files)
        return _finished(Calibration(path.name, cameras, "", files, sizes_known=False), "")
    if not path.is_file():
        raise CalibrationError(f"There is no calibration '{path}'.", "Check the path.")
    if path.suffix.lower() == BOUGUET_SUFFIX:
        return _finished(Calibration(path.name, (_read_bouguet(path),), "", (path,), sizes_known=False), "")
    if path.suffix.lower() != ".toml":
        raise CalibrationError(
            f"'{path.name}' is no calibration format that can be read.",
            "Give a Pose2Sim, aniposelib, FreeMoCap or Caliscope TOML, or Bouguet .cal files.",
        )
    read = read_toml(path)
    notes = tuple(f"Camera {name} has no place in the world and is left out." for name in read.unposed)
    calibration = Calibration(path.name, read.cameras, "", (path,), crops=read.crops, notes=notes)
    return _finished(calibration, read.unit, turned=is_canonical(path))


def write_calibration(
    cameras: tuple[Camera, ...], path: Path, crops: dict[str, AssumedCrop] | None = None
) -> None:
    """Write the canonical TOML: mm, sizes, quarter turns for display, and the crops that were assumed."""
    write_toml(cameras, path, crops)


def _finished(read: Calibration, unit: str, turned: bool = False) -> Calibration:
    """In mm, sorted, upright (unless the file says how far to turn); names checked."""
    names = [camera.name for camera in read.cameras]
    if len(set(names)) != len(names):
        raise CalibrationError(
            f"'{read.label}' names a camera twice ({listed(names)}).", "Give each camera its own name."
        )
    scale, note = _unit(read.cameras, unit)
    cameras = sorted(read.cameras, key=lambda camera: natural_key(camera.name))
    scaled = [dataclasses.replace(camera, translation=camera.translation * scale) for camera in cameras]
    if not turned:
        scaled = [dataclasses.replace(camera, quarter_turns=quarter_turns(camera)) for camera in scaled]
    return dataclasses.replace(read, cameras=tuple(scaled), unit_note=note)


def _unit(cameras: tuple[Camera, ...], named: str) -> tuple[float, str]:
    """Factor to mm, and the sentence that says why."""
    if named:
        return (1.0 if named == "mm" else 1000.0), f"The calibration is in {named}, as the file says."
    centres = np.array([camera.centre for camera in cameras])
    distance = float(np.median(np.linalg.norm(centres, axis=1)))
    if len(centres) > 1:
        gaps = np.linalg.norm(centres[:, None] - centres[None], axis=2)
        distance = max(distance, float(np.median(gaps[np.triu_indices(len(centres), 1)])))
    unit, scale = ("mm", 1.0) if distance > MM_FROM else ("m", 1000.0)
    return (
        scale,
        f"The calibration is taken to be in {unit} (cameras are {distance:.4g} apart or from the origin).",
    )


def _read_bouguet(path: Path) -> Camera:
    """One camera of 25 numbers: fx fy cx cy skew, k1 k2 p1 p2 k3, R (rows), T, om; om repeats R as
    Rodrigues."""
    where = f"'{path.name}'"
    try:
        values = np.array([float(word) for word in path.read_text(encoding="utf-8").split()])
    except (OSError, UnicodeDecodeError, ValueError) as problem:
        raise CalibrationError(f"{where} is not a list of numbers ({problem}).", "Export it again.") from None
    if len(values) != BOUGUET_NUMBERS or not np.all(np.isfinite(values)):
        raise CalibrationError(
            f"{where} holds {np.count_nonzero(np.isfinite(values))} finite numbers, not {BOUGUET_NUMBERS}.",
            "A .cal file has fx fy cx cy skew, five distortions, nine of the rotation, T and om.",
        )
    fx, fy, cx, cy, skew = values[:5]
    if fx <= 0.0 or fy <= 0.0:
        raise CalibrationError(f"{where}: focal lengths {fx:g}, {fy:g}.", "They are positive pixels.")
    rotation = check_rotation(values[10:19].reshape(3, 3), where)
    repeated = np.asarray(cv2.Rodrigues(values[22:25].copy())[0])
    if not math.isclose(float(np.abs(rotation - repeated).max()), 0.0, abs_tol=ROTATIONS_AGREE):
        raise CalibrationError(
            f"{where}: rotation matrix and rotation vector say different things.", "Export the file again."
        )
    matrix = np.array([[fx, skew * fx, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return Camera(path.stem, *BOUGUET_SIZE, matrix, values[5:10], rotation, values[19:22])
