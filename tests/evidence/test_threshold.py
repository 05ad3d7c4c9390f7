"""Masks by brightness and colour."""

import dataclasses

import cv2
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


@pytest.mark.parametrize(
    "knobs",
    [
        {"mask_darkest": 100, "mask_brightest": 140},
        {"mask_darkest": 0, "mask_brightest": 255, "mask_hue_reach": 20.0, "mask_hue": 100.0},
        {"mask_darkest": 90, "mask_brightest": 255, "mask_hue_reach": 120.0, "mask_hue": 300.0},
        {"mask_darkest": 0, "mask_brightest": 200, "mask_saturation": 0.2},
        {"mask_darkest": 80, "mask_brightest": 170, "mask_saturation": 0.2, "mask_hue_reach": 60.0},
    ],
)
def test_every_pixels_smoothed_colour_decides_up_to_the_thresholds_themselves(
    knobs: dict[str, float],
) -> None:
    settings = dataclasses.replace(EvidenceSettings(), **knobs)
    colours = np.random.default_rng(3).integers(0, 256, (150, 200, 3), dtype=np.uint8)
    around = np.pad(colours.astype(int), ((1, 1), (1, 1), (0, 0)), mode="reflect")
    smooth = np.rint(sum(around[y : y + 150, x : x + 200] for y in range(3) for x in range(3)) / 9.0)
    level = np.rint(smooth.sum(axis=2) / 3.0)
    hue, saturation, _ = np.moveaxis(cv2.cvtColor(smooth.astype(np.uint8), cv2.COLOR_BGR2HSV), 2, 0)
    away = np.abs(2.0 * hue - settings.mask_hue)
    inside = (level >= settings.mask_darkest) & (level <= settings.mask_brightest)
    inside &= saturation / 255.0 >= settings.mask_saturation
    inside &= np.minimum(away, 360.0 - away) <= settings.mask_hue_reach
    assert 0.05 < inside.mean() < 0.95
    np.testing.assert_array_equal(between_thresholds(colours, settings), np.where(inside, 255, 0))
