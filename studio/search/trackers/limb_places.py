# pyright: standard
"""Places of a grid that changed in all views, and that a pose leaves bare in some; cells that limbs cover."""

import numpy as np
from numpy.typing import NDArray

from studio.evidence.cells import cell_at
from studio.foundations.arrays import Array, Bytes
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.trackers.agreement_kernels import distance_to
from studio.search.trackers.limb_reach import is_reached_by_any
from studio.search.trackers.refinement_kernels import box_of, is_seen, turning

SAME, CHANGED, OPEN = 0, 1, 2
"""Kinds of a view's cells: the background; what changed; where nothing can be told."""
BARE_VIEWS = 2
"""In which a place is bare, at least."""
ROUGH, BLOCK = 4, 4
"""Cells along the side of a square, and places along that of a block, which are left out together."""


@njit(**EXACT)
def cells_of(
    mask: Bytes,
    shadow: Bytes,
    unknown: Bytes,
    size: int,
    least: float,
    kinds: Bytes,
    is_shaded: bool,
    is_open: bool,
) -> None:
    """Fill in the kinds (h, w) of cells of which a share `least` changed, or else cannot be told. mask, shadow, unknown
    : (H, W) pixels above 0; the second and third count only if there are any. size : pixels along a cell's side.
    """
    height, width = mask.shape
    changed, told = np.zeros(kinds.shape[1], np.int64), np.zeros(kinds.shape[1], np.int64)
    enough = least * size * size
    for row in range(kinds.shape[0]):
        changed[:], told[:] = 0, 0
        for y in range(row * size, min(height, (row + 1) * size)):
            column = left = 0
            for x in range(width):
                changed[column] += mask[y, x] > 0 or (is_shaded and shadow[y, x] > 0)
                told[column] += is_open and unknown[y, x] > 0
                left += 1
                if left == size:
                    column, left = column + 1, 0
        for column in range(kinds.shape[1]):
            kinds[row, column] = (
                CHANGED if changed[column] >= enough else OPEN if told[column] >= enough else SAME
            )


@njit(**EXACT)
def cover(
    quads: Array, owners: NDArray[np.int64], reach: float, bits: NDArray[np.uint32], near: Bytes
) -> None:
    """Set in (h, w) the bit of a limb's owner in each cell whose centre the limb covers, and 1 in those within `reach`
    of it. quads : (L, 4, 2) and reach in cells.
    """
    for limb in range(len(quads)):
        quad = quads[limb]
        if not is_seen(quad):
            continue
        turn, bit = turning(quad), np.uint32(1) << np.uint32(owners[limb])
        left, top, right, bottom = box_of(quad)
        for row in range(max(0, int(np.ceil(top - reach))), min(bits.shape[0] - 1, int(bottom + reach)) + 1):
            for column in range(
                max(0, int(np.ceil(left - reach))), min(bits.shape[1] - 1, int(right + reach)) + 1
            ):
                away = distance_to(float(column), float(row), quad, turn)
                if away == 0.0:
                    bits[row, column] |= bit
                if away <= reach:
                    near[row, column] = 1


