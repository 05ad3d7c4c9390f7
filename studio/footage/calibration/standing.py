"""The height of a standing person, from silhouettes alone.

A calibration of the wrong size makes a person smaller or larger with the same shape. So a height shows the size
only where the shape proves that the person stands: a straight column with a head at its top and
its feet on the floor. All measures of shape are shares of the seen height, which no wrong size changes. They are taken
of the visual hull, which holds the person: where it is narrow, so is the person.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.footage.calibration.boards import rays_of
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

CELLS = 48
SLABS = 20
LOWER, TOP = 0.42, 0.93
"""Up to which share of the height the legs reach, from which on only the head is left."""
FEET, LEGS, LEAN, HEAD, CENTRE, UNSEEN = 0.06, 0.42, 0.09, 0.18, 0.505, 0.04
VOLUME = (0.02, 0.036)
LEAST_FRAMES, AGREEMENT = 2, 0.06
"""Limits of a standing person, by the fields of `Posture`. On masks rendered of 18 motions (walks, dances, jumps, a
cartwheel, a handstand, random poses; 520 poses of two people, each by three rigs) and drawn of 24 postures (bowing,
squatting, kneeling, sitting, kicking, leaping, arms up), those that passed were measured at 0.90 to 1.06 of their true
height, and no take of five frames with its own calibration raised a finding (0 of 108; of takes of 0.7 to 1.4 times
the size, 24).
"""


@dataclass(frozen=True, slots=True)
class Posture:
    """The shape of a person in one frame. height_mm : of the hull; reach_mm : its longest extent along an axis. All
    others are shares of the height. feet : of the lowest point over the floor (z = 0). legs : widest extent of the
    lower part. lean : how far any slab's middle lies from the upright line amid them, the lowest (feet) aside. head :
    widest extent of the top. volume : over the height cubed. centre : mean height of the volume. unseen : by how much
    a mask reaches above or below the hull, of the mask's height.
    """

    height_mm: float
    reach_mm: float
    feet: float
    legs: float
    lean: float
    head: float
    volume: float
    centre: float
    unseen: float

    @property
    def stands(self) -> bool:
        """Whether this can only be an upright person: legs under the trunk, nothing over the head, on the floor."""
        return (
            abs(self.feet) <= FEET
            and self.legs <= LEGS
            and self.lean <= LEAN
            and self.head <= HEAD
            and VOLUME[0] <= self.volume <= VOLUME[1]
            and self.centre >= CENTRE
            and self.unseen <= UNSEEN
        )


def postures(cameras: Sequence[Camera], masks: Mapping[int, Mapping[str, Bytes]]) -> tuple[Posture, ...]:
    """Of the frames (frame → camera → mask) in which there is one."""
    measured = (posture(cameras, views) for views in masks.values())
    return tuple(one for one in measured if one is not None)


def standing_height(measured: Sequence[Posture]) -> float | None:
    """The height (mm) of a person who stands in several frames and is as tall in each; None if not certain."""
    heights = [one.height_mm for one in measured if one.stands]
    if len(heights) < LEAST_FRAMES:
        return None
    middle = float(np.median(heights))
    return middle if max(heights) - min(heights) <= AGREEMENT * middle else None


def posture(cameras: Sequence[Camera], views: Mapping[str, Bytes]) -> Posture | None:
    """The shape of the person in a frame's masks, camera → (H, W), nonzero = person; None where fewer than two views
    have the whole person, or the hull is empty. A view that the picture's edge cuts says nothing of what lies outside.
    """
    seen = [camera for camera in cameras if camera.name in views and np.any(views[camera.name])]
    whole = [camera for camera in seen if not _cut(views[camera.name])]
    if len(whole) < 2:
        return None
    middle, reach = _surroundings(whole, views)
    steps = np.linspace(-reach, reach, CELLS)
    x, y, z = (part.ravel() for part in np.meshgrid(steps, steps, steps, indexing="ij"))
    points = middle + np.column_stack([x, y, z])
    for camera in seen:
        points = points[_covered(camera, views[camera.name], points, outside=camera not in whole)]
    if len(points) < 2 * SLABS:
        return None
    cell = float(steps[1] - steps[0])
    return _shape(points, cell, max(_unseen(camera, views[camera.name], points) for camera in whole))


def _cut(mask: Bytes) -> bool:
    return any(np.any(edge) for edge in (mask[0], mask[-1], mask[:, 0], mask[:, -1]))


def _surroundings(cameras: Sequence[Camera], views: Mapping[str, Bytes]) -> tuple[Array, float]:
    """The point nearest to the rays through the middles of the masks, (3,), and how far around it a person may be."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for camera in cameras:
        ahead = rays_of(camera, np.mean(np.nonzero(views[camera.name]), axis=1)[::-1][None])[0]
        across = np.eye(3) - np.outer(ahead, ahead)
        normal += across
        right += across @ camera.centre
    middle = np.linalg.solve(normal, right).astype(np.float64)
    reach = 0.0
    for camera in cameras:
        rows, columns = np.nonzero(views[camera.name])
        corners = [[c, r] for c in (columns.min(), columns.max()) for r in (rows.min(), rows.max())]
        towards = middle - camera.centre
        distance = float(np.linalg.norm(towards))
        angles = np.arccos(np.clip(rays_of(camera, np.array(corners, float)) @ towards / distance, -1.0, 1.0))
        reach = max(reach, distance * float(np.tan(min(angles.max(), 1.4))))
    return middle, reach


