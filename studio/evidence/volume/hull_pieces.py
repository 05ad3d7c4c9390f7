# pyright: standard
"""Connected pieces of a hull: the body is one, ghosts (foreground in all views by chance) are others."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.hull import Hull
from studio.foundations.numba_in_threads import KERNEL, njit


def piece_numbers(hull: Hull) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(K,) piece of each voxel, the largest being 0, and (P,) the pieces' volumes, mm³, descending."""
    if hull.empty:
        return np.zeros(0, dtype=np.int64), np.zeros(0)
    unit = hull.smallest_edge
    sides = np.rint(hull.edges / unit).astype(np.int64)
    lower = np.rint((hull.centres - 0.5 * hull.edges[:, None] - hull.box.corner) / unit).astype(np.int64)
    lower += 1 - lower.min(axis=0)
    filled = np.zeros((lower + sides[:, None]).max(axis=0) + 1, dtype=np.bool_)
    fill_cubes(lower, sides, filled)
    pieces = labels_of(filled)[lower[:, 0], lower[:, 1], lower[:, 2]].astype(np.int64) - 1
    volumes = np.bincount(pieces, weights=hull.volumes()).astype(np.float64)
    order = np.argsort(-volumes, kind="stable").astype(np.int64)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[pieces], volumes[order]


@njit(**KERNEL)
def fill_cubes(lower, sides, filled):
    """Set a grid's cells (X, Y, Z) in each cube: its lowest cell (K, 3) and its side (K,) in cells."""
    for k in range(len(sides)):
        side = sides[k]
        for x in range(lower[k, 0], lower[k, 0] + side):
            for y in range(lower[k, 1], lower[k, 1] + side):
                for z in range(lower[k, 2], lower[k, 2] + side):
                    filled[x, y, z] = True


@njit(**KERNEL)
def labels_of(filled):
    """(X, Y, Z) int32, the number of each cell's piece from 1 on, 0 for empty cells; cells touch by faces, edges or
    corners. filled : (X, Y, Z), its outermost cells empty.

    Runs of cells along Z are joined with those that they touch of the row before and of three in the slice before; of
    joined runs the first one's number stands for all. So pieces are numbered in the order of their first cells.
    """
    wide, deep, high = filled.shape
    labels = np.zeros((wide, deep, high), np.int32)
    parents = np.zeros(1 + np.count_nonzero(filled), np.int32)
    count = 0
    for x in range(1, wide - 1):
        for y in range(1, deep - 1):
            row = filled[x, y]
            z = 1
            while z < high - 1:
                if not row[z]:
                    z += 1
                    continue
                end = z
                while row[end]:
                    end += 1
                count += 1
                parents[count] = count
                own = count
                for near in range(4):
                    before = labels[x, y - 1] if near == 0 else labels[x - 1, y - 2 + near]
                    last = 0
                    for k in range(z - 1, end + 1):
                        if before[k] and before[k] != last:
                            last = before[k]
                            own = joined(parents, own, last)
                labels[x, y, z:end] = count
                z = end
    number = 0
    for run in range(1, count + 1):
        if parents[run] == run:
            number += 1
            parents[run] = -number
        else:
            # A run's parent is an earlier one, whose place holds its piece's number by now.
            parents[run] = parents[parents[run]]
    for x in range(1, wide - 1):
        for y in range(1, deep - 1):
            for z in range(1, high - 1):
                if filled[x, y, z]:
                    labels[x, y, z] = -parents[labels[x, y, z]]
    return labels


@njit(**KERNEL)
def joined(parents, one, other):
    """The number of two runs' common piece: the smaller one of theirs."""
    one, other = root_of(parents, one), root_of(parents, other)
    parents[max(one, other)] = min(one, other)
    return min(one, other)


@njit(**KERNEL)
def root_of(parents, run):
    """The number of a run's piece."""
    while parents[run] != run:
        parents[run] = parents[parents[run]]
        run = parents[run]
    return run


def chosen_voxels(hull: Hull, chosen: NDArray[np.bool_]) -> Hull:
    """The hull with only some of its voxels. chosen : (K,)."""
    return dataclasses.replace(
        hull,
        centres=hull.centres[chosen],
        edges=hull.edges[chosen],
        colours=hull.colours[chosen],
        view_colours=hull.view_colours[chosen],
    )
