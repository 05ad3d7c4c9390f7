# pyright: standard
"""Areas in which limbs and silhouettes disagree, limb by limb, on a grid of pixels."""

import numpy as np

from studio.foundations.arrays import Array, Floats, Indices, Mask
from studio.foundations.numba_in_threads import EXACT, njit
from studio.search.trackers.refinement_kernels import box_of, is_seen, turning

NEARER = 1.0 + 1e-9
"""Leaves room for rounding where a box decides what is farther."""
FIELDS = 3
"""Columns of the counts: a limb's area, its part far outside the silhouette, silhouette far from any limb."""


@njit(**EXACT)
def distance_to(x, y, quad, turn):
    """Distance in pixels from a point to a quadrilateral (4, 2) with orientation `turn`; 0 inside."""
    inside, nearest = True, np.inf
    for corner in range(4):
        following = (corner + 1) & 3
        ax, ay = quad[corner, 0], quad[corner, 1]
        ex, ey = quad[following, 0] - ax, quad[following, 1] - ay
        px, py = x - ax, y - ay
        if turn * (ex * py - ey * px) < 0.0:
            inside = False
        squared = ex * ex + ey * ey
        u = min(1.0, max(0.0, (px * ex + py * ey) / squared)) if squared > 0.0 else 0.0
        nearest = min(nearest, (px - u * ex) ** 2 + (py - u * ey) ** 2)
    return 0.0 if inside else np.sqrt(nearest)


@njit(**EXACT)
def is_inside(x, y, quad, turn):
    """Whether a point lies in a quadrilateral (4, 2) with orientation `turn`."""
    for corner in range(4):
        following = (corner + 1) & 3
        ex, ey = quad[following, 0] - quad[corner, 0], quad[following, 1] - quad[corner, 1]
        if turn * (ex * (y - quad[corner, 1]) - ey * (x - quad[corner, 0])) < 0.0:
            return False
    return True


