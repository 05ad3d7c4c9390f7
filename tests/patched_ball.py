"""A session of something that no network knows: a ball of two colours before patched walls, seen by three cameras,
of which one is on its side and one began earlier.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from studio.evidence.strokes import Stroke
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.arrays import Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import placed_camera
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, SIZE, FOCAL, RADIUS = 6, (240, 180), 165.0, 300.0
PLACES = ((3200.0, 0.0), (-1600.0, 2800.0), (-1600.0, -2800.0))
SPOT, BALL = (60, 200, 235), (190, 90, 40)


@dataclass(frozen=True, slots=True, eq=False)
class PatchedBall:
    """session, and by camera and frame the true masks (H, W) 0 or 255, the ball's middle and its radius in pixels."""

    session: Session
    masks: dict[tuple[str, int], Bytes]
    circles: dict[tuple[str, int], tuple[float, float, float]]

    def strokes(self, frame: int, camera: str | None = None) -> tuple[Stroke, ...]:
        """A line through both colours, and one around, in a frame of each camera, or of one."""
        found: list[Stroke] = []
        for name in ("cam0", "cam1", "cam2"):
            if camera not in (None, name):
                continue
            x, y, r = self.circles[name, frame]
            across = ((x - 0.6 * r, y), (x + 0.6 * r, y))
            angles = np.linspace(0.0, 2.0 * np.pi, 17)
            around = tuple((float(x + 1.5 * r * np.cos(a)), float(y + 1.5 * r * np.sin(a))) for a in angles)
            found.append(Stroke(camera=name, frame=frame, kind="inside", width=3.0, points=across))
            found.append(Stroke(camera=name, frame=frame, kind="outside", width=3.0, points=around))
        return tuple(found)


def patched_ball(folder: Path) -> PatchedBall:
    """Written into `folder`, which must not exist."""
    cameras = tuple(
        placed_camera(f"cam{n}", (x, y, 1500.0), (0.0, 0.0, 900.0), size=SIZE, focal_px=FOCAL)
        for n, (x, y) in enumerate(PLACES)
    )
    masks: dict[tuple[str, int], Bytes] = {}
    circles: dict[tuple[str, int], tuple[float, float, float]] = {}
    sources: list[CameraSource] = []
    for n, camera in enumerate(cameras):
        turned, offset = (90, 0) if n == 1 else (0, 2 if n == 2 else 0)
        room = _room(n)
        (folder / "pictures" / camera.name).mkdir(parents=True)
        for number in range(FRAMES + offset):
            picture = room.copy()
            if number >= offset:
                key = camera.name, number - offset
                circles[key] = _circle(camera, number - offset)
                masks[key] = _drawn(picture, circles[key])
            noise = np.random.default_rng(100 * n + number).normal(0.0, 2.0, picture.shape)
            noisy = np.clip(picture + noise, 0, 255).astype(np.uint8)
            stored = np.rot90(noisy, turned // 90)
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{number:03d}.png"), stored)
        source = CameraSource(camera.name, "pictures", f"pictures/{camera.name}", *SIZE, FRAMES + offset)
        sources.append(replace(source, offset=offset, turned=turned))
    (folder / "calibration").mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    manifest = SessionManifest(
        name=folder.name,
        title="A ball",
        created=now(),
        body="human31",
        footage=FootageSource(30.0, FRAMES, tuple(sources)),
    )
    write_manifest(folder, manifest)
    return PatchedBall(Session(folder), masks, circles)


def _room(camera: int) -> Bytes:
    patches = np.random.default_rng(camera).integers(70, 200, (SIZE[1] // 20, SIZE[0] // 20, 1))
    tint = np.array([0.95, 1.0, 0.9])
    return (np.kron(patches, np.ones((20, 20, 1))) * tint).astype(np.uint8)


def _circle(camera: Camera, frame: int) -> tuple[float, float, float]:
    at = np.array([[120.0 * frame - 300.0, 60.0 * frame - 150.0, 900.0 + 20.0 * frame]])
    pixels, depths = project(camera, at)
    return float(pixels[0, 0]), float(pixels[0, 1]), FOCAL * RADIUS / float(depths[0])


def _drawn(picture: Bytes, circle: tuple[float, float, float]) -> Bytes:
    """Draw the ball; returns its mask."""
    x, y, r = circle
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.circle(mask, (round(x), round(y)), round(r), 255, cv2.FILLED)
    spot = np.zeros(SIZE[::-1], np.uint8)
    cv2.circle(spot, (round(x + 0.4 * r), round(y)), round(0.55 * r), 255, cv2.FILLED)
    picture[mask > 0] = BALL
    picture[(mask > 0) & (spot > 0)] = SPOT
    return mask
