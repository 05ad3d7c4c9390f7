"""The vertical, as the cameras show it: people set cameras up level, so that the rows of all pictures are horizontal.

A world's axes say nothing of it where the world is a camera's own frame, as aniposelib and FreeMoCap leave it. What the
rows leave over follows from how well they agree; where they do not, the pictures' common up is a rough guess.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera

LEVEL_DEGREES = {2: 6.0, 3: 4.0}
MANY_LEVEL_DEGREES = 3.0
"""Phones on tripods are level to about this; the fewer there are, the less their agreement proves."""
MOST_ROLL_DEGREES = 10.0
MOST_UNCERTAIN_DEGREES = 10.0
MOST_APART_DEGREES = 30.0
"""Rows of a few rolled pictures agree by chance: rolled ones are not believed this far off the pictures' common up."""
LEAST_COMMON = 0.5
"""Length of the mean of the pictures' ups from which on it says something."""
ORIGIN_MM = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Vertical:
    """up : (3,) unit vector, in the cameras' world. degrees : how far it may be off. level : whether it is that of
    level pictures, which is the better evidence.
    """

    up: Array
    degrees: float
    level: bool

    def off(self, axis: Array) -> float:
        """Degrees between it and the (3,) unit vector `axis`."""
        return float(np.degrees(np.arccos(np.clip(self.up @ axis, -1.0, 1.0))))


def common_vertical(cameras: Sequence[Camera]) -> Vertical | None:
    """What the cameras show of the vertical; None where they show nothing (one that looks down, all rolled)."""
    ups = -np.array([camera.rotation[1] for camera in cameras])
    mean = ups.mean(axis=0)
    return _of_level_rows(cameras, ups) or (
        Vertical(mean / np.linalg.norm(mean), 30.0, level=False)
        if np.linalg.norm(mean) >= LEAST_COMMON
        else None
    )


def _of_level_rows(cameras: Sequence[Camera], ups: Array) -> Vertical | None:
    rows = np.array([camera.rotation[0] for camera in cameras])
    if len(rows) < 2:
        return None
    values, vectors = np.linalg.eigh(rows.T @ rows)
    up: Array = vectors[:, 0]
    up = up if float(np.mean(ups @ up)) > 0.0 else -up
    roll = np.degrees(np.sqrt(float(np.sum((rows @ up) ** 2)) / max(1, len(rows) - 2)))
    least = LEVEL_DEGREES.get(len(rows), MANY_LEVEL_DEGREES)
    # Rows that are nearly parallel leave the vertical free to turn about them.
    degrees = max(float(roll), least) / max(1e-6, float(np.sqrt(max(values[1], 0.0))))
    if roll > MOST_ROLL_DEGREES or degrees > MOST_UNCERTAIN_DEGREES or (ups @ up).min() <= 0.0:
        return None
    mean = ups.mean(axis=0)
    apart = up @ mean < np.cos(np.radians(MOST_APART_DEGREES)) * np.linalg.norm(mean)
    return None if apart and roll > least else Vertical(up, degrees, level=True)


def camera_at_origin(cameras: Sequence[Camera]) -> str:
    """The camera whose lens is the world's origin, "" for none: such a world knows nothing of the floor."""
    at = [camera.name for camera in cameras if np.linalg.norm(camera.centre) < ORIGIN_MM]
    return at[0] if len(at) == 1 and len(cameras) > 1 else ""


def level_world(vertical: Array) -> Array:
    """(3, 3) rows: the axes of a world with z along `vertical` (3,), x as near to the old x as that leaves it."""
    old = np.array([1.0, 0.0, 0.0]) if abs(vertical[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x: Array = old - (old @ vertical) * vertical
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(vertical, x), vertical])
