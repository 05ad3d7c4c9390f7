"""The skeletons of rendered people: published or other proportions of a height, or taped lengths."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from studio.body.catalogue import load_body
from studio.body.person import SIDES, PersonMotion, Skeleton, marker_motion
from studio.body.subject import Subject, subject_from_shape
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError
from studio.foundations.geometry.rotations import axis_turn
from studio.sessions.importers.bodytrack import read_numbers

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
    """The skeleton with other proportions and the same standing height: all lengths are scaled alike to keep it."""
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
    """The subject's limb lengths as taped: marker pair to mm (constant over time)."""
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


# A person with the limb lengths of a tracker's shape file: joints of that body, flesh of a person.
# Only lengths are taken from the file; radii belong to the tracker. Hands and feet, which the Lee walk's file
# leaves out, have published proportions.


# Offsets of the shoulders in front of and above the neck's base, mm: rounded means of both sides in the Lee walk's
# start pose. The sideways offset follows from the clavicle's length.
SHOULDER_FORWARD, SHOULDER_UP = -40.0, -70.0
# The Lee walk's shins end this high above the floor, mm (28 and 10 in the start pose).
ANKLE_HEIGHT = 24.0
# Length of a shoe, as a share of the height, from the Lee walk's silhouettes.
SHOE = 0.168
# The rendered shoe begins this far behind the ankle and reaches this far past the toes' joint, mm.
SHOE_BEHIND, SHOE_BEYOND, FINGERTIPS = 70.0, 27.0, 15.0
TOES, KNUCKLES = 0.62, 0.90


def subject_of_file(path: Path, body: str) -> Subject:
    """The subject that a shape file describes for a body. Raises BodyError where they do not belong together."""
    numbers = read_numbers(path)
    if numbers is None:
        raise BodyError(f"'{path}' is not a file.", "Name the file that holds the body's shape.")
    return subject_from_shape(load_body(body), numbers)


def skeleton_of_subject(subject: Subject) -> Skeleton:
    """The skeleton with the distances of neighbouring markers given by the subject's dimensions.

    Raises BodyError for a subject that does not give all of them.
    """
    length = subject.dimensions_mm

    def both(name: str) -> tuple[float, float]:
        left, right = (_length(length, f"{side}_{name}") for side in SIDES)
        return left, right

    thigh, shin = both("thigh_length"), both("shin_length")
    trunk, head = _length(length, "torso_length"), _length(length, "head_length")
    height = subject.height_mm or float(np.mean(thigh) + np.mean(shin) + trunk + head + ANKLE_HEIGHT)
    return Skeleton(
        height=height,
        trunk=trunk,
        head=head,
        hip_half_width=both("hip_offset"),
        thigh=thigh,
        shin=shin,
        shoulder=(_shoulder(both("clavicle_length")[0]), _shoulder(both("clavicle_length")[1])),
        upper_arm=both("upper_arm_length"),
        forearm=both("forearm_length"),
        hand=HAND * height,
        foot=SHOE * height,
        ankle_height=ANKLE_HEIGHT,
    )


def with_hands_and_feet(subject: Subject, bones: Skeleton) -> Subject:
    """The subject with the lengths of the rendered hands and shoes, for body human31 (which then draws them)."""
    extra = {f"{side}_foot_length": SHOE_BEHIND + TOES * bones.foot + SHOE_BEYOND for side in SIDES}
    extra |= {f"{side}_hand_length": KNUCKLES * bones.hand + FINGERTIPS for side in SIDES}
    extra |= {"foot_heel": SHOE_BEHIND, "foot_drop": 0.0}
    lengths = {**subject.dimensions_mm, **{name: round(value, 1) for name, value in extra.items()}}
    return Subject(subject.body, subject.height_mm, subject.lengths_mm, lengths, subject.ratios)


def _shoulder(clavicle: float) -> tuple[float, float, float]:
    """(forward, outward, up) of a shoulder at the clavicle's distance from the neck's base, mm."""
    inside = np.hypot(SHOULDER_FORWARD, SHOULDER_UP)
    if clavicle < 1.2 * inside:
        scale = clavicle / (1.2 * inside)
        return (
            SHOULDER_FORWARD * scale,
            float(np.sqrt(clavicle**2 - (inside * scale) ** 2)),
            SHOULDER_UP * scale,
        )
    return SHOULDER_FORWARD, float(np.sqrt(clavicle**2 - inside**2)), SHOULDER_UP


def _length(dimensions: Mapping[str, float], name: str) -> float:
    value = dimensions.get(name, 0.0)
    if value <= 0.0:
        raise BodyError(
            f"The shape gives no '{name}'.", "Take a shape of body human31, or give a height instead."
        )
    return value
