"""`studio calibrate` and `studio board`."""

from pathlib import Path

import click

from studio.calibration.board_folders import find_board_footage
from studio.calibration.board_footage_reading import HowTaken
from studio.calibration.board_pdf import PAGES, usual_board, write_board_pdf
from studio.calibration.boards import board_from_text
from studio.calibration.findings import Finding, blocking
from studio.calibration.lens_verdict import verdict
from studio.calibration.report import report_of, told_source, write_calibrated
from studio.calibration.verbs import Calibrated, calibrate
from studio.cli.output import command, note, progress
from studio.errors import CalibrationError, NotFoundError
from studio.sessions.calibration_changes import NewCalibration, replace_calibration
from studio.sessions.calibration_fit import fit_to_session
from studio.sessions.session import Session
from studio.sessions.workspace import Workspace

BOARD_HELP = (
    "charuco:5x7,40,30 (squares, square mm, marker mm[, dictionary]) or chessboard:4x7,60 (inner corners)."
)
FLOOR_HELP = (
    "frame:N with the board on the floor, a folder of pictures of that, or a .json of clicked points."
)
TO_HELP = "The calibration to write; default: calibration/cameras.toml in the session or folder."


@click.command("calibrate")
@click.argument("source", metavar="SESSION_OR_FOLDER")
@click.option("--board", "board_text", required=True, metavar="BOARD", help=BOARD_HELP)
@click.option(
    "--intrinsics",
    type=click.Path(path_type=Path),
    help="Board footage for the lenses, a video or folder each; or a calibration file that has them.",
)
@click.option(
    "--extrinsics", type=click.Path(path_type=Path), help="Board footage of all cameras at once, in step."
)
@click.option("--floor", metavar="HOW", help=FLOOR_HELP)
@click.option("--thickness", type=click.FloatRange(0.0), default=0.0, help="Of the board's plate, mm.")
@click.option(
    "--distance",
    "distances",
    multiple=True,
    metavar="A,B=MM",
    help="A measured distance between two lenses, to check the scale; again for more.",
)
@click.option(
    "--offset",
    "offsets",
    multiple=True,
    metavar="CAMERA=FRAMES",
    help="The camera's frame of the common board footage that the others' frame 0 belongs to; again for more.",
)
@click.option("--refine", is_flag=True, help="Let the lenses move a little in the last adjustment.")
@click.option("--to", "place", type=click.Path(path_type=Path), help=TO_HELP)
@click.option("--force", is_flag=True, help="Replace the calibration that is there (it is kept).")
@click.option("--anyway", is_flag=True, help="Write it even if a check says that it is wrong.")
@command
def calibrate_command(
    source: str,
    board_text: str,
    intrinsics: Path | None,
    extrinsics: Path | None,
    floor: str | None,
    thickness: float,
    distances: tuple[str, ...],
    offsets: tuple[str, ...],
    refine: bool,
    place: Path | None,
    force: bool,
    anyway: bool,
) -> dict[str, object]:
    """Solve cameras from footage of a printed board: lenses, places, floor.

    SESSION_OR_FOLDER holds intrinsics/ and extrinsics/ (or they are named by the options): one video or folder of
    pictures a camera, named after the cameras. Beside the calibration lie its report (JSON) and coverage pictures.
    """
    board = board_from_text(board_text, thickness)
    folder, session = _source(source)
    measured = dict(_distance(text) for text in distances)
    if intrinsics is None and extrinsics is None:
        intrinsics, extrinsics = find_board_footage(folder)
    target = place or folder / "calibration" / "cameras.toml"
    if target.exists() and not force:
        raise CalibrationError(
            f"'{target}' is there already.", "Name another file with --to, or give --force."
        )
    sources = session.manifest.footage.cameras if session is not None else ()
    with progress("Calibrating") as report:
        found = calibrate(
            board,
            intrinsics=intrinsics,
            extrinsics=extrinsics,
            floor=floor,
            names=tuple(entry.name for entry in sources),
            footage_sizes={entry.name: (entry.width, entry.height) for entry in sources},
            distances_mm=measured,
            refine_lenses=refine,
            taken=_taken(session, offsets),
            progress=report,
        )
    stops = blocking(found.findings) if not anyway else ()
    written = _kept(found, session if place is None else None, target, stops)
    for finding in found.findings:
        note(_told(finding))
    if stops:
        raise CalibrationError(
            f"No calibration was written: {stops[0].message}",
            f"{stops[0].remedy} The report is {written[0]}.",
        )
    return {**report_of(found), "written": [str(path) for path in written], "text": _text(found, written)}