@njit(**EXACT)
def count_limbs(quads, turns, signed, corner, size, step, far, counts):
    """Fill the first two columns of counts (L, 3) of one view: see `agreement.Disagreement`."""
    left, top = corner
    height, width = signed.shape
    for limb in range(quads.shape[0]):
        quad = quads[limb]
        if not is_seen(quad):
            continue
        lowest_x, lowest_y, highest_x, highest_y = box_of(quad)
        first_x = max(0, int(np.ceil(lowest_x / step)))
        last_x = min((size[0] - 1) // step, int(np.floor(highest_x / step)))
        first_y = max(0, int(np.ceil(lowest_y / step)))
        last_y = min((size[1] - 1) // step, int(np.floor(highest_y / step)))
        for row in range(first_y, last_y + 1):
            y = row * step
            for column in range(first_x, last_x + 1):
                x = column * step
                if not is_inside(x, y, quad, turns[limb]):
                    continue
                counts[limb, 0] += 1.0
                mapped = 0 <= x - left < width and 0 <= y - top < height
                if not mapped or signed[y - top, x - left] > far:
                    counts[limb, 1] += 1.0


@njit(**EXACT)
def count_uncovered(quads, turns, signed, corner, step, far, counts):
    """Fill the last column of counts (L, 3) of one view: silhouette far from every limb, at the nearest limb."""
    left, top = corner
    height, width = signed.shape
    boxes = np.zeros((quads.shape[0], 4))
    for limb in range(quads.shape[0]):
        boxes[limb, 0], boxes[limb, 1], boxes[limb, 2], boxes[limb, 3] = box_of(quads[limb])
    # Of the limb that covered the last point: it usually covers this one, too.
    usual = -1
    for row in range(-(-top // step), (top + height - 1) // step + 1):
        y = row * step
        for column in range(-(-left // step), (left + width - 1) // step + 1):
            x = column * step
            if signed[y - top, x - left] >= 0.0:
                continue
            if usual >= 0 and distance_to(x, y, quads[usual], turns[usual]) <= far:
                continue
            usual, found, nearest = -1, -1, np.inf
            for limb in range(quads.shape[0]):
                if not np.isfinite(quads[limb, 0, 0]):
                    continue
                aside = max(boxes[limb, 0] - x, x - boxes[limb, 2], 0.0)
                above = max(boxes[limb, 1] - y, y - boxes[limb, 3], 0.0)
                if aside * aside + above * above > NEARER * nearest * nearest:
                    continue
                distance = distance_to(x, y, quads[limb], turns[limb])
                if distance < nearest:
                    found, nearest = limb, distance
                    if distance <= far:
                        usual = limb
                        break
            if found >= 0 and nearest > far:
                counts[found, 2] += 1.0


@njit(**EXACT)
def far_points(
    quads: Array,
    signed: Floats,
    corner: tuple[int, int],
    step: int,
    far: float,
) -> Array:
    """(K, 2) grid points of one view's silhouette that are farther than `far` pixels from every limb of quads."""
    left, top = corner
    height, width = signed.shape
    first_row, last_row = -(-top // step), (top + height - 1) // step
    first_column, last_column = -(-left // step), (left + width - 1) // step
    most = max(0, last_row + 1 - first_row) * max(0, last_column + 1 - first_column)
    turns = np.zeros(quads.shape[0])
    for limb in range(quads.shape[0]):
        turns[limb] = turning(quads[limb])
    found, count = np.zeros((most, 2)), 0
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            x, y = column * step, row * step
            if signed[y - top, x - left] < 0.0 and not is_near(x, y, quads, turns, far):
                found[count, 0], found[count, 1] = x, y
                count += 1
    return found[:count]


@njit(**EXACT)
def nearest_limbs(points: Array, quads: Array) -> Indices:
    """(K,) the limb of quads (L, 4, 2) that is nearest to each point (K, 2), the first of those that are as near; -1
    where none is seen.
    """
    turns, found = np.zeros(quads.shape[0]), np.full(points.shape[0], -1, np.int64)
    for limb in range(quads.shape[0]):
        turns[limb] = turning(quads[limb])
    for k in range(points.shape[0]):
        nearest = np.inf
        for limb in range(quads.shape[0]):
            if not np.isfinite(quads[limb, 0, 0]):
                continue
            distance = distance_to(points[k, 0], points[k, 1], quads[limb], turns[limb])
            if distance < nearest:
                found[k], nearest = limb, distance
    return found


@njit(**EXACT)
def is_near(x, y, quads, turns, far):
    """Whether a point is within `far` pixels of one of the quadrilaterals."""
    for limb in range(quads.shape[0]):
        quad = quads[limb]
        if not np.isfinite(quad[0, 0]):
            continue
        if x < min(quad[0, 0], quad[1, 0], quad[2, 0], quad[3, 0]) - far:
            continue
        if x > max(quad[0, 0], quad[1, 0], quad[2, 0], quad[3, 0]) + far:
            continue
        if y < min(quad[0, 1], quad[1, 1], quad[2, 1], quad[3, 1]) - far:
            continue
        if y > max(quad[0, 1], quad[1, 1], quad[2, 1], quad[3, 1]) + far:
            continue
        if distance_to(x, y, quad, turns[limb]) <= far:
            return True
    return False


@njit(**EXACT)
def add_limb_counts(
    quads: Array,
    points: Array,
    signed: Floats,
    corner: tuple[int, int],
    size: tuple[int, int],
    step: int,
    far: float,
    counts: Array,
) -> None:
    """Add to counts (N,), for N places (N, L, 4, 2) of a few limbs in one view, the grid points that they cover far
    outside the silhouette, and those of points (K, 2), as `far_points` gives them, that they leave bare.
    """
    turns, own = np.zeros(quads.shape[1]), np.zeros((quads.shape[1], FIELDS))
    near = np.zeros(points.shape[0], np.bool_)
    for n in range(quads.shape[0]):
        for limb in range(quads.shape[1]):
            turns[limb] = turning(quads[n, limb])
        own[:] = 0.0
        count_limbs(quads[n], turns, signed, corner, size, step, far, own)
        near[:] = False
        for limb in range(quads.shape[1]):
            mark_near(points, quads[n, limb], turns[limb], far, near)
        counts[n] += own[:, 1].sum() + points.shape[0] - near.sum()


@njit(**EXACT)
def mark_near(points, quad, turn, far, near):
    """Set near (K,) where points (K, 2), which are in the order of their rows, are within `far` of a quadrilateral."""
    if not is_seen(quad):
        return
    left, top, right, bottom = box_of(quad)
    left, top, right, bottom = left - far, top - far, right + far, bottom + far
    for k in range(np.searchsorted(points[:, 1], top), points.shape[0]):
        if points[k, 1] > bottom:
            break
        if not near[k] and left <= points[k, 0] <= right:
            near[k] = distance_to(points[k, 0], points[k, 1], quad, turn) <= far


@njit(**EXACT)
def view_counts(
    quads: Array,
    signed: Floats,
    corner: tuple[int, int],
    size: tuple[int, int],
    step: int,
    far: float,
    counts: Array,
) -> None:
    """Fill counts (L, 3) of one view, in grid points. quads : (L, 4, 2) pixels, NaN where a limb is not seen. signed,
    corner, size : as in `evidence.distance_maps`. step : pixels between grid points. far : pixels.
    """
    turns = np.zeros(quads.shape[0])
    for limb in range(quads.shape[0]):
        turns[limb] = turning(quads[limb])
    counts[:] = 0.0
    count_limbs(quads, turns, signed, corner, size, step, far, counts)
    count_uncovered(quads, turns, signed, corner, step, far, counts)


@njit(**EXACT)
def count_cells(
    quads: Array,
    signed: Floats,
    corner: tuple[int, int],
    cell: int,
    far: float,
    counts: Array,
) -> None:
    """Update one view's counts (H, W): add 1 to cells whose middle a limb of quads covers farther than `far` pixels
    from the silhouette, set cells that show silhouette to 0.
    """
    covered = np.zeros(counts.shape, np.bool_)
    for limb in range(quads.shape[0]):
        quad = quads[limb]
        if not is_seen(quad):
            continue
        turn = turning(quad)
        lowest_x, lowest_y, highest_x, highest_y = box_of(quad)
        last_row = min(counts.shape[0] - 1.0, highest_y // cell)
        last_column = min(counts.shape[1] - 1.0, highest_x // cell)
        for row in range(max(0, int(lowest_y // cell)), int(last_row) + 1):
            for column in range(max(0, int(lowest_x // cell)), int(last_column) + 1):
                x, y = column * cell + cell // 2, row * cell + cell // 2
                covered[row, column] |= is_inside(x, y, quad, turn)
    count_covered(covered, signed, corner, cell, far, counts)


@njit(**EXACT)
def count_covered(
    covered: Mask,
    signed: Floats,
    corner: tuple[int, int],
    cell: int,
    far: float,
    counts: Array,
) -> None:
    """The same of cells (H, W) whose middle is covered."""
    left, top = corner
    height, width = signed.shape
    for row in range(counts.shape[0]):
        for column in range(counts.shape[1]):
            x, y = column * cell + cell // 2 - left, row * cell + cell // 2 - top
            mapped = 0 <= x < width and 0 <= y < height
            if mapped and signed[y, x] <= 0.0:
                counts[row, column] = 0.0
            elif covered[row, column] and not (mapped and signed[y, x] <= far):
                counts[row, column] += 1.0
