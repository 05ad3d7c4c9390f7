"""A body's size as a few numbers, which a fit of the subject searches besides the poses.

Dimensions of a body file that set a joint's place or a limb's length are *lengths*, those that are a cone's radius are
*radii*. Dimensions that are equal in a person (left and right) make a group, whose one number is the
logarithm of a common factor: 0 is the unchanged body, 0.1 is 10.5 % more, and no value is impossible. A
cone's two radii are two groups: shins taper more than the body file's, and a cone that cannot has its joints moved.

Dimensions of which the file gives the spread among people are flesh: *ratios* of a cone's depth and width, and
*offsets* of its axis from the bone, which may be negative: `OFFSET_SIGMA` is one standard deviation of these.
"""

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from studio.body.definition import BodyDefinition, split_sign
from studio.body.dimensions import with_dimensions
from studio.body.model import BodyModel, ends_of
from studio.body.stretching import written_limbs
from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError

SIDE = re.compile(r"(^|_)(left|right)(_|$)")
SMALL = ("foot_heel", "foot_drop", "ankle_height")
"""Offsets within a foot: they follow from the height, as silhouettes do not show them."""
OFFSET_SIGMA = 0.15
"""Number of an offset that is a standard deviation away: as a radius's, so that searches step alike."""
Kind = Literal["length", "radius", "ratio", "offset"]


@dataclass(frozen=True, slots=True)
class ShapeGroup:
    """Dimensions with a common number. name : such as "thigh_length". spread : standard deviation, mm of an offset, of
    a ratio's logarithm; 0 where the file has none.
    """

    name: str
    kind: Kind
    dimensions: tuple[str, ...]
    spread: float = 0.0

    def resized(self, own: float, value: float) -> float:
        """A dimension of the group, `own` in the unchanged body, where the group's number is `value`."""
        if self.kind == "offset":
            return own + self.spread / OFFSET_SIGMA * value
        return own * float(np.exp(value))


