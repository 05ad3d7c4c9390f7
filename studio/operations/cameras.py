"""Cameras: solved from footage of a printed board, and turned until the silhouettes agree."""

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from studio.footage.calibration.board_pdf import PAGES, usual_board, write_board_pdf
from studio.footage.calibration.boards import Board, board_from_text
from studio.footage.calibration.findings import Finding
from studio.footage.calibration.floor import read_clicks
from studio.footage.calibration.verbs import Calibrated
from studio.foundations.declaring import Target, Terminal, Web, operation
from studio.foundations.errors import SettingsError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.runs.setup.aligning import SessionAlignment, align_cameras
from studio.runs.setup.levelling import level_by_clicks, level_by_run, level_by_silhouettes, use_level_world
from studio.runs.setup.mask_quality import measure_masks
from studio.runs.setup.silhouette_doubts import MEASURED
from studio.runs.setup.turned_cameras import alignment_words, remember_alignment, turn_back, turn_cameras
from studio.sessions.board_calibration import keep_boards, place_of_boards, solve_boards
from studio.sessions.provenance import origin_of
from studio.sessions.session import Session

SPELLING = (
    "charuco:5x7,40,30 (squares, square mm, marker mm[, dictionary][, legacy])"
    " or chessboard:4x7,60 (inner corners)."
)
Frames = Annotated[Sequence[int], Field(max_length=64)]


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


@operation
@keeping_in_place
def calibrate(
    source: Annotated[
        SessionName,
        Field(description="A session, or a folder with intrinsics/ and extrinsics/."),
        Target(""),
        Terminal(kind=str, metavar="SESSION_OR_FOLDER"),
    ],
    board: Annotated[
        Board | str,
        Field(max_length=120, description=SPELLING),
        Terminal("--board", "BOARD", kind=str),
        Web(kind=str),
    ],
    *,
    intrinsics: Annotated[
        str | Path | None,
        Field(
            description="Board footage for the lenses, a video or folder each; or a calibration file that has them."
        ),
        Terminal(kind=Path),
    ] = None,
    extrinsics: Annotated[
        str | Path | None,
        Field(description="Board footage of all cameras at once, in step."),
        Terminal(kind=Path),
    ] = None,
    floor: Annotated[
        str | None,
        Field(
            description="frame:N with the board on the floor, a folder of pictures of that, or a .json of clicked"
            " points."
        ),
        Terminal(metavar="HOW"),
    ] = None,
    thickness_mm: Annotated[
        float, Field(ge=0, le=200, description="Of the board's plate, mm."), Terminal("--thickness")
    ] = 0.0,
    distances_mm: Annotated[
        Mapping[tuple[str, str], float] | None,
        Field(max_length=64, description="A measured distance between two lenses, to check the scale."),
        Terminal("--distance", "A,B=MM", kind=Mapping[str, float]),
    ] = None,
    offsets: Annotated[
        Mapping[str, int] | None,
        Field(
            max_length=64,
            description="The camera's frame of the common board footage that the others' frame 0 belongs to.",
        ),
        Terminal("--offset", "CAMERA=FRAMES"),
    ] = None,
    refine_lenses: Annotated[
        bool, Field(description="Let the lenses move a little in the last adjustment."), Terminal("--refine")
    ] = False,
    to: Annotated[
        str | Path | None,
        Field(
            description="The calibration to write; default: calibration/cameras.toml in the session or folder."
        ),
        Terminal(kind=Path),
    ] = None,
    replace: Annotated[
        bool, Field(description="Replace the calibration that is there (it is kept)."), Terminal("--force")
    ] = False,
    anyway: Annotated[bool, Field(description="Write it even if a check says that it is wrong.")] = False,
    progress: Reporting = None,
) -> Calibration:
    """Solve cameras from footage of a printed board: lenses, places, floor.

    A session or folder holds intrinsics/ and extrinsics/ (unless they are named): one video or folder of pictures a
    camera, named after the cameras. Beside the calibration lie its report (JSON) and coverage pictures. That of a
    session becomes the session's.

    Raises CalibrationError where something blocks: nothing but the report is written then.
    """
    pattern = board_from_text(board, thickness_mm) if isinstance(board, str) else board
    place = place_of_boards(source.path if isinstance(source, Session) else source)
    target = place.target(_path(to), replace=replace)
    with reporting(progress, "Calibrating") as report:
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
    say(progress, (*kept.notes, *map(_in_words, found.findings)))
    kept.check()
    return Calibration(found, kept.files, kept.notes)


@operation
def board(
    to: Annotated[str | Path, Field(description="The file."), Terminal("--to", "FILE.pdf", kind=Path)],
    *,
    kind: Annotated[Literal["charuco", "chessboard"], Field(description="Which pattern.")] = "charuco",
    board: Annotated[
        str,
        Field(max_length=120, description=f"{SPELLING} Default: one that fills the page."),
        Terminal(metavar="BOARD"),
    ] = "",
    page: Annotated[Literal["a3", "a4", "letter"], Field(description="Of the printer.")] = "a4",
) -> Board:
    """Make a calibration board to print, as PDF of true size.

    Print at 100 %, measure the bar and the squares, glue the page on a flat, stiff plate.

    Raises CalibrationError.
    """
    if page not in PAGES:
        raise SettingsError(f"There is no page '{page}'.", f"Known: {', '.join(PAGES)}.")
    made = board_from_text(board) if board else usual_board(kind, page)
    write_board_pdf(made, Path(to), page)
    return made


