"""A person's skeleton, independent of any tracker: lengths, segment frames over time, and the 15 markers.

Recorded motion is retargeted to it and rendered people are built on it; it is independent of the trackers' body files.
Segment frames have x forward, y to the person's left and z up when standing upright with hanging arms. Trunk: the
neck's base lies on the thorax's z axis, which turns about the pelvis centre. Knees and elbows are hinges about y.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.spatial.transform import Rotation, RotationSpline

from studio.body.motion_files.trc import MarkerMotion
from studio.foundations.arrays import Array

SIDES = ("left", "right")
# Frames before and after the sampled ones that the curves go through.
MARGIN_FRAMES = 12
MARKERS = (
    *("Hip", "Neck", "Head"),
    *(
        f"{letter}{joint}"
        for letter in "RL"
        for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")
    ),
)


@dataclass(frozen=True, slots=True)
class Skeleton:
    """Lengths in mm, one entry per side where there are two (left, right).

    hip_half_width : of each hip joint from the pelvis centre. shoulder : of each shoulder joint from the neck's
    base, (forward, outward, up).
    """

    height: float
    trunk: float
    head: float
    hip_half_width: tuple[float, float]
    thigh: tuple[float, float]
    shin: tuple[float, float]
    shoulder: tuple[tuple[float, float, float], tuple[float, float, float]]
    upper_arm: tuple[float, float]
    forearm: tuple[float, float]
    hand: float
    foot: float
    ankle_height: float

    @property
    def standing_hip_height(self) -> float:
        """Height of the hip joints above the floor with straight legs, mm."""
        return self.ankle_height + min(t + s for t, s in zip(self.thigh, self.shin, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class PersonMotion:
    """A moving skeleton.

    root : (F, 3) pelvis centre, mm. turns : segment name to (F, 3, 3) world_from_segment.
    """

    skeleton: Skeleton
    fps: float
    root: Array
    turns: dict[str, Array]

    @property
    def frame_count(self) -> int:
        return len(self.root)


def first_frames(motion: PersonMotion, frames: int | None) -> PersonMotion:
    """The beginning of a motion; all of it for None."""
    turns = {name: turn[:frames] for name, turn in motion.turns.items()}
    return replace(motion, root=motion.root[:frames], turns=turns)


def sampled(motion: PersonMotion, times: Array, fps: float) -> PersonMotion:
    """The motion at times (F,) in seconds from its first frame, on smooth curves through its frames (cubic splines of
    places and of turns; times of frames give these frames). fps : of the result.
    """
    last = motion.frame_count - 1
    inside = np.clip(times * motion.fps, 0.0, last)
    low = int(np.clip(np.floor(inside.min()) - MARGIN_FRAMES, 0, last - 1))
    high = int(np.clip(np.ceil(inside.max()) + MARGIN_FRAMES, low + 1, last))
    known = np.arange(low, high + 1, dtype=np.float64)
    turns = {
        name: RotationSpline(known, Rotation.from_matrix(turn[low : high + 1]))(inside).as_matrix()
        for name, turn in motion.turns.items()
    }
    root: Array = scipy.interpolate.CubicSpline(known, motion.root[low : high + 1])(inside)
    return PersonMotion(motion.skeleton, fps, root, turns)


def joint_points(motion: PersonMotion) -> dict[str, Array]:
    """Where each segment begins, and the ends of head, hands and feet (`head_top`, `left_fingers`,
    `left_toes`).

    Each value is (F, 3) mm, world.
    """
    bones, turns = motion.skeleton, motion.turns

    def along(start: Array, segment: str, offset: tuple[float, float, float]) -> Array:
        return start + turns[segment] @ np.array(offset)

    points = {"pelvis": motion.root, "thorax": motion.root}
    points["head"] = along(motion.root, "thorax", (0.0, 0.0, bones.trunk))
    points["head_top"] = along(points["head"], "head", (0.0, 0.0, bones.head))
    for index, side in enumerate(SIDES):
        sign = 1.0 if side == "left" else -1.0
        forward, out, down = bones.shoulder[index]
        points[f"{side}_clavicle"] = points["head"]
        points[f"{side}_upper_arm"] = along(points["head"], f"{side}_clavicle", (forward, sign * out, down))
        points[f"{side}_forearm"] = along(
            points[f"{side}_upper_arm"], f"{side}_upper_arm", (0.0, 0.0, -bones.upper_arm[index])
        )
        points[f"{side}_hand"] = along(
            points[f"{side}_forearm"], f"{side}_forearm", (0.0, 0.0, -bones.forearm[index])
        )
        points[f"{side}_fingers"] = along(points[f"{side}_hand"], f"{side}_hand", (0.0, 0.0, -bones.hand))
        points[f"{side}_thigh"] = along(motion.root, "pelvis", (0.0, sign * bones.hip_half_width[index], 0.0))
        points[f"{side}_shin"] = along(
            points[f"{side}_thigh"], f"{side}_thigh", (0.0, 0.0, -bones.thigh[index])
        )
        points[f"{side}_foot"] = along(points[f"{side}_shin"], f"{side}_shin", (0.0, 0.0, -bones.shin[index]))
        points[f"{side}_toes"] = along(
            points[f"{side}_foot"], f"{side}_foot", (0.70 * bones.foot, 0.0, -bones.ankle_height)
        )
    return points


MARKER_POINTS = {
    "Hip": "pelvis",
    "Neck": "head",
    "Head": "head_top",
    **{
        f"{side[0].upper()}{joint}": f"{side}_{point}"
        for side in SIDES
        for joint, point in (
            ("Hip", "thigh"),
            ("Knee", "shin"),
            ("Ankle", "foot"),
            ("Shoulder", "upper_arm"),
            ("Elbow", "forearm"),
            ("Wrist", "hand"),
        )
    },
}


def marker_motion(motion: PersonMotion) -> MarkerMotion:
    """The 15 markers of the error measure, exact, mm, world z up; row 0 is frame 0 at time 0."""
    points = joint_points(motion)
    positions = np.stack([points[MARKER_POINTS[name]] for name in MARKERS], axis=1)
    times = np.arange(motion.frame_count) / motion.fps
    return MarkerMotion(MARKERS, times, positions, unit="m", rate=motion.fps)
