"""Floor and axes from a board lying down and from clicks."""

from pathlib import Path

import msgspec
import numpy as np
import pytest
from board_footage import floor_board
from calibrated_scenes import CHARUCO, ring, seen, true_lens, waved

from studio.footage.calibration.boards import Board
from studio.footage.calibration.extrinsics import Rig, moved, solve_rig
from studio.footage.calibration.floor import (
    board_on_floor,
    clicked_floor,
    floor_from_board,
    floor_from_points,
    read_clicks,
    triangulated,
)
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import transform

CAMERAS = ring(4)
FLOOR_POINTS = np.array(
    [[-900.0, -700.0, 0.0], [1100.0, -650.0, 0.0], [1000.0, 800.0, 0.0], [-800.0, 900.0, 0.0]]
)


@pytest.fixture(scope="module")
def rig() -> Rig:
    """A solved rig in the frame of its first camera."""
    _, detections = waved(CHARUCO, CAMERAS)
    return solve_rig(CHARUCO, detections, {camera.name: true_lens(camera) for camera in CAMERAS})


def clicks_file(path: Path, world: bool, scale: float = 1.0) -> Path:
    points = []
    for point in FLOOR_POINTS:
        pixels = {camera.name: project(camera, point[None])[0][0].tolist() for camera in CAMERAS[:3]}
        points.append({"pixels": pixels, **({"world": (scale * point).tolist()} if world else {})})
    path.write_bytes(msgspec.json.encode({"points": points}))
    return path


@pytest.mark.parametrize("thickness", [0.0, 12.0])
def test_a_board_on_the_floor_sets_the_world(rig: Rig, thickness: float) -> None:
    lying = floor_board((300.0, -200.0), 0.4, thickness)
    detections = seen(CHARUCO, CAMERAS, lying[None])
    assert len(detections) >= 3
    lenses = {camera.name: true_lens(camera) for camera in CAMERAS}
    pose = board_on_floor(rig, CHARUCO, detections, lenses)
    placed = moved(rig, floor_from_board(pose, thickness))
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    for camera, solved in zip(CAMERAS, placed.cameras, strict=True):
        expected = np.append(turn.T @ (camera.centre[:2] - [300.0, -200.0]), camera.centre[2])
        np.testing.assert_allclose(solved.centre, expected, atol=15.0)
    alone = board_on_floor(rig, CHARUCO, detections[:1], lenses)
    np.testing.assert_allclose(alone[:, 3], pose[:, 3], atol=40.0)


def test_clicked_points_without_places_give_a_level_floor(rig: Rig, tmp_path: Path) -> None:
    clicks = read_clicks(clicks_file(tmp_path / "floor.json", world=False))
    placed = moved(rig, clicked_floor(clicks, rig.cameras).new_from_old)
    heights = [camera.centre[2] for camera in placed.cameras]
    np.testing.assert_allclose(heights, [camera.centre[2] for camera in CAMERAS], atol=10.0)
    pixels = {camera.name: project(camera, FLOOR_POINTS)[0] for camera in CAMERAS}
    points = triangulated(placed.cameras, pixels)
    np.testing.assert_allclose(points[:, 2], 0.0, atol=4.0)
    np.testing.assert_allclose(points[0], 0.0, atol=4.0)
    assert points[1, 0] == pytest.approx(np.linalg.norm(FLOOR_POINTS[1] - FLOOR_POINTS[0]), abs=10.0)
    assert abs(points[1, 1]) < 0.2


def test_clicked_points_with_places_give_their_world(rig: Rig, tmp_path: Path) -> None:
    clicks = read_clicks(clicks_file(tmp_path / "floor.json", world=True))
    placed = moved(rig, clicked_floor(clicks, rig.cameras).new_from_old)
    for camera, solved in zip(CAMERAS, placed.cameras, strict=True):
        np.testing.assert_allclose(solved.centre, camera.centre, atol=15.0)


def test_clicks_that_contradict_the_boards_scale_are_refused(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"0\.8\d+ times as far apart"):
        clicked_floor(read_clicks(clicks_file(tmp_path / "floor.json", world=True, scale=1.2)), rig.cameras)


def test_clicks_that_cannot_be_used(rig: Rig, tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"points": [{"pixel": {}}]}')
    with pytest.raises(CalibrationError, match="is not a list of clicked points"):
        read_clicks(tmp_path / "bad.json")
    with pytest.raises(CalibrationError, match="is no camera"):
        triangulated(CAMERAS, {"cam9": np.zeros((3, 2))})
    with pytest.raises(CalibrationError, match="Point 1 is given in fewer than two"):
        triangulated(CAMERAS, {"cam1": np.zeros((3, 2))})
    with pytest.raises(CalibrationError, match=r"'cam1' lies more than 1e\+06 pixels outside"):
        triangulated(CAMERAS, {"cam1": np.array([[1e308, 2.0]]), "cam2": np.zeros((1, 2))})
    with pytest.raises(CalibrationError, match="on a line"):
        floor_from_points(np.array([[0.0, 0, 0], [100, 0, 0], [300, 0, 0]]), CAMERAS)


def test_no_camera_sees_the_floor_board(rig: Rig) -> None:
    with pytest.raises(CalibrationError, match="No camera sees the board on the floor"):
        board_on_floor(rig, CHARUCO, [], {})


def test_a_symmetric_board_lies_the_same_way_for_all() -> None:
    board = Board("chessboard", 7, 5, 90.0)
    _, detections = waved(board, CAMERAS)
    lenses = {camera.name: true_lens(camera) for camera in CAMERAS}
    solved = solve_rig(board, detections, lenses)
    pose = board_on_floor(solved, board, seen(board, CAMERAS, floor_board()[None]), lenses)
    heights = [camera.centre[2] for camera in moved(solved, floor_from_board(pose)).cameras]
    np.testing.assert_allclose(heights, [camera.centre[2] for camera in CAMERAS], atol=15.0)
    corner = transform(pose, board.points).mean(axis=0)
    assert np.isfinite(corner).all()
