"""The common form of all calibration formats, and the conditions for a valid camera.

A lens is checked apart from the camera's place, because some files hold lenses only.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import distorted

DISTORTION_NUMBERS = (4, 5)
FOCAL_SHARES = (0.1, 100.0)
"""Focal lengths as shares of the longer side: 160 degrees at the one end, half a degree at the other."""
WIDEST_PIXEL = 2.0
LARGEST_CENTRE = 100_000.0
CENTRE_SHARES = (-0.5, 1.5)
RADIAL_FACTORS = (0.2, 5.0)
LARGEST_TANGENTIAL = 0.5
"""Distortion may move what lies at the picture's border by these factors of its distance from the centre."""


@dataclass(frozen=True, slots=True)
class AssumedCrop:
    """How footage is taken to have been made from the calibrated picture.

    calibrated : (width, height) that the calibration was made for. scale : what the whole picture was scaled
    by first. left, top, right, bottom : pixels then cut off, negative where black bars were added.
    """

    left: float
    top: float
    right: float
    bottom: float
    calibrated: tuple[int, int]
    scale: float = 1.0

    def words(self, camera: str) -> str:
        """The assumption as a sentence."""
        sides = {"left": self.left, "right": self.right, "top": self.top, "bottom": self.bottom}
        cut = [f"{pixels:g} px at the {side}" for side, pixels in sides.items() if pixels > 0.0]
        added = [f"{-pixels:.3g} px at the {side}" for side, pixels in sides.items() if pixels < 0.0]
        what = [
            *([f"a centred crop cut off {' and '.join(cut)}"] if cut else []),
            *([f"{' and '.join(added)} were added around it"] if added else []),
        ]
        size = f"{self.calibrated[0]}x{self.calibrated[1]}"
        if self.scale != 1.0:
            return (
                f"Camera {camera}: assumed crop: none (0 px), as the footage has black bars: the whole {size}"
                f" picture was scaled by {self.scale:.4f} and {'; '.join(what)}."
            )
        return (
            f"Camera {camera}: assumed crop: of the calibrated {size} picture {'; '.join(what)};"
            f" the principal point is moved by ({0.0 - self.left:g}, {0.0 - self.top:g}) px."
        )


@dataclass(frozen=True, slots=True, eq=False)
class Intrinsics:
    """A camera's lens without its place. width, height : pixels; matrix : (3, 3); distortion : (5,) k1 k2 p1 p2 k3."""

    name: str
    width: int
    height: int
    matrix: Array
    distortion: Array

    def placed(self, rotation: Array, translation: Array, quarter_turns: int = 0) -> Camera:
        """The camera at a place. rotation, translation : camera_from_world, (3, 3) and (3,)."""
        return Camera(
            self.name,
            self.width,
            self.height,
            self.matrix,
            self.distortion,
            rotation,
            translation,
            quarter_turns,
        )


@dataclass(frozen=True, slots=True, eq=False)
class FoundCameras:
    """The content of a file or folder: cameras with translations in the file's own unit.

    unit : "mm" or "m" where the format or the file says so, else "".
    sources : the files that were read.
    unposed : cameras that the file gives no place in the world.
    sizes_known : False where picture sizes are stand-ins.
    notes : what was assumed or left out, sentences.
    """

    cameras: tuple[Camera, ...]
    unit: str
    sources: tuple[Path, ...]
    unposed: tuple[Intrinsics, ...] = ()
    sizes_known: bool = True
    crops: dict[str, AssumedCrop] = field(default_factory=dict[str, AssumedCrop])
    notes: tuple[str, ...] = ()


