"""A body of cones in a ring of cameras: its exact masks and which points lie in it, without the studio's hull."""

import numpy as np
from looking_cameras import turned_to
from scipy.spatial import ConvexHull

from studio.body.forward_kinematics import limb_frames
from studio.body.model import BodyModel, kinematic_tables
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project

ROUND = np.linspace(0.0, 2.0 * np.pi, 96, endpoint=False)
DISTORTION = (-0.32, 0.14, 0.001, -0.001, 0.0)


def ring(count: int, width: int = 320, height: int = 240, distance: float = 3300.0) -> tuple[Camera, ...]:
    """Cameras with barrel distortion, as far apart as can be, at head's height and above, the person filling them."""
    cameras = []
    for number in range(count):
        bearing = 2.0 * np.pi * number / count + 0.3
        up = 2500.0 if number % 2 else 1500.0
        centre = np.array([distance * np.cos(bearing), distance * np.sin(bearing), up])
        rotation = turned_to(centre, (0.0, 0.0, 950.0))
        focal = 0.95 * width
        matrix = np.array([[focal, 0.0, width / 2 - 3.0], [0.0, focal, height / 2 + 2.0], [0.0, 0.0, 1.0]])
        cameras.append(
            Camera(f"ring{number}", width, height, matrix, np.array(DISTORTION), rotation, -rotation @ centre)
        )
    return tuple(cameras)


class Cones:
    """The drawn limbs of one pose as solid cones."""

    def __init__(self, body: BodyModel, pose: np.ndarray) -> None:
        self.shapes = kinematic_tables(body).limb_shape
        self.frames = limb_frames(body, pose[None])[0]

    def mask(self, camera: Camera) -> np.ndarray:
        """(H, W) 255 where a pixel's centre lies in a cone's silhouette: the convex hull of its two end circles."""
        mask = np.zeros((camera.height, camera.width), np.uint8)
        x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        pixels = np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
        for (length, start, end, sx, sy), frame in zip(self.shapes, self.frames, strict=True):
            rims = [
                np.stack([r * sx * np.cos(ROUND), r * sy * np.sin(ROUND), np.full_like(ROUND, z)], axis=1)
                for r, z in ((start, 0.0), (end, length))
            ]
            points, _ = project(camera, np.concatenate(rims) @ frame[:, :3].T + frame[:, 3])
            inside = (ConvexHull(points).equations @ pixels <= 0.0).all(axis=0)
            mask[inside.reshape(mask.shape)] = 255
        return mask

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Which points (N, 3) mm lie in any cone."""
        found = np.zeros(len(points), dtype=bool)
        for (length, start, end, sx, sy), frame in zip(self.shapes, self.frames, strict=True):
            own = (points - frame[:, 3]) @ frame[:, :3]
            along = own[:, 2] / length
            radius = start + along * (end - start)
            across = np.hypot(own[:, 0] / sx, own[:, 1] / sy)
            found |= (along >= 0.0) & (along <= 1.0) & (across <= radius)
        return found

    def points(self, spacing: float) -> np.ndarray:
        """(N, 3) a grid's points that lie in the body; each stands for spacing³ of its volume."""
        ends = np.concatenate(
            [self.frames[:, :, 3], self.frames[:, :, 3] + self.frames[:, :, 2] * self.shapes[:, :1]]
        )
        low, high = ends.min(axis=0) - 250.0, ends.max(axis=0) + 250.0
        axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return grid[self.contains(grid)]


def evidence_of(
    masks: list[np.ndarray], cameras: tuple[Camera, ...], rng: np.random.Generator
) -> FrameEvidence:
    """Masks as a frame, in noisy pictures that are bright where the mask is."""
    views = []
    for camera, mask in zip(cameras, masks, strict=True):
        level = 60.0 + 90.0 * (mask[..., None] > 0) + rng.normal(0.0, 3.0, (*mask.shape, 3))
        picture = np.clip(np.round(level), 0, 255).astype(np.uint8)
        views.append(ViewEvidence(camera.name, picture, mask, np.zeros_like(mask)))
    return FrameEvidence(0, tuple(views))
