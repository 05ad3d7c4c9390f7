"""Corners found in rendered pictures against where they truly are."""

import numpy as np
import pytest
from board_footage import BoardRenderer, Footage, close_boards

from studio.footage.calibration.boards import Board
from studio.footage.calibration.detection import BoardFinder, on_a_plane, sharpness
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import transform
from studio.results.drawing_footage.cameras import placed_camera

CAMERA = placed_camera(
    "cam1",
    (3000.0, 0.0, 1500.0),
    (0.0, 0.0, 900.0),
    size=(640, 480),
    focal_px=560.0,
    distortion=(-0.15, 0.05, 0.0006, -0.0004, 0.0),
)
BOARDS = [
    Board("charuco", 6, 5, 60.0, 45.0),
    Board("charuco", 6, 8, 50.0, 38.0, legacy=True),
    Board("chessboard", 6, 5, 60.0),
    Board("chessboard", 6, 4, 60.0),
]


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.text)
def test_corners_to_a_fraction_of_a_pixel(board: Board) -> None:
    poses = close_boards(np.random.default_rng(2), board, CAMERA, 5)
    renderer, finder = BoardRenderer(board, [CAMERA]), BoardFinder(board)
    found = 0
    for frame, pose in enumerate(poses):
        detection = finder.find(renderer.picture(0, frame, pose), "cam1", frame)
        if detection is None:
            continue
        found += 1
        truth, _ = project(CAMERA, transform(pose, board.points))
        ends = (detection.ids, len(truth) - 1 - detection.ids) if board.turn_symmetric else (detection.ids,)
        misses = [np.linalg.norm(truth[ids] - detection.pixels, axis=1) for ids in ends]
        assert min(np.sqrt(np.mean(miss**2)) for miss in misses) < 0.25
        nearest = misses[int(np.argmin([np.mean(miss) for miss in misses]))]
        assert np.median(nearest) < 0.2
        assert detection.size == (640, 480)
    assert found >= 4


def test_the_first_corner_is_identified_by_its_colour_however_the_board_is_turned() -> None:
    board = BOARDS[2]
    pose = close_boards(np.random.default_rng(0), board, CAMERA, 5)[4]
    picture = BoardRenderer(board, [CAMERA]).picture(0, 0, pose)
    finder = BoardFinder(board)
    upright, over = (
        finder.find(picture, "c", 0),
        finder.find(np.ascontiguousarray(picture[::-1, ::-1]), "c", 0),
    )
    np.testing.assert_allclose(over.pixels, np.array([639.0, 479.0]) - upright.pixels, atol=0.3)


def test_a_mirrored_charuco_board_is_found_and_reported_as_mirrored() -> None:
    board = BOARDS[0]
    pose = close_boards(np.random.default_rng(0), board, CAMERA, 5)[4]
    picture = BoardRenderer(board, [CAMERA]).picture(0, 0, pose)
    mirrored = BoardFinder(board).find(np.ascontiguousarray(picture[:, ::-1]), "c", 0)
    assert mirrored.mirrored
    straight = BoardFinder(board).find(picture, "c", 0)
    assert not straight.mirrored
    assert BoardFinder(board, mirrored_too=False).find(np.ascontiguousarray(picture[:, ::-1]), "c", 0) is None


def test_nothing_is_found_where_nothing_is() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    for board in BOARDS:
        assert BoardFinder(board, thorough=False).find(noise, "c", 0) is None


def test_a_wrong_row_of_corners_is_no_plane() -> None:
    board = BOARDS[2]
    pose = close_boards(np.random.default_rng(0), board, CAMERA, 1)[0]
    pixels, _ = project(CAMERA, transform(pose, board.points))
    assert on_a_plane(board, pixels)
    wrong = pixels.copy()
    wrong[-6:] += 0.9 * (wrong[-6:] - wrong[-12:-6]) + 8.0
    assert not on_a_plane(board, wrong)


def test_blur_is_less_sharp() -> None:
    board = BOARDS[0]
    pose = close_boards(np.random.default_rng(0), board, CAMERA, 5)[4]
    values = []
    for blur in (0.4, 0.9):
        picture = BoardRenderer(board, [CAMERA], Footage(blur=blur)).picture(0, 0, pose)
        detection = BoardFinder(board).find(picture, "c", 0)
        assert detection is not None
        values.append(sharpness(picture, detection))
    assert values[0] > 1.1 * values[1]
