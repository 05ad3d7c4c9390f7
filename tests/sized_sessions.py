"""A session on disk of a person with drawn limb lengths: pictures and a plate a camera, nothing else is told."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from sized_people import MEASURED, SIZE, drawn_and_seen, renderer_of

from studio.body.person import PersonMotion, Skeleton
from studio.footage.capture.calibration_files import write_calibration
from studio.footage.capture.footage_source import CameraSource, FootageSource
from studio.results.drawing_footage.motions import make_motion
from studio.results.drawing_footage.person import marker_lengths
from studio.sessions.manifest import SessionManifest, now, write_manifest
from studio.sessions.session import Session

POSTURES = (("walk", 40), ("run", 12), ("box", 70), ("run", 26), ("box", 96))
"""Motions and frames of them at 60 Hz, one frame of the session each."""
FPS = 60.0


def make_sized_session(folder: Path, seed: int) -> tuple[Session, dict[str, float], float]:
    """A session of the person of a seed, the true lengths by group, and the height as it was told (± 3 cm), mm."""
    rng = np.random.default_rng(np.random.SeedSequence((seed, 0xE2E)))
    skeleton, measured, cameras = drawn_and_seen(rng)
    for camera in cameras:
        (folder / "pictures" / camera.name).mkdir(parents=True)
    for name in ("calibration", "background"):
        (folder / name).mkdir()
    write_calibration(cameras, folder / "calibration" / "cameras.toml")
    motion = _postures(skeleton)
    renderer = renderer_of(cameras, motion, seed, noise=1.5)
    for frame in range(motion.frame_count):
        shadow = renderer.shadow(frame)
        for index, camera in enumerate(cameras):
            picture, _ = renderer.picture(index, frame, shadow)
            cv2.imwrite(str(folder / "pictures" / camera.name / f"{frame:04d}.png"), picture)
    for index, camera in enumerate(cameras):
        cv2.imwrite(str(folder / "background" / f"{camera.name}.png"), renderer.empty(index, 0))
    sources = tuple(
        CameraSource(
            camera.name,
            "pictures",
            f"pictures/{camera.name}",
            *SIZE,
            motion.frame_count,
            background=f"background/{camera.name}.png",
        )
        for camera in cameras
    )
    footage = FootageSource(FPS, motion.frame_count, sources)
    manifest = SessionManifest(
        name=folder.name,
        title="Drawn person",
        created=now(),
        body="human31",
        footage=footage,
        weighting="edge-region-silhouette",
    )
    write_manifest(folder, manifest)
    lengths = marker_lengths(motion)
    return Session(folder), {group: lengths[pair] for group, pair in MEASURED.items()}, measured


def _postures(skeleton: Skeleton) -> PersonMotion:
    """One frame of each motion, one after the other."""
    parts = [(make_motion(name, skeleton, at + 2, FPS, {}), at) for name, at in POSTURES]
    first = parts[0][0]
    return replace(
        first,
        root=np.stack([motion.root[at] for motion, at in parts]),
        turns={name: np.stack([motion.turns[name][at] for motion, at in parts]) for name in first.turns},
    )