@click.command("board")
@click.option("--kind", type=click.Choice(["charuco", "chessboard"]), default="charuco", show_default=True)
@click.option(
    "--board", "board_text", metavar="BOARD", help=BOARD_HELP + " Default: one that fills the page."
)
@click.option("--page", type=click.Choice(sorted(PAGES)), default="a4", show_default=True)
@click.option("--to", "place", required=True, type=click.Path(path_type=Path), metavar="FILE.pdf")
@command
def board_command(kind: str, board_text: str | None, page: str, place: Path) -> dict[str, object]:
    """Make a calibration board to print, as PDF of true size.

    Print at 100 %, measure the bar and the squares, glue the page on a flat, stiff plate.
    """
    board = board_from_text(board_text) if board_text else usual_board(kind, page)
    write_board_pdf(board, place, page)
    return {
        "board": board.spelling,
        "page": page,
        "written": str(place),
        "text": f"{place}: {board.spelling}\nCalibrate with: studio calibrate FOLDER --board {board.spelling}",
    }


def _kept(
    found: Calibrated, session: Session | None, target: Path, stops: tuple[Finding, ...]
) -> tuple[Path, ...]:
    """Write what was found, into the session as its calibration if it is one's own; returns the files."""
    if session is None or found.rig is None or stops:
        if session is not None and target.exists():
            # Only the report of what cannot be used: it must not pass for that of the calibration in use.
            target = target.with_name("refused.toml")
        if target.exists() and found.rig is not None and not stops:
            target.replace(target.with_name(f"{target.stem}.before.toml"))
        return write_calibrated(found, target, anyway=not stops)
    fitted = fit_to_session(session, found.rig.cameras)
    new = NewCalibration(
        fitted.cameras, told_source(found), crops=fitted.crops, matching=fitted.matching, calibrated=found
    )
    change = replace_calibration(session, new)
    for words in (*fitted.warnings, *change.notes):
        note(words)
    return tuple(sorted(path for path in target.parent.iterdir() if path.name.startswith("cameras.")))


def _taken(session: Session | None, offsets: tuple[str, ...]) -> HowTaken:
    """Offsets as typed, turns as the session has them. Raises CalibrationError."""
    sources = session.manifest.footage.cameras if session is not None else ()
    found: dict[str, int] = {}
    for text in offsets:
        name, _, number = text.partition("=")
        if not name or not number.lstrip("-").isdigit():
            raise CalibrationError(f"The offset '{text}' cannot be understood.", "Write cam2=3 (frames).")
        found[name] = int(number)
    return HowTaken(
        found,
        {source.name: source.turned for source in sources},
        {source.name: (source.width, source.height) for source in sources},
    )


def _source(text: str) -> tuple[Path, Session | None]:
    """The folder, and the session in it if it is one."""
    try:
        session = Workspace().resolve(text)
    except NotFoundError:
        folder = Path(text)
        if not folder.is_dir():
            raise CalibrationError(
                f"'{text}' is no session and no folder.",
                "Name a session, or the folder of the board's footage.",
            ) from None
        return folder, None
    return session.path, session


def _distance(text: str) -> tuple[tuple[str, str], float]:
    """("cam1", "cam2"), 4200.0 from "cam1,cam2=4200". Raises CalibrationError."""
    pair, _, length = text.partition("=")
    names = [name.strip() for name in pair.split(",")]
    try:
        value = float(length)
    except ValueError:
        value = 0.0
    if len(names) != 2 or value <= 0.0:
        raise CalibrationError(f"The distance '{text}' cannot be understood.", "Write cam1,cam2=4200 (mm).")
    return (names[0], names[1]), value


def _told(finding: Finding) -> str:
    return f"{'WRONG' if finding.severity == 'blocks' else 'Warning'} ({finding.code}): {finding}"


def _text(found: Calibrated, written: tuple[Path, ...]) -> str:
    lines: list[str] = []
    for lens in found.lenses.values():
        lines.append(verdict(lens))
        lines += [f"  left out {each.picture}: {each.dropped}" for each in lens.residuals if each.dropped]
    if found.rig is not None:
        for camera in found.rig.cameras:
            x, y, z = camera.centre
            lines.append(
                f"Camera {camera.name}: at ({x:.0f}, {y:.0f}, {z:.0f}) mm, residual {found.rig.rms[camera.name]:.2f} px"
                f" over {found.rig.views[camera.name]} boards."
            )
        lines.append(f"Floor: {found.floor or 'not set'}.")
    return "\n".join([*lines, *(f"Wrote {path}" for path in written)])
