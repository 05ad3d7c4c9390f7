"""From a checked body definition and the values of its dimensions to a `BodyModel`."""

import math
from collections.abc import Mapping

import numpy as np

from studio.body.definition import WORLD, BodyDefinition, ParameterEntry, StepEntry, split_sign
from studio.body.model import MOVE, TURN, BodyModel, Joint, Limb, Marker, Parameter, Step

AXES = "xyz"


def assemble(definition: BodyDefinition, name: str, dimensions: Mapping[str, float]) -> BodyModel:
    """The body with these dimensions (mm, ratios).

    definition : already checked (`validation.check_definition`), so every name in it exists.
    """
    parameter_index = {entry.name: index for index, entry in enumerate(definition.parameters)}
    joint_index = {entry.name: index for index, entry in enumerate(definition.joints)}

    def amount(value: float | str) -> float:
        if not isinstance(value, str):
            return float(value)
        sign, dimension = split_sign(value)
        return sign * dimensions[dimension]

    def rest(value: float | tuple[float | str, ...]) -> float:
        return sum(amount(part) for part in value) if isinstance(value, tuple) else value

    def step(entry: StepEntry) -> Step:
        kind, axis = (MOVE, entry.move) if entry.move else (TURN, entry.turn)
        axis_index = AXES.index(axis or "x")
        if isinstance(entry.by, str):
            sign, reference = split_sign(entry.by)
            if reference in parameter_index:
                return Step(kind, axis_index, parameter_index[reference], sign)
            return Step(kind, axis_index, -1, amount(entry.by))
        return Step(kind, axis_index, -1, entry.by if kind == MOVE else math.radians(entry.by))

    return BodyModel(
        name=name,
        title=definition.title,
        parameters=tuple(parameter(entry, rest(entry.neutral)) for entry in definition.parameters),
        joints=tuple(
            Joint(
                entry.name,
                -1 if entry.parent == WORLD else joint_index[entry.parent],
                tuple(step(part) for part in entry.sequence),
            )
            for entry in definition.joints
        ),
        limbs=tuple(
            Limb(
                entry.name,
                joint_index[entry.joint],
                amount(entry.length),
                amount(entry.radius_start),
                amount(entry.radius_end),
                amount(entry.scale_x),
                amount(entry.scale_y),
                entry.side,
                entry.part,
            )
            for entry in definition.limbs
        ),
        markers=tuple(
            Marker(entry.name, joint_index[entry.joint], np.array([amount(value) for value in entry.at]))
            for entry in definition.markers
        ),
        dimensions=dict(dimensions),
        definition=definition,
    )


def parameter(entry: ParameterEntry, neutral: float) -> Parameter:
    """A pose entry in radians or mm. neutral : degrees or mm."""
    unit = math.radians(1.0) if entry.kind == "angle" else 1.0
    return Parameter(
        name=entry.name,
        label=entry.label or entry.name.replace("_", " "),
        kind=entry.kind,
        lower=entry.lower * unit,
        upper=entry.upper * unit,
        max_step=entry.max_step * unit,
        neutral=neutral * unit,
        limb=entry.limb,
    )
