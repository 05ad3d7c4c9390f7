"""Rendered people in a furnished room, with exact masks: of one person, and of two in one picture."""

from dataclasses import dataclass, replace

import numpy as np
from sized_people import drawn_and_seen, renderer_of

from studio.body.person import PersonMotion
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera import Camera
from studio.results.drawing_footage.cameras import RIGS
from studio.results.drawing_footage.motions import make_motion

SIZE = (480, 360)
FPS = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """pictures, masks : (H, W, 3) and (H, W) by camera and frame. empty : (H, W, 3) by camera. motion : whose."""

    cameras: tuple[Camera, ...]
    pictures: dict[tuple[str, int], Bytes]
    masks: dict[tuple[str, int], Bytes]
    empty: dict[str, Bytes]
    motion: PersonMotion | None = None


def rendered_walk(frames: int, at: tuple[float, float] = (0.0, 0.0), seed: int = 3) -> Rendered:
    """Somebody who walks, seen from four corners; moved by `at`, mm."""
    skeleton, _, _ = drawn_and_seen(np.random.default_rng(seed))
    cameras = RIGS["corners"](SIZE, np.random.default_rng(1))
    motion = make_motion("walk", skeleton, frames, FPS, {})
    place: Array = np.array([*at, 0.0])
    motion = replace(motion, root=motion.root + place)
    renderer = renderer_of(cameras, motion, seed, noise=1.5)
    found = Rendered(cameras, {}, {}, {c.name: renderer.empty(i, 0) for i, c in enumerate(cameras)}, motion)
    for frame in range(frames):
        shadow = renderer.shadow(frame)
        for index, camera in enumerate(cameras):
            key = camera.name, frame
            found.pictures[key], found.masks[key] = renderer.picture(index, frame, shadow)
    return found


def overlap(one: Bytes, other: Bytes) -> float:
    """Intersection over union of two masks."""
    return float(((one > 0) & (other > 0)).sum() / ((one > 0) | (other > 0)).sum())