def _covered(camera: Camera, mask: Bytes, points: Array, *, outside: bool) -> NDArray[np.bool_]:
    """(K,) whether the points lie in the mask; `outside` : what is true of those out of the picture."""
    pixels, depth = project(camera, points)
    columns, rows = np.nan_to_num(np.round(pixels), nan=-1.0).astype(np.int64).T
    inside = (depth > 0) & (columns >= 0) & (rows >= 0) & (columns < mask.shape[1]) & (rows < mask.shape[0])
    covered = np.full(len(points), outside) & (depth > 0)
    covered[inside] = mask[rows[inside], columns[inside]] > 0
    return covered


def _shape(points: Array, cell: float, unseen: float) -> Posture:
    """The posture of a hull given as points (K, 3) of a grid, `cell` mm apart."""
    bottom, top = float(points[:, 2].min()) - 0.5 * cell, float(points[:, 2].max()) + 0.5 * cell
    height = top - bottom
    share = (points[:, 2] - bottom) / height
    lower, upper = points[share < LOWER, :2], points[share > TOP, :2]
    slab = np.minimum((share * SLABS).astype(int), SLABS - 1)
    middles = np.array(
        [np.median(points[slab == n, :2], axis=0) for n in range(1, SLABS) if np.any(slab == n)]
    )
    lean = float(np.linalg.norm(middles - np.median(middles, axis=0), axis=1).max()) / height
    return Posture(
        height,
        float(np.ptp(points, axis=0).max()) + cell,
        bottom / height,
        _extent(lower) / height,
        lean,
        _extent(upper) / height,
        len(points) * (cell / height) ** 3,
        float(share.mean()),
        unseen,
    )


def _extent(places: Array) -> float:
    """The widest extent of (K, 2) places over all directions."""
    angles = np.linspace(0.0, np.pi, 12, endpoint=False)
    along = places @ np.stack([np.cos(angles), np.sin(angles)])
    return float(np.ptp(along, axis=0).max()) if len(places) else 0.0


def _unseen(camera: Camera, mask: Bytes, points: Array) -> float:
    """By how much of its height a mask reaches further up or down than the hull does in its picture."""
    rows = np.flatnonzero(mask.any(axis=1))
    reached = project(camera, points)[0][:, 1]
    above, below = float(reached.min()) - rows[0], rows[-1] - float(reached.max())
    return float(max(above, below)) / len(rows)
