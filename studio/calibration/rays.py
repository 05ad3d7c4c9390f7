"""Pixels to rays: the other way round than `geometry.projection`, lens included."""

import cv2
import numpy as np

from studio.arrays import Array
from studio.geometry.camera import Camera


def rays_of(camera: Camera, pixels: Array) -> Array:
    """(K, 3) unit directions in the world from the camera's centre through (K, 2) pixels."""
    flat = cv2.undistortPoints(pixels[:, None], camera.matrix, camera.distortion)[:, 0]
    ahead = np.column_stack([flat, np.ones(len(flat))]) @ camera.rotation
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
