"""The pieces of a hull: a body is one, ghosts (places that all views take for foreground by chance) are others."""

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from studio.volume.hull import Hull

TOUCHING = np.ones((3, 3, 3), dtype=np.int64)
"""Voxels belong together that share a face, an edge or a corner."""


def piece_numbers(hull: Hull) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(K,) which piece each voxel belongs to, the largest being 0, and (P,) the pieces' volumes, mm³, falling."""
    if hull.empty:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    unit = hull.smallest_edge
    sides = np.rint(hull.edges / unit).astype(np.int64)
    lower = np.rint((hull.centres - 0.5 * hull.edges[:, None] - hull.box.corner) / unit).astype(np.int64)
    first = lower.min(axis=0)
    lower -= first
    filled = np.zeros((lower + sides[:, None]).max(axis=0), dtype=np.bool_)
    for (x, y, z), side in zip(lower, sides, strict=True):
        filled[x : x + side, y : y + side, z : z + side] = True
    labels = np.empty(filled.shape, dtype=np.int32)
    ndimage.label(filled, TOUCHING, output=labels)
    found = labels[lower[:, 0], lower[:, 1], lower[:, 2]].astype(np.int64) - 1
    volumes = np.bincount(found, weights=hull.volumes()).astype(np.float64)
    order = np.argsort(-volumes, kind="stable").astype(np.int64)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[found], volumes[order]


def largest_piece(hull: Hull) -> Hull:
    """The hull without all pieces but the largest."""
    numbers, _ = piece_numbers(hull)
    return chosen_voxels(hull, numbers == 0)


def chosen_voxels(hull: Hull, chosen: NDArray[np.bool_]) -> Hull:
    """The hull with only some of its voxels. chosen : (K,)."""
    return dataclasses.replace(
        hull,
        centres=hull.centres[chosen],
        edges=hull.edges[chosen],
        colours=hull.colours[chosen],
        view_colours=hull.view_colours[chosen],
    )
