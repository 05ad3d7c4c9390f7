"""A recording to learn a small behaviour from in seconds: a person who sways."""

from pathlib import Path

import numpy as np

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import marker_points
from studio.body.motion_files.trc import MarkerMotion, write_trc


def swaying(folder: Path, frames: int = 60) -> Path:
    """A TRC of a person who sways, 30 frames a second."""
    body = load_body("human31")
    poses = np.repeat(body.neutral[None], frames, axis=0)
    angles = [at for at, entry in enumerate(body.parameters) if entry.kind == "angle"]
    beat = np.sin(2.0 * np.pi * np.arange(frames)[:, None] / 25.0 + np.arange(len(angles)))
    limits = np.array([[max(entry.lower, -1.0), min(entry.upper, 1.0)] for entry in body.parameters])[angles]
    poses[:, angles] = limits.mean(axis=1) + 0.1 * beat * np.ptp(limits, axis=1)
    path = folder / "sway.trc"
    names = tuple(marker.name for marker in body.markers)
    write_trc(path, MarkerMotion(names, np.arange(frames) / 30.0, marker_points(body, poses)))
    return path
