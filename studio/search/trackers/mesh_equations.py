"""Normal equations of the outlines of meshes against silhouettes: those of `refinement` for a body whose links have
surfaces, which are exact where a cone around a link is several pixels off.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from studio.body.model import BodyModel
from studio.foundations.arrays import Array, Indices, evenly_spread
from studio.foundations.geometry.camera import Camera
from studio.search.likelihood.mesh_outlines import MeshOutline, MeshOutlines

NEIGHBOURS = 12
"""Points of the outline among which one that faces as a border point does is looked for."""
SAME_WAY = 0.5
"""Least cosine between the outward directions of a border point and the outline's point that explains it."""
REACH = 4.0
"""Times c: farther points explain nothing."""
SAMPLES = 300
"""Points of a view's outline that are compared with the silhouette."""


class MeshEquations:
    """Makes the equations of one body in some cameras; immutable."""

    def __init__(self, body: BodyModel, cameras: Sequence[Camera], differences: Array) -> None:
        """differences : (D,) half the step of the differences."""
        self._outlines, self._differences = MeshOutlines(body, cameras), differences

    def of(
        self,
        pose: Array,
        borders: Sequence[Array],
        maps: Sequence[tuple[Array, Indices]],
        mm: Array,
        scales: Array,
        part: float,
    ) -> tuple[float, Array, Array]:
        """The loss of a pose (D,), and the gradient (D,) and matrix (D, D) of half of it.

        borders : by view (K, 4) border points and their outward directions. maps : by view signed distances (H, W) and
        their left and top in the picture. mm : (V,) of a pixel. scales : (V,) c of the loss, mm. part : weight of an
        outline's point relative to a border point.
        """
        size = len(pose)
        loss, gradient, matrix = 0.0, np.zeros(size), np.zeros((size, size))
        for view, outline in enumerate(self._outlines.of(pose)):
            pairs = (
                (1.0, *_explained(outline, borders[view], REACH * scales[view] / mm[view])),
                (part, *_compared(outline, *maps[view], REACH * scales[view] / mm[view])),
            )
            for weight, rows, away, across in pairs:
                ratio = np.square(away * (mm[view] / scales[view]))
                loss += weight * scales[view] ** 2 * float(np.sum(ratio / (1.0 + ratio)))
                near = rows >= 0
                if not near.any():
                    continue
                moved = mm[view] * self._outlines.slopes(pose, view, outline, rows[near], self._differences)
                share = weight / np.square(1.0 + ratio[near])
                gradient += moved.T @ (share * mm[view] * across[near])
                matrix += (moved * share[:, None]).T @ moved
        return loss, gradient, matrix


def _explained(outline: MeshOutline, border: Array, reach: float) -> tuple[Indices, Array, Array]:
    """For every border point (K, 4) the outline's point that explains it, -1 for none, how far that is (K,), and how
    far outside the border it lies (K,), pixels.
    """
    rows, away, across = (
        np.full(len(border), -1, np.int64),
        np.full(len(border), reach),
        np.zeros(len(border)),
    )
    if not len(border) or not len(outline.border):
        return rows, away, across
    count = min(NEIGHBOURS, len(outline.border))
    far, near = cKDTree(outline.border).query(border[:, :2], k=count, distance_upper_bound=reach)
    far, near = np.asarray(far).reshape(len(border), -1), np.asarray(near).reshape(len(border), -1)
    there = np.isfinite(far)
    near = np.where(there, near, 0)
    there &= np.einsum("kni,ki->kn", outline.outward[near], border[:, 2:]) >= SAME_WAY
    known = there.any(axis=1)
    first = near[np.arange(len(border)), np.argmax(there, axis=1)]
    rows[known] = first[known]
    across[known] = np.einsum(
        "ki,ki->k", outline.border[rows[known]] - border[known, :2], outline.outward[rows[known]]
    )
    # Points of an outline are a pixel apart: how far they are along it says nothing.
    away[known] = np.abs(across[known])
    return rows, away, across


def _compared(
    outline: MeshOutline, signed: Array, corner: Indices, reach: float
) -> tuple[Indices, Array, Array]:
    """Of points of the outline: their rows, -1 for those far from the silhouette, and how far outside it they are
    (K,), twice, pixels.
    """
    if not len(outline.border) or not signed.size:
        return np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    rows = evenly_spread(len(outline.border), SAMPLES)
    places = (outline.border[rows] - corner)[:, ::-1].T
    # Both borders run half a pixel outside their pixels.
    across = map_coordinates(signed, places, order=1, mode="constant", cval=reach) + 0.5
    across = np.clip(across, -reach, reach)
    return np.where(np.abs(across) < reach, rows, -1), np.abs(across), across
