"""Areas in which limbs and silhouettes disagree, limb by limb, on a grid of pixels."""

import numpy as np

from studio.numba_in_threads import njit
from studio.tracking.refinement_kernels import OPTIONS, turning

FIELDS = 3
"""Columns of the counts: a limb's area, its part far outside the silhouette, silhouette far from any limb."""


@njit(**OPTIONS)
def distance_to(x, y, quad, turn):
    """Pixels from a point to a quadrilateral (4, 2) that runs round as `turn` says; 0 inside."""
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


@njit(**OPTIONS)
def count_limbs(quads, turns, signed, corner, size, step, far, counts):
    """Fill the first two columns of counts (L, 3) of one view: see `agreement.Disagreement`."""
    left, top = corner
    height, width = signed.shape
    for limb in range(quads.shape[0]):
        quad = quads[limb]
        if not np.isfinite(quad.sum()):
            continue
        first_x = max(0, int(np.ceil(quad[:, 0].min() / step)))
        last_x = min((size[0] - 1) // step, int(np.floor(quad[:, 0].max() / step)))
        first_y = max(0, int(np.ceil(quad[:, 1].min() / step)))
        last_y = min((size[1] - 1) // step, int(np.floor(quad[:, 1].max() / step)))
        for row in range(first_y, last_y + 1):
            y = row * step
            for column in range(first_x, last_x + 1):
                x = column * step
                if distance_to(x, y, quad, turns[limb]) > 0.0:
                    continue
                counts[limb, 0] += 1.0
                mapped = 0 <= x - left < width and 0 <= y - top < height
                if not mapped or signed[y - top, x - left] > far:
                    counts[limb, 1] += 1.0


@njit(**OPTIONS)
def count_uncovered(quads, turns, signed, corner, step, far, counts):
    """Fill the last column of counts (L, 3) of one view: silhouette that is far from every limb, at its nearest."""
    left, top = corner
    height, width = signed.shape
    for row in range(-(-top // step), (top + height - 1) // step + 1):
        y = row * step
        for column in range(-(-left // step), (left + width - 1) // step + 1):
            x = column * step
            if signed[y - top, x - left] >= 0.0:
                continue
            found, nearest = -1, np.inf
            for limb in range(quads.shape[0]):
                if not np.isfinite(quads[limb, 0, 0]):
                    continue
                distance = distance_to(x, y, quads[limb], turns[limb])
                if distance < nearest:
                    found, nearest = limb, distance
                    if distance <= far:
                        break
            if found >= 0 and nearest > far:
                counts[found, 2] += 1.0


@njit(**OPTIONS)
def view_counts(quads, signed, corner, size, step, far, counts):
    """Fill counts (L, 3) of one view, in grid points. quads : (L, 4, 2) pixels, NaN where a limb is not seen. signed,
    corner, size : as in `evidence.distance_maps`. step : pixels between grid points. far : pixels.
    """
    turns = np.zeros(quads.shape[0])
    for limb in range(quads.shape[0]):
        turns[limb] = turning(quads[limb])
    counts[:] = 0.0
    count_limbs(quads, turns, signed, corner, size, step, far, counts)
    count_uncovered(quads, turns, signed, corner, step, far, counts)
