"""Cameras from footage of a printed board."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.calibration.board_folders import find_board_footage
from studio.calibration.board_footage_reading import HowTaken
from studio.calibration.boards import Board, board_from_text
from studio.calibration.findings import Finding, blocking
from studio.calibration.report import write_calibrated
from studio.calibration.verbs import Calibrated
from studio.calibration.verbs import calibrate as solve
from studio.errors import CalibrationError, NotFoundError
from studio.geometry.camera import Camera
from studio.notebook.opening import SessionName, open_session
from studio.notebook.progress import Told, told
from studio.sessions.session import CAMERAS_PATH, Session


@dataclass(frozen=True, slots=True)
class Calibration:
    """What came of it, and where it lies. files : the calibration, its report and the coverage pictures."""

    solved: Calibrated
    files: tuple[Path, ...]

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The placed cameras; none where only lenses were solved."""
        return self.solved.rig.cameras if self.solved.rig is not None else ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What the checks say, what blocks first."""
        return self.solved.findings


def calibrate(
    source: SessionName,
    board: Board | str,
    *,
    intrinsics: str | Path | None = None,
    extrinsics: str | Path | None = None,
    floor: str | None = None,
    offsets: Mapping[str, int] | None = None,
    thickness_mm: float = 0.0,
    distances_mm: Mapping[tuple[str, str], float] | None = None,
    refine_lenses: bool = False,
    to: str | Path | None = None,
    replace: bool = False,
    anyway: bool = False,
    progress: Told = None,
) -> Calibration:
    """Solve the cameras of a session, or of a folder with intrinsics/ and extrinsics/, and write the calibration.

    board : "charuco:5x7,40,30" or "chessboard:4x7,60". floor : "frame:N", a folder of pictures, a .json of clicks.
    offsets : by camera, the frame of its board footage that is moment 0; it is turned as the session's footage is.
    distances_mm : measured between two lenses, to check the scale. to : the file; default calibration/cameras.toml.
    replace : over the one that is there (kept as *.before.toml). anyway : even if a check says that it is wrong.
    Raises CalibrationError where something blocks: nothing but the report is written then.
    """
    pattern = board_from_text(board, thickness_mm) if isinstance(board, str) else board
    folder, session = folder_of(source)
    lenses, rig = _path(intrinsics), _path(extrinsics)
    if lenses is None and rig is None:
        lenses, rig = find_board_footage(folder)
    target = _path(to) or folder / CAMERAS_PATH
    if target.exists() and not replace:
        raise CalibrationError(f"'{target}' is there already.", "Name another file, or ask to replace it.")
    cameras = session.manifest.footage.cameras if session is not None else ()
    with told(progress, "Calibrating") as report:
        found = solve(
            pattern,
            intrinsics=lenses,
            extrinsics=rig,
            floor=floor,
            names=tuple(entry.name for entry in cameras),
            footage_sizes={entry.name: (entry.width, entry.height) for entry in cameras},
            distances_mm=distances_mm,
            refine_lenses=refine_lenses,
            taken=HowTaken(
                dict(offsets or {}),
                {entry.name: entry.turned for entry in cameras},
                {entry.name: (entry.width, entry.height) for entry in cameras},
            ),
            progress=report,
        )
    return _written(found, target, anyway)


def folder_of(source: SessionName) -> tuple[Path, Session | None]:
    """The folder, and the session in it if it is one. Raises CalibrationError."""
    try:
        session = open_session(source)
    except NotFoundError:
        folder = Path(str(source))
        if not folder.is_dir():
            raise CalibrationError(
                f"'{source}' is no session and no folder.",
                "Name a session, or the folder of the board's footage.",
            ) from None
        return folder, None
    return session.path, session


def _written(found: Calibrated, target: Path, anyway: bool) -> Calibration:
    stops = () if anyway else blocking(found.findings)
    if target.exists() and found.rig is not None and not stops:
        target.replace(target.with_name(f"{target.stem}.before.toml"))
    files = write_calibrated(found, target, anyway=anyway)
    if stops:
        raise CalibrationError(
            f"No calibration was written: {stops[0].message}", f"{stops[0].remedy} The report is {files[0]}."
        )
    return Calibration(found, files)


def _path(given: str | Path | None) -> Path | None:
    return Path(given) if given is not None else None