@dataclass(frozen=True, slots=True, eq=False)
class ShapeSpace:
    """S groups of a body's dimensions. body : of shape 0."""

    body: BodyModel
    groups: tuple[ShapeGroup, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """(S,) names of the groups."""
        return tuple(group.name for group in self.groups)

    def dimensions(self, shape: Array) -> dict[str, float]:
        """The dimensions of a shape (S,): name to mm or ratio."""
        return {
            name: group.resized(self.body.dimensions[name], float(value))
            for group, value in zip(self.groups, shape, strict=True)
            for name in group.dimensions
        }

    def body_of(self, shape: Array) -> BodyModel:
        """The body of a shape (S,)."""
        return with_dimensions(self.body, self.dimensions(shape))

    def sizes(self, shape: Array) -> Array:
        """(S,) mm, ratios without a unit: the mean of each group's dimensions."""
        sizes = self.dimensions(shape)
        means = [
            sum(sizes[name] for name in group.dimensions) / len(group.dimensions) for group in self.groups
        ]
        return np.array(means, dtype=np.float64)


def shape_space(
    body: BodyModel,
    *,
    symmetric: bool = True,
    lengths: bool | Literal["untaped"] = True,
    radii: bool = True,
    flesh: bool = False,
) -> ShapeSpace:
    """The shape space of a body read from a file.

    symmetric : left and right are one group. lengths, radii, flesh : what may change (flesh: ratios and offsets);
    "untaped": of the lengths only those that no tape measures (`untaped_lengths`). Lengths and radii that are zero
    (absent limbs) stay so. Raises BodyError where nothing can change.
    """
    kinds = dimension_kinds(body.definition) if body.definition else {}
    untaped = untaped_lengths(body)
    chosen = {"length": bool(lengths), "radius": radii, "ratio": flesh, "offset": flesh}
    by_size: dict[tuple[str, Kind], list[str]] = {}
    for name, kind in kinds.items():
        if lengths == "untaped" and kind == "length" and name not in untaped:
            continue
        if chosen[kind] and (body.dimensions[name] > 0.0 or kind == "offset") and name not in SMALL:
            by_size.setdefault((_group_name(name, symmetric), kind), []).append(name)
    if not by_size:
        raise BodyError(
            f"Body '{body.name}' has no dimensions that could be fitted.",
            "Give its lengths and radii in the body file as named dimensions.",
        )
    groups = tuple(
        ShapeGroup(name, kind, tuple(dimensions), _spread(body, dimensions[0], kind))
        for (name, kind), dimensions in by_size.items()
    )
    return ShapeSpace(body, groups)


def dimension_kinds(definition: BodyDefinition) -> dict[str, Kind]:
    """The dimensions that are a "length" (of a limb, or a joint's way from its parent), a "radius", a "ratio" or an
    "offset", in order.
    """
    lengths: set[str] = set()
    radii: set[str] = set()
    for joint in definition.joints:
        lengths |= {_name(step.by) for step in joint.sequence if step.move}
    for limb in definition.limbs:
        lengths.add(_name(limb.length))
        radii |= {_name(limb.radius_start), _name(limb.radius_end)}
    kinds: dict[str, Kind] = {}
    for name, entry in definition.dimensions.items():
        if entry.spread is not None:
            kinds[name] = "ratio" if entry.ratio is not None else "offset"
        elif name in radii:
            kinds[name] = "radius"
        elif name in lengths:
            kinds[name] = "length"
    return kinds


def untaped_lengths(body: BodyModel) -> frozenset[str]:
    """Lengths of limbs that no tape measures: at the ends of the body (hands, feet, head), and along the trunk where it
    is no share of a person's height, as in an animal's fur.
    """
    if body.definition is None:
        return frozenset()
    dimensions = body.definition.dimensions
    names = set[str]()
    for limb, is_end in zip(written_limbs(body.definition), ends_of(body, body.limbs), strict=True):
        entry = dimensions.get(_name(limb.length))
        if entry is not None and (is_end or (limb.part == "trunk" and entry.of_height is None)):
            names.add(_name(limb.length))
    return frozenset(names)


def keeps_taped(body: BodyModel, dimensions: Mapping[str, float]) -> bool:
    """Whether dimensions of a body from a file leave its lengths that a tape measures as they are: a fit with measured
    lengths does.
    """
    assert body.definition is not None
    kinds, untaped = dimension_kinds(body.definition), untaped_lengths(body)
    taped = [name for name, kind in kinds.items() if kind == "length" and name not in untaped]
    return all(dimensions[name] == body.dimensions[name] for name in taped)


def _spread(body: BodyModel, name: str, kind: Kind) -> float:
    """The spread of a dimension's group (`ShapeGroup`)."""
    spread = body.definition.dimensions[name].spread if body.definition else None
    if spread is None:
        return 0.0
    return spread / body.dimensions[name] if kind == "ratio" else spread


def _name(value: float | str) -> str:
    return split_sign(value)[1] if isinstance(value, str) else ""


def _group_name(name: str, symmetric: bool) -> str:
    """The group of a dimension: without its side where both sides are alike."""
    return SIDE.sub(r"\1", name) if symmetric else name


def mean_sides(space: ShapeSpace, dimensions: Mapping[str, float]) -> dict[str, float]:
    """The dimensions, those of groups with a left and a right replaced by the group's mean."""
    levelled = dict(dimensions)
    for group in space.groups:
        pairs: dict[str, list[str]] = {}
        for name in group.dimensions:
            pairs.setdefault(SIDE.sub(r"\1", name), []).append(name)
        for names in pairs.values():
            mean = float(np.mean([dimensions[name] for name in names]))
            levelled.update(dict.fromkeys(names, mean))
    return levelled


def levelled(space: ShapeSpace) -> ShapeSpace:
    """The same groups of a body whose left and right are equal, as far as they are in one group."""
    return dataclasses.replace(
        space, body=with_dimensions(space.body, mean_sides(space, space.body.dimensions))
    )
