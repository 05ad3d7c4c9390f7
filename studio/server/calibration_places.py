"""Where calibration files and board footage lie: in an upload, or in a folder of this machine that may be read."""

from pathlib import Path

from studio.errors import CalibrationError, NotFoundError
from studio.server.app_state import AppState
from studio.server.calibration_schemas import FootagePlace
from studio.server.safe_paths import folder_to_import
from studio.server.upload_routes import upload_folder
from studio.sessions.archives import is_litter, unpacked, unwrapped
from studio.sessions.names import PathRefused, place_in, relative_path

PARTS = ("intrinsic*", "extrinsic*", "calib*", "cam*")


def place_of(app: AppState, request: FootagePlace) -> Path:
    """The file or folder that a client means. Raises PathRefused, NotFoundError."""
    if request.upload is not None:
        folder = unwrapped(unpacked(upload_folder(app, request.upload)), PARTS)
        return place_in(folder, relative_path(request.path)) if request.path else folder
    path = Path(request.path.strip()).expanduser()
    if path.is_absolute() and path.is_file():
        folder = folder_to_import(str(path.parent), app.footage_roots)
        place = (folder / path.name).resolve()
        if not any(place.is_relative_to(root) for root in app.footage_roots):
            raise PathRefused(
                f"'{path.name}' leads out of the folders that may be read.",
                "Copy it there instead of linking it.",
            )
        return place
    if path.is_absolute() and path.suffix and not path.exists():
        folder_to_import(str(path.parent), app.footage_roots)
        raise NotFoundError(f"There is no file '{path}'.", "Check the path.")
    return folder_to_import(request.path, app.footage_roots)


def chosen_file(place: Path, file: str, found: tuple[Path, ...]) -> Path:
    """The calibration that is meant: the place itself, the one of that name in it, or the only one.

    Raises CalibrationError where there are none or several.
    """
    if place.is_file():
        return place
    if file:
        named = place_in(place, relative_path(file))
        if not named.exists():
            raise NotFoundError(f"There is no '{file[:200]}' in '{place.name}'.", "Choose another file.")
        return named
    if len(found) == 1:
        return found[0]
    files = [path for path in place.iterdir() if path.is_file() and not is_litter(path.name)]
    if not found and len(files) == 1:
        return files[0]
    if not found:
        raise CalibrationError(
            f"'{place.name}' holds no calibration that can be read.",
            "Give a Pose2Sim, anipose, FreeMoCap or Caliscope TOML, EasyMocap's or OpenCV's YAML, or Qualisys's file.",
        )
    names = ", ".join(path.name for path in found)
    raise CalibrationError(f"'{place.name}' holds several calibrations ({names}).", "Say which one to take.")
