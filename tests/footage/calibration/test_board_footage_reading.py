"""Board footage as videos and folders: which frames are looked at, and which count."""

from pathlib import Path

import numpy as np
import pytest
from board_footage import BoardRenderer, close_boards
from calibrated_scenes import CHARUCO, ring, seen
from toy_footage import write_video

from studio.footage.calibration.board_footage_reading import (
    Seen,
    by_camera,
    chosen_for_lens,
    find_board_footage,
    frames_in_step,
    list_footage,
    look_together,
)
from studio.footage.calibration.boards import Board
from studio.footage.calibration.detection import BoardFinder
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import transform
from studio.results.drawing_footage.cameras import placed_camera

BOARD = Board("charuco", 5, 4, 90.0, 68.0, "DICT_4X4_50")


def test_videos_are_read_in_step_and_by_name(tmp_path: Path) -> None:
    camera = placed_camera("cam1", (2500.0, 0.0, 1500.0), (0.0, 0.0, 900.0), size=(480, 360), focal_px=400.0)
    poses = close_boards(np.random.default_rng(4), BOARD, camera, 6)
    renderer = BoardRenderer(BOARD, [camera])
    pictures = [renderer.picture(0, frame, pose) for frame, pose in enumerate(poses)]
    (tmp_path / "extrinsics").mkdir()
    write_video(tmp_path / "extrinsics" / "cam1.mp4", pictures)
    write_video(tmp_path / "extrinsics" / "cam2.mp4", pictures[:5])
    assert find_board_footage(tmp_path) == (None, tmp_path / "extrinsics")
    footage = by_camera(list_footage(tmp_path / "extrinsics"), ["Camera 1", "Camera 2"])
    found = look_together(BoardFinder(BOARD), footage)
    frames = {
        name: {each.detection.frame for each in found if each.detection.camera == name} for name in footage
    }
    assert frames["Camera 1"] == frames["Camera 2"] <= {0, 1, 2, 3, 4}
    assert len(frames["Camera 1"]) >= 3
    for each in found:
        truth, _ = project(camera, transform(poses[each.detection.frame], BOARD.points))
        assert np.median(np.linalg.norm(truth[each.detection.ids] - each.detection.pixels, axis=1)) < 0.6


def test_frames_are_spread_over_the_shortest_recording() -> None:
    assert frames_in_step([5, 9], 10).tolist() == [0, 1, 2, 3, 4]
    assert frames_in_step([1000, 400], 100).tolist() == list(range(0, 400, 4))


def test_lens_pictures_are_sharp_and_cover_the_view() -> None:
    camera = ring(1)[0]
    poses = close_boards(np.random.default_rng(0), CHARUCO, camera, 60)
    detections = seen(CHARUCO, (camera,), poses)
    entries = [
        Seen(detection, 0.2 if number % 5 == 0 else 1.0) for number, detection in enumerate(detections)
    ]
    chosen, blurred = chosen_for_lens(entries, most=12)
    assert blurred == len(range(0, len(detections), 5))
    assert len(chosen) == 12
    soft = {detection.frame for number, detection in enumerate(detections) if number % 5 == 0}
    assert not soft & {detection.frame for detection in chosen}
    middles = np.array([detection.pixels.mean(axis=0) for detection in chosen])
    everything = np.array([detection.pixels.mean(axis=0) for detection in detections])
    assert np.all(np.ptp(middles, axis=0) > 0.7 * np.ptp(everything, axis=0))


def test_folders_without_footage_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="holds no board footage"):
        find_board_footage(tmp_path)
    with pytest.raises(CalibrationError, match="no videos and no folders"):
        list_footage(tmp_path)
    with pytest.raises(CalibrationError, match="There is no folder"):
        find_board_footage(tmp_path / "nowhere")
