"""A person with the limb lengths of a tracker's shape file: joints where that body has them, flesh as a person's.

Of the file only lengths are taken; radii stay the tracker's business. Hands and feet, which the Lee walk's file leaves
out, have published proportions.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from studio.body.catalogue import load_body
from studio.body.person import SIDES, Skeleton
from studio.body.subject import Subject, subject_from_shape
from studio.errors import BodyError
from studio.sessions.importers.bodytrack import read_numbers
from studio.synthesis.person import HAND

# How far in front of and above the neck's base the shoulders are, mm: rounded means of both sides in the Lee walk's
# start pose. Sideways they are as far as the clavicle's length then leaves.
SHOULDER_FORWARD, SHOULDER_UP = -40.0, -70.0
# The Lee walk's shins end this high above the floor, mm (28 and 10 in the start pose).
ANKLE_HEIGHT = 24.0
# Length of a shoe, of the height: the silhouettes of the Lee walk show it.
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
    """The skeleton whose neighbouring markers are as far apart as the subject's dimensions say.

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
    """The subject with the lengths of the rendered hands and shoes, for body human31 (which draws them then)."""
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
