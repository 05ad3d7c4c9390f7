"""The same body in another size."""

import math
from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel
from studio.body.reader import assemble
from studio.foundations.errors import BodyError

FOOT = "foot"


def with_usual_feet(body: BodyModel) -> BodyModel:
    """The body with feet of the usual share of its height where its file has feet of zero length; else the body
    unchanged. Its pose vector stays the same.
    """
    if body.definition is None:
        return body
    declared = body.definition.dimensions
    missing = {
        name: declared[name].of_height
        for name, value in body.dimensions.items()
        if value == 0.0 and FOOT in name.split("_") and name in declared and declared[name].of_height
    }
    if not missing:
        return body
    height = float(np.ptp(limb_ends(body, body.neutral)[0, ..., 2]))
    return with_dimensions(body, {name: share * height for name, share in missing.items() if share})


def follows_height(body: BodyModel) -> bool:
    """Whether any of the body's lengths is a published share of a person's height."""
    return body.definition is not None and any(
        entry.of_height is not None for entry in body.definition.dimensions.values()
    )


def with_dimensions(body: BodyModel, changes: Mapping[str, float]) -> BodyModel:
    """The body with some dimensions changed: its steps, limbs and markers are rebuilt.

    changes : dimension name to mm (or ratio). Raises BodyError for an unknown name, and for a value that is
    not finite or negative.
    """
    if body.definition is None:
        raise BodyError(
            f"Body '{body.name}' was not read from a file.", "Read it from a body file to resize it."
        )
    for name, value in changes.items():
        if name not in body.dimensions:
            known = ", ".join(body.dimensions) or "none"
            raise BodyError(f"Body '{body.name}' has no dimension '{name}'.", f"Known: {known}.")
        if not (math.isfinite(value) and (value >= 0.0 or body.definition.dimensions[name].is_offset)):
            raise BodyError(
                f"Dimension '{name}' cannot be {value}.", "Give a finite number that is not negative."
            )
    return _resized(body, tuple(sorted(changes.items())))


@lru_cache(maxsize=64)
def _resized(body: BodyModel, changes: tuple[tuple[str, float], ...]) -> BodyModel:
    assert body.definition is not None
    return assemble(body.definition, body.name, {**body.dimensions, **dict(changes)})