def checked_intrinsics(
    where: str, name: str, size: tuple[float, float] | None, matrix: Array, distortion: Array
) -> Intrinsics:
    """A lens whose numbers a camera can have.

    where : names file and camera in messages. size : (width, height), None where the format has none: twice
    the principal point then stands in. distortion : (4 or 5,), further ones must be 0. Raises CalibrationError.
    """
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise CalibrationError(f"{where}: matrix is not 3x3 finite numbers.", "Export the calibration again.")
    if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or matrix[1, 0] != 0 or matrix[2].tolist() != [0.0, 0.0, 1.0]:
        raise CalibrationError(
            f"{where}: matrix is no intrinsic matrix.", "It is [[fx, s, cx], [0, fy, cy], [0, 0, 1]]."
        )
    coefficients = five_distortions(where, distortion)
    if size is None:
        if np.abs(matrix[:2, 2]).max() > LARGEST_CENTRE:
            raise CalibrationError(
                f"{where}: the principal point ({matrix[0, 2]:.4g}, {matrix[1, 2]:.4g}) is no camera's.",
                "It is in pixels: calibrate or export again.",
            )
        width, height = (max(1, round(2.0 * float(matrix[axis, 2]))) for axis in (0, 1))
    else:
        if min(size) < 1 or size[0] != round(size[0]) or size[1] != round(size[1]):
            raise CalibrationError(f"{where}: size {list(size)} is no picture size.", "Give [width, height].")
        width, height = round(size[0]), round(size[1])
        _check_focal(where, width, height, matrix)
        _check_distortion(where, width, height, matrix, coefficients)
    return Intrinsics(name, width, height, matrix, coefficients)


def five_distortions(where: str, values: Array) -> Array:
    """(5,) k1 k2 p1 p2 k3; four numbers mean k3 = 0, further ones must be zero. Raises CalibrationError."""
    flat = values.ravel() if values.ndim == 2 and 1 in values.shape else np.atleast_1d(values)
    if flat.ndim != 1 or len(flat) < DISTORTION_NUMBERS[0] or np.any(flat[5:] != 0.0):
        raise CalibrationError(
            f"{where}: distortions has {flat.size} numbers, the model has k1, k2, p1, p2 and k3.",
            "Calibrate with four or five distortion coefficients.",
        )
    if not np.all(np.isfinite(flat)):
        raise CalibrationError(
            f"{where}: 'distortions' holds a number that is not finite.", "Calibrate again."
        )
    return np.concatenate([flat[:5], np.zeros(max(0, 5 - len(flat)))]).astype(np.float64)


def _check_focal(where: str, width: int, height: int, matrix: Array) -> None:
    """Raises CalibrationError for focal lengths and centres that no camera has."""
    fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    share = np.array([fx, fy]) / max(width, height)
    if share.min() < FOCAL_SHARES[0] or share.max() > FOCAL_SHARES[1] or max(fx / fy, fy / fx) > WIDEST_PIXEL:
        raise CalibrationError(
            f"{where}: focal lengths of {fx:.4g} and {fy:.4g} px are no camera's at {width}x{height} px.",
            "Check that they are in pixels and belong to this picture size, or calibrate again.",
        )
    low, high = CENTRE_SHARES
    if not (low < cx / width < high and low < cy / height < high):
        raise CalibrationError(
            f"{where}: the principal point ({cx:.4g}, {cy:.4g}) lies far outside {width}x{height} px.",
            "Check that the calibration belongs to this picture size, or calibrate again.",
        )


def _check_distortion(where: str, width: int, height: int, matrix: Array, distortion: Array) -> None:
    """Raises CalibrationError for a distortion that folds or tears the picture's border."""
    xs, ys = (np.array([0.0, 0.5, 1.0]) * side for side in (width, height))
    x = (np.repeat(xs, 3) - matrix[0, 2]) / matrix[0, 0]
    y = (np.tile(ys, 3) - matrix[1, 2]) / matrix[1, 1]
    xd, yd, radial = distorted(x, y, distortion)
    sideways = np.hypot(xd - x * radial, yd - y * radial)
    low, high = RADIAL_FACTORS
    if radial.min() < low or radial.max() > high or np.any(sideways > LARGEST_TANGENTIAL * np.hypot(x, y)):
        raise CalibrationError(
            f"{where}: the distortions {', '.join(f'{value:.4g}' for value in distortion)} tear the picture apart.",
            "Check their order (k1 k2 p1 p2 k3), or calibrate again.",
        )
