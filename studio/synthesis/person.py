"""The skeletons of rendered people: published proportions of a height, others, lengths by tape measure."""

from dataclasses import replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.body.person import PersonMotion, Skeleton, marker_motion
from studio.geometry.rotations import axis_turn

Array = NDArray[np.float64]

# Segment lengths as shares of the body's height: Drillis & Contini (1966) as printed in Winter,
# Biomechanics and Motor Control of Human Movement (2009), Fig. 4.1; trunk and head divide what lies above
# the hips (0.530) at C7.
TRUNK, HEAD, HIP_HALF_WIDTH = 0.320, 0.150, 0.053
THIGH, SHIN, FOOT = 0.245, 0.246, 0.152
UPPER_ARM, FOREARM, HAND = 0.186, 0.146, 0.108
SHOULDER_OUT, SHOULDER_DOWN = 0.105, 0.036
SOLE = 0.045


def skeleton_of_height(height_mm: float, rng: np.random.Generator) -> Skeleton:
    """A skeleton with published proportions and the small left-right differences that real people have (0.5 %)."""
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


def marker_lengths(motion: PersonMotion) -> dict[str, float]:
    """The subject's limb lengths as a tape measure gives them: marker pair to mm (they do not change over time)."""
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
    """(..., 3, 3): heading about z, then leaning forward about y (positive), then to the right about x (positive)."""
    return axis_turn(2, yaw) @ axis_turn(1, pitch) @ axis_turn(0, roll)
