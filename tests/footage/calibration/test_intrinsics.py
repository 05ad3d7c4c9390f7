"""Lenses from boards: against the truth, with outliers, and with too little."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest
from board_footage import BoardRenderer, close_boards
from calibrated_scenes import CHARUCO, SIZE, ring

from studio.footage.calibration.boards import Board, Detection, board_from_text
from studio.footage.calibration.coverage import coverage_of, coverage_picture
from studio.footage.calibration.detection import BoardFinder
from studio.footage.calibration.findings import blocking
from studio.footage.calibration.intrinsics import solve_lens
from studio.footage.calibration.lens_verdict import lens_findings, verdict
from studio.footage.capture.pictures import list_pictures, read_picture
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import rigid, transform
from studio.results.drawing_footage.cameras import placed_camera

CAMERA = ring(1)[0]


def sightings_of(
    camera: Camera, poses: np.ndarray, board: Board = CHARUCO, noise: float = 0.1
) -> list[Detection]:
    rng = np.random.default_rng(7)
    found = []
    for frame, pose in enumerate(poses):
        pixels, _ = project(camera, transform(pose, board.points))
        spoilt = pixels + rng.normal(0.0, noise, pixels.shape)
        inside = np.all((spoilt > 0) & (spoilt < np.array([camera.width, camera.height]) - 1), axis=1)
        if inside.sum() >= 6:
            size = (camera.width, camera.height)
            ids = np.flatnonzero(inside)
            found.append(Detection(camera.name, frame, f"p{frame}", size, ids, spoilt[inside]))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_focal_length_within_half_a_percent(seed: int) -> None:
    poses = close_boards(np.random.default_rng(seed), CHARUCO, CAMERA, 24)
    lens = solve_lens(CHARUCO, sightings_of(CAMERA, poses))
    np.testing.assert_allclose(np.diag(lens.matrix)[:2], np.diag(CAMERA.matrix)[:2], rtol=5e-3)
    np.testing.assert_allclose(lens.matrix[:2, 2], CAMERA.matrix[:2, 2], atol=6.0)
    assert lens.rms == pytest.approx(0.1 * np.sqrt(2.0), rel=0.25)
    assert abs(lens.matrix[0, 0] - CAMERA.matrix[0, 0]) < 4.0 * lens.focal_deviation
    assert blocking(lens_findings(lens)) == ()
    assert "aspect" in lens.model


def test_the_same_pictures_give_the_same_lens_to_the_last_bit_on_any_number_of_threads() -> None:
    sightings = sightings_of(CAMERA, close_boards(np.random.default_rng(0), CHARUCO, CAMERA, 24))
    threads, found = cv2.getNumThreads(), set[bytes]()
    for asked in (1, 2, 4, 4, 4):
        cv2.setNumThreads(asked)
        lens = solve_lens(CHARUCO, sightings)
        found.add(lens.matrix.tobytes() + lens.distortion.tobytes())
    cv2.setNumThreads(threads)
    assert len(found) == 1


@pytest.mark.slow
def test_a_rendered_board_gives_the_lens_within_half_a_percent() -> None:
    camera = placed_camera(
        "cam1",
        (3000.0, 0.0, 1500.0),
        (0.0, 0.0, 900.0),
        size=(960, 720),
        focal_px=800.0,
        distortion=(-0.12, 0.05, 0.0006, -0.0004, 0.0),
        principal=(484.0, 355.0),
    )
    poses = close_boards(np.random.default_rng(1), CHARUCO, camera, 18)
    renderer, finder = BoardRenderer(CHARUCO, [camera]), BoardFinder(CHARUCO)
    seen = [finder.find(renderer.picture(0, frame, pose), "cam1", frame) for frame, pose in enumerate(poses)]
    lens = solve_lens(CHARUCO, [detection for detection in seen if detection is not None])
    np.testing.assert_allclose(np.diag(lens.matrix)[:2], 800.0, rtol=5e-3)
    assert lens.rms < 0.3


def test_an_outlier_is_dropped_with_the_reason() -> None:
    poses = close_boards(np.random.default_rng(0), CHARUCO, CAMERA, 14)
    detections = sightings_of(CAMERA, poses)
    moved = detections[4].pixels.copy()
    moved[: len(moved) // 2] += 9.0
    detections[4] = dataclasses.replace(detections[4], pixels=moved)
    lens = solve_lens(CHARUCO, detections)
    dropped = [residual for residual in lens.residuals if residual.dropped]
    assert [residual.picture for residual in dropped] == [detections[4].picture]
    assert "its residual is" in dropped[0].dropped
    assert len(lens.used) == len(detections) - 1
    np.testing.assert_allclose(lens.matrix[0, 0], CAMERA.matrix[0, 0], rtol=1e-2)


def test_too_few_pictures_are_reported() -> None:
    """Five boards in the middle that all face the camera: focal length and distance cannot be separated."""
    middle = CHARUCO.points.mean(axis=0)
    ahead = [np.array([0.0, 0.0, 2500.0 + 20.0 * k]) - middle - CAMERA.translation for k in range(5)]
    facing = [rigid(CAMERA.rotation.T, CAMERA.rotation.T @ place) for place in ahead]
    lens = solve_lens(CHARUCO, sightings_of(CAMERA, np.array(facing)))
    findings = lens_findings(lens)
    codes = {finding.code for finding in findings}
    assert {"few-pictures", "coverage", "little-tilt", "uncertain-focal"} <= codes
    assert blocking(findings)
    assert all(finding.remedy for finding in findings)
    assert "centre held" in lens.model
    assert "5 of 5 pictures" in verdict(lens)


def test_too_few_pictures_and_two_sizes_are_refused() -> None:
    detections = sightings_of(CAMERA, close_boards(np.random.default_rng(0), CHARUCO, CAMERA, 4))
    with pytest.raises(CalibrationError, match="2 pictures of camera cam1"):
        solve_lens(CHARUCO, detections[:2])
    with pytest.raises(CalibrationError, match="640x480"):
        solve_lens(CHARUCO, [dataclasses.replace(detections[0], size=(640, 480)), *detections[1:]])


def test_coverage_names_the_parts_that_were_not_seen() -> None:
    rng = np.random.default_rng(0)
    pixels = rng.uniform([0, 0], [SIZE[0] / 2, SIZE[1]], (800, 2))
    detection = Detection("cam1", 0, "p", SIZE, np.arange(800), pixels)
    coverage = coverage_of([detection], SIZE)
    assert coverage.share == pytest.approx(0.5, abs=0.06)
    assert coverage.empty_parts == ("top right", "right", "bottom right")
    picture = coverage_picture(coverage, [detection])
    assert picture.shape == (360, 480, 3)
    assert picture[:, :200].mean() > picture[:, 280:].mean() + 30


@pytest.mark.slow
@pytest.mark.real_data
@pytest.mark.parametrize(
    ("camera", "focal"), [("cam01", 1681.2), ("cam02", 1673.8), ("cam03", 1681.6), ("cam04", 1675.2)]
)
def test_seven_real_pictures(real_data: Path, camera: str, focal: float) -> None:
    """Focal lengths of the Qualisys calibration within 3 % (measured: 0.6 %), and what is missing is named (show 1)."""
    board = board_from_text("chessboard:4x7,60")
    folder = real_data / "pose2sim-balance" / "calibration" / "intrinsics" / f"int_{camera}_img"
    finder = BoardFinder(board)
    seen = [
        finder.find(read_picture(path), camera, frame, path.name)
        for frame, path in enumerate(list_pictures(folder))
    ]
    found = [detection for detection in seen if detection is not None]
    assert len(found) >= 6
    lens = solve_lens(board, found)
    assert np.diag(lens.matrix)[:2] == pytest.approx([focal, focal], rel=0.03)
    assert lens.rms < 0.5
    codes = {finding.code for finding in lens_findings(lens)}
    assert "few-pictures" in codes
    assert blocking(lens_findings(lens)) == ()
