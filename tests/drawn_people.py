"""Masks of a body's cones, drawn with OpenCV as the hulls of their ends: an artist of its own, and a rough one."""

import cv2
import numpy as np
from looking_cameras import turned_to
from numpy.typing import NDArray

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

RING = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)


def ring_of_cameras(
    count: int, width: int = 320, height: int = 240, distance: float = 3500.0
) -> tuple[Camera, ...]:
    """Cameras on a circle about a person who stands at the origin, 2 m up, looking at their middle."""
    cameras = []
    for number in range(count):
        angle = 2.0 * np.pi * number / count + 0.4
        centre = np.array([distance * np.cos(angle), distance * np.sin(angle), 2000.0])
        rotation = turned_to(centre, (0.0, 0.0, 950.0))
        focal = 0.95 * width * distance / 3500.0
        matrix = np.array([[focal, 0.0, (width - 1) / 2], [0.0, focal, (height - 1) / 2], [0.0, 0.0, 1.0]])
        cameras.append(
            Camera(f"cam{number + 1}", width, height, matrix, np.zeros(5), rotation, -rotation @ centre)
        )
    return tuple(cameras)


def drawn_outlines(body: BodyModel, pose: Array, camera: Camera) -> list[NDArray[np.int32]]:
    """Of each drawn limb the convex hull of two discs that stand across its axis, pixels."""
    found = []
    for limb, frame in zip(body.drawn, limb_frames(body, pose)[0], strict=True):
        across = np.stack([limb.scale_x * np.cos(RING), limb.scale_y * np.sin(RING), 0.0 * RING], axis=1)
        ends = [
            radius * across + [0.0, 0.0, along]
            for radius, along in ((limb.radius_start, 0.0), (limb.radius_end, limb.length))
        ]
        points = np.concatenate(ends) @ frame[:, :3].T + frame[:, 3]
        found.append(cv2.convexHull(np.round(project(camera, points)[0]).astype(np.int32)))
    return found


def drawn_mask(body: BodyModel, pose: Array, camera: Camera) -> NDArray[np.uint8]:
    """(H, W) 0 and 255, of all limbs' outlines."""
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for outline in drawn_outlines(body, pose, camera):
        cv2.fillConvexPoly(mask, outline, 255)
    return mask


def drawn_evidence(
    body: BodyModel, pose: Array | None, cameras: tuple[Camera, ...], frame: int = 0
) -> FrameEvidence:
    """A frame of somebody bright before noise; None: nobody there."""
    rng, views = np.random.default_rng(frame), []
    for camera in cameras:
        size = (camera.height, camera.width)
        mask = np.zeros(size, np.uint8) if pose is None else drawn_mask(body, pose, camera)
        shade = rng.integers(70, 110, (*size, 3), dtype=np.uint8)
        picture = np.where(mask[..., None] > 0, np.uint8(200), shade)
        near = cv2.GaussianBlur(cv2.Canny(mask, 50, 150), (0, 0), 1.5)
        edges = cv2.normalize(near, np.empty_like(near), 0, 255, cv2.NORM_MINMAX)
        views.append(ViewEvidence(camera.name, picture, mask, edges.astype(np.uint8)))
    return FrameEvidence(frame, tuple(views))
