"""Boards to print, as PDF pages of true size."""

from dataclasses import dataclass
from pathlib import Path

import cv2.aruco
import numpy as np

from studio.footage.calibration.boards import DEFAULT_DICTIONARY, Board
from studio.foundations.arrays import Array, Bytes, runs_of
from studio.foundations.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """The black parts of a board.

    width, height : of the squares, mm, without a margin. black : (N, 4) left, top, width, height of rectangles, mm from
    the top left corner of the squares, y down.
    """

    width: float
    height: float
    black: Array


def pattern_of(board: Board) -> Pattern:
    """The squares and, on a ChArUco board, the black cells of its markers."""
    across, down = board.squares
    side = board.square_mm
    columns, rows = np.meshgrid(np.arange(across), np.arange(down))
    # A legacy ChArUco board with an even number of rows begins with a white square; all others with a black one.
    begins_white = board.legacy and down % 2 == 0
    dark = (columns + rows) % 2 == int(begins_white)
    squares = np.column_stack([columns[dark] * side, rows[dark] * side])
    parts = [np.column_stack([squares, np.full((len(squares), 2), side)])]
    if board.kind == "charuco":
        opencv = board.opencv_board()
        parts += [
            _marker(board, int(number), np.asarray(corners)[0, :2])
            for number, corners in zip(np.ravel(opencv.getIds()), opencv.getObjPoints(), strict=True)
        ]
    return Pattern(across * side, down * side, np.concatenate(parts))


def drawn(board: Board, pixels_per_mm: float, margin_mm: float = 0.0) -> Bytes:
    """(H, W) picture of the board: 0 black, 255 white, a white margin around."""
    pattern = pattern_of(board)
    shape = (pattern.height + 2 * margin_mm, pattern.width + 2 * margin_mm)
    picture = np.full([max(1, round(extent * pixels_per_mm)) for extent in shape], 255, np.uint8)
    for left, top, width, height in pattern.black:
        x0, x1 = (round((margin_mm + x) * pixels_per_mm) for x in (left, left + width))
        y0, y1 = (round((margin_mm + y) * pixels_per_mm) for y in (top, top + height))
        picture[y0:y1, x0:x1] = 0
    return picture


def _marker(board: Board, number: int, corner: Array) -> Array:
    """(K, 4) the black cells of one marker, merged along its rows; corner : its top left, mm."""
    dictionary = board.opencv_dictionary()
    cells = dictionary.markerSize + 2
    bits = cv2.aruco.generateImageMarker(dictionary, number, cells, borderBits=1) < 128
    side = board.marker_mm / cells
    rectangles: list[tuple[float, float, float, float]] = []
    for row in range(cells):
        for first, last in runs_of(bits[row]):
            rectangles.append((corner[0] + first * side, corner[1] + row * side, (last - first) * side, side))
    return np.array(rectangles)


PAGES = {"a4": (297.0, 210.0), "a3": (420.0, 297.0), "letter": (279.4, 215.9)}
"""Long and short side, mm."""
MARGIN, FOOT = 8.0, 16.0
"""mm that stay white around the board (printers do not reach the edge), and that text and check bar take below it."""
CHECK_BAR = 100.0
MARKER_SHARE = 0.75
USUAL_SQUARES = {"charuco": (7, 5), "chessboard": (10, 7)}


def usual_board(kind: str, page: str = "a4") -> Board:
    """A board that fills a page, its squares whole millimetres. Raises CalibrationError for an unknown page."""
    columns, rows = USUAL_SQUARES["charuco" if kind == "charuco" else "chessboard"]
    wide, high = _room(page, landscape=True)
    side = float(int(min(wide / columns, high / rows)))
    if kind == "charuco":
        return Board("charuco", columns, rows, side, round(MARKER_SHARE * side, 1), DEFAULT_DICTIONARY)
    return Board("chessboard", columns - 1, rows - 1, side)


def write_board_pdf(board: Board, path: Path, page: str = "a4") -> None:
    """One page with the board in true size, its measures in words, and a bar of 100 mm to check the print by.

    page : "a4", "a3" or "letter"; laid out upright or across as the board fits. Raises CalibrationError if it does not.
    """
    pattern = pattern_of(board)
    landscape = pattern.width >= pattern.height
    room = _room(page, landscape)
    if pattern.width > room[0] or pattern.height > room[1]:
        fits = min(room[0] / board.squares[0], room[1] / board.squares[1])
        raise CalibrationError(
            f"A board of {pattern.width:.0f}x{pattern.height:.0f} mm does not fit on {page.upper()} paper.",
            f"Use squares of {int(fits)} mm at most, fewer squares, or larger paper.",
        )
    from fpdf import FPDF  # noqa: PLC0415 - it loads fonts' tools, for a fifth of a second

    long, short = PAGES[page]
    width, height = (long, short) if landscape else (short, long)
    document = FPDF(orientation="landscape" if landscape else "portrait", unit="mm", format=(short, long))
    document.set_auto_page_break(False)
    document.set_title(f"Calibration board {board.text}")
    document.add_page()
    document.set_fill_color(0, 0, 0)
    left, top = (width - pattern.width) / 2.0, MARGIN + (room[1] - pattern.height) / 2.0
    for x, y, across, down in pattern.black.tolist():
        document.rect(left + x, top + y, across, down, style="F")
    foot = height - MARGIN - FOOT + 6.0
    document.rect(MARGIN, foot, CHECK_BAR, 1.2, style="F")
    document.set_font("Helvetica", size=8)
    document.text(
        MARGIN, foot + 5.0, "This bar is 100 mm long: print at 100 %, not fitted to the page, and measure it."
    )
    document.text(MARGIN, foot + 9.0, _words(board))
    path.write_bytes(bytes(document.output()))


def _words(board: Board) -> str:
    sizes = f"squares of {board.square_mm:g} mm"
    if board.kind == "chessboard":
        return f"Chessboard, {board.columns} x {board.rows} inner corners, {sizes}.  studio: {board.text}"
    return (
        f"ChArUco board, {board.columns} x {board.rows} {sizes}, markers of {board.marker_mm:g} mm, {board.dictionary}."
        f"  studio: {board.text}"
    )


def _room(page: str, landscape: bool) -> tuple[float, float]:
    """Width and height that a board may take, mm."""
    if page not in PAGES:
        raise CalibrationError(f"There is no paper '{page}' here.", f"Choose one of {', '.join(PAGES)}.")

    long, short = PAGES[page]
    width, height = (long, short) if landscape else (short, long)
    return width - 2.0 * MARGIN, height - 2.0 * MARGIN - FOOT
