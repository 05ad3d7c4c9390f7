"""Ways to spoil what a tracker is given, each of a degree, the same for the same seed.

Masks and edge maps are spoilt as they lie in memory, calibration as cameras: nothing of the session changes.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from studio.comparison.tracked import Changed
from studio.evidence.frame_evidence import FrameEvidence, ViewEvidence
from studio.geometry.camera import Camera
from studio.synthesis.damage import misplaced

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]

HOLE_SHARE = 0.5
"""Of the damage of a mask: holes in the person; the rest are blobs beside the person."""
BLOB_PIXELS = 9.0
"""Radius of holes and blobs, up to twice that: a hand's or a shadow's size in the twin's pictures."""
AROUND = 40
"""Blobs lie within this many pixels of the person."""
CLUTTER_LENGTH = (30.0, 120.0)
CLUTTER_BLUR = 2.0
FOREGROUND = 255


def nothing(degree: float, seed: int) -> Changed:
    """No damage, whatever the degree."""
    return Changed()


def mask_damage(degree: float, seed: int) -> Changed:
    """Holes torn into the masks, and blobs set beside the person, new in every frame.

    degree : damaged pixels as a share of the person's.
    """

    def spoil(evidence: FrameEvidence) -> FrameEvidence:
        views = tuple(
            replace(
                view,
                mask=damaged_mask(view.mask, degree, np.random.default_rng((seed, evidence.frame, index))),
            )
            for index, view in enumerate(evidence.views)
        )
        return FrameEvidence(evidence.frame, views)

    return Changed(evidence=spoil)


def damaged_mask(mask: Bytes, degree: float, rng: np.random.Generator) -> Bytes:
    """The mask with round holes and blobs until they cover `degree` of the person's pixels."""
    person = int((mask > 0).sum())
    if degree <= 0.0 or person == 0:
        return mask
    damaged = mask.copy()
    rows, columns = np.nonzero(mask)
    wanted = degree * person
    torn = set_ = 0
    while torn < HOLE_SHARE * wanted:
        place = int(rng.integers(person))
        torn += _paint(damaged, columns[place], rows[place], BLOB_PIXELS * (1.0 + rng.random()), 0)
    # Blobs fall near the person; where they hit it they count for nothing, so the number of tries is bounded.
    for _ in range(10_000):
        if set_ >= (1.0 - HOLE_SHARE) * wanted:
            break
        place = int(rng.integers(person))
        x, y = columns[place] + rng.uniform(-AROUND, AROUND), rows[place] + rng.uniform(-AROUND, AROUND)
        if 0 <= int(y) < mask.shape[0] and 0 <= int(x) < mask.shape[1] and not mask[int(y), int(x)]:
            set_ += _paint(damaged, x, y, BLOB_PIXELS * (1.0 + rng.random()), FOREGROUND)
    return damaged


def _paint(mask: Bytes, x: float, y: float, radius: float, value: int) -> int:
    """Paint a disc; returns how many pixels changed."""
    height, width = mask.shape
    top, bottom = max(0, int(y - radius)), min(height, int(y + radius) + 2)
    left, right = max(0, int(x - radius)), min(width, int(x + radius) + 2)
    window = mask[top:bottom, left:right]
    down, along = np.ogrid[top:bottom, left:right]
    disc = (down - y) ** 2 + (along - x) ** 2 <= radius * radius
    changed = int((disc & (window != value)).sum())
    window[disc] = value
    return changed


def clutter(degree: float, seed: int) -> Changed:
    """Straight edges all over the edge maps that do not move, as a cluttered room has them.

    degree : pixels on an edge as a share of the picture's.
    """
    kept: dict[tuple[int, tuple[int, ...]], Bytes] = {}

    def spoil(evidence: FrameEvidence) -> FrameEvidence:
        views: list[ViewEvidence] = []
        for index, view in enumerate(evidence.views):
            key = (index, view.edges.shape)
            if key not in kept:
                kept[key] = clutter_edges(view.edges.shape, degree, np.random.default_rng((seed, index)))
            views.append(replace(view, edges=np.maximum(view.edges, kept[key])))
        return FrameEvidence(evidence.frame, tuple(views))

    return Changed(evidence=spoil)


def clutter_edges(shape: tuple[int, ...], degree: float, rng: np.random.Generator) -> Bytes:
    """(H, W) an edge map of random lines, blurred and scaled to 0…255 as the real ones are."""
    height, width = shape
    lines = np.zeros(shape)
    while lines.mean() < degree:
        length, turn = rng.uniform(*CLUTTER_LENGTH), rng.uniform(0.0, np.pi)
        along = np.arange(0.0, length, 0.5)
        x = np.floor(rng.uniform(0, width) + along * np.cos(turn)).astype(int)
        y = np.floor(rng.uniform(0, height) + along * np.sin(turn)).astype(int)
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        lines[y[inside], x[inside]] = 1.0
    if degree <= 0.0:
        return np.zeros(shape, np.uint8)
    soft = gaussian_filter(lines, CLUTTER_BLUR)
    # A lone line keeps its full height, as the evidence's own proximity maps do.
    ridge = 1.0 / (CLUTTER_BLUR * np.sqrt(2.0 * np.pi))
    return np.round(255.0 * np.minimum(1.0, soft / ridge)).astype(np.uint8)


def calibration_error(degree: float, seed: int) -> Changed:
    """Every camera believed to look elsewhere than it does.

    degree : pixels by which the picture's middle is off, in a direction of its own for each camera.
    """

    def spoil(cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
        return misplaced(cameras, degree, seed)

    return Changed(cameras=spoil)


DAMAGES: dict[str, Callable[[float, int], Changed]] = {
    "none": nothing,
    "mask": mask_damage,
    "clutter": clutter,
    "calibration": calibration_error,
}
