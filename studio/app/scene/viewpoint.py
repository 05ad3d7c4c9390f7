"""From where a body is looked at: framed, from its front, side or top, nearer to what the pointer is on.

An eye is six numbers, metres: its place and what is looked at. Up is z. Fields of view are vertical, radians.
"""

from typing import Literal

import numpy as np

from studio.body.model import BodyModel
from studio.foundations.arrays import Array

Eye = tuple[float, ...]
Preset = Literal["front", "side", "top"]

BROWSERS_OWN = 3.0, 3.0, 3.0, 0.0, 0.0, 0.0
"""Where viser's page stands until it is put somewhere, metres."""
FILLED, WIDEST = 0.8, 0.86
"""Of the view's height that a framed body fills, and at most of its width."""
WELL_FRAMED = 0.72, 0.88
"""Shares of the height between which a body needs not be framed again."""
CLOSEST = 0.3
"""Between the eye and the nearest point of a framed body, beside its size: from above that is its head."""
NEAREST, FARTHEST = 0.12, 9.0
"""Distances of the eye from what it looks at, beside the body's size."""
ASTRAY = 0.6
"""How far beyond the body, beside its size, a zoom may take what is looked at."""
_TOP_ELEVATION = 1.5
_LEVEL = 0.12
"""Radians above the body: straight down no direction is up, and a person is looked at from a little above."""


def axes(eye: Eye) -> tuple[Array, Array, Array]:
    """(3,) each: right, up and forward of an eye."""
    place, target = np.array(eye[:3]), np.array(eye[3:])
    forward = target - place
    forward = forward / max(float(np.linalg.norm(forward)), 1e-9)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(right))
    right = np.array([1.0, 0.0, 0.0]) if size < 1e-6 else right / size
    return right, np.cross(right, forward), forward


def on_screen(points: Array, eye: Eye, fov: float, aspect: float) -> Array:
    """(K, 3): points (K, 3) metres as shares of the view (x right, y down), and metres before the eye."""
    right, up, forward = axes(eye)
    away = points - np.array(eye[:3])
    depth = away @ forward
    half = np.tan(fov / 2.0) * np.maximum(depth, 1e-6)
    across, down = (away @ right) / (half * aspect), -(away @ up) / half
    return np.stack([(across + 1.0) / 2.0, (down + 1.0) / 2.0, depth], axis=-1)


def is_browsers_own(eye: Eye) -> bool:
    """Whether a viewer stands where its browser began: it was not put anywhere yet, nor moved."""
    return bool(np.allclose(eye, BROWSERS_OWN, atol=1e-6))


def framed(points: Array, toward: Array, fov: float, aspect: float, filled: float = FILLED) -> Eye:
    """The eye that sees points (K, 3) metres fill the view. toward : (3,) from them to the eye."""
    right, up, forward = axes((*toward, 0.0, 0.0, 0.0))
    along = points @ forward
    ways = ((points @ right, np.tan(fov / 2.0) * aspect * WIDEST), (points @ up, np.tan(fov / 2.0) * filled))
    # Of every point the view's edges say how far behind 0 the eye has to be: least where both edges touch.
    behind = max(
        float(((side / slope - along).max() + (-side / slope - along).max()) / 2.0) for side, slope in ways
    )
    behind = max(behind, CLOSEST * float(np.linalg.norm(np.ptp(points, axis=0))) - float(along.min()))
    across, high = (
        float(((side - slope * (along + behind)).max() + (side + slope * (along + behind)).min()) / 2.0)
        for side, slope in ways
    )
    place = across * right + high * up - behind * forward
    target = place + ((float(along.min()) + float(along.max())) / 2.0 + behind) * forward
    return (*map(float, place), *map(float, target))


def is_well_framed(points: Array, eye: Eye, fov: float, aspect: float) -> bool:
    """Whether all of a body is seen and neither small nor cut."""
    seen = on_screen(points, eye, fov, aspect)
    height = float(np.ptp(seen[:, 1]))
    inside = bool((seen[:, :2] > 0.0).all() and (seen[:, :2] < 1.0).all() and (seen[:, 2] > 0.0).all())
    return inside and WELL_FRAMED[0] <= height <= WELL_FRAMED[1]


