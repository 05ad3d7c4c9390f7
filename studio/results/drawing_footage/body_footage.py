"""Footage of any body, moving through key poses in a room: a robot arm, a hand.

The surface is the body's own cones, a robot's with flat ends like its links (`edge_mm`), a hand's with rounded ones, so
lengths and joints are those of the body and the outline is not quite. A hand may have flesh of its own instead
(`hand_flesh.py`), and other sizes than the session's body. The motion is smooth between keys (monotone
cubics, an angle for itself), so the truth is exact in every parameter. A small body is rendered `magnify` times as
large before cameras that are so much further off, and pictures, calibration and truth are those of its own size: rooms
are made for people.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from studio.body.catalogue import body_file_text, load_body
from studio.body.dimensions import with_dimensions
from studio.body.forward_kinematics import limb_ends, limb_frames, marker_points
from studio.body.model import BodyModel
from studio.body.motion_files.trc import MarkerMotion
from studio.body.subject import Subject
from studio.foundations.arrays import Array
from studio.foundations.csv_text import poses_csv
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress
from studio.results.drawing_footage.damage import cameras_left, clutter_before
from studio.results.drawing_footage.flesh import (
    AXES,
    BOUND,
    BOUND_RADIUS,
    COLUMNS,
    EDGE,
    LENGTH,
    RADIUS_END,
    RADIUS_START,
    SCALE_X,
    SCALE_Y,
    SKIN,
    START,
)
from studio.results.drawing_footage.hand_flesh import hand_tables
from studio.results.drawing_footage.person_footage import write_footage
from studio.results.drawing_footage.recipe_file import HAND, Key, Recipe
from studio.results.drawing_footage.renderer import MOMENTS, SurfaceRenderer
from studio.results.drawing_footage.rooms import room_called
from studio.results.drawing_footage.wardrobes import dressed
from studio.sessions.atomic_files import write_text
from studio.sessions.named_rows import write_pose

ROUNDED = 0.7
"""Share of a cone's radius by which its rounded end begins before the flat one."""
LONGEST_INSET, LARGEST_EDGE = 0.45, 0.4
TRUE_POSES = "true_poses.csv"


def recipe_body(recipe: Recipe, folder: Path) -> BodyModel:
    """The body of a recipe: of a file beside it, or by name, in the recipe's sizes. Raises BodyError."""
    beside = folder / recipe.body
    body = load_body(str(beside) if beside.is_file() else recipe.body)
    return with_dimensions(body, recipe.sizes) if recipe.sizes else body


def key_poses(body: BodyModel, keys: Sequence[Key], spread: float, rng: np.random.Generator) -> Array:
    """(K, D) poses of the keys, radians and mm: parameters that a key does not name keep their rest value.

    spread : the largest random change, degrees, of angles that any key names; limits hold. Raises StudioError for a
    parameter that the body does not have.
    """
    index = {entry.name: place for place, entry in enumerate(body.parameters)}
    named = {name for key in keys for name in key.pose}
    if strange := sorted(named - index.keys()):
        raise StudioError(
            f"Body '{body.name}' has no parameter '{strange[0]}'.", f"It has {', '.join(index)}."
        )
    poses = np.tile(body.neutral, (len(keys), 1))
    for name in sorted(named, key=lambda one: index[one]):
        place, entry = index[name], body.parameters[index[name]]
        unit = np.radians(1.0) if entry.kind == "angle" else 1.0
        moved = spread * unit * rng.uniform(-1.0, 1.0, len(keys)) if entry.kind == "angle" else 0.0
        rest = entry.neutral / unit
        wanted = unit * np.array([key.pose.get(name, rest) for key in keys]) + moved
        poses[:, place] = np.clip(wanted, entry.lower, entry.upper)
    return poses


def body_motion(recipe: Recipe, body: BodyModel, times: Array) -> Array:
    """(T, D) poses of a recipe at times in seconds; before its first key and after its last one it rests."""
    rng = np.random.default_rng((recipe.seed, 21))
    poses = key_poses(body, recipe.keys, recipe.options.get("spread_degrees", 0.0), rng)
    if len(recipe.keys) == 1:
        return np.tile(poses, (len(times), 1))
    moments = np.array([key.at_s for key in recipe.keys])
    return np.asarray(PchipInterpolator(moments, poses)(np.clip(times, moments[0], moments[-1])))


