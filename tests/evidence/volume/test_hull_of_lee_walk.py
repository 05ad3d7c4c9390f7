"""Show 1 on real masks: the Lee walk's hull, clipped at the floor."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_pieces import chosen_voxels, piece_numbers
from studio.evidence.volume.reconstruction import reconstruct
from studio.evidence.volume.tracking_space import box_of
from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

pytestmark = pytest.mark.real_data

CORNERS = np.array([[a, b, c] for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (-0.5, 0.5)])


def frame_of(folder: Path, cameras: tuple[Camera, ...], frame: int) -> FrameEvidence:
    views = []
    for number, camera in enumerate(cameras, 1):
        picture = cv2.imread(str(folder / f"CAM{number}" / f"image{frame:04d}.bmp"))
        mask = cv2.imread(str(folder / f"FG{number}" / f"image{frame:04d}.bmp"), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        assert mask is not None
        mask = np.where(mask > 0, 255, 0).astype(np.uint8)
        views.append(ViewEvidence(camera.name, np.asarray(picture, np.uint8), mask, np.zeros_like(mask)))
    return FrameEvidence(frame, tuple(views))


def largest_region(mask: np.ndarray) -> np.ndarray:
    _, labels, sizes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    return labels == 1 + np.argmax(sizes[1:, cv2.CC_STAT_AREA])


def silhouette(hull: Hull, camera: Camera) -> np.ndarray:
    drawn = np.zeros((camera.height, camera.width), np.uint8)
    for centre, edge in zip(hull.centres, hull.edges, strict=True):
        pixels, _ = project(camera, centre + edge * CORNERS)
        outline = cv2.convexHull(pixels.astype(np.float32)).reshape(-1, 2)
        cv2.fillConvexPoly(drawn, np.round(8 * outline).astype(np.int32), (255,), shift=3)
    return drawn > 0


@pytest.mark.slow
def test_a_man_stands_on_the_floor_and_covers_his_silhouettes(real_data: Path) -> None:
    folder = real_data / "lee-walk"
    cameras = read_calibration(folder / "CALIB").cameras
    for frame in range(4):
        evidence = frame_of(folder, cameras, frame)
        hull = reconstruct(evidence, cameras, box_of(cameras))
        assert hull.centres[:, 2].min() > 0.0
        assert 1700.0 <= hull.top() <= 1800.0
        for camera, view in zip(cameras, evidence.views, strict=True):
            region = largest_region(view.mask)
            assert (region & silhouette(hull, camera)).sum() >= 0.9 * region.sum()


def test_pieces_from_clutter_are_small_and_separate(real_data: Path) -> None:
    folder = real_data / "lee-walk"
    cameras = read_calibration(folder / "CALIB").cameras
    hull = reconstruct(frame_of(folder, cameras, 0), cameras, box_of(cameras))
    _, volumes = piece_numbers(hull)
    assert volumes[1:].sum() < 0.02 * volumes[0]
    assert chosen_voxels(hull, piece_numbers(hull)[0] == 0).volume() == pytest.approx(volumes[0])
