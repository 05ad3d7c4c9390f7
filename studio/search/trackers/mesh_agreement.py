"""How well the links' own silhouettes explain all views: `agreement` for a body with meshes.

A cone around a link with an arm or a bend covers twice as much as the link: no mask agrees with it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices, Mask
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.mesh_outlines import MeshOutlines
from studio.search.likelihood.mesh_silhouettes import MeshSilhouettes
from studio.search.trackers.agreement_kernels import FIELDS
from studio.search.trackers.refinement import Distances


class MeshAgreement:
    """Compares poses of one body with silhouettes in some cameras; immutable."""

    def __init__(self, body: BodyModel, cameras: tuple[Camera, ...]) -> None:
        self._body, self._cameras = body, cameras
        self._outlines = MeshOutlines(body, cameras)

    def counts(
        self, pose: Array, silhouettes: Sequence[Distances], steps: Sequence[int], far: Sequence[float]
    ) -> tuple[Array, list[tuple[Array, Indices]]]:
        """Of a pose (D,), (V, L, 3) cells as `agreement_kernels.view_counts` has them, a link's where it is seen, given
        to the limb that stands for it; and of every view the cells that are bare, pixels (K, 2), with the nearest limb
        (K,). steps, far : pixels, by view.
        """
        counts, bare = (
            np.zeros((len(silhouettes), len(self._body.drawn), FIELDS)),
            list[tuple[Array, Indices]](),
        )
        views = zip(counts, silhouettes, steps, far, strict=True)
        for view, (own, silhouette, step, reach) in enumerate(views):
            signed = _sampled(silhouette, step)
            owner = self._outlines.owners(pose, view, step, (signed.shape[1], signed.shape[0]))
            seen = owner >= 0
            away, (rows, columns) = _nearest(seen)
            lost = (signed < 0.0) & (away * step > reach) & seen.any()
            limbs = owner[rows[lost], columns[lost]]
            for column, cells in enumerate((owner[seen], owner[seen & (signed > reach)], limbs)):
                np.add.at(own[:, column], cells, 1.0)
            places: Array = (np.argwhere(lost)[:, ::-1] * step + step // 2).astype(np.float64)
            bare.append((places, limbs))
        return counts, bare

    def covered(self, pose: Array, view: int, cell: int) -> Mask:
        """(H, W) whether a link lies on the middle of a cell of so many pixels; what is left at the right and below is
        a cell.
        """
        camera = self._cameras[view]
        size = -(-camera.width // cell), -(-camera.height // cell)
        return self._outlines.owners(pose, view, cell, size) >= 0

    def of_places(self, poses: Array, silhouettes: Sequence[Distances], mm: Sequence[float]) -> Array:
        """(N,) mm² by which the silhouettes of poses (N, D) differ from a frame's. mm : of a pixel, by view."""
        masks = [_mask(silhouette) for silhouette in silhouettes]
        problem = MeshSilhouettes(self._body, self._cameras, masks)
        area = sum(np.count_nonzero(mask) * size**2 for mask, size in zip(masks, mm, strict=True))
        return problem.wrong(poses) * float(area)


def _sampled(silhouette: Distances, step: int) -> Array:
    """(H, W) the signed distances at the middles of a picture's whole cells, infinite beside the map."""
    (width, height), (left, top) = silhouette.size, silhouette.corner
    found = np.full((height // step, width // step), np.inf)
    rows = np.arange(found.shape[0]) * step + step // 2 - top
    columns = np.arange(found.shape[1]) * step + step // 2 - left
    inside = [
        (places >= 0) & (places < most)
        for places, most in zip((rows, columns), silhouette.signed.shape, strict=True)
    ]
    found[np.ix_(*inside)] = silhouette.signed[np.ix_(rows[inside[0]], columns[inside[1]])]
    return found


def _nearest(seen: Mask) -> tuple[Array, tuple[NDArray[np.int32], NDArray[np.int32]]]:
    """(H, W) cells to the nearest one that is seen, and its rows and columns."""
    away, places = ndimage.distance_transform_edt(~seen, return_indices=True)
    return away, (places[0], places[1])


def _mask(silhouette: Distances) -> Mask:
    mask = np.zeros(silhouette.size[::-1], np.bool_)
    (left, top), (height, width) = silhouette.corner, silhouette.signed.shape
    mask[top : top + height, left : left + width] = silhouette.signed < 0.0
    return mask
