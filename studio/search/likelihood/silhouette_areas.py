"""Exact areas of projected bodies against observed silhouettes (Fleischmann et al. 2012, section 2.2).

Y is the area that lies in both the projected and the observed silhouette, B in the projected one only, R in the
observed one only, all in pixels whose centres count. At half resolution a pixel stands for a square of four: it is
silhouette where more than half of those that exist are; where exactly half are, every second one is, as on a
chessboard, so that silhouettes neither grow nor shift.
"""

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from studio.evidence.frame_evidence import FrameEvidence, half_mask
from studio.foundations.arrays import Array, Floats, Mask
from studio.foundations.knobs import next_frame_knob
from studio.foundations.numba_in_threads import parallel_blocks
from studio.search.likelihood.area_kernels import ROWS, WINDOW_STEP, area_blocks, halve, pack_windows
from studio.search.likelihood.outline_kernels import LANES
from studio.search.likelihood.picture_maps import Maps

IntArray = NDArray[np.int64]
Words = NDArray[np.uint64]

FOREGROUND = 128
"""Mask values from here on are silhouette."""
FULL, HALF = "full", "half"
BLOCKS_A_THREAD = 16
"""About half a millisecond of ten limbs in four pictures."""


def resolution_knob() -> Any:  # noqa: ANN401 - as `knob` itself
    """The knob of the silhouettes' resolution, the same for all likelihoods that have it."""
    return next_frame_knob(
        HALF,
        choices=(HALF, FULL),
        help="Resolution of the silhouettes' areas; half ranks poses as full does and is nearly twice as fast.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Areas:
    """Areas of N poses in V views, pixels at the chosen resolution.

    both : (N, V) Y. projected : (N, V) B + Y. observed : (V,) R + Y. outside : (N, V) area of limbs beyond the
    picture, overlaps counted twice; the whole picture's for each limb that cannot be projected.
    """

    both: IntArray
    projected: IntArray
    observed: IntArray
    outside: Array

    def fitness(self) -> Array:
        """(N, V) f_s = 1/2 Y / (B + Y) + 1/2 Y / (R + Y), the area outside the picture counted in B; 0 / 0 is 0."""
        return 0.5 * _share(self.both, self.projected + self.outside) + 0.5 * _share(self.both, self.observed)


class Silhouettes:
    """The silhouettes of a frame, packed for the kernel. pixels : (V,) areas. sizes : (V, 2) widths, heights."""

    def __init__(self, evidence: FrameEvidence, resolution: str = FULL) -> None:
        self.scale = 0.5 if resolution == HALF else 1.0
        masks = [half_mask(view) >= FOREGROUND for view in evidence.views]
        if resolution == HALF:
            masks = [halved(mask) for mask in masks]
        self.sizes = np.array([mask.shape[::-1] for mask in masks], dtype=np.int64)
        self.pixels = np.array([np.count_nonzero(mask) for mask in masks], dtype=np.int64)
        self.maps = packed_windows(masks)

    def areas(self, outlines: Floats, count: int) -> Areas:
        """The areas of the first `count` poses of outlines (B, V, L, 160)."""
        blocks, views = outlines.shape[:2]
        counts = np.empty((blocks, views, LANES, 2), dtype=np.int64)
        outside = np.empty((blocks, views, LANES))
        given = count, outlines, self.scale, self.maps
        parallel_blocks(area_blocks, blocks, BLOCKS_A_THREAD, *given, counts, outside)
        counts = counts.transpose(0, 2, 1, 3).reshape(-1, views, 2)[:count]
        beyond = outside.transpose(0, 2, 1).reshape(-1, views)[:count]
        return Areas(counts[..., 1], counts[..., 0], self.pixels, beyond)


_known: WeakKeyDictionary[FrameEvidence, dict[str, Silhouettes]] = WeakKeyDictionary()


def silhouettes_of(evidence: FrameEvidence, resolution: str) -> Silhouettes:
    """The silhouettes of a frame, kept as long as the evidence is: likelihood and loss detection share them."""
    by_resolution = _known.setdefault(evidence, {})
    if resolution not in by_resolution:
        by_resolution[resolution] = Silhouettes(evidence, resolution)
    return by_resolution[resolution]


def halved(mask: Mask) -> Mask:
    """(ceil(H / 2), ceil(W / 2)) a mask (H, W) at half resolution."""
    found = np.empty((-(-mask.shape[0] // 2), -(-mask.shape[1] // 2)), dtype=np.bool_)
    halve(mask, found)
    return found


def packed_windows(masks: list[Mask]) -> Maps:
    """All masks as columns of 64-bit words, one column for every WINDOW_STEP pixels: bit k of the word in column c
    and row y is pixel (16 c + k, y). The second number of a view is that of words a column.
    """
    views = np.zeros((len(masks), 4), dtype=np.int64)
    for row, mask in zip(views, masks, strict=True):
        row[1:] = mask.shape[0] + ROWS, mask.shape[1], mask.shape[0]
    sizes = -(-views[:, 2] // WINDOW_STEP) * views[:, 1]
    views[1:, 0] = np.cumsum(sizes)[:-1]
    words: Words = np.empty(int(sizes.sum()), np.uint64)
    for view, size, mask in zip(views, sizes, masks, strict=True):
        start = int(view[0])
        pack_windows(mask, int(view[1]), words[start : start + int(size)])
    return Maps(words, views)


def _share(part: NDArray[Any], whole: NDArray[Any]) -> Array:
    """part / whole, 0 where there is no whole (then there is no part)."""
    return part / np.maximum(whole, 1.0)
