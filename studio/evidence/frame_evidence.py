"""The evidence of one frame."""

import functools
from dataclasses import dataclass

import numpy as np

from studio.evidence.yuv_background import YuvBackground
from studio.foundations.arrays import Bytes

EDGE_KINDS = ("proximity", "bodytrack", "none", "hull")
"""Maps that a weighting reads; "hull": no map, but the evidence of a visual hull (knob hull_evidence)."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewEvidence:
    """One camera's evidence.

    picture : (H, W, 3) uint8 BGR.
    mask : (H, W) uint8, 0 background, 255 foreground.
    edges : (H, W) uint8 edge proximity map, 255 = on an edge (Eq. 14's p = edges / 255).
    background : the camera's empty view where the hull is to be carved from pixels; None: from the mask. A view with a
        background may have a mask of zeros, where none is needed.
    unknown : (H, W) uint8, 255 where it cannot be told whether a pixel is the body's: another subject is in front of
        it, or it looks like a shadow that too few cameras confirm; else 0. None: nowhere. Distances of silhouettes
        (`distance_maps`) leave the first out and count the second half, a hull is not carved by it (`open_mask`),
        likelihoods count it by `half_mask`.
    shadow : (H, W) uint8, 255 where a pixel changed but passed for a shadow, whatever became of it. None: nowhere.
    empty : (H, W, 3) uint8 BGR: the picture without the subject. None: not asked for, or not known.
    """

    camera: str
    picture: Bytes
    mask: Bytes
    edges: Bytes
    background: YuvBackground | None = None
    unknown: Bytes | None = None
    shadow: Bytes | None = None
    empty: Bytes | None = None


def half_mask(view: ViewEvidence) -> Bytes:
    """(H, W) the mask, with every second square of two by two pixels of the background that may be the body's: an area
    of it, at full or half resolution, counts half on either side, on a processor and a card alike.
    """
    return view.mask if view.unknown is None else view.mask | (view.unknown & _squares(*view.mask.shape))


def open_mask(view: ViewEvidence) -> Bytes:
    """(H, W) the mask with all that may be the body's."""
    return view.mask if view.unknown is None else view.mask | view.unknown


@functools.lru_cache(maxsize=16)
def _squares(height: int, width: int) -> Bytes:
    """A chessboard of two by two pixels, shared and read-only."""
    rows, columns = np.indices((height, width), sparse=True)
    board = np.where((rows // 2 + columns // 2) % 2 == 0, np.uint8(255), np.uint8(0))
    board.setflags(write=False)
    return board


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class FrameEvidence:
    """All cameras' evidence of one frame, in the order of the session's cameras."""

    frame: int
    views: tuple[ViewEvidence, ...]
