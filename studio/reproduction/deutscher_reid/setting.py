"""Common parts of the experiments of Deutscher & Reid (2005): the filter before and after section 6, footage, and the
criterion of success.

The paper calls tracking successful "when the algorithm locks onto the body and limbs for the duration of the
sequence" (6.3), judged by eye. Here: the mean error of every frame is below LIMIT_MM, and no marker of any limb is
ever more than 150 mm off.
"""

from collections.abc import Mapping
from typing import Any

from studio.comparison.tracked import Tracked

WEIGHTING = "edge-region"
BODY = "human29, the paper's 29 parameters"

# Sections 3 to 5: noise planned ahead (Eq. 13) and half of the particles surviving (3.1).
PLAIN: Mapping[str, Any] = {"adaptive_diffusion": False, "crossover": 0.0, "survival": 0.5}
# Section 6.1 added: noise in proportion to what is still uncertain (Eq. 18).
ADAPTIVE: Mapping[str, Any] = {"adaptive_diffusion": True, "crossover": 0.0, "survival": 0.5}
# Section 6.2 added: every particle is made from two, cut between any two parameters (6.2.1, Eq. 19).
IMPROVED: Mapping[str, Any] = {**ADAPTIVE, "crossover": 1.0, "crossover_by": "parameters"}
# The studio's own way: half of the particles, cut between whole limbs.
BY_LIMBS: Mapping[str, Any] = {**ADAPTIVE, "crossover": 0.5, "crossover_by": "limbs"}
# The studio's own choice: all three terms, fewer survivors, no limb inside another.
STUDIO: Mapping[str, Any] = {**BY_LIMBS, "survival": 0.3, "constraints": "redraw", "limbs_apart": True}
STUDIO_WEIGHTING = "edge-region-silhouette"

CIRCLE, BOX = "circle-three-cameras", "box-and-turn"
TURNS, RUN, HANDSTAND = "walk-with-turns", "run-three-cameras", "handstand-three-cameras"

LIMIT_MM = 100.0
# Footage is rendered as far as it is used; a preview takes this many frames of each.
QUICK_FRAMES = 48

EQ18_WORDS = (
    "Eq. 18 prints no constant; with noise on top of the survivors the cloud grows, so they are shrunk towards their "
    "mean first (noise of 0.4 standard deviations)."
)
EQ17_WORDS = "Eq. 17 is printed without the minus sign of Eq. 16; it belongs there and is used."


def annealing_as_ten(layers: int) -> float:
    """The survival rate with which `layers` layers anneal as much as the ten of 0.5 of section 3.1: the product over
    the layers is the same, and so is the size at which the planned noise of Eq. 13 ends.
    """
    return float(0.5 ** (10 / layers))


def succeeded(found: Tracked) -> bool:
    """Whether every frame stays below LIMIT_MM and no limb is ever lost."""
    return found.worst_mm < LIMIT_MM and not found.lost_limbs
