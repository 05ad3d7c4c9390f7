"""Footage of planar arms: one camera facing the plane shows the tracker's own body, moving smoothly.

Deutscher & Reid 6.1 and 6.2.2: the arms are the model itself, so that the search is studied, not the fit of a model to
a person. The mask is exact: a pixel is arm when its centre lies in the outline of a drawn limb.
"""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_frames, marker_points
from studio.body.model import BodyModel, kinematic_tables
from studio.body.motion_files.trc import MarkerMotion
from studio.foundations.arrays import Array, Bytes
from studio.foundations.csv_text import poses_csv
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.cones import limb_outlines
from studio.foundations.geometry.projection import project
from studio.foundations.progress import Progress
from studio.results.drawing_footage.clips import ClipWriter
from studio.results.drawing_footage.noise_kernels import add_sensor_noise
from studio.results.drawing_footage.recipe_file import Recipe
from studio.sessions.atomic_files import write_text

SWING_SHARE, SPEED_SHARE = 0.30, 0.5
ARM_COLOUR, WALL_COLOUR = (196.0, 186.0, 178.0), (64.0, 62.0, 60.0)
SAMPLES = 3


def arm_motion(body: BodyModel, frames: int, fps: float, rng: np.random.Generator) -> Array:
    """(frames, D) poses: each angle swings sinusoidally about a place in the middle of its range, at most
    SWING_SHARE of the range wide and SPEED_SHARE of the parameter's `max_step` fast; a length stays neutral.

    Unbounded angles range over half a turn to both sides.
    """
    times = np.arange(frames) / fps
    poses = np.tile(body.neutral, (frames, 1))
    for index, entry in enumerate(body.parameters):
        if entry.kind != "angle":
            continue
        low = entry.lower if np.isfinite(entry.lower) else -np.pi
        high = entry.upper if np.isfinite(entry.upper) else np.pi
        swing = SWING_SHARE * (high - low) * rng.uniform(0.5, 1.0)
        middle = 0.5 * (low + high) + rng.uniform(-0.9, 0.9) * (0.5 * (high - low) - swing)
        speed = min(SPEED_SHARE * entry.max_step, 2.0 * np.pi * swing)
        poses[:, index] = middle + swing * np.sin(speed / swing * times + rng.uniform(0.0, 2.0 * np.pi))
    return poses


def arm_outlines(body: BodyModel, poses: Array, camera: Camera) -> Array:
    """(N, L, 4, 2) pixels: the quadrilaterals that the drawn limbs make in the camera's picture."""
    world = limb_outlines(kinematic_tables(body).limb_shape, limb_frames(body, poses), camera)
    return project(camera, world)[0]


def coverage(outlines: Array, width: int, height: int, samples: int) -> NDArray[np.float32]:
    """(height, width) share, 0...1, of samples × samples points a pixel that lie in any of the quadrilaterals.

    outlines : (L, 4, 2) pixels, convex. One sample is the pixel's centre.
    """
    step = 1.0 / samples
    columns = (np.arange(width * samples) + 0.5) * step - 0.5
    rows = (np.arange(height * samples) + 0.5) * step - 0.5
    inside = np.zeros((height * samples, width * samples), dtype=bool)
    for corners in outlines:
        sides: list[Array] = []
        for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            along = other - one
            sides.append(along[0] * (rows[:, None] - one[1]) - along[1] * (columns[None, :] - one[0]))
        signs = np.stack(sides)
        inside |= (signs >= 0.0).all(axis=0) | (signs <= 0.0).all(axis=0)
    blocks = inside.reshape(height, samples, width, samples)
    return blocks.mean(axis=(1, 3)).astype(np.float32)


def filled(outlines: Array, width: int, height: int) -> Bytes:
    """(H, W) 255 where a pixel's centre lies in any of the convex outlines (L, 4, 2); those not in front of the camera,
    which are not finite, cover nothing.
    """
    finite = outlines[np.isfinite(outlines).all(axis=(1, 2))]
    return np.where(coverage(finite, width, height, 1) > 0.0, 255, 0).astype(np.uint8)


def render_arm(recipe: Recipe, camera: Camera, source: Path, progress: Progress) -> MarkerMotion:
    """Write videos/ and masks/ of the recipe's body and true_poses.csv; returns the markers' motion."""
    body = load_body(recipe.body)
    poses = arm_motion(body, recipe.frames, recipe.fps, np.random.default_rng(recipe.seed))
    outlines = arm_outlines(body, poses, camera)
    size = (camera.width, camera.height)
    for folder in ("videos", "masks", "truth"):
        (source / folder).mkdir()
    footage = ClipWriter(source / "videos" / f"{camera.name}.mp4", size, recipe.fps, recipe.picture.quality)
    masks = ClipWriter(source / "masks" / f"{camera.name}.mp4", size, recipe.fps, 0.0)
    with footage, masks:
        for frame in range(recipe.frames):
            share = coverage(outlines[frame], *size, SAMPLES)
            stream = recipe.seed * 1_000_003 + frame
            footage.add(_picture(share, recipe.picture.noise, stream))
            masks.add(filled(outlines[frame], *size))
            progress("rendering", frame + 1, recipe.frames)
    names = tuple(entry.name for entry in body.parameters)
    write_text(source / "true_poses.csv", poses_csv(names, np.arange(recipe.frames), poses))
    markers = tuple(marker.name for marker in body.markers)
    times = np.arange(recipe.frames) / recipe.fps
    return MarkerMotion(markers, times, marker_points(body, poses), unit="m", rate=recipe.fps)


def _picture(share: NDArray[np.float32], noise: float, stream: int) -> Bytes:
    """(H, W, 3) BGR: a pale arm before a dark wall, with sensor noise."""
    light = np.array(WALL_COLOUR) + share[..., None] * (np.array(ARM_COLOUR) - np.array(WALL_COLOUR))
    soft = cv2.GaussianBlur(light.astype(np.float32), (0, 0), 0.6)
    out = np.zeros(soft.shape, np.uint8)
    add_sensor_noise(np.asarray(soft, np.float32), noise, stream, out)
    return out