def body_pieces(
    body: BodyModel, poses: Array, magnify: float, edge_mm: float = 0.0
) -> tuple[Array, NDArray[np.int64]]:
    """The body's cones in the room: (T, L, COLUMNS) as `flesh.py` has them, and (L, 2) material and group.

    edge_mm : by so much the edges of flat ends are rounded; 0: the ends are parts of spheres.
    """
    frames = limb_frames(body, poses)
    tables = np.zeros((len(poses), len(body.drawn), COLUMNS))
    for place, limb in enumerate(body.drawn):
        length, radii = magnify * abs(limb.length), magnify * np.array([limb.radius_start, limb.radius_end])
        flat = edge_mm > 0.0
        inset = np.zeros(2) if flat else np.minimum(ROUNDED * radii, LONGEST_INSET * length)
        turn = frames[:, place, :, :3]
        if limb.length < 0.0:
            turn = turn * np.array([1.0, -1.0, -1.0])
        start = magnify * frames[:, place, :, 3] + inset[0] * turn[..., 2]
        table, swept = tables[:, place], length - float(inset.sum())
        table[:, START : START + 3] = start
        table[:, AXES : AXES + 9] = np.swapaxes(turn, 1, 2).reshape(-1, 9)
        table[:, LENGTH] = swept
        # The spheres at both ends are those of the cone there.
        slope = (radii[1] - radii[0]) / length
        table[:, RADIUS_START], table[:, RADIUS_END] = radii + slope * inset * np.array([1.0, -1.0])
        table[:, SCALE_X], table[:, SCALE_Y] = limb.scale_x, limb.scale_y
        table[:, EDGE] = min(magnify * edge_mm, LARGEST_EDGE * radii.min(), LARGEST_EDGE * length)
        table[:, BOUND : BOUND + 3] = start + 0.5 * swept * turn[..., 2]
        table[:, BOUND_RADIUS] = 0.5 * swept + radii.max() * max(1.0, limb.scale_x, limb.scale_y)
    return tables, np.array([(SKIN, place) for place in range(len(body.drawn))])


def body_renderer(
    recipe: Recipe, body: BodyModel, cameras: tuple[Camera, ...], frames: int
) -> SurfaceRenderer:
    """The renderer of a recipe's room and body. cameras : of the body's own size."""
    shutter, magnify = recipe.damage.shutter, recipe.magnify
    moments = MOMENTS if shutter > 0.0 else 1
    within = shutter * ((np.arange(moments) + 0.5) / moments - 0.5)
    times = (np.arange(frames)[:, None] + within) / recipe.fps
    poses = body_motion(recipe, body, times.ravel())
    if recipe.flesh == HAND:
        tables, labels = hand_tables(body, poses, magnify)
    else:
        tables, labels = body_pieces(body, poses, magnify, recipe.edge_mm)
    enlarged = tuple(replace(camera, translation=magnify * camera.translation) for camera in cameras)
    room = room_called(recipe.room)
    points = magnify * limb_ends(body, body_motion(recipe, body, times[:, moments // 2]))
    points = points.reshape(frames, -1, 3)
    things = clutter_before(recipe.damage.clutter, enlarged, points, points.mean(axis=1)[:, :2], recipe.seed)
    return SurfaceRenderer(
        replace(room, blocks=room.blocks + things),
        enlarged,
        tables.reshape(frames, moments, *tables.shape[1:]),
        labels,
        noise=recipe.picture.noise,
        samples=recipe.picture.samples,
        seed=recipe.seed,
        wardrobe=dressed(recipe.wardrobe, recipe.colours),
    )


def render_body(
    recipe: Recipe, folder: Path, cameras: tuple[Camera, ...], source: Path, progress: Progress, frames: int
) -> tuple[MarkerMotion, Subject]:
    """Write footage, the body's file, its true poses and a start pose; returns the markers' motion and the subject.

    frames : number of first frames. The start pose is the true one with normal noise: `start_pose_noise_degrees`, and
    `start_pose_noise_mm` for lengths.
    """
    body = recipe_body(recipe, folder)
    cameras = cameras_left(cameras, recipe.damage.missing)
    write_footage(recipe, body_renderer(recipe, body, cameras, frames), cameras, frames, source, progress)
    poses = body_motion(recipe, body, np.arange(frames) / recipe.fps)
    names = tuple(entry.name for entry in body.parameters)
    if recipe.include.truth:
        write_text(source / TRUE_POSES, poses_csv(names, np.arange(frames), poses))
    if (folder / recipe.body).is_file():
        (source / "bodies").mkdir()
        write_text(source / "bodies" / f"{body.name}.toml", body_file_text(str(folder / recipe.body)))
    if recipe.include.start_pose:
        rng = np.random.default_rng((recipe.seed, 22))
        degrees = np.radians(recipe.include.start_pose_noise_degrees)
        noise = [
            degrees if e.kind == "angle" else recipe.include.start_pose_noise_mm for e in body.parameters
        ]
        near = poses[0] + rng.normal(0.0, 1.0, len(noise)) * np.array(noise)
        lower, upper = (np.array([getattr(e, end) for e in body.parameters]) for end in ("lower", "upper"))
        write_pose(source / "start_pose.csv", names, np.clip(near, lower, upper))
    markers = tuple(marker.name for marker in body.markers)
    times = np.arange(frames) / recipe.fps
    truth = MarkerMotion(markers, times, marker_points(body, poses), unit="mm", rate=recipe.fps)
    return truth, Subject(body=body.name)
