"""From the studio's world (mm, z up) to a file's: units and which axis is up."""

from dataclasses import dataclass

import numpy as np

from studio.arrays import Array
from studio.export.options import MM_PER_UNIT

# x forward, y left, z up becomes z forward, x left, y up: as TRC files have it, and as Blender and Maya expect a BVH.
Y_UP = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, slots=True)
class Axes:
    """unit : "mm", "cm" or "m". up : "y" or "z"."""

    unit: str
    up: str

    @property
    def turn(self) -> Array:
        """(3, 3) from the world's axes to the file's."""
        return Y_UP if self.up == "y" else np.eye(3)

    @property
    def mm(self) -> float:
        """Millimetres in one unit of the file."""
        return MM_PER_UNIT[self.unit]

    def points(self, points: Array) -> Array:
        """Points (..., 3) mm of the world in the file's units and axes."""
        return points @ self.turn.T / self.mm

    def points_back(self, points: Array) -> Array:
        """Points (..., 3) of the file in the world, mm."""
        return points @ self.turn * self.mm

    def turns(self, turns: Array) -> Array:
        """Rotations (..., 3, 3) of the world written in the file's axes."""
        return self.turn @ turns @ self.turn.T

    def turns_back(self, turns: Array) -> Array:
        """Rotations (..., 3, 3) of the file written in the world's axes."""
        return self.turn.T @ turns @ self.turn
