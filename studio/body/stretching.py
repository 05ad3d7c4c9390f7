"""Limbs of changing length, as slides and cones that every reader of a body knows.

A limb of length L that may be a·L to b·L long becomes two overlapping cones. The thicker end has the limb's taper over
a·L, so that it never reaches beyond a limb at its shortest; the thinner end is a cylinder of (b - a)·L, which lies
inside the taper as far as the two overlap: the radius has no step at any length. The far cone lies on a slide along the
limb. Whatever is moved by the limb's length (joints' steps, markers) is moved by the slide as well.
"""

from collections.abc import Mapping
from typing import Literal

import msgspec

from studio.body.definition import (
    WORLD,
    BodyDefinition,
    JointEntry,
    LimbEntry,
    MarkerEntry,
    ParameterEntry,
    StepEntry,
    split_sign,
)

MOST_STRETCH = 2.0
"""Greatest length as a multiple of the least: two cones that fit into the shortest limb reach along the longest."""
AXES: tuple[Literal["x", "y", "z"], ...] = ("x", "y", "z")
BOUND_TO_BOUND_S = 0.25
"""Seconds from the least to the greatest length, where the body says no largest movement."""


def stretch_name(limb: LimbEntry) -> str:
    """The parameter of a limb that stretches: mm beyond its own length."""
    return f"{limb.name.replace(' ', '_')}_stretch"


def far_name(limb: LimbEntry) -> str:
    """The far cone of a limb that stretches, and its joint."""
    return f"{limb.name} end"


def stretch_step(limb: LimbEntry, length: float) -> float:
    """The largest movement of a limb that stretches, mm per second. length : its own, mm."""
    least, greatest = limb.stretch or (1.0, 1.0)
    return limb.stretch_step or (greatest - least) * length / BOUND_TO_BOUND_S


def with_slides(definition: BodyDefinition, dimensions: Mapping[str, float]) -> BodyDefinition:
    """The definition with two cones and a slide in place of each limb that stretches.

    dimensions : mm and ratios by name. A joint's type does not count the slides that its sequence now holds.
    """
    stretching = {
        split_sign(limb.length)[1]: limb
        for limb in definition.limbs
        if limb.stretch is not None and isinstance(limb.length, str)
    }
    if not stretching:
        return definition
    return _Slides(definition, dimensions, stretching).definition()


def written_limbs(definition: BodyDefinition) -> tuple[LimbEntry, ...]:
    """For each limb of the assembled body the entry that it is made of."""
    return tuple(limb for limb in definition.limbs for _ in range(1 if limb.stretch is None else 2))


