"""Boards as text, their corners and their pattern against OpenCV's own drawing."""

import cv2
import numpy as np
import pytest

from studio.footage.calibration.board_pdf import drawn
from studio.footage.calibration.boards import Board, board_from_text
from studio.foundations.errors import CalibrationError


@pytest.mark.parametrize(
    "text", ["charuco:5x7,40,30", "charuco:7x6,40,30,DICT_5X5_100,legacy", "chessboard:4x7,60"]
)
def test_text_and_back(text: str) -> None:
    board = board_from_text(text)
    assert board_from_text(board.text) == board


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("circles:4x5,10", "cannot be understood"),
        ("chessboard:4x7", "cannot be understood"),
        ("chessboard:4x7,wide", "no number"),
        ("chessboard:4x7,0", "Squares of 0 mm"),
        ("chessboard:5x5,30", "quarter turn"),
        ("chessboard:1x7,30", "inner corners"),
        ("charuco:5x7,40,40", "do not fit"),
        ("charuco:5x7,40,30,DICT_NONE", "no marker dictionary"),
        ("charuco:20x20,40,30,DICT_4X4_50", "too few markers"),
    ],
)
def test_boards_that_cannot_be(text: str, word: str) -> None:
    with pytest.raises(CalibrationError, match=word) as raised:
        board_from_text(text)
    assert raised.value.hint


def test_corners_are_opencvs_from_the_first_inner_one() -> None:
    board = Board("charuco", 7, 5, 60.0, 45.0)
    theirs = np.array(board.opencv_board().getChessboardCorners())
    np.testing.assert_allclose(board.points, theirs - theirs[0], atol=1e-4)
    assert board.turn_symmetric is False


@pytest.mark.parametrize(
    "board",
    [
        Board("charuco", 7, 5, 40.0, 30.0),
        Board("charuco", 6, 8, 40.0, 30.0, "DICT_4X4_50"),
        Board("charuco", 6, 8, 40.0, 30.0, "DICT_4X4_50", legacy=True),
        Board("charuco", 5, 7, 40.0, 28.0, "DICT_5X5_100", legacy=True),
    ],
)
def test_the_pattern_is_opencvs(board: Board) -> None:
    per_mm = 2
    size = (int(board.columns * board.square_mm * per_mm), int(board.rows * board.square_mm * per_mm))
    theirs = board.opencv_board().generateImage(size, marginSize=0, borderBits=1)
    np.testing.assert_array_equal(theirs > 127, drawn(board, per_mm) > 127)


def test_a_chessboards_ends_are_distinguished_only_where_colours_differ() -> None:
    for across, down in [(4, 7), (7, 5), (6, 4), (9, 6)]:
        board = Board("chessboard", across, down, 30.0)
        picture = drawn(board, 1.0)
        same = np.array_equal(picture, cv2.rotate(picture, cv2.ROTATE_180))
        assert board.turn_symmetric is same
