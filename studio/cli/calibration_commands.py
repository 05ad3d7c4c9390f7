"""`studio calibrate` and `studio board`."""

from pathlib import Path

import click

from studio.calibration.board_pdf import PAGES, usual_board, write_board_pdf
from studio.calibration.boards import board_from_text
from studio.calibration.findings import Finding
from studio.calibration.lens_verdict import verdict
from studio.calibration.report import report_of
from studio.calibration.verbs import Calibrated
from studio.cli.arguments import camera_numbers
from studio.cli.output import command, note, progress
from studio.errors import CalibrationError
from studio.sessions.board_calibration import keep_boards, place_of_boards, solve_boards

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
    boards = place_of_boards(source)
    measured = dict(_distance(text) for text in distances)
    target = boards.target(place, replace=force)
    with progress("Calibrating") as report:
        found = solve_boards(
            boards,
            board,
            intrinsics=intrinsics,
            extrinsics=extrinsics,
            floor=floor,
            offsets=camera_numbers(offsets, "--offset"),
            distances_mm=measured,
            refine_lenses=refine,
            progress=report,
        )
    kept = keep_boards(boards, found, target, anyway=anyway)
    for line in (*kept.notes, *map(_told, found.findings)):
        note(line)
    kept.check()
    return {
        **report_of(found),
        "written": [str(path) for path in kept.files],
        "text": _text(found, kept.files),
    }


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
