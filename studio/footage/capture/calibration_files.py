"""Calibrations as files: which ones a folder holds, reading any of them, writing the canonical one.

Everything is converted to mm. Where a format does not name its unit, the distance between cameras
determines it: rigs are metres wide, so a number above 50 means mm. Names, rotations, lenses and shapes are checked; see
`sanity.py` and `calibration_parts.py`. Formats to write for other tools: `CALIBRATION_FORMATS`.
"""

import dataclasses
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studio.footage.capture.calibration_bouguet import BOUGUET_SUFFIX, bouguet_files, read_bouguet
from studio.footage.capture.calibration_dannce import DANNCE_SUFFIX, dannce_files, is_label3d, read_dannce
from studio.footage.capture.calibration_easymocap import EXTRINSICS, INTRINSICS, is_easymocap, read_easymocap
from studio.footage.capture.calibration_opencap import FILE_NAME as OPENCAP_NAME
from studio.footage.capture.calibration_opencap import opencap_files, read_opencap
from studio.footage.capture.calibration_opencv import opencv_files, read_opencv
from studio.footage.capture.calibration_parts import AssumedCrop, FoundCameras, Intrinsics
from studio.footage.capture.calibration_qualisys import is_qualisys, read_qualisys
from studio.footage.capture.calibration_storage import STORAGE_SUFFIXES
from studio.footage.capture.calibration_toml import (
    calibration_text,
    is_canonical,
    looks_like_calibration,
    read_toml,
    write_calibration,
)
from studio.footage.capture.calibration_writers import (
    CALIBRATION_FORMATS,
    CalibrationFormat,
    WrittenCalibration,
    added_reader,
)
from studio.footage.capture.naming import listed, natural_key
from studio.footage.capture.sanity import quarter_turns
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import foreign_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.worlds import WORLDS

__all__ = [
    "CALIBRATION_FORMATS",
    "AssumedCrop",
    "Calibration",
    "CalibrationFormat",
    "Intrinsics",
    "WrittenCalibration",
    "calibration_text",
    "export_calibration",
    "find_calibrations",
    "is_calibration",
    "read_calibration",
    "read_intrinsics",
    "write_calibration",
]

