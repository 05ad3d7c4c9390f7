"""Cameras from footage of a printed board."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.calibration.boards import Board, board_from_text
from studio.calibration.findings import Finding
from studio.calibration.verbs import Calibrated
from studio.geometry.camera import Camera
from studio.notebook.opening import SessionName
from studio.notebook.progress import Told, told
from studio.sessions.board_calibration import keep_boards, place_of_boards, solve_boards
from studio.sessions.session import Session


@dataclass(frozen=True, slots=True)
class Calibration:
    """What came of it. files : the calibration, its report and the coverage pictures. notes : what it means for a
    session.
    """

    solved: Calibrated
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()

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
    replace : over the one that is there, which is kept. anyway : even if a check says that it is wrong.
    Raises CalibrationError where something blocks: nothing but the report is written then.
    """
    pattern = board_from_text(board, thickness_mm) if isinstance(board, str) else board
    place = place_of_boards(source.path if isinstance(source, Session) else source)
    target = place.target(_path(to), replace=replace)
    with told(progress, "Calibrating") as report:
        found = solve_boards(
            place,
            pattern,
            intrinsics=_path(intrinsics),
            extrinsics=_path(extrinsics),
            floor=floor,
            offsets=offsets,
            distances_mm=distances_mm,
            refine_lenses=refine_lenses,
            progress=report,
        )
    kept = keep_boards(place, found, target, anyway=anyway)
    kept.check()
    return Calibration(found, kept.files, kept.notes)


def _path(given: str | Path | None) -> Path | None:
    return Path(given) if given is not None else None
