"""Rigs, board detections and silhouettes with known truth, without rendering."""

import cv2
import numpy as np
from board_footage import waved_boards
from numpy.typing import NDArray

from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.coverage import coverage_of
from studio.footage.calibration.intrinsics import Lens
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import transform
from studio.results.drawing_footage.cameras import placed_camera

CHARUCO = Board("charuco", 7, 5, 100.0, 75.0)
CHESS = Board("chessboard", 6, 5, 90.0)
SIZE = (1280, 960)
LENS = (-0.12, 0.05, 0.0006, -0.0004, 0.0)


def ring(count: int, seed: int = 3, radius: float = 4000.0) -> tuple[Camera, ...]:
    """Cameras around the room, of unlike heights and lenses."""
    rng = np.random.default_rng(seed)
    found = []
    for number in range(count):
        angle = 2.0 * np.pi * number / count + 0.3
        place = (radius * np.cos(angle), radius * np.sin(angle), 1500.0 + 400.0 * (number % 3))
        centre = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2]) + rng.normal(0.0, 6.0, 2)
        found.append(
            placed_camera(
                f"cam{number + 1}",
                (float(place[0]), float(place[1]), place[2]),
                (0.0, 0.0, 1000.0),
                size=SIZE,
                focal_px=float(1067.0 * rng.uniform(0.95, 1.1)),
                distortion=LENS,
                roll=float(rng.normal(0.0, 0.03)),
                principal=(float(centre[0]), float(centre[1])),
            )
        )
    return tuple(found)


def seen(
    board: Board, cameras: tuple[Camera, ...], poses: Array, noise: float = 0.12, seed: int = 0
) -> list[Detection]:
    """What the cameras see of boards whose face is towards them and whole in the picture."""
    rng = np.random.default_rng(seed)
    found = []
    for frame, pose in enumerate(poses):
        world = transform(pose, board.points)
        for camera in cameras:
            pixels, depth = project(camera, world)
            towards = camera.centre - world.mean(axis=0)
            facing = float(-pose[:, 2] @ towards / np.linalg.norm(towards))
            inside = np.all((pixels > 4) & (pixels < np.array(SIZE) - 5)) and np.all(depth > 0)
            if facing < 0.35 or not inside:
                continue
            spoilt = pixels + rng.normal(0.0, noise, pixels.shape)
            ids = np.arange(len(world))
            if board.turn_symmetric and spoilt[0].sum() > spoilt[-1].sum():
                spoilt = spoilt[::-1].copy()
            found.append(Detection(camera.name, frame, f"frame {frame}", SIZE, ids, spoilt))
    return found


def waved(
    board: Board, cameras: tuple[Camera, ...], each: int = 10, seed: int = 1
) -> tuple[Array, list[Detection]]:
    """Boards waved about, `each` times the number of cameras, and what was seen."""
    poses = waved_boards(np.random.default_rng(seed), board, cameras, each * len(cameras))
    return poses, seen(board, cameras, poses)


def true_lens(camera: Camera) -> Lens:
    """The lens of a camera as if it had been solved."""
    size = (camera.width, camera.height)
    return Lens(
        camera.name, size, camera.matrix, camera.distortion, 0.1, 1.0, 1.0, "", (), coverage_of((), size)
    )


def person_masks(
    cameras: tuple[Camera, ...], frames: int = 6, seed: int = 5, reach: float = 700.0
) -> dict[int, dict[str, NDArray]]:
    """Silhouettes of a lopsided person of 1800 mm walking about, `reach` mm each way: one arm out, a leg apart."""
    rng = np.random.default_rng(seed)
    limbs = np.array(
        [
            [[0, 0, 900], [0, 0, 1450], [150, 0, 0]],
            [[0, 0, 1600], [0, 0, 1690], [110, 0, 0]],
            [[0, 0, 900], [90, -80, 40], [70, 0, 0]],
            [[0, 0, 900], [260, 200, 40], [70, 0, 0]],
            [[0, 0, 1400], [100, 550, 1250], [50, 0, 0]],
            [[0, 0, 1400], [60, -260, 900], [50, 0, 0]],
        ],
        float,
    )
    found: dict[int, dict[str, NDArray]] = {}
    for frame in range(frames):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        place = np.array([*rng.uniform(-reach, reach, 2), 0.0])
        for camera in cameras:
            mask = np.zeros((camera.height, camera.width), np.uint8)
            for start, end, (radius, _, _) in limbs:
                for share in np.linspace(0.0, 1.0, 24):
                    point = turn @ (start + share * (end - start)) + place
                    pixel, depth = project(camera, point[None])
                    wide = max(1, round(float(radius * camera.matrix[1, 1] / depth[0])))
                    cv2.circle(mask, (round(pixel[0, 0]), round(pixel[0, 1])), wide, 255, -1)
            found.setdefault(frame, {})[camera.name] = mask
    return found
