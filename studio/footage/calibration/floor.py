"""Where the floor is and where the axes point: from a board lying on it, or from points that a person clicked.

Z is up, the floor is z = 0. The frame of solved cameras (`extrinsics.Rig`) is arbitrary until then.

Clicked points of the floor, as a JSON file: pixels in two cameras or more, and where the points lie, if known.

    {"points": [{"pixels": {"cam1": [812.0, 640.5], "cam2": [300.1, 588.0]}, "world": [0, 0, 0]}, ...]}

`world` (mm, Z up) is given for all points or for none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import msgspec
import numpy as np

from studio.footage.calibration.board_poses import view_of
from studio.footage.calibration.boards import Board, Detection
from studio.footage.calibration.extrinsics import Rig
from studio.footage.calibration.intrinsics import Lens
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import foreign_file, read_file
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rigid import best_fit, compose, inverse, rigid, transform

FEWEST_POINTS = 3
FARTHEST_PIXEL = 1e6
"""Wider than any picture: what lies beyond is no click."""
STRETCHED = 1e-2
"""Three points lie on a line if the second extent is less than this share of the first."""
FAR_OFF = 0.05
"""Clicked points may miss their known places by this share of their extent."""


def floor_from_board(pose: Array, thickness_mm: float = 0.0) -> Array:
    """(3, 4) new_from_old of a world on a board that lies on the floor, face up.

    pose : (3, 4) old_from_board. Origin below the board's first corner, X along its rows, Z up.
    """
    axes = pose[:, :3] @ np.diag([1.0, -1.0, -1.0])
    floor = pose[:, 3] - thickness_mm * axes[:, 2]
    return inverse(rigid(axes, floor))


def board_on_floor(
    rig: Rig, board: Board, detections: Sequence[Detection], lenses: Mapping[str, Lens]
) -> Array:
    """(3, 4) world_from_board of a still board that several cameras saw, or one: the pose that fits all best.

    Raises CalibrationError if none of the rig's cameras saw it.
    """
    cameras = {camera.name: camera for camera in rig.cameras}
    seen = [detection for detection in detections if detection.camera in cameras]
    best, least = None, np.inf
    for detection in seen:
        view = view_of(board, detection, lenses[detection.camera])
        camera = cameras[detection.camera]
        for pose in view.poses[~view.turned] if view is not None else ():
            candidate = compose(inverse(rigid(camera.rotation, camera.translation)), pose)
            cost = sum(_off(board, cameras[other.camera], candidate, other) for other in seen)
            if cost < least:
                best, least = candidate, cost
    if best is None:
        raise CalibrationError(
            "No camera sees the board on the floor.",
            "Lay it where the cameras look, face up, and light it evenly.",
        )
    return best


def triangulated(cameras: Sequence[Camera], clicks: Mapping[str, Array]) -> Array:
    """(N, 3) points seen at (N, 2) pixels by two cameras or more; NaN pixels where a camera does not see a point.

    Raises CalibrationError for an unknown camera or a point that fewer than two cameras see.
    """
    known = {camera.name: camera for camera in cameras}
    for name in clicks:
        if name not in known:
            raise CalibrationError(
                f"Points were given in '{name}', which is no camera.", "Name a calibrated camera."
            )
        if (np.abs(clicks[name]) > FARTHEST_PIXEL).any():
            raise CalibrationError(
                f"A point in '{name}' lies more than {FARTHEST_PIXEL:g} pixels outside its picture.",
                "Click each point where it is seen.",
            )
    points: list[Array] = []
    for number in range(len(next(iter(clicks.values()), np.zeros((0, 2))))):
        rows = [
            _lines(known[name], pixels[number])
            for name, pixels in clicks.items()
            if np.isfinite(pixels[number]).all()
        ]
        if len(rows) < 2:
            raise CalibrationError(
                f"Point {number + 1} is given in fewer than two cameras.",
                "Click each point in two cameras or more.",
            )
        solved = np.linalg.svd(np.concatenate(rows))[2][-1]
        points.append(solved[:3] / solved[3])
    return np.array(points, dtype=np.float64)


def floor_from_points(points: Array, cameras: Sequence[Camera]) -> Array:
    """(3, 4) new_from_old of a world on the plane through three or more floor points: origin at the first, X towards
    the second, Z to the side of the cameras. Raises CalibrationError for points on a line.
    """
    if len(points) < FEWEST_POINTS:
        raise CalibrationError(f"{len(points)} floor points are too few.", "Give three or more, far apart.")
    middle = points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points - middle)
    if extents[1] < STRETCHED * extents[0]:
        raise CalibrationError("The floor points lie on a line.", "Click points that span a triangle.")
    up: Array = axes[2]
    above = np.mean([(camera.centre - middle) @ up for camera in cameras])
    up = up if above > 0.0 else -up
    origin = points[0] - ((points[0] - middle) @ up) * up
    along = points[1] - points[0]
    x: Array = along - (along @ up) * up
    if np.linalg.norm(x) < 1e-9:
        raise CalibrationError("The first two floor points are the same.", "Click two that lie apart.")
    x = x / np.linalg.norm(x)
    return inverse(rigid(np.stack([x, np.cross(up, x), up], axis=1), origin))


def world_from_points(points: Array, world: Array) -> tuple[Array, float]:
    """(3, 4) new_from_old that puts points where they are known to lie, and their ratio of lengths, old over new.

    points, world : (N, 3), three or more, not on a line. Raises CalibrationError if they do not fit one another.
    """
    if len(points) < FEWEST_POINTS:
        raise CalibrationError(
            f"{len(points)} known points are too few.", "Give three or more, not on a line."
        )
    spread = np.linalg.svd(world - world.mean(axis=0), compute_uv=False)
    if spread[1] < STRETCHED * spread[0]:
        raise CalibrationError("The known points lie on a line.", "Give points that span a triangle.")
    ratio = float(np.linalg.norm(points - points.mean(axis=0)) / np.linalg.norm(world - world.mean(axis=0)))
    new_from_old = best_fit(points / ratio, world)
    off = np.linalg.norm(transform(new_from_old, points / ratio) - world, axis=1)
    if off.max() > FAR_OFF * spread[0]:
        raise CalibrationError(
            f"Point {int(np.argmax(off)) + 1} lies {off.max():.0f} mm from where it should.",
            "Check the clicks and the coordinates (mm, Z up, right-handed).",
        )
    return best_fit(points, world), ratio


def _off(board: Board, camera: Camera, pose: Array, detection: Detection) -> float:
    """Root mean square pixels between a board's pose and a detection (either end of a board that looks alike)."""
    world = transform(pose, board.points)
    local = world @ camera.rotation.T + camera.translation
    if np.any(local[:, 2] <= 0.0):
        return 1e6
    pixels = cv2.projectPoints(local, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion)[0][:, 0]
    ends = (
        (detection.ids, len(board.points) - 1 - detection.ids) if board.turn_symmetric else (detection.ids,)
    )
    return min(float(np.sqrt(((pixels[ids] - detection.pixels) ** 2).sum(axis=1).mean())) for ids in ends)


