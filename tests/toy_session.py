"""A tiny session on disk: the planar arm seen by one camera, drawn with OpenCV from a motion that is
known."""

from pathlib import Path

import cv2
import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.capture.calibration_files import write_calibration
from studio.capture.footage_source import CameraSource, FootageSource
from studio.geometry.camera import Camera
from studio.geometry.projection import project
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, FPS, WIDTH, HEIGHT = 8, 60.0, 160, 120
BODY = "planar_arm4"
DISTANCE, FOCAL = 3000.0, 150.0


def facing_camera(name: str = "front") -> Camera:
    """A camera 3 m in front of the arm's plane, looking along +y, z up in the picture."""
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    centre = np.array([0.0, -DISTANCE, 0.0])
    matrix = np.array([[FOCAL, 0.0, (WIDTH - 1) / 2], [0.0, FOCAL, (HEIGHT - 1) / 2], [0.0, 0.0, 1.0]])
    return Camera(name, WIDTH, HEIGHT, matrix, np.zeros(5), rotation, -rotation @ centre)


def true_poses(frames: int = FRAMES) -> np.ndarray:
    """(F, 4) radians: each joint swings at most 1.2 degrees a frame."""
    time = np.arange(frames)[:, None] / 12.0
    return 0.25 * np.sin(time + np.array([0.0, 0.9, 1.9, 2.8]))


def make_session(folder: Path, frames: int = FRAMES, weighting: str = "edge-region") -> Session:
    """Write the session into `folder`, which must not exist."""
    camera, body = facing_camera(), load_body(BODY)
    for part in ("pictures", "masks"):
        (folder / part / camera.name).mkdir(parents=True)
    (folder / "calibration").mkdir()
    write_calibration((camera,), folder / "calibration" / "cameras.toml")
    shade = np.random.default_rng(5).integers(90, 110, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    for frame, ends in enumerate(limb_ends(body, true_poses(frames))):
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        for limb, (near, far) in zip(body.drawn, ends, strict=True):
            pixels, _ = project(camera, np.stack([near, far]))
            thickness = max(1, round((limb.radius_start + limb.radius_end) * FOCAL / DISTANCE))
            first, last = np.round(pixels).astype(int)
            cv2.line(mask, first.tolist(), last.tolist(), 255, thickness)
        picture = np.where(mask[..., None] > 0, np.uint8(210), shade)
        cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:04d}.png"), picture)
        cv2.imwrite(str(folder / "masks" / camera.name / f"{frame:04d}.png"), mask)
    source = CameraSource(
        camera.name, "pictures", f"pictures/{camera.name}", WIDTH, HEIGHT, frames, f"masks/{camera.name}"
    )
    manifest = SessionManifest(
        name=folder.name,
        title="Toy arm",
        created=now(),
        body=BODY,
        footage=FootageSource(FPS, frames, (source,)),
        weighting=weighting,
    )
    write_manifest(folder, manifest)
    return Session(folder)
