"""A calibrated camera: pinhole with radial and tangential distortion, OpenCV axes (x right, y down, z forward)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera that is complete: it exists only when every value is known.

    width, height : picture size, pixels; the origin is the centre of the top-left pixel.
    matrix : (3, 3) intrinsic matrix, pixels (may hold a skew at [0, 1]). distortion : (5,) k1 k2 p1 p2 k3.
    rotation, translation : camera_from_world, (3, 3) and (3,) mm: x_camera = rotation @ x_world + translation.
    quarter_turns : how often the picture is turned by 90 degrees clockwise to be *shown* upright (display only).
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
