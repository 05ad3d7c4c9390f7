"""A small session made of arithmetic: cameras in a ring, a swaying body, clouds around it."""

from pathlib import Path

import cv2
import numpy as np
from looking_cameras import turned_to

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion, write_trc
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.tracker import Estimate, FilterState, FrameResult, LayerRecord, ParticleSet
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

FRAMES, LAYERS, PARTICLES = 6, 4, 30
WIDTH, HEIGHT, FPS = 320, 240, 60.0


def ring_camera(name: str, bearing: float, quarter_turns: int = 0) -> Camera:
    """A camera 3.4 m from the middle and 2.2 m high, looking at the hips; rolled if it is to be turned."""
    centre = np.array([3400.0 * np.cos(bearing), 3400.0 * np.sin(bearing), 2200.0])
    rotation = turned_to(centre, (0.0, 0.0, 900.0))
    # Rolled so that turning the picture clockwise by the quarter turns makes it upright again.
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotation = np.linalg.matrix_power(turn.T, quarter_turns) @ rotation
    matrix = np.array([[330.0, 0.0, 164.0], [0.0, 332.0, 117.0], [0.0, 0.0, 1.0]])
    distortion = np.array([-0.12, 0.04, 0.001, -0.001, 0.0])
    translation = -rotation @ centre
    return Camera(name, WIDTH, HEIGHT, matrix, distortion, rotation, translation, quarter_turns)


def swaying_pose(body: BodyModel, frame: int) -> np.ndarray:
    """The rest pose with every free angle swaying a little, walking along x."""
    phase = np.arange(len(body.parameters))
    pose = body.neutral + 0.08 * np.sin(0.7 * frame + phase)
    pose[3:6] = body.neutral[3:6] + np.array([25.0 * frame, 4.0 * frame, 0.0])
    return pose


def cloud_record(body: BodyModel, frame: int, layer: int) -> LayerRecord:
    """A layer whose cloud shrinks with its number; weights fall with the distance from the middle."""
    rng = np.random.default_rng([frame, layer])
    pose = swaying_pose(body, frame)
    spread = np.where([entry.kind == "angle" for entry in body.parameters], 0.12, 30.0) * 0.6**layer
    offsets = rng.standard_normal((PARTICLES, len(pose)))
    log_weights = -0.5 * (offsets**2).sum(axis=1)
    flat = np.zeros(len(pose))
    return LayerRecord(
        frame=frame,
        layer=layer,
        settings_version=1,
        beta=1.0,
        alpha_wanted=0.5,
        alpha_reached=0.5,
        variance_weighed=flat,
        variance_resampled=flat,
        variance_diffused=flat,
        best=pose,
        best_log_weight=float(log_weights.max()),
        mean=pose,
        poses=pose + offsets * spread,
        log_weights=log_weights,
        milliseconds=1.0,
    )


def frame_result(body: BodyModel, frame: int, shift: float = 0.0) -> FrameResult:
    """A frame's result at the swaying pose, moved sideways by `shift` mm."""
    pose = swaying_pose(body, frame)
    pose[4] += shift
    last = cloud_record(body, frame, LAYERS - 1)
    carried = FilterState(ParticleSet(last.poses, last.log_weights))
    return FrameResult(frame, Estimate(pose, pose, pose, -1.0), LAYERS, LAYERS * PARTICLES, 1, 4.0, carried)


def make_session(folder: Path, cameras: tuple[Camera, ...], body: BodyModel) -> Session:
    """A session folder with pictures, calibration, truth and start pose."""
    rng = np.random.default_rng(5)
    for camera in cameras:
        place = folder / "pictures" / camera.name
        place.mkdir(parents=True)
        ground = cv2.GaussianBlur(rng.integers(60, 130, (HEIGHT, WIDTH, 3), dtype=np.uint8), (0, 0), 6)
        for frame in range(FRAMES):
            cv2.imwrite(str(place / f"frame{frame:04d}.png"), ground)
    (folder / "calibration").mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    sources = tuple(
        CameraSource(camera.name, "pictures", f"pictures/{camera.name}", WIDTH, HEIGHT, FRAMES)
        for camera in cameras
    )
    footage = FootageSource(FPS, FRAMES, sources)
    manifest = SessionManifest(
        name=folder.name, title="Swaying", created=now(), body="human31", footage=footage
    )
    write_manifest(folder, manifest)
    poses = np.stack([swaying_pose(body, frame) for frame in range(FRAMES)])
    points = marker_points(body, poses)
    points[..., 1] += 40.0
    names = tuple(marker.name for marker in body.markers)
    (folder / "truth").mkdir()
    write_trc(folder / "truth" / "truth.trc", MarkerMotion(names, np.arange(FRAMES) / FPS, points))
    return Session(folder)