class _Slides:
    def __init__(
        self, written: BodyDefinition, dimensions: Mapping[str, float], stretching: Mapping[str, LimbEntry]
    ) -> None:
        self.written, self.dimensions, self.stretching = written, dimensions, stretching
        # By the joint that they hang from.
        self.more: dict[str, list[JointEntry]] = {}

    def definition(self) -> BodyDefinition:
        limbs = tuple(cone for limb in self.written.limbs for cone in self.cones(limb))
        markers = tuple(self.marker(one) for one in self.written.markers)
        joints = list[JointEntry]()
        for joint in self.written.joints:
            sequence = tuple(step for one in joint.sequence for step in (one, *self.slide(one)))
            joints += [msgspec.structs.replace(joint, sequence=sequence), *self.more.get(joint.name, [])]
        return msgspec.structs.replace(
            self.written, parameters=self.parameters(), joints=tuple(joints), limbs=limbs, markers=markers
        )

    def slide(self, step: StepEntry) -> tuple[StepEntry, ...]:
        """The step that goes along with a move by the length of a limb that stretches."""
        if step.move is None or not isinstance(step.by, str):
            return ()
        sign, name = split_sign(step.by)
        limb = self.stretching.get(name)
        return () if limb is None else (StepEntry(_signed(sign, stretch_name(limb)), move=step.move),)

    def cones(self, limb: LimbEntry) -> tuple[LimbEntry, ...]:
        if limb.stretch is None or not isinstance(limb.length, str):
            return (limb,)
        sign, name = split_sign(limb.length)
        length, (least, greatest) = sign * self.dimensions[name], limb.stretch
        taper, cylinder = least * length, (greatest - least) * length
        # By the file's own sizes: radii that are fitted leave the cones as they are.
        if self.own(limb.radius_start) >= self.own(limb.radius_end):
            middle, near, far = limb.radius_end, taper, cylinder
        else:
            middle, near, far = limb.radius_start, cylinder, taper
        end = far_name(limb)
        start = StepEntry(length - far, move="z")
        along = StepEntry(_signed(sign, stretch_name(limb)), move="z")
        self.more.setdefault(limb.joint, []).append(JointEntry(end, limb.joint, "slide", (start, along)))
        plain = msgspec.structs.replace(limb, stretch=None, stretch_step=None)
        return (
            msgspec.structs.replace(plain, length=near, radius_end=middle),
            msgspec.structs.replace(plain, name=end, joint=end, length=far, radius_start=middle),
        )

    def own(self, value: float | str) -> float:
        if not isinstance(value, str):
            return value
        sign, name = split_sign(value)
        return sign * self.written.dimensions[name].value

    def marker(self, marker: MarkerEntry) -> MarkerEntry:
        """The marker, on a slide of its own where it lies by the length of a limb that stretches."""
        steps = tuple(
            slide
            for axis, value in zip(AXES, marker.at, strict=True)
            for slide in self.slide(StepEntry(value, move=axis))
        )
        if not steps:
            return marker
        # Markers that lie alike share a joint.
        name = " ".join([marker.joint, *(f"{step.move} {step.by}".replace("-", "down ") for step in steps)])
        hanging = self.more.setdefault(marker.joint, [])
        if all(one.name != name for one in hanging):
            hanging.append(JointEntry(name, marker.joint, "slide", steps))
        return msgspec.structs.replace(marker, joint=name)

    def parameters(self) -> tuple[ParameterEntry, ...]:
        entries = list(self.written.parameters)
        for name, limb in self.stretching.items():
            above = self.moving_limb(limb)
            group = above if above and not self.is_rooted(limb) else limb.name
            places = [at for at, one in enumerate(entries) if one.limb == group]
            places = places or [at for at, one in enumerate(entries) if one.limb == above]
            least, greatest = limb.stretch or (1.0, 1.0)
            length = self.dimensions[name]
            entries.insert(
                places[-1] + 1 if places else len(entries),
                ParameterEntry(
                    name=stretch_name(limb),
                    kind="length",
                    max_step=stretch_step(limb, length),
                    limb=group,
                    label=f"{limb.name} stretch",
                    lower=(least - 1.0) * length,
                    upper=(greatest - 1.0) * length,
                ),
            )
        return tuple(entries)

    def moving_joint(self, limb: LimbEntry) -> JointEntry | None:
        """The joint of a limb or, as far as joints are fixed, the one above."""
        joints = {joint.name: joint for joint in self.written.joints}
        joint = joints.get(limb.joint)
        while joint is not None and joint.type == "fixed":
            joint = joints.get(joint.parent)
        return joint

    def is_rooted(self, limb: LimbEntry) -> bool:
        joint = self.moving_joint(limb)
        return joint is None or joint.parent == WORLD

    def moving_limb(self, limb: LimbEntry) -> str:
        joint = self.moving_joint(limb)
        groups = {entry.name: entry.limb for entry in self.written.parameters}
        driven = (
            split_sign(step.by)[1] for step in (joint.sequence if joint else ()) if isinstance(step.by, str)
        )
        return next((groups[name] for name in driven if name in groups), "")


def _signed(sign: float, name: str) -> str:
    return f"-{name}" if sign < 0.0 else name
