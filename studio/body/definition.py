"""The entries of a body file, before names are resolved.

A body file is TOML. Lengths in mm, angles in degrees. The body's name is the file's name without `.toml`.

    title = "Words on screen"
    source = "where order, conventions and proportions come from"
    shape_order = []                  # optional: dimensions in the order of the body's own shape file

    [dimensions]                      # everything that differs between subjects
    thigh_length = { mm = 424.8, of_height = 0.245 }   # of_height: published share of a person's height
    torso_flatness = { ratio = 0.88 }                  # a number without unit
    chest_forward = { mm = 0, spread = 10 }            # flesh beside the bone, also below 0; spread: standard deviation
    chest_depth = { ratio = 0.8, spread = 0.05 }       # among people, where a run fits it to its first frames

    [[parameters]]                    # the pose vector, in order
    name = "left_knee"
    label = "left knee"
    kind = "angle"                    # or "length"
    lower = 0                         # degrees or mm; absent: unbounded
    upper = 150
    neutral = 5                       # the rest pose; a list of numbers and dimensions: their sum; absent: 0
    max_step = 650                    # largest expected movement, degrees or mm per second
    spread = 15                       # optional: usual deviation from rest, of angles that silhouettes hardly show
    limb = "left leg"                 # parameters of one limb are neighbours

    [[joints]]                        # parents before children
    name = "left_shin"
    parent = "left_thigh"             # or "world"
    type = "hinge"                    # fixed 0, hinge 1, two-axis 2, ball 3 angles; slide 1 length; free 3 and 3
    sequence = [                      # from the parent's frame to this one, each step in the frame so far
        { move = "z", by = "-thigh_length" },      # mm, [-]dimension or [-]length parameter
        { turn = "y", by = "left_knee" },          # degrees, or [-]angle parameter
    ]

    [[limbs]]                         # truncated elliptical cones along the joint's z
    name = "left shin"
    joint = "left_shin"
    length = "-shin_length"           # mm or [-]dimension; 0: kept, but neither counted nor drawn
    radius_start = 60                 # mm or dimension, at z = 0
    radius_end = 45                   # at z = length
    scale_x = 1                       # of the cross-section; number or ratio
    scale_y = 1
    side = "left"                     # left, right or middle
    part = ""                         # optional: "trunk" or "head", where a likelihood treats these apart
    stretch = [0.8, 1.25]             # optional, of a limb of changing length: its least and greatest length, as shares
                                      # of `length`, which is a dimension that no other limb has. The pose vector gets
                                      # "left_shin_stretch", mm beyond that length, 0 at rest; whatever joints and
                                      # markers are moved by the dimension is moved along. At most twice the least
    stretch_step = 30                 # optional: largest expected change, mm per second

    [[markers]]                       # named points, between which a subject's lengths are given
    name = "LKnee"
    joint = "left_shin"
    at = [0, 0, 0]                    # mm or [-]dimension each

    [[meshes]]                        # optional, made of a robot's file: surfaces whose outlines are exact
    joint = "link_1"
    points = "…"                      # packed (`body.meshes`)
    triangles = "…"
"""

import math
from typing import Literal

import msgspec

WORLD = "world"


class DimensionEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A size that differs between subjects: `mm` or (without unit) `ratio`, its share of a height, and its spread."""

    mm: float | None = None
    ratio: float | None = None
    of_height: float | None = None
    spread: float | None = None

    @property
    def value(self) -> float:
        """The body's own value, mm or a ratio (exactly one of the two is given)."""
        given = self.mm if self.mm is not None else self.ratio
        return math.nan if given is None else given

    @property
    def is_offset(self) -> bool:
        """Whether it is a place of flesh beside the bone, which may be negative."""
        return self.mm is not None and self.spread is not None


class ParameterEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One entry of the pose vector, degrees or mm."""

    name: str
    kind: Literal["angle", "length"]
    max_step: float
    limb: str
    label: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    neutral: float | tuple[float | str, ...] = 0.0
    spread: float = math.inf


class StepEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A move along or a turn about one axis, by a number or a [-]name."""

    by: float | str
    move: Literal["x", "y", "z"] | None = None
    turn: Literal["x", "y", "z"] | None = None


class JointEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A frame of the tree and the steps that lead to it from its parent's."""

    name: str
    parent: str
    type: Literal["fixed", "hinge", "slide", "two-axis", "ball", "free"]
    sequence: tuple[StepEntry, ...] = ()


class LimbEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A truncated elliptical cone along its joint's z."""

    name: str
    joint: str
    length: float | str
    radius_start: float | str
    radius_end: float | str
    scale_x: float | str = 1.0
    scale_y: float | str = 1.0
    side: Literal["left", "right", "middle"] = "middle"
    part: Literal["trunk", "head", ""] = ""
    stretch: tuple[float, float] | None = None
    stretch_step: float | None = None


class MarkerEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A named point fixed to a joint's frame."""

    name: str
    joint: str
    at: tuple[float | str, float | str, float | str]


class MeshEntry(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The surface of a link, fixed to a joint's frame. points, triangles : packed (`body.meshes`)."""

    joint: str
    points: str
    triangles: str


class BodyDefinition(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A whole body file."""

    title: str
    parameters: tuple[ParameterEntry, ...]
    joints: tuple[JointEntry, ...]
    limbs: tuple[LimbEntry, ...]
    source: str = ""
    dimensions: dict[str, DimensionEntry] = {}
    markers: tuple[MarkerEntry, ...] = ()
    shape_order: tuple[str, ...] = ()
    meshes: tuple[MeshEntry, ...] = ()


def split_sign(reference: str) -> tuple[float, str]:
    """The sign and the name of a reference such as "-left_hip_ry"."""
    return (-1.0, reference[1:]) if reference.startswith("-") else (1.0, reference)