@dataclass(frozen=True, slots=True)
class Alignment:
    """What the silhouettes say of the cameras, by name.

    before, after : pixels by which the silhouettes miss (median; NaN for a camera that nothing tells of), as the
    cameras were and turned. turns : degrees. needed : whether the misses matter; better : whether turning explains
    them; changed : whether the session uses the turned cameras now. notes : what that means for what is there.
    """

    session: Session
    found: SessionAlignment
    before: dict[str, float]
    after: dict[str, float]
    turns: dict[str, float]
    needed: bool
    better: bool
    changed: bool
    words: str
    notes: tuple[str, ...] = ()


@operation
@keeping_in_place
def align(
    session: SessionName,
    frames: Annotated[Frames, Field(description="To look at; default: sixteen, evenly spread.")] = (),
    *,
    keep: Annotated[
        bool,
        Field(
            description="Let the session use the turned cameras where that is needed and explains the misses."
        ),
        Terminal("--keep/--dry-run"),
    ] = True,
    progress: Reporting = None,
) -> Alignment:
    """Turn a session's cameras a little so that the silhouettes of all views agree.

    For calibrations that are nearly right: a camera that was touched after it. Needs masks (studio background) of a
    person who is whole in the pictures. The calibration before is kept; nothing is changed where the cameras agree.

    Raises CalibrationError for one camera, or too few whole silhouettes.
    """
    opened = open_session(session)
    with reporting(progress, f"{opened.name}: cameras") as report:
        found = align_cameras(opened, frames, progress=report)
    remember_alignment(opened, found)
    words, notes = alignment_words(found), ()
    changed = keep and found.needed and found.better
    if changed:
        change = turn_cameras(opened, found)
        opened, notes = change.session, change.notes
        say(progress, notes)
        _measure_masks_again(opened, progress)
    each = found.found
    before, after, turns = (
        dict(zip(found.names, map(float, values), strict=True))
        for values in (each.before, each.after, each.turns)
    )
    return Alignment(
        opened, found, before, after, turns, found.needed, found.better, changed, words, tuple(notes)
    )


@operation
@keeping_in_place
def unalign(session: SessionName, *, progress: Reporting = None) -> Session:
    """Use the calibration again that a session's cameras were turned from.

    Raises NotFoundError where they were not.
    """
    change = turn_back(open_session(session))
    say(progress, change.notes)
    _measure_masks_again(change.session, progress)
    return change.session


@dataclass(frozen=True, slots=True)
class Levelled:
    """A session's world after it was levelled. tilted : degrees that it was off the vertical. lowered : mm that its
    origin lay above the floor. how : by what. changed : whether the session uses it now. notes : what that means.
    """

    session: Session
    tilted: float
    lowered: float
    how: str
    changed: bool
    notes: tuple[str, ...] = ()


@operation
@keeping_in_place
def level(
    session: SessionName,
    *,
    clicks: Annotated[
        str | Path | None,
        Field(description="A .json of clicked floor points, as of calibrate --floor."),
        Terminal(kind=Path),
    ] = None,
    run: Annotated[
        str,
        Field(max_length=100, description="A run of the session: its feet show the floor."),
        Terminal(metavar="RUN"),
    ] = "",
    keep: Annotated[
        bool, Field(description="Let the session use the levelled world."), Terminal("--keep/--dry-run")
    ] = True,
    progress: Reporting = None,
) -> Levelled:
    """Turn a session's world to the vertical, and put z = 0 on the floor.

    For calibrations whose world is a camera's frame (aniposelib, FreeMoCap) or a guess. By clicked points of the
    floor, by a run's feet, or by the silhouettes (some centimetres off); the last two take the vertical from the
    cameras, which stand level. The calibration before is kept.

    Raises CalibrationError where nothing shows the vertical or the floor.
    """
    opened = open_session(session)
    if clicks is not None:
        found = level_by_clicks(opened, read_clicks(Path(clicks)))
    elif run:
        found = level_by_run(opened, opened.run(run))
    else:
        with reporting(progress, f"{opened.name}: floor") as report:
            found = level_by_silhouettes(opened, progress=report)
    if not keep:
        return Levelled(opened, found.tilted, found.lowered, found.how, changed=False)
    change = use_level_world(opened, found)
    say(progress, change.notes)
    _measure_masks_again(change.session, progress)
    return Levelled(change.session, found.tilted, found.lowered, found.how, changed=True, notes=change.notes)


def _measure_masks_again(session: Session, progress: Reporting) -> None:
    """Measure how far the masks agree under the cameras of now, where that was known of those before."""
    if origin_of(session, MEASURED) is None:
        return
    # Cameras that were turned stay so, whatever the masks say.
    with contextlib.suppress(StudioError), reporting(progress, f"{session.name}: masks") as report:
        measure_masks(session, progress=report)


def _path(given: str | Path | None) -> Path | None:
    return Path(given) if given is not None else None


def _in_words(finding: Finding) -> str:
    return f"{'WRONG' if finding.severity == 'blocks' else 'Warning'} ({finding.code}): {finding}"
