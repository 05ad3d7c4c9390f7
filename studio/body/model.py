"""The articulated body as data: a kinematic tree, its dimensions, its limbs and its markers.

A `BodyModel` is frozen and independent of any particular pose. Each joint's frame is its parent's frame
times a sequence of elementary `Step`s (a move along, or a turn about, one of the current x, y, z axes by a
fixed number or by one parameter of the pose vector), so any order and direction of rotation can be written
down. Lengths in mm, angles in radians here (degrees in body files).
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from studio.body.definition import BodyDefinition
from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.errors import StudioError
from studio.foundations.geometry.reach import within_reach

MOVE, TURN = 0, 1


@dataclass(frozen=True, slots=True)
class Parameter:
    """One entry of the pose vector.

    kind : "angle" (radians) or "length" (mm). lower, upper : limits, ±inf where unbounded. max_step : largest
    expected movement, rad/s or mm/s. neutral : the value in the rest pose. limb : group for crossover by
    limbs. spread : usual deviation from rest, inf where none is known.
    """

    name: str
    label: str
    kind: str
    lower: float
    upper: float
    max_step: float
    neutral: float
    limb: str
    spread: float = math.inf


@dataclass(frozen=True, slots=True)
class Step:
    """One elementary motion: kind MOVE or TURN, axis 0..2, and `value` (mm or radians) when parameter < 0,
    else `value` is the coefficient (±1) of pose entry `parameter`."""

    kind: int
    axis: int
    parameter: int
    value: float


@dataclass(frozen=True, slots=True)
class Joint:
    """A frame of the tree. parent : index of an earlier joint, -1 for the world."""

    name: str
    parent: int
    steps: tuple[Step, ...]

    @property
    def parameters(self) -> tuple[int, ...]:
        """The entries of the pose vector that its steps read, in their order."""
        return tuple(step.parameter for step in self.steps if step.parameter >= 0)


@dataclass(frozen=True, slots=True)
class Limb:
    """A truncated elliptical cone along its joint's z, from z = 0 to z = length (which may be negative).

    radius_start, radius_end : mm at z = 0 and z = length. scale_x, scale_y : of the cross-section along local
    x, y. side : "left", "right" or "middle" (colours). part : "trunk", "head" or "" (neither), for likelihoods
    that treat these apart. Limbs of zero length are kept here but are not counted or drawn: see
    `BodyModel.drawn`. slide : the entry of the pose vector that moves it, where it is the far part of a limb of
    changing length, else -1.
    """

    name: str
    joint: int
    length: float
    radius_start: float
    radius_end: float
    scale_x: float
    scale_y: float
    side: str
    part: str = ""
    slide: int = -1


@dataclass(frozen=True, slots=True)
class Marker:
    """A named point fixed to a joint's frame. offset : (3,) mm."""

    name: str
    joint: int
    offset: Array


@dataclass(frozen=True, slots=True, eq=False)
class LinkMesh:
    """The surface of a link. joint : in whose frame it is fixed. points : (V, 3) mm. triangles : (F, 3) of them."""

    joint: int
    points: Array
    triangles: Indices


@dataclass(frozen=True, slots=True, eq=False)
class KinematicTables:
    """The tree as flat arrays for kernels. F joints, S steps in all, L drawn limbs.

    parent (F,); first_step (F + 1,): joint f owns steps first_step[f]:first_step[f+1]; step_kind, step_axis,
    step_parameter (S,) int64; step_value (S,) float64; limb_joint (L,) int64; limb_shape (L, 5) float64:
    length, radius_start, radius_end, scale_x, scale_y.
    """

    parent: Indices
    first_step: Indices
    step_kind: Indices
    step_axis: Indices
    step_parameter: Indices
    step_value: Array
    limb_joint: Indices
    limb_shape: Array


@dataclass(frozen=True, slots=True, eq=False)
class BodyModel:
    """A body: parameters in the order of the pose vector, joints parents first, limbs, markers, dimensions.

    dimensions : the named lengths and radii (mm; ratios without unit) that the steps, limbs and markers were built
        from.
    definition : the body file's entries, from which a body of other dimensions is built (None: built in code, its
        dimensions cannot change).
    meshes : surfaces of all links, whatever the dimensions are; empty where the limbs are all that is known.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...]
    joints: tuple[Joint, ...]
    limbs: tuple[Limb, ...]
    markers: tuple[Marker, ...]
    dimensions: dict[str, float]
    definition: BodyDefinition | None = None
    meshes: tuple[LinkMesh, ...] = ()

    @property
    def drawn(self) -> tuple[Limb, ...]:
        """The limbs with a length, in order: those that are counted, weighed and shown."""
        return tuple(limb for limb in self.limbs if limb.length != 0.0)

    @property
    def neutral(self) -> Array:
        """(D,) the rest pose."""
        return np.array([entry.neutral for entry in self.parameters])

    @property
    def lower(self) -> Array:
        """(D,) least values, -inf where there is none."""
        return np.array([entry.lower for entry in self.parameters])

    @property
    def upper(self) -> Array:
        """(D,) greatest values, inf where there is none."""
        return np.array([entry.upper for entry in self.parameters])

    @property
    def spread(self) -> Array:
        """(D,) usual deviations from the rest pose, inf where none is known."""
        return np.array([entry.spread for entry in self.parameters])

    @property
    def angles(self) -> Mask:
        """(D,) which parameters are angles."""
        return np.array([entry.kind == "angle" for entry in self.parameters], dtype=np.bool_)

    @property
    def bounded_angles(self) -> Mask:
        """(D,) which parameters are angles with limits on both sides."""
        return self.angles & np.isfinite(self.lower) & np.isfinite(self.upper)


@lru_cache(maxsize=64)
def kinematic_tables(body: BodyModel) -> KinematicTables:
    """The body's tree and drawn limbs as arrays (see `KinematicTables`), made once a body: read only."""
    steps = [step for joint in body.joints for step in joint.steps]
    counts = [len(joint.steps) for joint in body.joints]
    shapes = [
        (limb.length, limb.radius_start, limb.radius_end, limb.scale_x, limb.scale_y) for limb in body.drawn
    ]
    return KinematicTables(
        parent=np.array([joint.parent for joint in body.joints], dtype=np.int64),
        first_step=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        step_kind=np.array([step.kind for step in steps], dtype=np.int64),
        step_axis=np.array([step.axis for step in steps], dtype=np.int64),
        step_parameter=np.array([step.parameter for step in steps], dtype=np.int64),
        step_value=np.array([step.value for step in steps], dtype=np.float64),
        limb_joint=np.array([limb.joint for limb in body.drawn], dtype=np.int64),
        limb_shape=np.array(shapes, dtype=np.float64).reshape(-1, 5),
    )