def _lines(camera: Camera, pixel: Array) -> Array:
    """(2, 4) equations of a point on a pixel's ray."""
    flat = cv2.undistortPoints(pixel.reshape(1, 1, 2).astype(float), camera.matrix, camera.distortion)[0, 0]
    pose = np.column_stack([camera.rotation, camera.translation])
    return np.stack([flat[0] * pose[2] - pose[0], flat[1] * pose[2] - pose[1]])


LENGTHS_AGREE = 0.03


class Click(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One point. pixels : camera → x, y. world : mm, or None."""

    pixels: dict[str, tuple[float, float]]
    world: tuple[float, float, float] | None = None


class Clicks(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All points of a file."""

    points: tuple[Click, ...]


def read_clicks(path: Path) -> Clicks:
    """The points of a file. Raises CalibrationError."""
    remedy = 'Write {"points": [{"pixels": {"cam1": [x, y], "cam2": [x, y]}, "world": [x, y, z]}]}; world is optional.'
    with foreign_file(path, CalibrationError, "a list of clicked points", remedy):
        return msgspec.json.decode(read_file(path), type=Clicks)


@dataclass(frozen=True, slots=True, eq=False)
class ClickedFloor:
    """new_from_old : (3, 4). points : (N, 3) the clicked points in the new world, mm. missed : camera → (N,) pixels
    between each click and its point, NaN where a camera does not have it.
    """

    new_from_old: Array
    points: Array
    missed: dict[str, Array]


def clicked_floor(clicks: Clicks, cameras: Sequence[Camera]) -> ClickedFloor:
    """The clicked points in space, and their world. Raises CalibrationError, also for contradicting lengths."""
    names = sorted({name for click in clicks.points for name in click.pixels})
    pixels = {
        name: np.array([click.pixels.get(name, (np.nan, np.nan)) for click in clicks.points])
        for name in names
    }
    points = triangulated(cameras, pixels)
    known = {camera.name: camera for camera in cameras}
    missed = {
        name: np.linalg.norm(project(known[name], points)[0] - clicked, axis=1)
        for name, clicked in pixels.items()
    }
    new_from_old = _world_of(clicks, points, cameras)
    return ClickedFloor(new_from_old, transform(new_from_old, points), missed)


def _world_of(clicks: Clicks, points: Array, cameras: Sequence[Camera]) -> Array:
    known = [click.world for click in clicks.points if click.world is not None]
    if not known:
        return floor_from_points(points, cameras)
    if len(known) != len(points):
        raise CalibrationError(
            f"{len(known)} of {len(points)} points have a place in the world.",
            "Give it for all points or for none.",
        )
    new_from_old, ratio = world_from_points(points, np.array(known, dtype=np.float64))
    if abs(ratio - 1.0) > LENGTHS_AGREE:
        raise CalibrationError(
            f"The clicked points lie {ratio:.3f} times as far apart as the given places in the world.",
            "Measure the board's squares (the given size may be wrong) and the points' places.",
        )
    return new_from_old
