"""Cameras: solved from footage of a printed board, and turned until the silhouettes agree."""

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from studio.footage.calibration.board_pdf import PAGES, usual_board, write_board_pdf
from studio.footage.calibration.boards import Board, board_from_text
from studio.footage.calibration.findings import Finding
from studio.footage.calibration.floor import read_clicks
from studio.footage.calibration.lens_verdict import verdict
from studio.footage.calibration.report import report_of
from studio.footage.calibration.verbs import Calibrated
from studio.foundations.declaring import Target, Terminal, Web, operation, taking
from studio.foundations.errors import SettingsError, StudioError
from studio.foundations.geometry.camera import Camera
from studio.operations.opening import SessionName, keeping_in_place, open_session
from studio.operations.progress import Reporting, reporting, say
from studio.results.overlay_pictures import forget_composers
from studio.runs.setup.aligning import SessionAlignment, align_cameras
from studio.runs.setup.levelling import level_by_clicks, level_by_run, level_by_silhouettes, use_level_world
from studio.runs.setup.mask_quality import measure_masks
from studio.runs.setup.silhouette_faults import MEASURED
from studio.runs.setup.turned_cameras import (
    alignment_words,
    remember_alignment,
    turn_back,
    turn_cameras,
    turned_from,
)
from studio.sessions.board_calibration import BoardOptions, keep_boards, place_of_boards, solve_boards
from studio.sessions.calibration_changes import CalibrationChange
from studio.sessions.provenance import origin_of
from studio.sessions.session import Session

SPELLING = (
    "charuco:5x7,40,30 (squares, square mm, marker mm[, dictionary][, legacy])"
    " or chessboard:4x7,60 (inner corners)."
)
Frames = Annotated[Sequence[int], Field(max_length=64)]


@dataclass(frozen=True, slots=True)
class Calibration:
    """The result of a calibration.

    solved : lenses, cameras and findings.
    files : the calibration, its report and the coverage pictures.
    notes : what it means for a session.
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
        """What the checks say, blocking findings first."""
        return self.solved.findings

    @property
    def report(self) -> dict[str, object]:
        """The whole report as plain values (lengths in mm, angles in degrees)."""
        return report_of(self.solved)

    def in_words(self) -> list[str]:
        """Lens by lens and camera by camera, then the floor."""
        lines: list[str] = []
        for lens in self.solved.lenses.values():
            lines.append(verdict(lens))
            lines += [f"  left out {each.picture}: {each.dropped}" for each in lens.residuals if each.dropped]
        rig = self.solved.rig
        if rig is None:
            return lines
        for camera in rig.cameras:
            x, y, z = camera.centre
            lines.append(
                f"Camera {camera.name}: at ({x:.0f}, {y:.0f}, {z:.0f}) mm, residual {rig.rms[camera.name]:.2f} px"
                f" over {rig.views[camera.name]} boards."
            )
        return [*lines, f"Floor: {self.solved.floor or 'not set'}."]


@operation
@taking(BoardOptions)
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
    to: Annotated[
        str | Path | None,
        Field(
            description="File of the new calibration; default: calibration/cameras.toml in the session or folder."
        ),
        Terminal(kind=Path),
    ] = None,
    replace: Annotated[
        bool, Field(description="Replace the present calibration (it is kept)."), Terminal("--force")
    ] = False,
    anyway: Annotated[
        bool, Field(description="Write the calibration even if a check says that it is wrong.")
    ] = False,
    progress: Reporting = None,
    **options: Any,  # noqa: ANN401 - of the types that are declared
) -> Calibration:
    """Solve cameras from footage of a printed board: lenses, places, floor.

    A session or folder holds intrinsics/ and extrinsics/ (unless they are named): one video or folder of pictures a
    camera, named after the cameras. The report (JSON) and coverage pictures are written beside the calibration. The
    calibration of a session becomes the one in use. Lenses by Zhang's method (PAMI 2000) as OpenCV implements it, then
    all boards and cameras in one bundle adjustment.

    Raises CalibrationError where a check blocks: then nothing but the report is written.
    """
    wanted = BoardOptions(**options)
    pattern = board_from_text(board, wanted.thickness_mm) if isinstance(board, str) else board
    place = place_of_boards(source.path if isinstance(source, Session) else source)
    target = place.target(_path(to), replace=replace)
    with reporting(progress, "Calibrating") as report:
        solved = solve_boards(place, pattern, wanted, report)
    kept = keep_boards(place, solved, target, anyway=anyway)
    say(progress, (*kept.notes, *map(_in_words, solved.findings)))
    kept.check()
    return Calibration(solved, kept.files, kept.notes)


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
    """Make a calibration board to print, as a PDF of true size.

    Print it at 100 %, measure the bar and the squares, and glue the page on a flat, stiff plate.

    Raises CalibrationError for a board that cannot be made or does not fit the page.
    """
    if page not in PAGES:
        raise SettingsError(f"There is no page '{page}'.", f"Known: {', '.join(PAGES)}.")
    made = board_from_text(board) if board else usual_board(kind, page)
    write_board_pdf(made, Path(to), page)
    return made


@dataclass(frozen=True, slots=True)
class AlignmentLine:
    """One camera of an alignment.

    before_px, after_px : median distance by which the silhouettes miss, as the camera stands and turned; null where
        nothing shows.
    turn_degrees : by which it would be turned.
    """

    camera: str
    before_px: float
    after_px: float
    turn_degrees: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """What the silhouettes say of the cameras.

    before, after : by camera, the pixels by which the silhouettes miss (median; NaN where nothing shows), as the
        cameras were and turned.
    turns : by camera, degrees.
    needed : whether the misses matter.
    better : whether turning explains them.
    changed : whether the session uses the turned cameras now.
    words : the same as a sentence.
    notes : what the change means for masks and runs that are there.
    """

    session: Session
    alignment: SessionAlignment
    before: dict[str, float]
    after: dict[str, float]
    turns: dict[str, float]
    needed: bool
    better: bool
    changed: bool
    words: str
    notes: tuple[str, ...] = ()

    @property
    def cameras(self) -> tuple[AlignmentLine, ...]:
        """The same, one line a camera."""
        return tuple(
            AlignmentLine(name, before, self.after[name], self.turns[name])
            for name, before in self.before.items()
        )

    @property
    def frames(self) -> tuple[int, ...]:
        """The frames that were looked at."""
        return tuple(self.alignment.aligned.frames)


@operation
@keeping_in_place
def align(
    session: SessionName,
    frames: Annotated[Frames, Field(description="Frames to look at; default: sixteen, evenly spread.")] = (),
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

    For a calibration that is nearly right, such as of a camera that was touched after it. Needs masks (studio
    background) of a person who is completely in the pictures. The earlier calibration is kept; nothing is changed where
    the cameras agree. The turns minimise how far epipolar tangents of the outlines miss each other.

    Raises CalibrationError for a single camera, or for too few complete silhouettes.
    """
    opened = open_session(session)
    with reporting(progress, f"{opened.name}: cameras") as report:
        aligned = align_cameras(opened, frames, progress=report)
    remember_alignment(opened, aligned)
    words, notes = alignment_words(opened, aligned), ()
    changed = keep and aligned.needed and aligned.better
    if changed:
        change = use_turned(opened, aligned)
        opened, notes = change.session, change.notes
        say(progress, notes)
        _measure_masks_again(opened, progress)
    each = aligned.aligned
    before, after, turns = (
        dict(zip(aligned.names, map(float, values), strict=True))
        for values in (each.before, each.after, each.turns)
    )
    return Alignment(
        opened, aligned, before, after, turns, aligned.needed, aligned.better, changed, words, tuple(notes)
    )


