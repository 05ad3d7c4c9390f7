"""Where cameras stand, against the truth, for 2 to 8 of them."""

import dataclasses

import cv2
import numpy as np
import pytest
from calibrated_scenes import CHARUCO, ring, seen, true_lens, waved

from studio.footage.calibration.board_checks import pair_findings
from studio.footage.calibration.boards import Board
from studio.footage.calibration.bundle import Bundle, Observations, predicted
from studio.footage.calibration.extrinsics import Rig, moved, solve_rig
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import best_fit, rigid, transform
from studio.foundations.geometry.rotations import vector_from_rotation
from studio.results.drawing_footage.cameras import placed_camera


def half_ring(count: int) -> tuple[Camera, ...]:
    """Two or three cameras beside each other, as such rigs stand."""
    cameras = ring(8)
    return tuple(dataclasses.replace(cameras[k], name=f"cam{k + 1}") for k in range(count))


def position_errors(rig: Rig, cameras: tuple[Camera, ...], board: Board, poses: np.ndarray) -> np.ndarray:
    """mm between solved and true camera positions, the worlds put together by the boards."""
    frames = list(rig.boards)
    solved = np.concatenate([transform(rig.boards[frame], board.points) for frame in frames])
    true = np.concatenate([transform(poses[frame], board.points) for frame in frames])
    true_from_solved = best_fit(solved, true)
    names = {camera.name: camera for camera in rig.cameras}
    centres = np.array([names[camera.name].centre for camera in cameras])
    return np.linalg.norm(
        transform(true_from_solved, centres) - np.array([camera.centre for camera in cameras]), axis=1
    )


@pytest.mark.parametrize(
    "count", [2, 3, 4, 5, 6, pytest.param(7, marks=pytest.mark.slow), pytest.param(8, marks=pytest.mark.slow)]
)
def test_positions_within_ten_millimetres_at_four_metres(count: int) -> None:
    cameras = half_ring(count) if count < 4 else ring(count)
    poses, detections = waved(CHARUCO, cameras, each=12)
    lenses = {camera.name: true_lens(camera) for camera in cameras}
    rig = solve_rig(CHARUCO, detections, lenses)
    assert len(rig.cameras) == count
    assert position_errors(rig, cameras, CHARUCO, poses).max() < 10.0
    assert max(rig.rms.values()) < 0.3
    assert pair_findings(rig) == ()


@pytest.mark.slow
def test_a_board_that_looks_alike_after_half_a_turn() -> None:
    board = Board("chessboard", 7, 5, 90.0)
    assert board.turn_symmetric
    cameras = ring(5)
    _, detections = waved(board, cameras)
    rng = np.random.default_rng(0)
    detections = [
        dataclasses.replace(detection, pixels=detection.pixels[::-1]) if rng.random() < 0.5 else detection
        for detection in detections
    ]
    rig = solve_rig(board, detections, {camera.name: true_lens(camera) for camera in cameras})
    names = {camera.name: camera for camera in rig.cameras}
    solved = np.array([names[camera.name].centre for camera in cameras])
    true = np.array([camera.centre for camera in cameras])
    assert np.linalg.norm(transform(best_fit(solved, true), solved) - true, axis=1).max() < 10.0


@pytest.mark.slow
def test_wrong_views_are_left_out() -> None:
    cameras = ring(4)
    poses, detections = waved(CHARUCO, cameras)
    spoilt = [
        dataclasses.replace(detection, pixels=detection.pixels + 25.0) if number % 13 == 0 else detection
        for number, detection in enumerate(detections)
    ]
    rig = solve_rig(CHARUCO, spoilt, {camera.name: true_lens(camera) for camera in cameras})
    assert rig.dropped >= 4
    assert position_errors(rig, cameras, CHARUCO, poses).max() < 10.0


