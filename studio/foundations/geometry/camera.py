"""A calibrated camera: pinhole with radial and tangential distortion, OpenCV axes (x right, y down, z forward)."""

from dataclasses import dataclass, replace

import numpy as np

from studio.foundations.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera with all its parameters.

    width, height : picture size, pixels; the origin is the centre of the top-left pixel.
    matrix : (3, 3) intrinsic matrix, pixels (may hold a skew at [0, 1]).
    distortion : (5,) k1 k2 p1 p2 k3.
    rotation, translation : camera_from_world, (3, 3) and (3,) mm: x_camera = rotation @ x_world + translation.
    quarter_turns : clockwise turns by 90 degrees that *show* the picture upright (display only).
    """

    name: str
    width: int
    height: int
    matrix: Array
    distortion: Array
    rotation: Array
    translation: Array
    quarter_turns: int = 0

    @property
    def centre(self) -> Array:
        """(3,) position of the camera in the world, mm."""
        return -self.rotation.T @ self.translation

    def resized(self, width: int, height: int) -> "Camera":
        """The camera of the same pictures resized to width x height pixels."""
        across, down = width / self.width, height / self.height
        scale = np.array([[across, 0.0, 0.5 * across - 0.5], [0.0, down, 0.5 * down - 0.5], [0.0, 0.0, 1.0]])
        return replace(self, width=width, height=height, matrix=scale @ self.matrix)

    def reduced(self, least_side: int) -> "Camera":
        """The camera of its pictures made smaller by the largest whole factor that leaves their shorter side at least
        `least_side` pixels; the camera itself where they are smaller than twice that.
        """
        factor = max(1, min(self.width, self.height) // least_side)
        if factor == 1:
            return self
        return self.resized(-(-self.width // factor), -(-self.height // factor))
