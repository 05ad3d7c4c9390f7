"""Landmarks that were clicked in several views, in space: which clicks agree, and where each landmark is.

All views of a landmark count if each click is within a tolerance of the point that they give together. Else, of three
views or more, those count that agree with the point of some two of them, if one choice has more than any other.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.footage.calibration.floor import triangulated
from studio.foundations.arrays import Array, Mask
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

LEAST_ANGLE = np.radians(1.0)
"""Between the rays of a landmark's views: below it, how far away it is cannot be told."""
FEWEST_TO_OUTVOTE = 3


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkPoint:
    """A landmark in space.

    point : (3,) mm; None where its views disagree, or look along nearly the same line.
    off : (V,) pixels between each click and the point's projection; where there is no point, of the point that all
        views give together.
    agrees : (V,) which clicks the point was made of.
    flat : whether its views look along nearly the same line.
    """

    point: Array | None
    off: Array
    agrees: Mask
    flat: bool = False


def landmark_point(cameras: Sequence[Camera], pixels: Array, tolerance: float) -> LandmarkPoint:
    """Where a landmark is that two views or more have. pixels : (V, 2). tolerance : pixels."""
    everyone = np.ones(len(cameras), dtype=np.bool_)
    point, off = _point_of(cameras, pixels, everyone)
    best = everyone
    if not (off <= tolerance).all():
        agreeing = _outvoting(cameras, pixels, tolerance)
        if agreeing is None:
            return LandmarkPoint(None, off, np.zeros_like(everyone))
        best = agreeing
        point, off = _point_of(cameras, pixels, best)
    if (
        _widest_angle([camera for camera, used in zip(cameras, best, strict=True) if used], point)
        < LEAST_ANGLE
    ):
        return LandmarkPoint(None, off, np.zeros_like(everyone), flat=True)
    return LandmarkPoint(point, off, best)


def _outvoting(cameras: Sequence[Camera], pixels: Array, tolerance: float) -> Mask | None:
    """The largest set of views, of three or more, that agree; None where none does, or several pairs do."""
    if len(cameras) < FEWEST_TO_OUTVOTE:
        return None
    sets = dict[tuple[bool, ...], float]()
    for pair in itertools.combinations(range(len(cameras)), 2):
        used = np.isin(np.arange(len(cameras)), pair)
        off = _point_of(cameras, pixels, used)[1]
        agrees = off <= tolerance
        if agrees[used].all():
            sets[tuple(agrees.tolist())] = float(off[agrees].max())
    if not sets:
        return None
    most = max(sum(one) for one in sets)
    largest = [one for one in sets if sum(one) == most]
    if most == 2 and len(largest) > 1:
        return None
    return np.array(min(largest, key=lambda one: sets[one]), dtype=np.bool_)


def _point_of(cameras: Sequence[Camera], pixels: Array, used: Mask) -> tuple[Array, Array]:
    """The point (3,) of some views, and how far every click (V,) is from it, pixels."""
    clicks = {camera.name: pixels[at][None] for at, camera in enumerate(cameras) if used[at]}
    point = triangulated(cameras, clicks)[0]
    seen = np.array([project(camera, point)[0] for camera in cameras])
    off = np.linalg.norm(seen - pixels, axis=1)
    return point, np.where(np.isfinite(off), off, np.inf)


def _widest_angle(cameras: Sequence[Camera], point: Array) -> float:
    rays = np.array([point - camera.centre for camera in cameras])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    crossed = np.linalg.norm(np.cross(rays[:, None], rays[None]), axis=-1)
    return float(np.arcsin(np.clip(crossed, 0.0, 1.0)).max())
