"""Whether a camera's picture shows a point."""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import picture_limit
from studio.foundations.geometry.projection import project


def sees(camera: Camera, points: Array) -> NDArray[np.bool_]:
    """Which world points (..., 3) mm lie in the camera's picture.

    Far outside the picture the distortion polynomial folds back into it; such points are not seen.
    """
    pixels, depth = project(camera, points)
    ahead = np.where(depth > 0.0, depth, 1.0)
    seen = points @ camera.rotation.T + camera.translation
    radius = (seen[..., 0] ** 2 + seen[..., 1] ** 2) / ahead**2
    size = np.array([camera.width, camera.height]) - 0.5
    inside = ((pixels >= -0.5) & (pixels < size)).all(axis=-1)
    return (depth > 0.0) & (radius <= picture_limit(camera)) & inside
