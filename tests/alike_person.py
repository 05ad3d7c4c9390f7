"""A session on disk of a person of flat limbs before a wooden floor, whose forearms may be of its colour."""

from pathlib import Path

import cv2
import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.results.drawing_footage.cameras import placed_camera
from studio.runs.drawing.overlay_drawing import projected_silhouette
from studio.search.likelihood.outlines import OutlineProjector
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

BODY, SIZE = "human31", (640, 480)
WOOD, CLOTH, SHADE = np.array([80.0, 120.0, 160.0]), np.array([150.0, 60.0, 40.0]), 0.7


def standing_pose() -> np.ndarray:
    """(D,) arms away from the trunk, soles on the floor."""
    body = load_body(BODY)
    pose = body.neutral.copy()
    names = [parameter.name for parameter in body.parameters]
    for side in ("left", "right"):
        pose[names.index(f"{side}_shoulder_rx")] = 0.9
    pose[names.index("pelvis_z")] -= limb_ends(body, pose[None])[0, ..., 2].min()
    return pose


def make_alike_session(folder: Path, *, forearms_alike: bool) -> Session:
    """The session; its forearms are a darker floor, or cloth. On the floor lies a shadow."""
    rng, body, pose = np.random.default_rng(8), load_body(BODY), standing_pose()
    corners = [(2800.0, 2000.0), (-2000.0, 2800.0), (-2800.0, -2000.0), (2000.0, -2800.0)]
    cameras = tuple(
        placed_camera(f"cam{n}", (*at, 4200.0), (0.0, 0.0, 600.0), size=SIZE, focal_px=560.0)
        for n, at in enumerate(corners, 1)
    )
    for part in ("calibration", "background"):
        (folder / part).mkdir(parents=True)
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    empty = np.broadcast_to(WOOD, (SIZE[1], SIZE[0], 3))
    for camera in cameras:
        (folder / "pictures" / camera.name).mkdir(parents=True)
        picture = np.where(_shadow(camera)[:, :, None] > 0, SHADE * WOOD, WOOD)
        quads = OutlineProjector.of_body(body, (camera,)).corners(pose[None])[0][0, 0]
        for limb, quad in zip(body.drawn, quads, strict=True):
            drawn = projected_silhouette((quad,), SIZE[1], SIZE[0])[:, :, None] > 0
            alike = forearms_alike and "forearm" in limb.name
            picture = np.where(drawn, SHADE * WOOD if alike else CLOTH, picture)
        for name, content in (
            (f"pictures/{camera.name}/0000", picture),
            (f"background/{camera.name}", empty),
        ):
            noisy = content + rng.normal(0.0, 1.0, content.shape)
            cv2.imwrite(str(folder / f"{name}.png"), noisy.clip(0, 255).astype(np.uint8))
    sources = tuple(
        CameraSource(
            camera.name,
            "pictures",
            f"pictures/{camera.name}",
            *SIZE,
            1,
            background=f"background/{camera.name}.png",
        )
        for camera in cameras
    )
    write_manifest(
        folder,
        SessionManifest(
            name=folder.name,
            title="Forearms on wood",
            created=now(),
            body=BODY,
            layout="a folder a camera",
            footage=FootageSource(30.0, 1, sources),
        ),
    )
    return Session(folder)


def _shadow(camera: Camera) -> np.ndarray:
    """(H, W) 255 where a shadow lies on the floor: an ellipse a metre long."""
    around = np.linspace(0.0, 2.0 * np.pi, 60)
    points = np.stack([400.0 + 600.0 * np.cos(around), 250.0 * np.sin(around), np.zeros(60)], axis=1)
    return projected_silhouette((project(camera, points)[0],), SIZE[1], SIZE[0])
