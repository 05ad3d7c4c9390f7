"""Masks by brightness and colour."""

import dataclasses

import numpy as np
import pytest

from studio.evidence.settings import EvidenceSettings
from studio.evidence.threshold import between_thresholds

COLOURED = {"mask_darkest": 0, "mask_hue_reach": 20.0, "mask_saturation": 0.2}
GREY, RED, BLUE, PALE_RED = (120, 120, 120), (30, 30, 220), (220, 40, 40), (150, 150, 200)


def picture() -> np.ndarray:
    """Four stripes of ten columns (20, 40, 3)."""
    return (
        np.stack([np.array(colour, np.uint8) for colour in (GREY, RED, BLUE, PALE_RED)])
        .repeat(10, axis=0)[None]
        .repeat(20, axis=0)
    )


@pytest.mark.parametrize(
    ("knobs", "inside"),
    [
        ({"mask_darkest": 110}, (True, False, False, True)),
        ({"mask_darkest": 0, "mask_brightest": 119}, (False, True, True, False)),
        (COLOURED | {"mask_hue": 350.0}, (False, True, False, True)),
        (COLOURED | {"mask_hue": 240.0}, (False, False, True, False)),
        ({"mask_darkest": 0, "mask_saturation": 0.5}, (False, True, True, False)),
    ],
)
def test_what_is_between_the_thresholds_is_the_subject(
    knobs: dict[str, float], inside: tuple[bool, ...]
) -> None:
    mask = between_thresholds(picture(), dataclasses.replace(EvidenceSettings(), **knobs))
    assert set(np.unique(mask)) <= {0, 255}
    # Two columns beside each change are smoothed.
    assert tuple(bool(mask[5, 10 * k + 5]) for k in range(4)) == inside
