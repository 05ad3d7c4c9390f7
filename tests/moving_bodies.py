"""Motion that is known exactly, and files of it."""

from pathlib import Path

import ezc3d
import numpy as np

from studio.body.forward_kinematics import marker_points
from studio.body.model import BodyModel
from studio.foundations.arrays import Array


def standing(body: BodyModel, **angles: float) -> Array:
    """(D,) upright with the pelvis 950 mm above the floor; angles : radians more, by the parameter's name."""
    names = [entry.name for entry in body.parameters]
    pose = body.neutral.copy()
    pose[names.index("pelvis_z")] = 950.0
    for name, angle in angles.items():
        pose[names.index(name)] += angle
    return pose


def swinging(body: BodyModel, frames: int, fps: float, seed: int = 3) -> Array:
    """(F, D) poses: every angle swings well inside its limits, slowly, the root wanders and turns."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames)[:, None] / fps
    rates, phases = rng.uniform(0.25, 0.6, len(body.parameters)), rng.uniform(0.0, 6.0, len(body.parameters))
    wave = np.sin(2.0 * np.pi * rates * times + phases)
    poses = np.tile(body.neutral, (frames, 1))
    for place, entry in enumerate(body.parameters):
        if entry.kind == "length":
            poses[:, place] += 80.0 * wave[:, place]
        elif not np.isfinite(entry.upper - entry.lower):
            poses[:, place] += 0.25 * wave[:, place]
        else:
            middle = np.clip(entry.neutral, 0.8 * entry.lower + 0.2 * entry.upper, None)
            size = min(0.35, 0.8 * (entry.upper - middle), 0.8 * (middle - entry.lower))
            poses[:, place] = middle + size * wave[:, place]
    return poses


def write_c3d(path: Path, labels: list[str], points: Array, fps: float, unit: str = "mm") -> Path:
    """A C3D file of points (F, M, 3) in its unit."""
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [fps]
    content["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    content["parameters"]["POINT"]["UNITS"]["value"] = (unit,)
    data = np.ones((4, points.shape[1], points.shape[0]))
    data[:3] = points.transpose(2, 1, 0)
    content["data"]["points"] = data
    content.write(str(path))
    return path


def c3d_of(path: Path, body: BodyModel, poses: Array, fps: float, prefix: str = "") -> Path:
    """A C3D file of the body's markers along poses (F, D)."""
    labels = [f"{prefix}{marker.name}" for marker in body.markers]
    return write_c3d(path, labels, marker_points(body, poses), fps)
