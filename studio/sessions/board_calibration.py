"""Calibrates cameras from board footage: a session's, or those of a folder that is no session yet."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.footage.calibration.board_footage_reading import HowTaken, find_board_footage
from studio.footage.calibration.boards import Board
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.report import calibration_source, write_calibrated
from studio.footage.calibration.verbs import Calibrated, calibrate
from studio.foundations.declaring import Terminal
from studio.foundations.errors import CalibrationError, NotFoundError
from studio.foundations.progress import Progress
from studio.sessions.calibration_changes import NewCalibration, fit_to_session, replace_calibration
from studio.sessions.session import CAMERAS_PATH, Session
from studio.sessions.workspace import Workspace

REFUSED_NAME = "refused.toml"


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """How cameras are calibrated from footage of a board."""

    intrinsics: Annotated[
        str | Path | None,
        Field(
            description="Board footage for the lenses, a video or folder each; or a calibration file that has them."
        ),
        Terminal(kind=Path),
    ] = None
    extrinsics: Annotated[
        str | Path | None,
        Field(description="Board footage of all cameras at once, in step."),
        Terminal(kind=Path),
    ] = None
    floor: Annotated[
        str | None,
        Field(
            description="frame:N with the board on the floor, a folder of pictures of that, or a .json of clicked"
            " points."
        ),
        Terminal(metavar="HOW"),
    ] = None
    thickness_mm: Annotated[
        float, Field(ge=0, le=200, description="Of the board's plate, mm."), Terminal("--thickness")
    ] = 0.0
    distances_mm: Annotated[
        Mapping[tuple[str, str], float] | None,
        Field(max_length=64, description="A measured distance between two lenses, to check the scale."),
        Terminal("--distance", "A,B=MM", kind=Mapping[str, float]),
    ] = None
    offsets: Annotated[
        Mapping[str, int] | None,
        Field(
            max_length=64,
            description="The camera's frame of the common board footage that the others' frame 0 belongs to.",
        ),
        Terminal("--offset", "CAMERA=FRAMES"),
    ] = None
    refine_lenses: Annotated[
        bool, Field(description="Let the lenses move a little in the last adjustment."), Terminal("--refine")
    ] = False


@dataclass(frozen=True, slots=True)
class BoardPlace:
    """A session or folder to calibrate. folder : of the board footage. session : None for a folder."""

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


def how_taken(session: Session | None, offsets: Mapping[str, int]) -> HowTaken:
    """How board footage of a session's cameras is read. Raises CalibrationError for a camera that is not there."""
    sources = session.manifest.footage.cameras if session is not None else ()
    unknown = sorted(set(offsets) - {source.name for source in sources}) if sources else []
    if unknown:
        raise CalibrationError(
            f"There is no camera '{unknown[0][:64]}'.", "Name offsets by the footage's cameras."
        )
    sizes = {source.name: (source.width, source.height) for source in sources}
    return HowTaken(dict(offsets), {source.name: source.turned for source in sources}, sizes)


def solve_boards(
    place: BoardPlace, board: Board, options: BoardOptions, progress: Progress | None = None
) -> Calibrated:
    """`footage.calibration.verbs.calibrate` with cameras named, sized and turned as the session's footage is, and the
    footage of the place unless the options name some. Nothing is written. Raises CalibrationError, FootageError.
    """
    taken = how_taken(place.session, options.offsets or {})
    lenses, common = (
        None if given is None else Path(given) for given in (options.intrinsics, options.extrinsics)
    )
    if lenses is None and common is None:
        lenses, common = find_board_footage(place.folder)
    return calibrate(
        board,
        intrinsics=lenses,
        extrinsics=common,
        floor=options.floor,
        names=tuple(taken.sizes),
        footage_sizes=taken.sizes,
        distances_mm=options.distances_mm,
        refine_lenses=options.refine_lenses,
        taken=taken,
        progress=progress,
    )


def keep_boards(place: BoardPlace, solved: Calibrated, target: Path, *, anyway: bool = False) -> KeptBoards:
    """Write a calibration to a `target` of the place; a session's earlier calibration is kept.

    anyway : even if a finding blocks; without it only the report is written then.
    """
    stops = () if anyway else blocking(solved.findings)
    own = place.session if target == place.folder / CAMERAS_PATH else None
    if own is not None and solved.rig is not None and not stops:
        fitted = fit_to_session(own, solved.rig.cameras)
        new = NewCalibration(
            fitted.cameras,
            calibration_source(solved),
            crops=fitted.crops,
            matching=fitted.matching,
            calibrated=solved,
        )
        change = replace_calibration(own, new)
        files = tuple(sorted(path for path in target.parent.iterdir() if path.name.startswith("cameras.")))
        return KeptBoards(files, (*fitted.warnings, *change.notes))
    if own is not None and target.exists():
        # A blocked calibration writes only its report, which must not replace that of the calibration in use.
        target = target.with_name(REFUSED_NAME)
    if target.exists() and solved.rig is not None and not stops:
        target.replace(target.with_name(f"{target.stem}.before.toml"))
    return KeptBoards(write_calibrated(solved, target, anyway=anyway), stops=stops)
