"""A body of known sizes before cameras around it, drawn as masks, and clicks on its landmarks."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from studio.body.film_fit import FilmedTree
from studio.body.forward_kinematics import limb_frames, marker_points
from studio.body.model import BodyModel
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.sessions.landmark_clicks import LandmarkClick
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

WIDTH, HEIGHT = 640, 480


def cameras_around(distance: float, height: float, focal: float, count: int = 4) -> tuple[Camera, ...]:
    """Cameras on a ring, mm, looking at the origin."""
    matrix = np.array([[focal, 0.0, (WIDTH - 1) / 2], [0.0, focal, (HEIGHT - 1) / 2], [0.0, 0.0, 1.0]])
    cameras: list[Camera] = []
    for number in range(count):
        turn = 0.4 + 2.0 * math.pi * number / count
        centre = np.array([distance * math.cos(turn), distance * math.sin(turn), height])
        ahead = -centre / np.linalg.norm(centre)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(ahead, right), ahead])
        cameras.append(
            Camera(f"cam{number + 1}", WIDTH, HEIGHT, matrix, np.zeros(5), rotation, -rotation @ centre)
        )
    return tuple(cameras)


def varied_poses(body: BodyModel, count: int, place: float = 20.0, seed: int = 3) -> Array:
    """(F, D) poses within half of the limits, the root turned and moved."""
    rng = np.random.default_rng(seed)
    lower = np.where(np.isfinite(body.lower), body.lower, body.neutral - 0.3)
    upper = np.where(np.isfinite(body.upper), body.upper, body.neutral + 0.3)
    poses = body.neutral + 0.6 * (rng.uniform(lower, upper, (count, len(body.parameters))) - body.neutral)
    moved = ~body.angles & ~np.isfinite(body.lower)
    poses[:, moved] = body.neutral[moved] + rng.uniform(-place, place, (count, int(moved.sum())))
    return poses


def drawn_mask(body: BodyModel, pose: Array, camera: Camera) -> Bytes:
    """(H, W) 0 or 255: the limbs as cones with round ends, as if they were round."""
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for limb, frame in zip(body.drawn, limb_frames(body, pose)[0], strict=True):
        shares = np.linspace(0.0, 1.0, 80)
        points = frame[:, 3] + shares[:, None] * limb.length * frame[:, 2]
        pixels, depths = project(camera, points)
        radii = (limb.radius_start + shares * (limb.radius_end - limb.radius_start)) / depths
        for (x, y), radius in zip(16.0 * pixels, 16.0 * camera.matrix[0, 0] * radii, strict=True):
            cv2.circle(mask, (round(x), round(y)), round(radius), 255, -1, shift=4)
    return mask


def write_session(
    folder: Path, body: BodyModel, poses: Array, cameras: Sequence[Camera], *, masks: bool
) -> Session:
    """A session of drawn pictures, with their masks or without."""
    for camera in cameras:
        for part in ("pictures", *(("masks",) if masks else ())):
            (folder / part / camera.name).mkdir(parents=True)
            for frame, pose in enumerate(poses):
                name = str(folder / part / camera.name / f"{frame:04d}.png")
                cv2.imwrite(
                    name, drawn_mask(body, pose, camera) if masks else np.zeros((HEIGHT, WIDTH), np.uint8)
                )
    (folder / "calibration").mkdir()
    write_calibration(tuple(cameras), folder / "calibration" / "cameras.toml")
    sources = tuple(
        CameraSource(
            one.name,
            "pictures",
            f"pictures/{one.name}",
            WIDTH,
            HEIGHT,
            len(poses),
            f"masks/{one.name}" if masks else "",
        )
        for one in cameras
    )
    write_manifest(
        folder,
        SessionManifest(
            name=folder.name,
            title="Filmed",
            created=now(),
            body="planar_arm4",
            footage=FootageSource(60.0, len(poses), sources),
        ),
    )
    return Session(folder)


def clicks_on(
    body: BodyModel, names: Sequence[str], poses: Array, cameras: Sequence[Camera], pixels: float = 1.0
) -> list[LandmarkClick]:
    """Clicks on every landmark in every view, with that standard deviation."""
    rng = np.random.default_rng(7)
    points = marker_points(FilmedTree(body, names).body, poses)
    clicks: list[LandmarkClick] = []
    for frame in range(len(poses)):
        for camera in cameras:
            seen = project(camera, points[frame])[0] + pixels * rng.standard_normal((len(names), 2))
            clicks += [
                LandmarkClick(frame, camera.name, name, float(x), float(y))
                for name, (x, y) in zip(names, seen, strict=True)
            ]
    return clicks


def moved(click: LandmarkClick, x: float, y: float) -> LandmarkClick:
    return replace(click, x=click.x + x, y=click.y + y)
