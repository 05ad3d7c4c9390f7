"""The skeleton inside the rendered person: lengths, segment frames over time, and the 15 markers.

It is the synthesis's own, in no way derived from a tracker's body file. Segment frames have x forward, y to
the person's left and z up when standing upright with hanging arms. Trunk: the neck's base lies on the
thorax's z axis, which turns about the pelvis centre. Knees and elbows are hinges about y.
"""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.capture.trc import MarkerMotion
from studio.geometry.rotations import axis_turn

Array = NDArray[np.float64]

SIDES = ("left", "right")
MARKERS = (
    *("Hip", "Neck", "Head"),
    *(
        f"{letter}{joint}"
        for letter in "RL"
        for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")
    ),
)

# Segment lengths as shares of the body's height: Drillis & Contini (1966) as printed in Winter,
# Biomechanics and Motor Control of Human Movement (2009), Fig. 4.1; trunk and head divide what lies above
# the hips (0.530) at C7.
TRUNK, HEAD, HIP_HALF_WIDTH = 0.320, 0.150, 0.053
THIGH, SHIN, FOOT = 0.245, 0.246, 0.152
UPPER_ARM, FOREARM, HAND = 0.186, 0.146, 0.108
SHOULDER_OUT, SHOULDER_DOWN = 0.105, 0.036
SOLE = 0.045


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


def skeleton_of_height(height_mm: float, rng: np.random.Generator) -> Skeleton:
    """A skeleton with published proportions and the small left-right differences that real people have (0.5
    %).
    """
    pair = np.exp(rng.normal(0.0, 0.005, (4, 2)))
    shoulder = (0.0, SHOULDER_OUT * height_mm, -SHOULDER_DOWN * height_mm)
    thigh, shin, upper_arm, forearm = (
        (float(share * height_mm * two[0]), float(share * height_mm * two[1]))
        for share, two in zip((THIGH, SHIN, UPPER_ARM, FOREARM), pair, strict=True)
    )
    return Skeleton(
        height=height_mm,
        trunk=TRUNK * height_mm,
        head=HEAD * height_mm,
        hip_half_width=(HIP_HALF_WIDTH * height_mm, HIP_HALF_WIDTH * height_mm),
        thigh=thigh,
        shin=shin,
        shoulder=(shoulder, shoulder),
        upper_arm=upper_arm,
        forearm=forearm,
        hand=HAND * height_mm,
        foot=FOOT * height_mm,
        ankle_height=SOLE * height_mm,
    )


class Proportions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Factors on the published lengths of a person of some height."""

    trunk: float = 1.0
    head: float = 1.0
    hips: float = 1.0
    shoulders: float = 1.0
    thighs: float = 1.0
    shins: float = 1.0
    upper_arms: float = 1.0
    forearms: float = 1.0
    hands: float = 1.0
    feet: float = 1.0


def proportioned(bones: Skeleton, factors: Proportions) -> Skeleton:
    """The skeleton with other proportions and the same standing height: all is scaled alike until it is that again."""
    if factors == Proportions():
        return bones
    legs = float(np.mean(bones.thigh)) * factors.thighs + float(np.mean(bones.shin)) * factors.shins
    tall = legs + bones.ankle_height + bones.trunk * factors.trunk + bones.head * factors.head
    before = float(np.mean(bones.thigh) + np.mean(bones.shin)) + bones.ankle_height + bones.trunk + bones.head
    again = before / tall

    def both(lengths: tuple[float, float], factor: float) -> tuple[float, float]:
        return lengths[0] * factor * again, lengths[1] * factor * again

    shoulders = tuple(
        (forward * again, out * factors.shoulders * again, up * again) for forward, out, up in bones.shoulder
    )
    return replace(
        bones,
        trunk=bones.trunk * factors.trunk * again,
        head=bones.head * factors.head * again,
        hip_half_width=both(bones.hip_half_width, factors.hips),
        thigh=both(bones.thigh, factors.thighs),
        shin=both(bones.shin, factors.shins),
        shoulder=(shoulders[0], shoulders[1]),
        upper_arm=both(bones.upper_arm, factors.upper_arms),
        forearm=both(bones.forearm, factors.forearms),
        hand=bones.hand * factors.hands * again,
        foot=bones.foot * factors.feet * again,
        ankle_height=bones.ankle_height * again,
    )


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
        """Number of frames."""
        return len(self.root)


def first_frames(motion: PersonMotion, frames: int | None) -> PersonMotion:
    """The beginning of a motion; all of it for None."""
    turns = {name: turn[:frames] for name, turn in motion.turns.items()}
    return replace(motion, root=motion.root[:frames], turns=turns)


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


def marker_lengths(motion: PersonMotion) -> dict[str, float]:
    """The subject's limb lengths as a tape measure gives them: marker pair to mm (they do not change over
    time).
    """
    markers = marker_motion(motion)
    index = {name: position for position, name in enumerate(markers.names)}
    pairs = [("Hip", "Neck"), ("Neck", "Head")]
    for letter in "RL":
        chain = [f"{letter}{joint}" for joint in ("Hip", "Knee", "Ankle", "Shoulder", "Elbow", "Wrist")]
        pairs += [("Hip", chain[0]), (chain[0], chain[1]), (chain[1], chain[2])]
        pairs += [("Neck", chain[3]), (chain[3], chain[4]), (chain[4], chain[5])]
    first = markers.positions[0]
    return {
        f"{one}_{other}": float(np.linalg.norm(first[index[one]] - first[index[other]]))
        for one, other in pairs
    }


def yaw_pitch_roll(yaw: Array, pitch: Array, roll: Array) -> Array:
    """(..., 3, 3): heading about z, then leaning forward about y (positive), then to the right about x
    (positive).
    """
    return axis_turn(2, yaw) @ axis_turn(1, pitch) @ axis_turn(0, roll)
