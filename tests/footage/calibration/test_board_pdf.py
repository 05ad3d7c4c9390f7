"""Printable boards, read back by another PDF reader."""

from pathlib import Path

import numpy as np
import pypdfium2
import pytest

from studio.footage.calibration.board_pdf import CHECK_BAR, PAGES, usual_board, write_board_pdf
from studio.footage.calibration.boards import Board, board_from_text
from studio.footage.calibration.detection import BoardFinder
from studio.foundations.errors import CalibrationError

PER_MM = 4.0


def rasterised(path: Path) -> np.ndarray:
    """(H, W) grey levels at four pixels a millimetre."""
    with pypdfium2.PdfDocument(str(path)) as document:
        assert len(document) == 1
        picture = document[0].render(scale=PER_MM * 25.4 / 72.0, grayscale=True).to_numpy()
    return np.ascontiguousarray(picture.reshape(picture.shape[:2]))


@pytest.mark.parametrize("page", ["a4", "a3", "letter"])
@pytest.mark.parametrize("kind", ["charuco", "chessboard"])
def test_a_printed_board_has_its_true_size_and_is_found(tmp_path: Path, kind: str, page: str) -> None:
    board = usual_board(kind, page)
    write_board_pdf(board, tmp_path / "board.pdf", page)
    picture = rasterised(tmp_path / "board.pdf")
    long, short = PAGES[page]
    assert picture.shape == pytest.approx((short * PER_MM, long * PER_MM), abs=2)
    detection = BoardFinder(board).find(picture, "printer", 0)
    assert len(detection.ids) == len(board.points)
    plan = board.points[detection.ids][:, :2]
    size = np.linalg.norm(detection.pixels[-1] - detection.pixels[0]) / np.linalg.norm(plan[-1] - plan[0])
    assert size == pytest.approx(PER_MM, rel=2e-3)
    row = picture[round((short - 8.0 - 16.0 + 6.6) * PER_MM)]
    assert np.count_nonzero(row < 128) / PER_MM == pytest.approx(CHECK_BAR, abs=0.6)


def test_the_words_say_the_square_size(tmp_path: Path) -> None:
    write_board_pdf(board_from_text("chessboard:4x7,22"), tmp_path / "upright.pdf")
    with pypdfium2.PdfDocument(str(tmp_path / "upright.pdf")) as document:
        assert document[0].get_width() < document[0].get_height()
        text = document[0].get_textpage().get_text_range()
    assert "squares of 22 mm" in text
    assert "chessboard:4x7,22" in text
    assert "100 mm long" in text


def test_a_board_larger_than_the_page_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="does not fit on A4") as raised:
        write_board_pdf(Board("charuco", 7, 5, 60.0, 45.0), tmp_path / "big.pdf")
    assert "at most" in raised.value.hint
    assert not (tmp_path / "big.pdf").exists()
    with pytest.raises(CalibrationError, match="no paper"):
        write_board_pdf(Board("charuco", 7, 5, 20.0, 15.0), tmp_path / "odd.pdf", "a7")
