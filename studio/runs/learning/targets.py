"""Targets of a body's pose in every frame: positions of its markers, directions of its head, hands and feet.

Fifteen markers at the joints leave open the rotation of head and feet; recorded skeletons have both.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from studio.body.forward_kinematics import joint_frames, marker_points
from studio.body.model import BodyModel, kinematic_tables
from studio.body.person import MARKERS, SIDES, PersonMotion, Skeleton, marker_motion
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError

HEAD = "head"
TIPS = tuple(f"{side} {part}" for side in SIDES for part in ("hand", "foot"))
POINTING: dict[str, tuple[float, float, float]] = {
    HEAD: (1.0, 0.0, 0.0),
    **{name: (0.0, 0.0, -1.0) if name.endswith("hand") else (1.0, 0.0, 0.0) for name in TIPS},
}
"""Direction of each limb in the frame of the synthetic skeleton's segment."""

# Shares of the height, for the skeleton's dimensions that a body lacks.
HAND_SHARE, FOOT_SHARE, ANKLE_SHARE = 0.108, 0.152, 0.045


@dataclass(frozen=True, slots=True, eq=False)
class Pointer:
    """A limb's direction: unit `axis` (3,) in the frame of joint number `joint`."""

    limb: str
    joint: int
    axis: Array


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Targets over F frames, world z up.

    names : markers. points : (F, M, 3) mm, NaN where missing. directions : limb name to (F, 3) unit vectors.
    """

    names: tuple[str, ...]
    points: Array
    directions: Mapping[str, Array]

    @property
    def frame_count(self) -> int:
        return len(self.points)


def marker_names(body: BodyModel) -> tuple[str, ...]:
    """The body's markers. Raises BodyError for one without the markers of a person."""
    names = tuple(marker.name for marker in body.markers)
    missing = sorted(set(MARKERS) - set(names))
    if missing:
        raise BodyError(
            f"Body '{body.name}' has no marker '{missing[0]}', so it cannot take a person's motion.",
            f"Choose a body with the markers {', '.join(MARKERS)}, or learn from runs of this body.",
        )
    return names


def pointers_of(body: BodyModel, *, movable: bool) -> tuple[Pointer, ...]:
    """The pointers of a body's head, hands and feet; `movable`: only of those with their own rotation parameter."""
    frames = joint_frames(body, body.neutral)[0]
    shapes, pointers = kinematic_tables(body).limb_shape, list[Pointer]()
    for limb, shape in zip(body.drawn, shapes, strict=True):
        if limb.name not in POINTING or (movable and not body.joints[limb.joint].parameters):
            continue
        if limb.name == HEAD:
            axis = frames[limb.joint, :, :3].T @ _rest_forward(body)
        else:
            axis = np.array([0.0, 0.0, np.sign(shape[0])])
        pointers.append(Pointer(limb.name, limb.joint, axis))
    return tuple(pointers)


def directions(pointers: tuple[Pointer, ...], frames: Array) -> Array:
    """(N, P, 3) directions of the pointers. frames : (N, F, 3, 4) world_from_joint."""
    joints = np.array([pointer.joint for pointer in pointers], dtype=np.int64)
    axes = np.array([pointer.axis for pointer in pointers]).reshape(-1, 3, 1)
    return (frames[:, joints, :, :3] @ axes)[..., 0]


def of_person(motion: PersonMotion) -> Targets:
    """Targets of a synthetic person: markers, and directions of head, hands and feet."""
    pointing = {
        limb: motion.turns[limb.replace(" ", "_")] @ np.array(axis) for limb, axis in POINTING.items()
    }
    markers = marker_motion(motion)
    return Targets(markers.names, markers.positions, pointing)


def of_poses(body: BodyModel, poses: Array) -> Targets:
    """Targets of another body: markers and pointers along poses (F, D)."""
    pointers = pointers_of(body, movable=False)
    along = directions(pointers, joint_frames(body, poses))
    pointing = {pointer.limb: along[:, place] for place, pointer in enumerate(pointers)}
    names = tuple(marker.name for marker in body.markers)
    return Targets(names, marker_points(body, poses), pointing)


def skeleton_of_body(body: BodyModel) -> Skeleton:
    """The synthetic skeleton with the body's proportions, from where its markers are in the rest pose.

    Raises BodyError for a body without a person's markers.
    """
    names = marker_names(body)
    points = dict(zip(names, marker_points(body, body.neutral)[0], strict=True))
    up, left = _rest_up(points), _rest_left(points)
    left = left - up * (left @ up)
    left /= np.linalg.norm(left)
    axes = np.stack([np.cross(left, up), left, up])

    def apart(one: str, other: str) -> tuple[float, float]:
        right, left = (float(np.linalg.norm(points[s + one] - points[s + other])) for s in "RL")
        return left, right

    def shoulder(letter: str, sign: float) -> tuple[float, float, float]:
        forward, out, high = axes @ (points[f"{letter}Shoulder"] - points["Neck"])
        return float(forward), float(sign * out), float(high)

    thigh, shin = apart("Hip", "Knee"), apart("Knee", "Ankle")
    trunk = float(np.linalg.norm(points["Neck"] - points["Hip"]))
    head = float(np.linalg.norm(points["Head"] - points["Neck"]))
    height = (np.mean(thigh) + np.mean(shin) + trunk + head) / (1.0 - ANKLE_SHARE)
    half = tuple(float(np.linalg.norm(points[f"{letter}Hip"] - points["Hip"])) for letter in "LR")
    return Skeleton(
        height=float(height),
        trunk=trunk,
        head=head,
        hip_half_width=(half[0], half[1]),
        thigh=thigh,
        shin=shin,
        shoulder=(shoulder("L", 1.0), shoulder("R", -1.0)),
        upper_arm=apart("Shoulder", "Elbow"),
        forearm=apart("Elbow", "Wrist"),
        hand=HAND_SHARE * float(height),
        foot=FOOT_SHARE * float(height),
        ankle_height=ANKLE_SHARE * float(height),
    )


def _rest_up(points: Mapping[str, Array]) -> Array:
    up = points["Neck"] - points["Hip"]
    return up / np.linalg.norm(up)


def _rest_left(points: Mapping[str, Array]) -> Array:
    return points["LShoulder"] - points["RShoulder"]


def _rest_forward(body: BodyModel) -> Array:
    """(3,) facing direction of the body in its rest pose; x for one without a person's markers."""
    names = tuple(marker.name for marker in body.markers)
    if not {"Neck", "Hip", "LShoulder", "RShoulder"} <= set(names):
        return np.array([1.0, 0.0, 0.0])
    points = dict(zip(names, marker_points(body, body.neutral)[0], strict=True))
    forward = np.cross(_rest_left(points), _rest_up(points))
    return forward / np.linalg.norm(forward)
