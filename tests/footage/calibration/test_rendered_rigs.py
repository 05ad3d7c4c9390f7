"""The whole way from rendered pictures, lenses and places, for 2 to 8 cameras at four metres (show 1)."""

import dataclasses

import numpy as np
import pytest
from board_footage import BoardRenderer, close_boards, waved_boards
from calibrated_scenes import CHARUCO, ring

from studio.footage.calibration.detection import BoardFinder
from studio.footage.calibration.extrinsics import solve_rig
from studio.footage.calibration.findings import blocking
from studio.footage.calibration.intrinsics import solve_lens
from studio.footage.calibration.lens_verdict import lens_findings
from studio.foundations.geometry.rigid import best_fit, transform


@pytest.mark.slow
@pytest.mark.timeout(1500)
@pytest.mark.parametrize("count", range(2, 9))
def test_focal_lengths_and_positions(count: int) -> None:
    cameras = ring(max(count, 8))[:count] if count < 4 else ring(count)
    cameras = tuple(dataclasses.replace(camera, name=f"cam{k + 1}") for k, camera in enumerate(cameras))
    rng = np.random.default_rng(count)
    renderer, finder = BoardRenderer(CHARUCO, cameras), BoardFinder(CHARUCO)
    lenses = {}
    for number, camera in enumerate(cameras):
        poses = close_boards(rng, CHARUCO, camera, 24)
        seen = [
            finder.find(renderer.picture(number, 1000 + frame, pose), camera.name, frame)
            for frame, pose in enumerate(poses)
        ]
        lens = solve_lens(CHARUCO, [detection for detection in seen if detection is not None])
        assert blocking(lens_findings(lens)) == ()
        np.testing.assert_allclose(np.diag(lens.matrix)[:2], np.diag(camera.matrix)[:2], rtol=5e-3)
        lenses[camera.name] = lens
    poses = waved_boards(rng, CHARUCO, cameras, 14 * count)
    detections = [
        detection
        for frame, pose in enumerate(poses)
        for number, camera in enumerate(cameras)
        if (detection := finder.find(renderer.picture(number, frame, pose), camera.name, frame)) is not None
    ]
    rig = solve_rig(CHARUCO, detections, lenses)
    frames = list(rig.boards)
    solved = np.concatenate([transform(rig.boards[frame], CHARUCO.points) for frame in frames])
    true = np.concatenate([transform(poses[frame], CHARUCO.points) for frame in frames])
    centres = np.array([camera.centre for camera in rig.cameras])
    placed = transform(best_fit(solved, true), centres)
    off = np.linalg.norm(placed - np.array([camera.centre for camera in cameras]), axis=1)
    focal = [abs(lenses[camera.name].matrix[0, 0] / camera.matrix[0, 0] - 1.0) for camera in cameras]
    print(f"{count} cameras: positions {off.max():.1f} mm, focal lengths {100 * max(focal):.2f} %")
    assert off.max() < 10.0
