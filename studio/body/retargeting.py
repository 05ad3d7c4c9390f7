"""A recorded motion on the synthetic skeleton: every segment rotated as the recorded one, the root's path scaled
by the length of the legs, the feet kept out of the floor.

A segment's frame in the recording's rest pose is known: z against the bone, x to the side it bends to (a table per
family of skeletons). It is rotated as the recorded segment was since. Trunk and head follow the lines between hips,
shoulders and crown instead, since skeletons divide their joints differently.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from studio.body.motion_files.recorded_motion import RecordedMotion
from studio.body.person import SIDES, PersonMotion, Skeleton, joint_points
from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.rotations import frames_along

Vector = tuple[float, float, float]

FORWARD: Vector = (1.0, 0.0, 0.0)
CMU_ELBOW: Vector = (0.866, 0.0, 0.5)
"""Direction in which the forearms of CMU's T pose bend: the elbow's axis in the ASF files lies 30 degrees off the
vertical."""
FLOOR_SHARE = 0.1
SPREAD_S = 0.1
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class Bone:
    """One segment of a side. `{s}` stands for the side's prefix. joint : whose rotation it follows. begin, end : joints
    at the bone's ends in the rest pose. front : approximate direction of its x axis in the rest pose.
    """

    segment: str
    joint: str
    begin: str
    end: str
    front: Vector = FORWARD


@dataclass(frozen=True, slots=True)
class Family:
    """Joint names of a kind of skeleton. prefixes : of left and right. crown : joint at the top of the head, "" where
    the head's own rotation is used.
    """

    prefixes: tuple[str, str]
    pelvis: str
    thorax: str
    neck: str
    head: str
    crown: str
    clavicle: str
    bones: tuple[Bone, ...]

    def named(self, pattern: str, side: int) -> str:
        """A joint's name on a side (0 left, 1 right)."""
        return pattern.replace("{s}", self.prefixes[side])

    def bone(self, segment: str) -> Bone:
        """The bone of a segment ("thigh", "forearm", ...)."""
        return next(bone for bone in self.bones if bone.segment == segment)


ACCLAIM = Family(
    ("l", "r"),
    *("root", "thorax", "lowerneck", "head", "head_end", "{s}clavicle"),
    (
        Bone("upper_arm", "{s}humerus", "{s}humerus", "{s}radius", CMU_ELBOW),
        Bone("forearm", "{s}radius", "{s}radius", "{s}wrist", CMU_ELBOW),
        Bone("hand", "{s}hand", "{s}hand", "{s}fingers"),
        Bone("thigh", "{s}femur", "{s}femur", "{s}tibia"),
        Bone("shin", "{s}tibia", "{s}tibia", "{s}foot"),
        Bone("foot", "{s}foot", "{s}tibia", "{s}foot"),
    ),
)
BIOVISION = Family(
    ("Left", "Right"),
    *("Hips", "Spine1", "Neck", "Head", "Head_end", "{s}Shoulder"),
    (
        Bone("upper_arm", "{s}Arm", "{s}Arm", "{s}ForeArm", CMU_ELBOW),
        Bone("forearm", "{s}ForeArm", "{s}ForeArm", "{s}Hand", CMU_ELBOW),
        Bone("hand", "{s}FingerBase", "{s}ForeArm", "{s}Hand"),
        Bone("thigh", "{s}UpLeg", "{s}UpLeg", "{s}Leg"),
        Bone("shin", "{s}Leg", "{s}Leg", "{s}Foot"),
        Bone("foot", "{s}Foot", "{s}Leg", "{s}Foot"),
    ),
)
HUMANOID = Family(
    ("left_", "right_"),
    *("pelvis", "torso", "head", "head", "", "torso"),
    (
        Bone("upper_arm", "{s}upper_arm", "{s}upper_arm", "{s}lower_arm"),
        Bone("forearm", "{s}lower_arm", "{s}lower_arm", "{s}hand"),
        Bone("hand", "{s}hand", "{s}lower_arm", "{s}hand"),
        Bone("thigh", "{s}thigh", "{s}thigh", "{s}shin"),
        Bone("shin", "{s}shin", "{s}shin", "{s}foot"),
        Bone("foot", "{s}foot", "{s}shin", "{s}foot"),
    ),
)
FAMILIES = (ACCLAIM, BIOVISION, HUMANOID)


def family_of(recorded: RecordedMotion) -> Family:
    """The joint names of the recording's skeleton. Raises StudioError for an unknown one."""
    for family in FAMILIES:
        required = {family.pelvis, family.thorax, family.neck, family.head} | {family.crown or family.head}
        for side in range(2):
            patterns = [
                family.clavicle,
                *(p for bone in family.bones for p in (bone.joint, bone.begin, bone.end)),
            ]
            required |= {family.named(pattern, side) for pattern in patterns}
        if required <= set(recorded.names):
            return family
    raise StudioError(
        f"The joints of '{recorded.source}' have the names of no known skeleton.",
        "Take a CMU clip (ASF/AMC or BVH), or arrays of the AMP humanoid.",
    )


