"""A session on disk whose calibration was right until one camera was nudged: masks of a wandering cloud of points,
drawn with OpenCV by the true cameras, and the calibration of before.
"""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.rotations import rotation_from_vector
from studio.results.drawing_footage.cameras import placed_camera
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, SIZE, FOCAL = 8, (640, 480), 620.0
NUDGED, DEGREES = "cam2", 1.2
PLACES = ((3600.0, 300.0), (-200.0, 3700.0), (-3500.0, -400.0), (500.0, -3600.0))


def true_cameras() -> tuple[Camera, ...]:
    """Four around the origin, 1.7 m up."""
    return tuple(
        placed_camera(f"cam{n + 1}", (x, y, 1700.0), (0.0, 0.0, 900.0), size=SIZE, focal_px=FOCAL)
        for n, (x, y) in enumerate(PLACES)
    )


def nudged(cameras: tuple[Camera, ...], degrees: float = DEGREES) -> tuple[Camera, ...]:
    """The same with one turned about its centre, right and down."""
    turn = rotation_from_vector(np.radians(degrees) * np.array([0.6, 0.8, 0.0]))
    found = []
    for camera in cameras:
        if camera.name == NUDGED:
            rotation = turn @ camera.rotation
            moved = dataclasses.replace(camera, rotation=rotation, translation=-rotation @ camera.centre)
            found.append(moved)
        else:
            found.append(camera)
    return tuple(found)


def make_nudged_session(folder: Path, degrees: float = DEGREES) -> Session:
    """Write it into `folder`, which must not exist. degrees : by which the calibration is wrong; 0 for a good one."""
    cameras = true_cameras()
    rng = np.random.default_rng(11)
    shade = rng.integers(90, 110, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    for camera in cameras:
        for part in ("pictures", "masks"):
            (folder / part / camera.name).mkdir(parents=True)
    for frame in range(FRAMES):
        points = rng.normal([0.0, 0.0, 900.0], [170.0, 170.0, 330.0], (40, 3)) + rng.normal(0.0, 120.0, 3)
        for camera in cameras:
            mask = _outline(camera, points)
            picture = np.where(mask[..., None] > 0, np.uint8(210), shade)
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:04d}.png"), picture)
            cv2.imwrite(str(folder / "masks" / camera.name / f"{frame:04d}.png"), mask)
    (folder / "calibration").mkdir()
    write_calibration(nudged(cameras, degrees), folder / "calibration" / "cameras.toml")
    sources = tuple(
        CameraSource(
            camera.name, "pictures", f"pictures/{camera.name}", *SIZE, FRAMES, f"masks/{camera.name}"
        )
        for camera in cameras
    )
    manifest = SessionManifest(
        name=folder.name,
        title="Nudged camera",
        created=now(),
        body="human31",
        footage=FootageSource(25.0, FRAMES, sources),
        calibration_source="board.toml",
    )
    write_manifest(folder, manifest)
    return Session(folder)


def _outline(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.uint8]:
    turn, _ = cv2.Rodrigues(camera.rotation)
    pixels, _ = cv2.projectPoints(points, turn, camera.translation, camera.matrix, camera.distortion)
    mask = np.zeros((camera.height, camera.width), np.uint8)
    hull = cv2.convexHull(np.round(pixels[:, 0]).astype(np.int32))
    return np.asarray(cv2.fillConvexPoly(mask, hull, 255), dtype=np.uint8)
