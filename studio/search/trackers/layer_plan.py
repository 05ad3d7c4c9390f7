"""What a filter's layer does, in numbers: the processor's steps and a card's are made from the same plan."""

import math
from dataclasses import dataclass

from studio.foundations.arrays import Array

WIDEST = 128
"""Most parameters of a body whose particles a card keeps."""


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Noise on a set of survivors.

    sigma : (D,) standard deviations; None: the survivors' own. scale : of all noise. kept : how far particles stay from
    the survivors' mean. correlated : as the survivors are.
    """

    sigma: Array | None
    scale: float = 1.0
    kept: float = 1.0
    correlated: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class LayerPlan:
    """What a layer does. survival : α, the share that is to survive, NaN where β is given. noise : None in a frame's
    last layer. beta : β where it is given, else NaN. crossed : share of children.
    """

    survival: float
    noise: Noise | None
    beta: float = math.nan
    crossed: float = 0.0