@njit(**EXACT)
def squares_of(kinds: Bytes, squares: Bytes) -> None:
    """Set 1 in squares of ROUGH cells where any of a view's cells (h, w) changed or cannot be told."""
    for row in range(kinds.shape[0]):
        for column in range(kinds.shape[1]):
            if kinds[row, column] != SAME:
                squares[row // ROUGH, column // ROUGH] = 1


@njit(**EXACT)
def count_alone(bits: NDArray[np.uint32], kinds: Bytes, counts: Array) -> None:
    """Add to (3, G) the cells in which each limb lies, those in which it lies alone, and those of them that changed;
    none where nothing can be told. bits : (h, w) as of `cover`. kinds : (h, w).
    """
    for row in range(bits.shape[0]):
        for column in range(bits.shape[1]):
            own, kind = bits[row, column], kinds[row, column]
            if own == 0 or kind == OPEN:
                continue
            alone = own & (own - np.uint32(1)) == 0
            for limb in range(counts.shape[1]):
                if (own >> np.uint32(limb)) & np.uint32(1):
                    counts[0, limb] += 1.0
                    counts[1, limb] += alone
                    counts[2, limb] += alone and kind != SAME


@njit(**EXACT)
def is_empty(
    rough: Bytes,
    begins: NDArray[np.int64],
    maps: NDArray[np.int64],
    views: Array,
    x: float,
    y: float,
    z: float,
) -> bool:
    """Whether some view sees no place of a block changed. x, y, z : mm, its middle. Others : as of
    `places_left_bare`.
    """
    for view in range(len(maps)):
        row, column = cell_at(maps, views, view, x, y, z)
        if row >= 0 and rough[begins[view, 0] + row // ROUGH * begins[view, 1] + column // ROUGH] == 0:
            return True
    return False


@njit(**EXACT)
def places_left_bare(
    kinds: Bytes,
    near: Bytes,
    rough: Bytes,
    begins: NDArray[np.int64],
    maps: NDArray[np.int64],
    views: Array,
    roots: Array,
    reaches: Array,
    low: Array,
    steps: NDArray[np.int64],
    spacing: float,
    frames: Array,
    halves: Array,
    cubes: Bytes,
    places: Array,
) -> tuple[NDArray[np.int64], int]:
    """(G,) how many places within a limb's length, where the joints let any limb lie, no view sees unchanged and two or
    more see bare; and how many of places (M, 3), mm, were filled in with the first of them.

    kinds, near : of all cells; near is above 0 beside a limb. rough : of squares of ROUGH by ROUGH cells, 0 where no
    place of a block around one seen there can have changed; begins : (V, 2) where a view's squares begin among all, and
    their columns. maps, views : as of `cell_at`. roots : (G, 3) mm, and reaches : (G,) mm, 0 for limbs that do not
    count. low : (3,) and steps : (3,) of the grid, in blocks. frames, halves, cubes : as of `limb_reach.Placed`.
    """
    limbs, filled = len(reaches), 0
    found, within = np.zeros(limbs, np.int64), np.zeros(limbs, np.bool_)
    half = 0.5 * (BLOCK - 1) * spacing
    for block in range(steps[0] * steps[1] * steps[2]):
        first = (
            block // (steps[1] * steps[2]) * BLOCK,
            block // steps[2] % steps[1] * BLOCK,
            block % steps[2] * BLOCK,
        )
        x, y, z = (
            low[0] + first[0] * spacing + half,
            low[1] + first[1] * spacing + half,
            low[2] + first[2] * spacing + half,
        )
        anywhere = False
        for limb in range(limbs):
            dx, dy, dz = x - roots[limb, 0], y - roots[limb, 1], z - roots[limb, 2]
            reach = reaches[limb] + np.sqrt(3.0) * half if reaches[limb] > 0.0 else 0.0
            anywhere |= dx * dx + dy * dy + dz * dz < reach * reach
        if not anywhere or is_empty(rough, begins, maps, views, x, y, z):
            continue
        for i in range(BLOCK):
            for j in range(BLOCK):
                for k in range(BLOCK):
                    x, y, z = (
                        low[0] + (first[0] + i) * spacing,
                        low[1] + (first[1] + j) * spacing,
                        low[2] + (first[2] + k) * spacing,
                    )
                    anywhere = False
                    for limb in range(limbs):
                        dx, dy, dz = x - roots[limb, 0], y - roots[limb, 1], z - roots[limb, 2]
                        within[limb] = dx * dx + dy * dy + dz * dz < reaches[limb] * reaches[limb]
                        anywhere |= within[limb]
                    if not anywhere:
                        continue
                    bare, refuted = 0, False
                    for view in range(len(maps)):
                        row, column = cell_at(maps, views, view, x, y, z)
                        if row < 0:
                            continue
                        at = maps[view, 0] + row * maps[view, 2] + column
                        kind = kinds[at]
                        if kind == SAME:
                            refuted = True
                            break
                        bare += kind != OPEN and near[at] == 0
                    if refuted or bare < BARE_VIEWS:
                        continue
                    if is_reached_by_any(frames, halves, cubes, x, y, z):
                        found += within
                        if filled < len(places):
                            places[filled, 0], places[filled, 1], places[filled, 2] = x, y, z
                            filled += 1
    return found, filled
