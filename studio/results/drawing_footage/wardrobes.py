"""Wardrobes of the rendered person: colours of skin, shirt, trousers, shoes, hair and of the shirt's stripes.

Each wardrobe is (6, 3) RGB, 0...1, in the order of the materials in `flesh.py`.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

STRIPED = np.array(
    [
        (0.80, 0.52, 0.42),
        (0.22, 0.34, 0.46),
        (0.15, 0.17, 0.23),
        (0.12, 0.12, 0.13),
        (0.15, 0.10, 0.07),
        (0.52, 0.56, 0.58),
    ]
)
# Hardly brighter or darker than an office, as in the Lee walk's pictures.
PLAIN = np.array(
    [
        (0.62, 0.42, 0.34),
        (0.26, 0.31, 0.40),
        (0.12, 0.125, 0.15),
        (0.07, 0.07, 0.075),
        (0.07, 0.06, 0.055),
        (0.36, 0.365, 0.37),
    ]
)
WARDROBES = {"striped": STRIPED, "plain": PLAIN}
MATERIALS = ("skin", "shirt", "trousers", "shoes", "hair", "stripes")
"""The rows of a wardrobe."""


def dressed(wardrobe: str, colours: Mapping[str, tuple[float, float, float]]) -> NDArray[np.float64]:
    """(6, 3) a wardrobe with other colours for some of the MATERIALS."""
    palette = WARDROBES[wardrobe].copy()
    for material, colour in colours.items():
        palette[MATERIALS.index(material)] = colour
    return palette
