"""Where board footage lies in the folders of neighbouring tools."""

from pathlib import Path

from studio.calibration.board_footage_reading import list_footage
from studio.errors import CalibrationError

LENS_NAMES = ("intrinsics", "intrinsic")
RIG_NAMES = ("extrinsics", "extrinsic")


def find_board_footage(folder: Path) -> tuple[Path | None, Path | None]:
    """The folders with footage for the lenses and with common footage.

    `intrinsics/` and `extrinsics/` in the folder or in its `calibration/` (Pose2Sim, Caliscope), or the folder itself
    with one recording a camera (anipose, FreeMoCap).

    Raises CalibrationError if neither is there.
    """
    if not folder.is_dir():
        raise CalibrationError(f"There is no folder '{folder}'.", "Name the folder of the board's footage.")
    for place in (folder, folder / "calibration"):
        lens = _first(place, LENS_NAMES)
        rig = _first(place, RIG_NAMES)
        if lens is not None or rig is not None:
            return lens, rig
    for place in (folder / "calibration", folder):
        if place.is_dir() and _holds_footage(place):
            return None, place
    raise CalibrationError(
        f"'{folder.name}' holds no board footage.",
        "Make folders intrinsics/ and extrinsics/ with one video or folder of pictures a camera, or name them.",
    )


def _first(place: Path, names: tuple[str, ...]) -> Path | None:
    return next((place / name for name in names if (place / name).is_dir()), None)


def _holds_footage(place: Path) -> bool:
    try:
        return bool(list_footage(place))
    except CalibrationError:
        return False