@dataclass(frozen=True, slots=True)
class CamerasInUse:
    """The cameras that a session has.

    possible : there are several calibrated cameras, which can be compared.
    turned : they were turned from an earlier calibration, which can be restored.
    """

    session: str
    possible: bool
    turned: bool


def cameras_in_use(session: Session) -> CamerasInUse:
    """Whether a session's cameras can be compared, and whether they were turned."""
    return CamerasInUse(session.name, session.is_comparable, bool(turned_from(session)))


def use_turned(session: Session, aligned: SessionAlignment) -> CalibrationChange:
    """Let the session use the turned cameras; the earlier calibration is kept.

    Raises SessionError while a run is being tracked, CalibrationError where the calibration is no longer the one that
    was measured.
    """
    change = turn_cameras(session, aligned)
    forget_composers()
    return change


def use_unturned(session: Session) -> CalibrationChange:
    """Let the session use the calibration again from which its cameras were turned.

    Raises NotFoundError where they were not turned, SessionError while a run is being tracked.
    """
    change = turn_back(session)
    forget_composers()
    return change


@operation
@keeping_in_place
def unalign(session: SessionName, *, progress: Reporting = None) -> Session:
    """Restore the calibration from which a session's cameras were turned.

    Raises NotFoundError where they were not turned.
    """
    change = use_unturned(open_session(session))
    say(progress, change.notes)
    _measure_masks_again(change.session, progress)
    return change.session


@dataclass(frozen=True, slots=True)
class Levelled:
    """A session whose world was levelled.

    tilted : degrees that the world was off the vertical.
    lowered : mm that its origin lay above the floor.
    how : by what it was measured.
    changed : whether the session uses the levelled world now.
    notes : what the change means for masks and runs that are there.
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
        Field(max_length=100, description="A run of the session whose feet show the floor."),
        Terminal(metavar="RUN"),
    ] = "",
    keep: Annotated[
        bool, Field(description="Let the session use the levelled world."), Terminal("--keep/--dry-run")
    ] = True,
    progress: Reporting = None,
) -> Levelled:
    """Turn a session's world to the vertical, and put z = 0 on the floor.

    For calibrations whose world is a camera's frame (aniposelib, FreeMoCap) or a guess. Measured by clicked points of
    the floor, by a run's feet, or by the silhouettes (off by some centimetres); the last two take the vertical from the
    cameras, which are assumed to stand level. The earlier calibration is kept.

    Raises CalibrationError where nothing shows the vertical or the floor.
    """
    opened = open_session(session)
    if clicks is not None:
        levelled = level_by_clicks(opened, read_clicks(Path(clicks)))
    elif run:
        levelled = level_by_run(opened, opened.run(run))
    else:
        with reporting(progress, f"{opened.name}: floor") as report:
            levelled = level_by_silhouettes(opened, progress=report)
    if not keep:
        return Levelled(opened, levelled.tilted, levelled.lowered, levelled.how, changed=False)
    change = use_level_world(opened, levelled)
    say(progress, change.notes)
    _measure_masks_again(change.session, progress)
    return Levelled(
        change.session, levelled.tilted, levelled.lowered, levelled.how, changed=True, notes=change.notes
    )


def _measure_masks_again(session: Session, progress: Reporting) -> None:
    """Measure how far the masks agree with the cameras of now, if it had been measured with those before."""
    if origin_of(session, MEASURED) is None:
        return
    # Cameras that were turned stay so, whatever the masks say.
    with contextlib.suppress(StudioError), reporting(progress, f"{session.name}: masks") as report:
        measure_masks(session, progress=report)


def _path(given: str | Path | None) -> Path | None:
    return Path(given) if given is not None else None


def _in_words(finding: Finding) -> str:
    return f"{'WRONG' if finding.severity == 'blocks' else 'Warning'} ({finding.code}): {finding}"