def on_skeleton(recorded: RecordedMotion, skeleton: Skeleton) -> PersonMotion:
    """The recorded motion as the skeleton would make it, at the recording's rate, feet on or above the floor.

    Raises StudioError for a skeleton whose joints are not known.
    """
    family = family_of(recorded)
    turns = _trunk(recorded, family)
    hips, _ = _middles(recorded, family)
    source_legs, legs = 0.0, 0.0
    for index, side in enumerate(SIDES):
        for bone in family.bones:
            turns[f"{side}_{bone.segment}"] = _follow(recorded, family, bone, index)
        turns[f"{side}_clavicle"] = _clavicle(recorded, family, turns["thorax"], index)
        source_legs += _rest_length(recorded, family, "thigh", index)
        source_legs += _rest_length(recorded, family, "shin", index)
        legs += skeleton.thigh[index] + skeleton.shin[index]
    free = PersonMotion(skeleton, recorded.fps, hips * legs / source_legs, turns)
    return on_floor(free)


def on_floor(motion: PersonMotion) -> PersonMotion:
    """The motion moved up or down as a whole until the lower foot mostly stands on the floor, then `above_floor`."""
    lowest = np.min([lowest_of_sole(motion, side) for side in SIDES], axis=0)
    level = float(np.quantile(lowest, FLOOR_SHARE))
    return above_floor(PersonMotion(motion.skeleton, motion.fps, motion.root - level * UP, motion.turns))


def above_floor(motion: PersonMotion) -> PersonMotion:
    """The motion raised smoothly while a foot would be in the floor; poses are unchanged."""
    below = np.max([-lowest_of_sole(motion, side) for side in SIDES], axis=0)
    lift = smooth_above(np.maximum(below, 0.0), max(1, round(SPREAD_S * motion.fps)))
    return PersonMotion(motion.skeleton, motion.fps, motion.root + lift[:, None] * UP, motion.turns)


def smooth_above(heights: Array, spread: int) -> Array:
    """(F,) a smooth curve that is nowhere below heights (F,). spread : frames on each side that it begins to rise."""
    # The greatest is held as far as the smoothing reaches, so that it never undercuts.
    held = scipy.ndimage.maximum_filter1d(heights, 2 * spread + 1, mode="nearest")
    return scipy.ndimage.gaussian_filter1d(held, spread / 3.0, radius=spread, mode="nearest")


def lowest_of_sole(motion: PersonMotion, side: str) -> Array:
    """(F,) height of the lower one of a foot's heel and toes above the floor, mm."""
    bones = motion.skeleton
    ankle, turn = joint_points(motion)[f"{side}_foot"], motion.turns[f"{side}_foot"]
    heel = (ankle + turn @ np.array([-0.20 * bones.foot, 0.0, -bones.ankle_height]))[:, 2]
    toes = (ankle + turn @ np.array([0.70 * bones.foot, 0.0, -bones.ankle_height]))[:, 2]
    return np.minimum(heel, toes)


def _middles(recorded: RecordedMotion, family: Family) -> tuple[Array, Array]:
    """(F, 3) the middles between the hips and between the shoulders."""
    places: list[Array] = []
    for segment in ("thigh", "upper_arm"):
        begin = family.bone(segment).begin
        both = [recorded.positions[:, recorded.index(family.named(begin, side))] for side in (0, 1)]
        places.append(0.5 * (both[0] + both[1]))
    return places[0], places[1]


def _rest_middle(recorded: RecordedMotion, family: Family, segment: str) -> Array:
    """(3,) the middle between both sides' beginnings of a segment in the rest pose."""
    begin = family.bone(segment).begin
    left, right = (recorded.rest[recorded.index(family.named(begin, side))] for side in (0, 1))
    return 0.5 * (left + right)


def _trunk(recorded: RecordedMotion, family: Family) -> dict[str, Array]:
    """Turns of pelvis, thorax and head."""
    hips, shoulders = _middles(recorded, family)
    pelvis, thorax, neck, head = (
        recorded.index(name) for name in (family.pelvis, family.thorax, family.neck, family.head)
    )
    turns = recorded.rotations
    rest_up = _rest_middle(recorded, family, "upper_arm") - _rest_middle(recorded, family, "thigh")
    left = np.array([0.0, 1.0, 0.0])
    if family.crown:
        up = recorded.positions[:, recorded.index(family.crown)] - recorded.positions[:, neck]
    else:
        up = turns[:, head] @ np.array([0.0, 0.0, 1.0])
    return {
        "pelvis": turns[:, pelvis] @ frames_along(rest_up[None], left[None])[0],
        "thorax": frames_along(shoulders - hips, turns[:, thorax] @ left),
        "head": frames_along(up, turns[:, head] @ left),
    }


def _clavicle(recorded: RecordedMotion, family: Family, thorax: Array, side: int) -> Array:
    """(F, 3, 3) the thorax's rotation times that of the recorded collar bone against the recorded thorax."""
    own = recorded.rotations[:, recorded.index(family.named(family.clavicle, side))]
    carrier = recorded.rotations[:, recorded.index(family.thorax)]
    return thorax @ np.swapaxes(carrier, 1, 2) @ own


def _follow(recorded: RecordedMotion, family: Family, bone: Bone, side: int) -> Array:
    """(F, 3, 3) rotations of a segment that turns with a joint, from its frame in the rest pose."""
    joint, begin, end = (
        recorded.index(family.named(name, side)) for name in (bone.joint, bone.begin, bone.end)
    )
    z = recorded.rest[begin] - recorded.rest[end]
    return recorded.rotations[:, joint] @ frames_along(z[None], np.cross(z, np.array(bone.front))[None])[0]


def _rest_length(recorded: RecordedMotion, family: Family, segment: str, side: int) -> float:
    bone = family.bone(segment)
    begin, end = (recorded.index(family.named(name, side)) for name in (bone.begin, bone.end))
    return float(np.linalg.norm(recorded.rest[end] - recorded.rest[begin]))
