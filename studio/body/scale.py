"""The size of a body beside a person: lengths that were measured on people, in mm, are multiplied by it.

A mouse is not tracked with a person's reach of clothes, nor looked for in a room of two metres. The scale is a power of
two, and 1 for everything between half and twice a person's size: people of all heights are tracked alike.
"""

import math
from functools import lru_cache

import numpy as np

from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel

PERSON_MM = 1700.0
"""The longest side of a person at rest."""


@lru_cache(maxsize=64)
def scale_of(body: BodyModel) -> float:
    """The longest side of a body at rest as a share of a person's, to a power of two; 1 between half and twice."""
    longest = longest_side(body)
    octaves = math.log2(longest / PERSON_MM) if longest > 0.0 else 0.0
    return 2.0 ** round(octaves) if abs(octaves) >= 1.0 else 1.0


def rest_height(body: BodyModel) -> float:
    """mm above the floor of the highest end of a limb's axis of a body at rest."""
    return float(limb_ends(body, body.neutral)[0, ..., 2].max())


def longest_side(body: BodyModel) -> float:
    """mm along x, y or z from end to end of the limbs' axes of a body at rest; 0 for a body without limbs."""
    if not body.drawn:
        return 0.0
    ends = limb_ends(body, body.neutral)[0].reshape(-1, 3)
    return float(np.ptp(ends, axis=0).max())
