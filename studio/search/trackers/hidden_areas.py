"""Occluded areas: parts of a view into which the body projects frame after frame, but where no mask ever shows it.

Masks carry no information there, and a silhouette cut off by a box does not end at the body's border. An occluded limb
differs from a lost one in that no part of the masks is left uncovered: a lost limb is seen elsewhere, an occluded one
is not seen at all. Frames are counted on a grid of cells in each view; the counts are part of the frame's state, so
that a resumed run, or a frame that is searched again, has them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.geometry.camera import Camera
from studio.search.trackers.agreement import FAR_MM, Disagreement
from studio.search.trackers.agreement_kernels import count_cells, count_covered
from studio.search.trackers.refinement import Distances
from studio.search.trackers.tracker import HIDDEN

Counts = NDArray[np.float64]

CELLS = 160
"""Cells along the longer side of a picture."""
FRAMES = 6.0
"""A cell is hidden once the body was expected in it, and never seen there, in so many frames."""
MOST_BARE = 0.01
"""Share of the body's area: where more of the masks is uncovered, the pose is doubtful and no cell is counted."""
ROUGH = 1.5
"""Times the reach of clothes: up to this distance from a hidden area a border is not taken for the body's."""


@dataclass(frozen=True, slots=True, eq=False)
class Uncovered:
    """A view's silhouette without its hidden areas: see `Distances`. In these `signed` is 0, neither inside nor
    outside, and they have no border.
    """

    size: tuple[int, int]
    corner: tuple[int, int]
    signed: NDArray[np.float32]
    border: Array
    outward: Array


def counts_of(memory: Mapping[str, Array], camera: Camera) -> Counts:
    """(H, W) frames counted so far, by cell."""
    known = memory.get(HIDDEN + camera.name)
    if known is not None:
        return known
    cell = cell_size(camera)
    return np.zeros((-(-camera.height // cell), -(-camera.width // cell)))


def cell_size(camera: Camera) -> int:
    """Side of a cell, pixels."""
    return max(1, round(max(camera.width, camera.height) / CELLS))


def without_hidden(
    masks: Sequence[Distances], cameras: Sequence[Camera], mm: Sequence[float], memory: Mapping[str, Array]
) -> list[Distances]:
    """The silhouettes of a frame's masks, one a camera, without hidden areas. mm : size of a pixel of each view at the
    body. memory : at the frame's start.
    """
    return [
        _without_hidden(view, camera, memory, scale)
        for view, camera, scale in zip(masks, cameras, mm, strict=True)
    ]


def _without_hidden(view: Distances, camera: Camera, memory: Mapping[str, Array], mm: float) -> Distances:
    """The same for one view, with a margin for rough masks. mm : size of a pixel."""
    counts = memory.get(HIDDEN + camera.name)
    if counts is None or not view.signed.size:
        return view
    hidden = counts >= FRAMES
    if not hidden.any():
        return view
    cell = cell_size(camera)
    near = np.asarray(scipy.ndimage.distance_transform_edt(~hidden)) * cell <= ROUGH * FAR_MM / mm
    left, top, signed = _with_room(view, near, cell)
    rows = (top + np.arange(len(signed))) // cell
    columns = (left + np.arange(int(signed.shape[1]))) // cell
    here = near[np.ix_(rows, columns)]
    signed = np.where(here & (signed > 0.0), np.float32(0.0), signed)
    at = view.border.astype(np.int64) // cell
    kept = ~near[at[:, 1], at[:, 0]]
    return Uncovered(view.size, (left, top), signed, view.border[kept], view.outward[kept])


def _with_room(view: Distances, near: NDArray[np.bool_], cell: int) -> tuple[int, int, NDArray[np.float32]]:
    """Left and top of the view's map enlarged to hold the cells of `near` too, and that map; far is far."""
    columns, rows = np.flatnonzero(near.any(axis=0)), np.flatnonzero(near.any(axis=1))
    (left, top), (height, width) = view.corner, view.signed.shape
    begin = min(left, columns[0] * cell), min(top, rows[0] * cell)
    end = (
        min(view.size[0], max(left + width, (columns[-1] + 1) * cell)),
        min(view.size[1], max(top + height, (rows[-1] + 1) * cell)),
    )
    found = np.full((end[1] - begin[1], end[0] - begin[0]), np.float32(max(view.size)))
    found[top - begin[1] :, left - begin[0] :][:height, :width] = view.signed
    return int(begin[0]), int(begin[1]), found


def learnt(
    memory: Mapping[str, Array],
    disagreement: Disagreement,
    cameras: Sequence[Camera],
    masks: Sequence[Distances],
) -> Mapping[str, Array]:
    """The memory after a frame. disagreement : of its pose. masks : one a camera."""
    if disagreement.bare.sum() > MOST_BARE * disagreement.area.sum():
        return memory
    found = dict(memory)
    views = zip(cameras, disagreement.corners, masks, disagreement.mm, strict=True)
    for number, (camera, quads, view, scale) in enumerate(views):
        counts, cell = counts_of(memory, camera).copy(), cell_size(camera)
        given = view.signed, view.corner, cell, FAR_MM / scale, counts
        if disagreement.covered is None:
            count_cells(quads, *given)
        else:
            count_covered(disagreement.covered(number, cell), *given)
        found[HIDDEN + camera.name] = counts
    return found
