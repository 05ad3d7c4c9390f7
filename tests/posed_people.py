"""People drawn as masks in any posture: upright, bent, crouching, kneeling, sitting, leaping, arms raised."""

import cv2
import numpy as np
from numpy.typing import NDArray

from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.projection import project
from studio.foundations.geometry.rotations import axis_turn
from studio.results.drawing_footage.gait import add_arm, trunk

Masks = dict[int, dict[str, NDArray[np.uint8]]]

SOLE = 0.022
BONES = {
    ("pelvis", "head"): 0.070,
    ("left_upper_arm", "right_upper_arm"): 0.040,
    ("left_thigh", "right_thigh"): 0.065,
    ("head", "head_top"): 0.048,
    **{(f"{side}_{start}", f"{side}_{end}"): radius for side in SIDES for start, end, radius in (
        ("thigh", "shin", 0.045), ("shin", "foot", 0.030), ("foot", "toes", SOLE), ("upper_arm", "forearm", 0.030),
        ("forearm", "hand", 0.023), ("hand", "fingers", 0.020),
    )},
}  # fmt: skip
"""Radii between joints as shares of the height."""


def posed(
    skeleton: Skeleton,
    rng: np.random.Generator,
    *,
    bend: float = 0.0,
    thighs: tuple[float, float] = (0.0, 0.0),
    knees: tuple[float, float] = (0.0, 0.0),
    arms: tuple[float, float] = (0.0, 8.0),
    elbows: float = 10.0,
    over_floor: float = 0.0,
) -> PersonMotion:
    """One pose, degrees, any heading: the trunk bent forwards, thighs forwards, knees bent, arms (forwards, sideways);
    the lowest point lies `over_floor` mm over the floor.
    """
    one = np.ones(1)

    def turned(degrees: float) -> Array:
        return np.radians(degrees + rng.normal(0.0, 2.0)) * one

    turns = trunk(rng.uniform(-np.pi, np.pi) * one, turned(bend), turned(0.0), turned(0.0))
    upright = trunk(np.arctan2(turns["pelvis"][:, 1, 0], turns["pelvis"][:, 0, 0]), 0.0, 0.0, 0.0)["pelvis"]
    for side, thigh, knee in zip(SIDES, thighs, knees, strict=True):
        sign = 1.0 if side == "left" else -1.0
        add_arm(turns, side, turned(arms[0]), turned(arms[1]), turned(elbows))
        turns[f"{side}_thigh"] = upright @ axis_turn(1, -turned(thigh)) @ axis_turn(0, sign * turned(4.0))
        turns[f"{side}_shin"] = turns[f"{side}_thigh"] @ axis_turn(1, turned(knee))
        turns[f"{side}_foot"] = turns[f"{side}_shin"] if knee > 80.0 and thigh < 30.0 else upright
    place = np.array([[*rng.uniform(-300.0, 300.0, 2), 0.0]])
    lowest = min(points[0, 2] for points in joint_points(PersonMotion(skeleton, 60.0, place, turns)).values())
    place[0, 2] = over_floor + SOLE * skeleton.height - lowest
    return PersonMotion(skeleton, 60.0, place, turns)


def masks_of(motion: PersonMotion, cameras: tuple[Camera, ...], stout: float = 1.0) -> dict[str, NDArray]:
    """Camera → (H, W), 0 and 255: discs along the bones of the motion's first frame."""
    points = {name: at[0] for name, at in joint_points(motion).items()}
    return {camera.name: _drawn(points, camera, stout * motion.skeleton.height) for camera in cameras}


def _drawn(points: dict[str, Array], camera: Camera, size: float) -> NDArray[np.uint8]:
    mask = np.zeros((camera.height, camera.width), np.uint8)
    for (start, end), share in BONES.items():
        bone = points[end] - points[start]
        last = 1.0 - share * size / float(np.linalg.norm(bone)) if end == "head_top" else 1.0
        line = points[start] + np.linspace(0.0, last, 16)[:, None] * bone
        pixels, depth = project(camera, line)
        for pixel, far in zip(pixels, depth, strict=True):
            wide = max(1, round(float(share * size * camera.matrix[1, 1] / far)))
            cv2.circle(mask, (round(float(pixel[0])), round(float(pixel[1]))), wide, 255, -1)
    return mask
