# pyright: standard
"""Which limb lies in front at the points of a view's grid, and how much better limbs in front explain colours."""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Mask
from studio.foundations.numba_in_threads import EXACT, njit

NOTHING = -1
"""No limb, or no colour, at a point of the grid."""


@njit(**EXACT)
def place_on(x, y, part, breadth):
    """Where along a part's axis a point lies, 0 to 1, or -1 where it is not on it. part : (8,) as of `front_limbs`."""
    ex, ey = part[2] - part[0], part[3] - part[1]
    squared = ex * ex + ey * ey
    if not squared > 0.0:
        return -1.0
    along = ((x - part[0]) * ex + (y - part[1]) * ey) / squared
    if not 0.0 <= along <= 1.0:
        return -1.0
    away = abs((x - part[0]) * ey - (y - part[1]) * ex) / np.sqrt(squared)
    return along if away <= breadth * (part[6] + along * (part[7] - part[6])) else -1.0


@njit(**EXACT)
def box_on(part, step, rows, columns):
    """First and last row, and column, of the grid's points that may lie on a part; none where it is not seen."""
    wide = max(part[6], part[7])
    left, right = min(part[0], part[2]) - wide, max(part[0], part[2]) + wide
    top, bottom = min(part[1], part[3]) - wide, max(part[1], part[3]) + wide
    # NaN, where a limb is not seen, is in no order.
    if not (right >= 0.0 and bottom >= 0.0 and left <= columns * step and top <= rows * step):
        return 0, -1, 0, -1
    return (
        int(np.ceil(max(0.0, top) / step)),
        int(np.floor(min(float(rows - 1), bottom / step))),
        int(np.ceil(max(0.0, left) / step)),
        int(np.floor(min(float(columns - 1), right / step))),
    )


@njit(**EXACT)
def front_limbs(
    parts: Array,
    owners: NDArray[np.int64],
    left_out: Mask,
    step: int,
    breadth: float,
    first: NDArray[np.int64],
    depths: Array,
    alone: Mask,
) -> None:
    """Fill in of a grid's points (h, w) which drawn limb lies in front, NOTHING where none does, its depth, mm, and
    whether all that lie there belong to one limb.

    parts : (L, 8) of each drawn one the pixels of both ends, depth of the surface at both, and half its breadth at
    both, pixels. owners : (L,) to which limb it belongs. left_out : (L,). step : pixels between points. breadth : share
    of a limb's breadth that counts.
    """
    first[:], depths[:], alone[:] = NOTHING, np.inf, True
    for limb in range(len(parts)):
        if left_out[limb]:
            continue
        part = parts[limb]
        top, bottom, left, right = box_on(part, step, *first.shape)
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                along = place_on(float(column * step), float(row * step), part, breadth)
                if along < 0.0:
                    continue
                depth = part[4] + along * (part[5] - part[4])
                if first[row, column] != NOTHING and owners[first[row, column]] != owners[limb]:
                    alone[row, column] = False
                if depth < depths[row, column]:
                    depths[row, column], first[row, column] = depth, limb


@njit(**EXACT)
def add_gains(
    parts: Array,
    kinds: NDArray[np.int64],
    codes: NDArray[np.int64],
    first: NDArray[np.int64],
    depths: Array,
    behind: NDArray[np.int64],
    logs: Array,
    usual: Array,
    step: int,
    breadth: float,
    most: float,
    gains: Array,
    expected: Array,
) -> None:
    """Add to gains (N,) the logarithms by which a limb's colours at the points where it lies in front are likelier
    than those of the limb behind it, at most `most` a point, and to expected (N,) what is usual there.

    parts : (N, M, 8) of the limb's parts in N poses, as of `front_limbs`. kinds : (M,) of each part's colours, NOTHING
    where they are not known. codes : (h, w) colour of a point, NOTHING outside the silhouette. first, depths : of the
    other limbs. behind : (L,) kind of each drawn limb's colours. logs : (K, C) logarithm of a colour's probability.
    usual : (K, K) gain of a point of the first kind before the second.
    """
    for pose in range(len(parts)):
        for which in range(parts.shape[1]):
            if kinds[which] == NOTHING:
                continue
            part = parts[pose, which]
            top, bottom, left, right = box_on(part, step, *first.shape)
            for row in range(top, bottom + 1):
                for column in range(left, right + 1):
                    code, other = codes[row, column], first[row, column]
                    if code == NOTHING or other == NOTHING or behind[other] == NOTHING:
                        continue
                    x, y = float(column * step), float(row * step)
                    along = place_on(x, y, part, breadth)
                    if along < 0.0 or part[4] + along * (part[5] - part[4]) > depths[row, column]:
                        continue
                    taken = False
                    for before in range(which):
                        taken |= (
                            kinds[before] != NOTHING and place_on(x, y, parts[pose, before], breadth) >= 0.0
                        )
                    if taken:
                        continue
                    gain = logs[kinds[which], code] - logs[behind[other], code]
                    gains[pose] += min(most, max(-most, gain))
                    expected[pose] += usual[kinds[which], behind[other]]