MM_FROM = 50.0
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
UNIT_PATTERN = r"^(|mm|cm|m|in|board=[0-9]+(\.[0-9]+)?(mm)?)$"
CALIBRATION = ("a calibration", "Export it again, or calibrate again.")
"""The name of the content, and the remedy for an unreadable file."""
PICKLES = frozenset((".pickle", ".pkl"))


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Cameras as a file places them, in mm, in natural order of their names, turned upright for display.

    label : the file's (or folder's) name. unit_note : the unit found and how, a sentence. sources : the
    files, to be kept byte for byte. sizes_known : False where the format has no picture size and
    a stand-in takes its place.
    crops : assumptions that an earlier import stored. notes : what was left out. mm : millimetres in the file's unit.
    """

    label: str
    cameras: tuple[Camera, ...]
    unit_note: str
    sources: tuple[Path, ...]
    sizes_known: bool = True
    crops: dict[str, AssumedCrop] = field(default_factory=dict[str, AssumedCrop])
    notes: tuple[str, ...] = ()
    mm: float = 1.0


def find_calibrations(folder: Path) -> tuple[Path, ...]:
    """Everything in a folder that can be read as a calibration: files, or the folder itself for several that belong
    together.

    A session's own `cameras.toml` stands for the originals that lie beside it, and any TOML for the files of other
    formats, which it is usually made from.
    """
    if not folder.is_dir():
        return ()
    canonical = folder / "cameras.toml"
    if is_canonical(canonical):
        return (canonical,)
    files = [
        path for path in folder.iterdir() if path.suffix.lower() == ".toml" and looks_like_calibration(path)
    ]
    if any(folder.glob(f"*{BOUGUET_SUFFIX}")):
        files.append(folder)
    if not files:
        files = _of_other_tools(folder)
    return tuple(sorted(files, key=lambda path: natural_key(path.name)))


def is_calibration(path: Path) -> bool:
    """Whether a file can be read as a calibration."""
    try:
        return bool(read_calibration(path).cameras)
    except CalibrationError:
        return False


def read_calibration(path: Path, unit: str = "", up: str = "z") -> Calibration:
    """The cameras of a file of any format that is known, or of a folder of files that belong together.

    unit : "mm", "cm", "m", "in" or "board=MM" overrides the file and the distances. up : the axis of the file's
    world that points up (x, y, z, -x, -y, -z); the cameras' world has z up.
    Raises CalibrationError naming file, camera and entry: wrong shapes, numbers that are not finite or no camera's,
    an invalid rotation, a fisheye camera, a name given twice, a damaged file, one that is a pipe.
    """
    with foreign_file(path, CalibrationError, *CALIBRATION):
        return _calibration(path, unit, up)


def _calibration(path: Path, unit: str, up: str) -> Calibration:
    content = _read(path)
    if not content.cameras:
        raise CalibrationError(
            f"'{path.name}' places no camera in the world.", "Calibrate the extrinsics and export again."
        )
    notes = tuple(
        f"Camera {lens.name} has no place in the world and is left out." for lens in content.unposed
    )
    calibration = Calibration(
        path.name,
        content.cameras,
        "",
        content.sources,
        content.sizes_known,
        content.crops,
        (*content.notes, *notes),
    )
    if unit:
        mm_of(unit)
    calibration = with_up(calibration, up)
    return _finish(calibration, content.unit, unit, turned=is_canonical(path) and up == "z")


def with_up(calibration: Calibration, up: str) -> Calibration:
    """The calibration in a world whose z axis is the old world's `up`. Raises CalibrationError for no axis."""
    if up not in WORLDS:
        raise CalibrationError(
            f"'{up}' is no axis that could point up.", f"Write one of {', '.join(WORLDS)}."
        )
    if up == "z":
        return calibration
    world = np.array(WORLDS[up], dtype=np.float64)
    cameras = tuple(
        dataclasses.replace(camera, rotation=camera.rotation @ world.T) for camera in calibration.cameras
    )
    note = f"The calibration's {up} axis was taken to point up, as requested."
    return dataclasses.replace(calibration, cameras=cameras, notes=(*calibration.notes, note))


def read_intrinsics(path: Path) -> tuple[Intrinsics, ...]:
    """The lenses of a calibration in natural order of their names, whether or not it places the cameras.

    Raises CalibrationError as `read_calibration` does.
    """
    with foreign_file(path, CalibrationError, *CALIBRATION):
        content = _read(path)
    posed = [
        Intrinsics(camera.name, camera.width, camera.height, camera.matrix, camera.distortion)
        for camera in content.cameras
    ]
    lenses = sorted([*posed, *content.unposed], key=lambda lens: natural_key(lens.name))
    if not lenses:
        raise CalibrationError(f"'{path.name}' holds no camera.", "Export the calibration again.")
    return tuple(lenses)


def export_calibration(cameras: tuple[Camera, ...], path: Path, writer: str) -> WrittenCalibration:
    """Write cameras for another tool. writer : of `CALIBRATION_FORMATS`. Raises CalibrationError, SettingsError."""
    return CALIBRATION_FORMATS[writer].write(cameras, path)


def _of_other_tools(folder: Path) -> list[Path]:
    """Qualisys files, those of added formats, EasyMocap's pair, OpenCV files (which together are one calibration)."""
    files = [path for path in folder.iterdir() if path.is_file()]
    calibrations = [path for path in files if is_qualisys(path) or added_reader(path)]
    if is_easymocap(folder):
        return [*calibrations, folder / INTRINSICS]
    if dannce_files(folder) or opencap_files(folder):
        return [*calibrations, folder]
    calibrations += [path for path in files if is_label3d(path)]
    opened = opencv_files(folder)
    return [*calibrations, *((folder,) if len(opened) > 1 else opened)]


