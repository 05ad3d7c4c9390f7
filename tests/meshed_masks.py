"""Masks of triangles, drawn by OpenCV: another artist than the tracker's."""

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import joint_frames
from studio.body.model import BodyModel
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

SHIFT = 4


def triangles_mask(camera: Camera, triangles: Array) -> NDArray[np.uint8]:
    """(H, W) 0 and 255: what triangles (F, 3, 3) in the world, mm, cover of a picture."""
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for corners in np.round(project(camera, triangles)[0] * (1 << SHIFT)).astype(np.int32):
        cv2.fillConvexPoly(mask, corners, (255,), cv2.LINE_8, SHIFT)
    return mask


def posed_triangles(body: BodyModel, pose: Array) -> Array:
    """(F, 3, 3) all triangles of a body's meshes in a pose (D,)."""
    frames, found = joint_frames(body, pose)[0], list[Array]()
    for mesh in body.meshes:
        points = mesh.points @ frames[mesh.joint, :, :3].T + frames[mesh.joint, :, 3]
        found.append(points[mesh.triangles])
    return np.concatenate(found)