def joints_upwards(body: BodyModel, joint: int) -> Iterator[int]:
    """A joint and those that it hangs from, up to the root; none of -1, the world."""
    while joint >= 0:
        yield joint
        joint = body.joints[joint].parent


def joints_above(body: BodyModel, joint: int) -> Iterator[int]:
    """The joints that a joint hangs from, the nearest first."""
    return itertools.islice(joints_upwards(body, joint), 1, None)


def moving_joint(body: BodyModel, joint: int) -> int:
    """The joint itself or, as far as joints are fixed, the one above; -1: it is fixed to the world."""
    return next((at for at in joints_upwards(body, joint) if body.joints[at].parameters), -1)


def limb_moving(body: BodyModel, joint: int) -> str | None:
    """The limb of the first parameter that moves a joint, or the nearest joint above that moves; None: it is fixed."""
    moving = moving_joint(body, joint)
    return body.parameters[body.joints[moving].parameters[0]].limb if moving >= 0 else None


def ends_of(body: BodyModel, limbs: Sequence[Limb]) -> Mask:
    """(L,) which of some limbs are ends of the body: none of the others hangs from them. Flesh may lie on a fixed joint
    beside its bone's, so that a limb also hangs from what its bone's joint hangs from.
    """
    bones = [moving_joint(body, limb.joint) for limb in limbs]
    carrying = {above for limb in limbs for above in joints_above(body, limb.joint)}
    bearing = {above for bone in bones for above in joints_above(body, bone)}
    # What a limb of changing length carries lies on joints of its own that its far part's slide moves along.
    sliding = {
        entry
        for limb in limbs
        for joint in joints_upwards(body, limb.joint)
        for entry in body.joints[joint].parameters
        if entry != limb.slide
    }
    return np.array(
        [
            limb.joint not in carrying and bone not in bearing and limb.slide not in sliding
            for limb, bone in zip(limbs, bones, strict=True)
        ],
        dtype=np.bool_,
    )


def free_ends(body: BodyModel) -> Mask:
    """(L,) whether a drawn limb's far end is an end of the body (fingers, toes, crown): no limb hangs from it, not even
    one of zero length.
    """
    drawn = np.array([limb.length != 0.0 for limb in body.limbs], dtype=np.bool_)
    return ends_of(body, body.limbs)[drawn]


def rigid_limbs(body: BodyModel) -> Mask:
    """(L,) whether a drawn limb ends the body at a joint that cannot turn (the papers' hands and feet): it is fixed to
    a joint that turns and has a limb itself. Where all parts of a link lie on fixed joints (a robot's housings, an
    animal's head and ears), they are its shape.

    A person's wrists and ankles do turn, so where such a limb is off a little, the shin or forearm need not be wrong.
    """
    ends = free_ends(body)
    still = [not body.joints[limb.joint].parameters for limb in body.drawn]
    joints = [limb.joint for limb in body.drawn]
    follows = np.array([moving_joint(body, joint) in joints for joint in joints], dtype=np.bool_)
    return ends & follows & np.array(still, dtype=np.bool_)


def extremities(body: BodyModel) -> tuple[int, ...]:
    """Indices of the drawn limbs on which no other drawn limb's joint hangs."""
    return tuple(int(index) for index in np.flatnonzero(ends_of(body, body.drawn)))


def checked_pose(body: BodyModel, pose: Sequence[float] | Array, error: type[StudioError]) -> Array:
    """(D,) the pose, if it is one of the body. Raises `error`."""
    given = np.asarray(pose, dtype=np.float64)
    if given.shape != (len(body.parameters),) or not within_reach(given):
        raise error(
            f"A pose of {body.name} has {len(body.parameters)} finite numbers, the given one does not.",
            "Give radians and mm in the order of the body's parameters.",
        )
    return given