@pytest.mark.slow
def test_refining_lenses_leads_towards_the_truth_and_never_far_from_a_good_start() -> None:
    """Boards at four metres say little of a focal length: the prior keeps the result of the close ones."""
    cameras = ring(4)
    poses, detections = waved(CHARUCO, cameras, each=14)
    lenses = {camera.name: true_lens(camera) for camera in cameras}
    matrix = lenses["cam2"].matrix * np.array([[1.006, 1.0, 1.0], [1.0, 1.006, 1.0], [1.0, 1.0, 1.0]])
    lenses["cam2"] = dataclasses.replace(lenses["cam2"], matrix=matrix)
    rig = solve_rig(CHARUCO, detections, lenses, refine_lenses=True)
    off = {
        camera.name: abs(solved.matrix[0, 0] / camera.matrix[0, 0] - 1.0)
        for camera, solved in zip(cameras, rig.cameras, strict=True)
    }
    assert off["cam2"] < 0.9 * 0.006
    assert max(off["cam1"], off["cam3"], off["cam4"]) < 2e-3
    held = solve_rig(CHARUCO, detections, lenses)
    assert rig.rms["cam2"] < held.rms["cam2"]
    assert (
        position_errors(rig, cameras, CHARUCO, poses)[1] < position_errors(held, cameras, CHARUCO, poses)[1]
    )


def test_cameras_that_share_no_view_are_named() -> None:
    cameras = ring(4)
    _, detections = waved(CHARUCO, cameras)
    apart = [
        dataclasses.replace(detection, frame=detection.frame + 10_000)
        if detection.camera in ("cam3", "cam4")
        else detection
        for detection in detections
    ]
    with pytest.raises(
        CalibrationError, match="Camera cam3, cam4 saw the board in no frame together with camera cam1"
    ):
        solve_rig(CHARUCO, apart, {camera.name: true_lens(camera) for camera in cameras})


@pytest.mark.slow
def test_unsynchronised_footage_is_reported() -> None:
    cameras = ring(4)
    _, detections = waved(CHARUCO, cameras, each=14)
    late = [
        dataclasses.replace(detection, frame=detection.frame + 4) if detection.camera == "cam2" else detection
        for detection in detections
    ]
    lenses = {camera.name: true_lens(camera) for camera in cameras}
    with pytest.raises(CalibrationError, match="cam2") as refused:
        solve_rig(CHARUCO, late, lenses)
    assert "in step" in refused.value.hint


def test_the_bundles_own_projection_is_the_studios() -> None:
    camera = placed_camera(
        "c",
        (3000.0, 900.0, 1500.0),
        (0.0, 0.0, 900.0),
        size=(640, 480),
        focal_px=560.0,
        distortion=(-0.2, 0.1, 1e-3, 2e-3, 0.01),
    )
    pose = np.concatenate([vector_from_rotation(camera.rotation), camera.translation])
    board = np.array([0.3, -0.2, 0.9, 40.0, 80.0, 900.0])
    lens = np.array([560.0, 560.0, *camera.matrix[:2, 2], *camera.distortion])
    points = CHARUCO.points
    zeros = np.zeros(len(points), np.int64)
    bundle = Bundle(pose[None], board[None], lens[None])
    mine = predicted(bundle, Observations(zeros, zeros, points, np.zeros((len(points), 2))))
    import_free = moved(
        Rig((camera,), {0: rigid(np.eye(3), np.zeros(3))}, {}, {}), rigid(np.eye(3), np.zeros(3))
    )
    from_world = transform(rigid(_turn(board[:3]), board[3:]), points)
    np.testing.assert_allclose(mine, project(import_free.cameras[0], from_world)[0], atol=1e-8)


def _turn(vector: np.ndarray) -> np.ndarray:

    return cv2.Rodrigues(vector)[0]


def test_seen_boards_are_few_enough_to_be_real() -> None:
    """The scenes' boards are seen by the cameras they face only."""
    cameras = ring(4)
    poses, detections = waved(CHARUCO, cameras)
    assert 1.2 < len(detections) / len(poses) < 3.0
    assert seen(CHARUCO, cameras, poses[:0]) == []