def is_in_sight(points: Array, eye: Eye, fov: float, aspect: float) -> bool:
    seen = on_screen(points, eye, fov, aspect)
    inside = (seen[:, 0] > 0.0) & (seen[:, 0] < 1.0) & (seen[:, 1] > 0.0) & (seen[:, 1] < 1.0)
    return bool((inside & (seen[:, 2] > 0.0)).any())


def direction(preset: Preset, body: BodyModel, ends: Array) -> Array:
    """(3,) from a body to the eye of a preset. ends : (L, 2, 3) of its limbs; without sides it is seen from least y."""
    forward = facing(body, ends)
    if preset == "top":
        return np.cos(_TOP_ELEVATION) * forward + np.sin(_TOP_ELEVATION) * np.array([0.0, 0.0, 1.0])
    level = forward if preset == "front" else np.cross(forward, [0.0, 0.0, 1.0])
    return level + np.array([0.0, 0.0, _LEVEL])


def facing(body: BodyModel, ends: Array) -> Array:
    """(3,) the level direction to which a body turns its front, by where its left and right limbs are."""
    sides = [
        ends[[at for at, limb in enumerate(body.drawn) if limb.side == side]].reshape(-1, 3)
        for side in ("left", "right")
    ]
    if not all(len(side) for side in sides):
        return np.array([0.0, -1.0, 0.0])
    leftwards = sides[0].mean(axis=0) - sides[1].mean(axis=0)
    forward = np.cross(leftwards, [0.0, 0.0, 1.0])
    size = float(np.linalg.norm(forward))
    return np.array([0.0, -1.0, 0.0]) if size < 1e-6 else forward / size


def between(one: Eye, other: Eye, share: float) -> Eye:
    """The eye after a share 0..1 of the way between two: about what is looked at, eased at both ends."""
    share = min(1.0, max(0.0, share))
    share = share * share * (3.0 - 2.0 * share)
    targets = np.array(one[3:]), np.array(other[3:])
    aways = np.array(one[:3]) - targets[0], np.array(other[:3]) - targets[1]
    distances = [max(float(np.linalg.norm(away)), 1e-6) for away in aways]
    turn = [np.arctan2(away[1], away[0]) for away in aways]
    rise = [
        np.arcsin(np.clip(away[2] / size, -1.0, 1.0)) for away, size in zip(aways, distances, strict=True)
    ]
    across = np.mod(turn[1] - turn[0] + np.pi, 2.0 * np.pi) - np.pi
    bearing, lift = turn[0] + share * across, rise[0] + share * (rise[1] - rise[0])
    distance = distances[0] ** (1.0 - share) * distances[1] ** share
    target = targets[0] + share * (targets[1] - targets[0])
    level = np.cos(lift)
    place = target + distance * np.array([level * np.cos(bearing), level * np.sin(bearing), np.sin(lift)])
    return (*map(float, place), *map(float, target))


def zoomed(eye: Eye, factor: float, at: tuple[float, float], fov: float, aspect: float, points: Array) -> Eye:
    """The eye after a zoom to what lies under the pointer, which stays there. factor : of the distance. at : where the
    pointer is, shares of the view. points : (K, 3) of the body, which is never lost.
    """
    right, up, forward = axes(eye)
    place, target = np.array(eye[:3]), np.array(eye[3:])
    distance, size = float(np.linalg.norm(target - place)), max(float(np.ptp(points, axis=0).max()), 1e-3)
    wanted = float(
        np.clip(distance * factor, NEAREST * size, max(FARTHEST * size, min(distance, distance * factor)))
    )
    half = np.tan(fov / 2.0)
    ray = forward + (2.0 * at[0] - 1.0) * half * aspect * right - (2.0 * at[1] - 1.0) * half * up
    under = place + distance * ray
    after = under + (wanted / distance) * (target - under)
    low, high = points.min(axis=0) - ASTRAY * size, points.max(axis=0) + ASTRAY * size
    if wanted > distance:
        # On the way out the body comes back into the middle.
        middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
        after = after + (1.0 - distance / wanted) * (middle - after)
    after = np.clip(after, np.minimum(low, target), np.maximum(high, target))
    return (*map(float, after - wanted * forward), *map(float, after))