def _read(path: Path) -> FoundCameras:
    if path.is_dir():
        return _read_folder(path)
    if not path.is_file():
        raise CalibrationError(f"There is no calibration '{path}'.", "Check the path.")
    suffix = path.suffix.lower()
    if suffix == BOUGUET_SUFFIX:
        return read_bouguet(path)
    if is_qualisys(path):
        return read_qualisys(path)
    if suffix == DANNCE_SUFFIX:
        return read_dannce(path)
    if path.name.lower() in (INTRINSICS, EXTRINSICS):
        return read_easymocap(path)
    added = added_reader(path)
    if added is not None:
        return added(path)
    if suffix in STORAGE_SUFFIXES:
        return read_opencv(path)
    if path.name == OPENCAP_NAME:
        return read_opencap(path)
    if suffix in PICKLES:
        raise CalibrationError(
            f"'{path.name}' is a Python pickle, which can run any program when it is opened; it is not read.",
            f"Convert it where you trust it, and give a TOML. OpenCap's are read: Videos/Cam0/{OPENCAP_NAME}, ….",
        )
    if suffix != ".toml":
        raise CalibrationError(
            f"'{path.name}' is no calibration format that can be read.",
            "Give a Pose2Sim, aniposelib, FreeMoCap or Caliscope TOML, EasyMocap's or OpenCV's YAML, a Qualisys"
            " .qca.txt, or Bouguet .cal files.",
        )
    return read_toml(path)


def _read_folder(folder: Path) -> FoundCameras:
    if bouguet_files(folder):
        return read_bouguet(folder)
    if is_easymocap(folder):
        return read_easymocap(folder)
    if dannce_files(folder):
        return read_dannce(folder)
    if opencap_files(folder):
        return read_opencap(folder)
    if opencv_files(folder):
        return read_opencv(folder)
    raise CalibrationError(
        f"Folder '{folder.name}' holds no .cal files, no intri.yml with extri.yml and no OpenCV files.",
        "Name a calibration file.",
    )


def _finish(read: Calibration, unit: str, requested: str, turned: bool = False) -> Calibration:
    """In mm, sorted, upright (unless the file says how far to turn); names checked."""
    names = [camera.name for camera in read.cameras]
    if len(set(names)) != len(names):
        raise CalibrationError(
            f"'{read.label}' names a camera twice ({listed(names)}).", "Give each camera its own name."
        )
    scale, note = _unit(read.cameras, unit)
    if requested:
        scale, note = mm_of(requested), f"The calibration is taken to be in {requested}, as requested."
    cameras = sorted(read.cameras, key=lambda camera: natural_key(camera.name))
    scaled = [dataclasses.replace(camera, translation=camera.translation * scale) for camera in cameras]
    if not turned:
        scaled = [dataclasses.replace(camera, quarter_turns=quarter_turns(camera)) for camera in scaled]
    return dataclasses.replace(read, cameras=tuple(scaled), unit_note=note, mm=scale)


def mm_of(unit: str) -> float:
    """Millimetres in a unit: one of UNITS, or board=MM. Raises CalibrationError."""
    if unit in UNITS:
        return UNITS[unit]
    match = re.fullmatch(r"board=([0-9]+(?:\.[0-9]+)?)(?:mm)?", unit)
    length = float(match[1]) if match else 0.0
    if not 1e-3 <= length <= 1e5:
        raise CalibrationError(
            f"'{unit}' is no unit of a calibration.",
            f"Write one of {', '.join(UNITS)}, or board=MM: the mm that are 1 in the file.",
        )
    return length


def _unit(cameras: tuple[Camera, ...], named: str) -> tuple[float, str]:
    """The factor to mm, and its reason as a sentence."""
    if named:
        return mm_of(named), f"The calibration is in {named}, as the file says."
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
