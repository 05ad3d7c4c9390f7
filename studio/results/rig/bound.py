"""What cameras would tell of a motion, linearised: a bound on errors in seconds, with nothing drawn.

A pose x is seen by where the outlines of its limbs are. A piece of outline tells one direction, that across it, and
only where it is in the picture and no other limb covers it there. With J its slope over the pose, mm, and σ how far
outlines are off, the pieces of a camera tell I = Σ JᵀJ / σ² (Fisher information), cameras add up, and the inverse of
the sum of it, with what is known of a body beforehand, bounds the covariance of x (Cramér & Rao; cameras are placed
by it in Olague & Mohr 2002, "Optimal camera placement for accurate reconstruction", Pattern Recognition 35(4)). It is
no error in mm: what the likelihood gets wrong, and a search that is lost, are not in it. Rigs are compared by it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, kinematic_tables
from studio.body.scale import scale_of
from studio.foundations.arrays import Array, Mask, evenly_spread
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import outward_limit
from studio.foundations.geometry.projection import project
from studio.results.inspection.reference import body_points

POSES = 16
"""Of a motion, evenly spread."""
ANGLE_STEP, LENGTH_STEP = 1e-3, 1.0
ALONG = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Where along a limb its two sides are looked at."""
OFF_PX, OFF_MM, ALIKE_MM = 1.0, 10.0, 60.0
"""How far an outline is off: in a picture, and of clothes; over how much of it that is the same. At a person's size."""
ROOM_MM, FREE_ANGLE = 300.0, 0.6
"""What is known beforehand: a body's place, and an angle (rad), to so much; at a person's size."""
_SIDES = len(ALONG)
_SHARES: Array = np.array([*ALONG, *ALONG, 0.0, 1.0])
_ACROSS: Array = np.array([1.0] * _SIDES + [-1.0] * _SIDES + [0.0, 0.0])
_AHEAD: Array = np.array([0.0] * (2 * _SIDES) + [-1.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class LinearMotion:
    """F poses of a body with L limbs and M points, and how these move with each of the D parameters, mm.

    ends : (F, L, 2, 3) of the limbs' axes. end_slopes : (F, L, 2, 3, D). radii : (L, 2) at the ends.
    point_slopes : (F, M, 3, D). known : (D,) what is known beforehand, 1 / variance. scale : of the body.
    """

    ends: Array
    end_slopes: Array
    radii: Array
    point_slopes: Array
    known: Array
    scale: float


def linear_motion(body: BodyModel, poses: Array, count: int = POSES) -> LinearMotion:
    """A motion, poses (N, D), around `count` poses of it."""
    chosen = poses[evenly_spread(len(poses), min(count, len(poses)))]
    frames, dimension = chosen.shape
    steps = np.where(body.angles, ANGLE_STEP, LENGTH_STEP)
    moved = np.concatenate([chosen[:, None] + np.diag(steps), chosen[:, None] - np.diag(steps)], axis=1)
    flat = moved.reshape(-1, dimension)

    def slopes(values: Array) -> Array:
        both = values.reshape(frames, 2, dimension, *values.shape[1:])
        by_step = (both[:, 0] - both[:, 1]) / (2.0 * steps).reshape(-1, *[1] * (values.ndim - 1))
        return np.moveaxis(by_step, 1, -1)

    shape, scale = kinematic_tables(body).limb_shape, scale_of(body)
    wide = shape[:, 1:3] * shape[:, 3:5].mean(axis=1, keepdims=True)
    deviation = np.where(body.angles, FREE_ANGLE, ROOM_MM * scale)
    return LinearMotion(
        limb_ends(body, chosen),
        slopes(limb_ends(body, flat)),
        wide,
        slopes(body_points(body, flat)),
        1.0 / deviation**2,
        scale,
    )


@dataclass(frozen=True, slots=True, eq=False)
class ViewInformation:
    """What a camera tells of a motion. information : (F, D, D). sees : share of the body in its picture."""

    information: Array
    sees: float


def view_information(motion: LinearMotion, camera: Camera) -> ViewInformation:
    """What a camera tells of each pose of a motion."""
    axis, slopes = _between(motion.ends, 2), _between(motion.end_slopes, 2)
    pixels, depth = project(camera, axis)
    ends, end_depth = project(camera, motion.ends)
    with np.errstate(invalid="ignore", divide="ignore"):
        per_mm = _focal(camera) / depth
        line = ends[:, :, 1] - ends[:, :, 0]
        length: Array = np.linalg.norm(line, axis=-1)
        along = line / np.maximum(length, 1e-9)[..., None]
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        half = _between(motion.radii, 1) * per_mm
        normal = np.abs(_ACROSS)[:, None] * across[:, :, None] + np.abs(_AHEAD)[:, None] * along[:, :, None]
        turned = _ACROSS[:, None] * across[:, :, None] + _AHEAD[:, None] * along[:, :, None]
        outline = pixels + half[..., None] * turned
        seen = _in_picture(camera, axis, depth, outline)
        uncovered = seen & ~_covered(outline, ends, motion.radii * _focal(camera) / end_depth)
        # Slope of the outline across itself, in mm where the limb is.
        ahead = np.stack(
            [(project(camera, axis + step)[0] - pixels) for step in np.eye(3)], axis=-1
        )  # pixels a mm
        rows = np.einsum("flsp,flspi,flsid->flsd", normal, ahead, slopes) / per_mm[..., None]
        piece = np.where(_AHEAD == 0.0, length[..., None] / per_mm / _SIDES, half / per_mm)
        off = (OFF_PX / per_mm) ** 2 + (OFF_MM * motion.scale) ** 2
        weight = np.where(uncovered, piece / (ALIKE_MM * motion.scale) / off, 0.0)
    rows, weight = np.where(uncovered[..., None], rows, 0.0), np.nan_to_num(weight)
    rows = (rows * np.sqrt(weight)[..., None]).reshape(len(rows), -1, rows.shape[-1])
    return ViewInformation(np.swapaxes(rows, 1, 2) @ rows, float(seen.mean()))


def errors_of(motion: LinearMotion, information: Array) -> Array:
    """(…, M) mm how far the points may be off, the mean over the poses. information : (…, F, D, D) of all cameras."""
    covariance = np.linalg.inv(information + np.diag(motion.known))
    squares = np.einsum(
        "fmid,...fde,fmie->...fm", motion.point_slopes, covariance, motion.point_slopes, optimize=True
    )
    return np.sqrt(np.maximum(squares, 0.0)).mean(axis=-2)


def total(views: Sequence[ViewInformation], motion: LinearMotion) -> Array:
    """(F, D, D) what cameras tell together."""
    frames, dimension = len(motion.ends), len(motion.known)
    return sum((one.information for one in views), np.zeros((frames, dimension, dimension)))


def _between(ends: Array, axis: int) -> Array:
    """Values at the shares of a limb's length, from those at both ends, which `axis` holds."""
    first, last = np.take(ends, [0], axis=axis), np.take(ends, [1], axis=axis)
    shares = _SHARES.reshape(-1, *[1] * (ends.ndim - axis - 1))
    return first + shares * (last - first)


def _focal(camera: Camera) -> float:
    return float(np.sqrt(camera.matrix[0, 0] * camera.matrix[1, 1]))


def _in_picture(camera: Camera, axis: Array, depth: Array, outline: Array) -> Mask:
    seen = axis @ camera.rotation.T + camera.translation
    wide = (seen[..., 0] ** 2 + seen[..., 1] ** 2) / depth**2
    inside = ((outline > -0.5) & (outline < np.array([camera.width, camera.height]) - 0.5)).all(axis=-1)
    return inside & (depth > 0.0) & (wide < outward_limit(camera))


def _covered(outline: Array, ends: Array, half: Array) -> Mask:
    """(F, L, S) which points of outlines (F, L, S, 2) lie within another limb: ends (F, L, 2, 2), half widths
    (F, L, 2).
    """
    covered = np.zeros(outline.shape[:3], dtype=np.bool_)
    for limb in range(ends.shape[1]):
        first, line = ends[:, limb, 0], ends[:, limb, 1] - ends[:, limb, 0]
        away = outline - first[:, None, None]
        square = np.maximum((line**2).sum(axis=-1), 1e-9)
        share = np.clip(np.einsum("flsp,fp->fls", away, line) / square[:, None, None], 0.0, 1.0)
        near: Array = np.linalg.norm(away - share[..., None] * line[:, None, None], axis=-1)
        wide = half[:, limb, 0, None, None] + share * (half[:, limb, 1] - half[:, limb, 0])[:, None, None]
        inside = near < wide
        inside[:, limb] = False
        covered |= inside
    return covered
