"""Calibrates cameras from board footage: a session's, or those of a folder that is no session yet."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from studio.footage.calibration.board_footage_reading import HowTaken, find_board_footage
from studio.footage.calibration.boards import Board
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.report import calibration_source, write_calibrated
from studio.footage.calibration.verbs import Calibrated, calibrate
from studio.foundations.errors import CalibrationError, NotFoundError
from studio.foundations.progress import Progress
from studio.sessions.calibration_changes import NewCalibration, fit_to_session, replace_calibration
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.workspace import Workspace

REFUSED_NAME = "refused.toml"


@dataclass(frozen=True, slots=True)
class BoardPlace:
    """A session or folder to calibrate. folder : the session's, or that of the board footage. session : None for a
    folder.
    """

    folder: Path
    session: Session | None = None

    def target(self, wanted: Path | None = None, *, replace: bool = False) -> Path:
        """The file to write, `calibration/cameras.toml` unless wanted elsewhere.

        Raises CalibrationError where one is that must not be replaced.
        """
        place = wanted or self.folder / CAMERAS_PATH
        if place.exists() and not replace:
            raise CalibrationError(f"'{place}' is there already.", "Name another file, or replace it.")
        return place


@dataclass(frozen=True, slots=True)
class KeptBoards:
    """The result of a calibration. files : the calibration unless a finding blocks it, its report, coverage pictures.
    notes : consequences for the session. stops : the findings that blocked writing the calibration.
    """

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()
    stops: tuple[Finding, ...] = ()

    def check(self) -> None:
        """Raise CalibrationError where a finding stopped it."""
        if self.stops:
            first = self.stops[0]
            raise CalibrationError(
                f"No calibration was written: {first.message}",
                f"{first.remedy} The report is {self.files[0]}.",
            )


def place_of_boards(source: str | Path) -> BoardPlace:
    """A session by its name or folder, else a folder. Raises CalibrationError."""
    try:
        session = Workspace().resolve(source)
    except NotFoundError:
        folder = Path(source)
        if not folder.is_dir():
            raise CalibrationError(
                f"'{source}' is no session and no folder.",
                "Name a session, or the folder of the board's footage.",
            ) from None
        return BoardPlace(folder)
    return BoardPlace(session.path, session)


def footage_sizes(session: Session) -> dict[str, tuple[int, int]]:
    """Camera → width, height of a session's footage."""
    return {source.name: (source.width, source.height) for source in session.manifest.footage.cameras}


def how_taken(session: Session | None, offsets: Mapping[str, int]) -> HowTaken:
    """How board footage of a session's cameras is read. Raises CalibrationError for a camera that is not there."""
    sources = session.manifest.footage.cameras if session is not None else ()
    unknown = sorted(set(offsets) - {source.name for source in sources}) if sources else []
    if unknown:
        raise CalibrationError(
            f"There is no camera '{unknown[0][:64]}'.", "Name offsets by the footage's cameras."
        )
    sizes = footage_sizes(session) if session is not None else {}
    return HowTaken(dict(offsets), {source.name: source.turned for source in sources}, sizes)


def solve_boards(
    place: BoardPlace,
    board: Board,
    *,
    intrinsics: Path | None = None,
    extrinsics: Path | None = None,
    floor: str | None = None,
    offsets: Mapping[str, int] | None = None,
    distances_mm: Mapping[tuple[str, str], float] | None = None,
    refine_lenses: bool = False,
    progress: Progress | None = None,
) -> Calibrated:
    """`footage.calibration.verbs.calibrate` with cameras named, sized and turned as the session's footage is.

    intrinsics, extrinsics : default those of the place. offsets : of the common footage, frames by camera. Nothing is
    written. Raises CalibrationError, FootageError.
    """
    taken = how_taken(place.session, offsets or {})
    if intrinsics is None and extrinsics is None:
        intrinsics, extrinsics = find_board_footage(place.folder)
    return calibrate(
        board,
        intrinsics=intrinsics,
        extrinsics=extrinsics,
        floor=floor,
        names=tuple(taken.sizes),
        footage_sizes=taken.sizes,
        distances_mm=distances_mm,
        refine_lenses=refine_lenses,
        taken=taken,
        progress=progress,
    )


def keep_boards(place: BoardPlace, found: Calibrated, target: Path, *, anyway: bool = False) -> KeptBoards:
    """Write a calibration to a `target` of the place; a session's earlier calibration is kept.

    anyway : even if a finding blocks; without it only the report is written then.
    """
    stops = () if anyway else blocking(found.findings)
    own = place.session if target == place.folder / CAMERAS_PATH else None
    if own is not None and found.rig is not None and not stops:
        fitted = fit_to_session(own, found.rig.cameras)
        new = NewCalibration(
            fitted.cameras,
            calibration_source(found),
            crops=fitted.crops,
            matching=fitted.matching,
            calibrated=found,
        )
        change = replace_calibration(own, new)
        files = tuple(sorted(path for path in target.parent.iterdir() if path.name.startswith("cameras.")))
        return KeptBoards(files, (*fitted.warnings, *change.notes))
    if own is not None and target.exists():
        # A blocked calibration writes only its report, which must not replace that of the calibration in use.
        target = target.with_name(REFUSED_NAME)
    if target.exists() and found.rig is not None and not stops:
        target.replace(target.with_name(f"{target.stem}.before.toml"))
    return KeptBoards(write_calibrated(found, target, anyway=anyway), stops=stops)
