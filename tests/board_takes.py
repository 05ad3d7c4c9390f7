"""Small board footage of two cameras with known truth, as folders of pictures; in the last common ones the board lies
on the floor.
"""

from pathlib import Path

import cv2
import numpy as np
from board_footage import BoardRenderer, close_boards, floor_board, waved_boards

from studio.footage.calibration.boards import Board
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.cameras import placed_camera
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

BOARD = Board("charuco", 6, 5, 120.0, 90.0, "DICT_4X4_50")
PLACES = ((2600.0, -900.0, 1500.0), (2600.0, 900.0, 1900.0))


def two_cameras(size: tuple[int, int], focal_px: tuple[float, float]) -> tuple[Camera, ...]:
    """Beside one another, with distorted pictures."""
    return tuple(
        placed_camera(
            f"cam{number + 1}",
            place,
            (0.0, 0.0, 700.0),
            size=size,
            focal_px=focal_px[number],
            distortion=(-0.1, 0.03, 0.0005, -0.0003, 0.0),
        )
        for number, place in enumerate(PLACES)
    )


SIZE = (640, 480)
CAMERAS = two_cameras(SIZE, (560.0, 572.0))
COMMON, LENS_PICTURES = 10, 11
FLOOR_FRAME = COMMON
FLOOR_PLACE = (-250.0, 200.0)


def render_takes(
    folder: Path,
    cameras: tuple[Camera, ...] = CAMERAS,
    common_count: int = COMMON,
    lens_count: int = LENS_PICTURES,
) -> Path:
    """Write intrinsics/ and extrinsics/ into `folder`, a folder of pictures a camera.

    common_count : boards seen by all, after which one lies on the floor. lens_count : boards for each lens.
    """
    rng = np.random.default_rng(4)
    renderer = BoardRenderer(BOARD, cameras)
    common = [*waved_boards(rng, BOARD, cameras, common_count, reach=450.0), floor_board(FLOOR_PLACE)]
    for number, camera in enumerate(cameras):
        lens = close_boards(rng, BOARD, camera, lens_count)
        for place, poses in (("intrinsics", lens), ("extrinsics", common)):
            pictures = folder / place / f"{place[:3]}_{camera.name}_img"
            pictures.mkdir(parents=True)
            for frame, pose in enumerate(poses):
                cv2.imwrite(str(pictures / f"{frame:03d}.png"), renderer.picture(number, frame, pose))
    return folder


def session_of_takes(place: Path, folder: Path) -> Session:
    """A session without a calibration, whose footage are the common pictures where they lie."""
    sources = tuple(
        CameraSource(
            camera.name, "pictures", str(folder / "extrinsics" / f"ext_{camera.name}_img"), *SIZE, COMMON + 1
        )
        for camera in CAMERAS
    )
    place.mkdir(parents=True)
    manifest = SessionManifest(
        name=place.name,
        title="Board",
        created=now(),
        body="human31",
        footage=FootageSource(30.0, COMMON + 1, sources),
    )
    write_manifest(place, manifest)
    return Session(place)
