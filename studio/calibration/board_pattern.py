"""The black rectangles of a board, for printing and for synthetic footage."""

from dataclasses import dataclass

import cv2.aruco
import numpy as np

from studio.arrays import Array, Bytes
from studio.calibration.boards import Board


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
    found: list[tuple[float, float, float, float]] = []
    for row in range(cells):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], bits[row].astype(int), [0]])))
        for first, last in edges.reshape(-1, 2):
            found.append((corner[0] + first * side, corner[1] + row * side, (last - first) * side, side))
    return np.array(found)
