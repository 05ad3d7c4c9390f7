"""A tiny session on disk: the planar arm seen by one camera, drawn with OpenCV from a motion that is
known."""

import itertools
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import rotation_from_vector
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


def side_camera(name: str = "side") -> Camera:
    """The same, 40 degrees further round."""
    front, turn = facing_camera(name), rotation_from_vector(np.array([0.0, 0.0, np.radians(40.0)]))
    rotation = front.rotation @ turn.T
    return replace(front, rotation=rotation, translation=-rotation @ turn @ front.centre)


def true_poses(frames: int = FRAMES) -> np.ndarray:
    """(F, 4) radians: each joint swings at most 1.2 degrees a frame."""
    time = np.arange(frames)[:, None] / 12.0
    return 0.25 * np.sin(time + np.array([0.0, 0.9, 1.9, 2.8]))


def make_session(
    folder: Path,
    frames: int = FRAMES,
    weighting: str = "edge-region",
    cameras: tuple[Camera, ...] = (facing_camera(),),
) -> Session:
    """Write the session into `folder`, which must not exist."""
    body = load_body(BODY)
    for part, camera in itertools.product(("pictures", "masks"), cameras):
        (folder / part / camera.name).mkdir(parents=True)
    (folder / "calibration").mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    shade = np.random.default_rng(5).integers(90, 110, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    drawn = itertools.product(enumerate(limb_ends(body, true_poses(frames))), cameras)
    for (frame, ends), camera in drawn:
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        for limb, (near, far) in zip(body.drawn, ends, strict=True):
            pixels, _ = project(camera, np.stack([near, far]))
            thickness = max(1, round((limb.radius_start + limb.radius_end) * FOCAL / DISTANCE))
            first, last = np.round(pixels).astype(int)
            cv2.line(mask, first.tolist(), last.tolist(), 255, thickness)
        picture = np.where(mask[..., None] > 0, np.uint8(210), shade)
        cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:04d}.png"), picture)
        cv2.imwrite(str(folder / "masks" / camera.name / f"{frame:04d}.png"), mask)
    sources = tuple(
        CameraSource(
            camera.name, "pictures", f"pictures/{camera.name}", WIDTH, HEIGHT, frames, f"masks/{camera.name}"
        )
        for camera in cameras
    )
    manifest = SessionManifest(
        name=folder.name,
        title="Toy arm",
        created=now(),
        body=BODY,
        footage=FootageSource(FPS, frames, sources),
        weighting=weighting,
    )
    write_manifest(folder, manifest)
    return Session(folder)
