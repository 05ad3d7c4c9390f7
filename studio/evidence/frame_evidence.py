"""The evidence of one frame."""

from dataclasses import dataclass

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
    hidden : (H, W) uint8, above 0 where the mask says nothing of the body, since another subject is in front of it;
        None: nowhere. Distances of silhouettes (`distance_maps`) leave it out; likelihoods weigh its pixels like any
        other, the processor and a card alike.
    """

    camera: str
    picture: Bytes
    mask: Bytes
    edges: Bytes
    background: YuvBackground | None = None
    hidden: Bytes | None = None


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class FrameEvidence:
    """All cameras' evidence of one frame, in the order of the session's cameras."""

    frame: int
    views: tuple[ViewEvidence, ...]
