"""The same body in another size."""

import math
from collections.abc import Mapping

from studio.body.assembly import assemble
from studio.body.model import BodyModel
from studio.errors import BodyError


def with_dimensions(body: BodyModel, changes: Mapping[str, float]) -> BodyModel:
    """The body with some dimensions changed: its steps, limbs and markers are built anew.

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
        if not (math.isfinite(value) and value >= 0.0):
            raise BodyError(
                f"Dimension '{name}' cannot be {value}.", "Give a finite number that is not negative."
            )
    return assemble(body.definition, body.name, {**body.dimensions, **changes})
