"""Runs with a planted cause of failure, on a person drawn as masks in four small pictures: what the detective test and
its rules are tried on.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from drawn_people import drawn_mask, ring_of_cameras
from numpy.typing import NDArray
from tracked_runs import finish

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.inverse_kinematics import pose_from_markers
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.body.person import marker_motion
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.damage import turned_camera
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import skeleton_of_height
from studio.runs.new_run import prepare_run
from studio.search.trackers.side_exchange import kinds_of
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.named_rows import write_pose
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

FPS, BODY = 60.0, "human31"
PARTICLES, LAYERS, FRAMES = 40, 4, 5
"""Of the small run of `inspection/conftest.py`."""
FRAME, MORE_LAYERS, FEWER_PARTICLES = 3, 7, 25
"""Of what is tried there."""
CAUSES = ("particles", "survival", "calibration", "masks", "exchange", "noise")
Damage = Callable[[int, str, NDArray[np.uint8]], NDArray[np.uint8]]
"""damage(frame, camera, mask) is the mask that is stored."""


def drawn_session(
    folder: Path,
    poses: Array,
    cameras: tuple[Camera, ...],
    calibrated: tuple[Camera, ...] | None = None,
    damage: Damage | None = None,
    start: Array | None = None,
    seed: int = 0,
    body: BodyModel | None = None,
) -> Session:
    """A session whose masks show a body in poses (K, D). calibrated : the cameras that it claims to have. start : its
    start pose, the first one where none is given.
    """
    body = body or load_body(BODY)
    rng = np.random.default_rng(seed)
    for camera in cameras:
        for part in ("pictures", "masks"):
            (folder / part / camera.name).mkdir(parents=True)
        shade = rng.integers(60, 90, (camera.height, camera.width, 3), dtype=np.uint8)
        for frame, pose in enumerate(poses):
            true = drawn_mask(body, pose, camera)
            mask = true if damage is None else damage(frame, camera.name, true)
            noise = rng.integers(0, 12, shade.shape, dtype=np.uint8)
            picture = np.where(true[..., None] > 0, np.uint8(170), shade) + noise
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:04d}.png"), picture)
            cv2.imwrite(str(folder / "masks" / camera.name / f"{frame:04d}.png"), mask)
    (folder / "calibration").mkdir()
    write_calibration(calibrated or cameras, folder / "calibration" / "cameras.toml")
    (folder / "truth").mkdir()
    names = tuple(marker.name for marker in body.markers)
    points = marker_points(body, poses)
    write_trc(
        folder / "truth" / "markers.trc", MarkerMotion(names, np.arange(len(poses)) / FPS, points, "m", FPS)
    )
    sources = tuple(
        CameraSource(
            camera.name,
            "pictures",
            f"pictures/{camera.name}",
            camera.width,
            camera.height,
            len(poses),
            f"masks/{camera.name}",
        )
        for camera in cameras
    )
    write_manifest(
        folder,
        SessionManifest(
            name=folder.name,
            title="Drawn person",
            created=now(),
            body=BODY,
            footage=FootageSource(FPS, len(poses), sources),
        ),
    )
    write_pose(
        folder / "start_pose.csv",
        tuple(entry.name for entry in body.parameters),
        poses[0] if start is None else start,
    )
    return Session(folder)


def cut_masks(camera: str) -> Damage:
    """Masks of one camera that miss the body's lower half and show a thing beside it."""

    def damage(frame: int, name: str, mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if name != camera:
            return mask
        rows = np.flatnonzero(mask.any(axis=1))
        bad = mask.copy()
        bad[int(rows.mean()) :] = 0
        height, width = mask.shape
        bad[height // 3 : height // 3 + height // 4, width // 10 : width // 4] = 255
        return bad

    return damage


def planted(
    folder: Path, cause: str, poses: Array, fast: Array, seed: int = 0, **settings: object
) -> tuple[Session, StoredRun]:
    """A tracked run that fails for one cause of CAUSES ("" for none). poses : (K, D) of a calm motion; fast : of one
    that is faster than the noise allows.
    """
    body, cameras = load_body(BODY), ring_of_cameras(4)
    moved = fast if cause == "noise" else poses
    calibrated, damage, start = cameras, None, None
    if cause == "calibration":
        turned = turned_camera(cameras[1], 45.0, 1.5)
        calibrated = (cameras[0], turned, *cameras[2:])
    if cause == "masks":
        damage = cut_masks("cam3")
    if cause == "exchange":
        legs = next(kind for kind in kinds_of(body) if "leg" in kind.what)
        start = legs.offered(poses[0])
    session = drawn_session(folder, moved, cameras, calibrated, damage, start, seed)
    knobs: dict[str, object] = {"refine_frames": False, "particles": 100, "layers": 10}
    knobs |= {"particles": {"particles": 8}, "survival": {"survival": 0.02}}.get(cause, {})
    run = prepare_run(session, seed=seed, knobs=knobs | settings, fit_shape=False, allow_inconsistent=True)
    finish(session, run)
    return session, run


def person_poses(motion: str, first: int, count: int, stride: int = 1) -> Array:
    """(count, D) of a walking or running person, about the middle of the cameras; every `stride`-th frame at 60 Hz."""
    body = load_body(BODY)
    made = make_motion(
        motion, skeleton_of_height(1750.0, np.random.default_rng(0)), first + count * stride, FPS, {}
    )
    markers = marker_motion(made)
    points = markers.positions[first::stride][:count]
    points = points - [*points.mean(axis=(0, 1))[:2], 0.0]
    poses, pose = list[Array](), body.neutral
    for row in points:
        pose, _ = pose_from_markers(body, markers.names, row, pose)
        poses.append(pose)
    return np.array(poses)
