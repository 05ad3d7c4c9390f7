"""Normal equations of outlines against silhouettes: what one step of `refinement` solves.

Outlines are the quadrilaterals A0 A1 B1 B0 of the limbs in each view (`weighting.outlines`). Only what lies on the
border of their union counts: a point of an outline inside another limb makes no border. Every distance is in mm at the
body (pixels times the view's mm per pixel); its loss is that of Geman & McClure, ρ(d) = d² / (1 + d² / c²), so that
what the body does not explain (hair, a shadow in the mask) pulls little.
"""

import numpy as np

from studio.numba_in_threads import njit

OPTIONS = {"error_model": "numpy", "nogil": True, "cache": True}
MARGIN = 1.0
"""Pixels that a point may lie inside another limb and still count as border."""
FIRST_CORNER, SECOND_CORNER = (0, 3, 1), (1, 2, 2)
"""Corners from which to which an outline's edges run: side A, side B, far end."""
SAMPLES_A_SIDE = 12
SAME_WAY = 0.3
"""Least cosine between the outward directions of a border point and of the edge that explains it."""


@njit(**OPTIONS)
def turning(quad):
    """+1 or -1: which way round a quadrilateral (4, 2) runs."""
    ax, ay = quad[2, 0] - quad[0, 0], quad[2, 1] - quad[0, 1]
    bx, by = quad[3, 0] - quad[1, 0], quad[3, 1] - quad[1, 1]
    return 1.0 if ax * by - ay * bx > 0.0 else -1.0


@njit(**OPTIONS)
def in_another(x, y, quads, usable, turns, own):
    """Whether a point lies inside (by MARGIN pixels) the quadrilateral of another limb than `own`."""
    for limb in range(quads.shape[0]):
        if limb == own or not usable[limb]:
            continue
        inside = True
        for corner in range(4):
            following = (corner + 1) & 3
            ex = quads[limb, following, 0] - quads[limb, corner, 0]
            ey = quads[limb, following, 1] - quads[limb, corner, 1]
            across = ex * (y - quads[limb, corner, 1]) - ey * (x - quads[limb, corner, 0])
            if turns[limb] * across <= MARGIN * np.sqrt(ex * ex + ey * ey):
                inside = False
                break
        if inside:
            return True
    return False


@njit(**OPTIONS)
def add_point(share, residual, nx, ny, slopes, first, second, u, row, matrix, gradient):
    """Add one residual to the normal equations: its slope is that of the point at u between two corners, along (nx,
    ny). slopes : (4, 2, D) of the limb's corners. row : (D,) scratch. matrix : (D, D) lower half.
    """
    size = row.shape[0]
    for p in range(size):
        row[p] = nx * ((1.0 - u) * slopes[first, 0, p] + u * slopes[second, 0, p]) + ny * (
            (1.0 - u) * slopes[first, 1, p] + u * slopes[second, 1, p]
        )
    for p in range(size):
        scaled = share * row[p]
        if scaled == 0.0:
            continue
        gradient[p] += scaled * residual
        for q in range(p + 1):
            matrix[p, q] += scaled * row[q]


@njit(**OPTIONS)
def nearest_edge(x, y, ox, oy, quads, usable, turns, ends, reach):
    """Limb, edge, place along it and squared distance (pixels) of the union's border nearest to a point with outward
    direction (ox, oy); limb -1 where none is within reach.
    """
    found, edge, place, nearest = -1, 0, 0.0, reach * reach
    for limb in range(quads.shape[0]):
        if not usable[limb]:
            continue
        for side in range(3 if ends[limb] else 2):
            first, second = FIRST_CORNER[side], SECOND_CORNER[side]
            bx, by = quads[limb, first, 0], quads[limb, first, 1]
            ex, ey = quads[limb, second, 0] - bx, quads[limb, second, 1] - by
            squared = ex * ex + ey * ey
            if squared <= 0.0:
                continue
            u = min(1.0, max(0.0, ((x - bx) * ex + (y - by) * ey) / squared))
            px, py = bx + u * ex, by + u * ey
            distance = (x - px) ** 2 + (y - py) ** 2
            if distance >= nearest:
                continue
            # Side B runs against the way round, from B0 to B1.
            sign = -turns[limb] if side == 1 else turns[limb]
            if sign * (ox * ey - oy * ex) < SAME_WAY * np.sqrt(squared):
                continue
            if in_another(px, py, quads, usable, turns, limb):
                continue
            found, edge, place, nearest = limb, side, u, distance
    return found, edge, place, nearest


@njit(**OPTIONS)
def read_map(x, y, values, start, width, height):
    """Value and slope of a map at (x, y), bilinear; a flag that is False outside the picture."""
    if not (0.0 <= x < width - 1.0 and 0.0 <= y < height - 1.0):
        return False, 0.0, 0.0, 0.0
    column, row = int(x), int(y)
    fx, fy = x - column, y - row
    at = start + row * width + column
    a, b, c, d = values[at], values[at + 1], values[at + width], values[at + width + 1]
    value = (a * (1.0 - fx) + b * fx) * (1.0 - fy) + (c * (1.0 - fx) + d * fx) * fy
    return True, value, (b - a) * (1.0 - fy) + (d - c) * fy, (c - a) * (1.0 - fx) + (d - b) * fx


@njit(**OPTIONS)
def add_border(border, quads, slopes, usable, turns, ends, mm, scale, row, matrix, gradient):
    """Border points (K, 4: place, outward) of one view to the outlines; returns their loss. scale : c, mm."""
    loss = 0.0
    for k in range(border.shape[0]):
        x, y = border[k, 0], border[k, 1]
        limb, side, u, squared = nearest_edge(
            x, y, border[k, 2], border[k, 3], quads, usable, turns, ends, 4.0 * scale / mm
        )
        ratio = squared * mm * mm / (scale * scale)
        loss += scale * scale * ratio / (1.0 + ratio)
        if limb < 0:
            continue
        first, second = FIRST_CORNER[side], SECOND_CORNER[side]
        ex = quads[limb, second, 0] - quads[limb, first, 0]
        ey = quads[limb, second, 1] - quads[limb, first, 1]
        length = np.sqrt(ex * ex + ey * ey)
        nx, ny = ey / length, -ex / length
        px, py = quads[limb, first, 0] + u * ex, quads[limb, first, 1] + u * ey
        residual = (nx * (px - x) + ny * (py - y)) * mm
        share = 1.0 / ((1.0 + ratio) * (1.0 + ratio))
        add_point(share, residual, nx * mm, ny * mm, slopes[limb], first, second, u, row, matrix, gradient)
    return loss


@njit(**OPTIONS)
def add_outline(
    values, view, size, quads, slopes, usable, turns, ends, mm, scale, part, row, matrix, gradient
):
    """Samples of one view's outlines to the silhouette's border; returns their loss. part : of a sample beside a
    border point. view : start, width, height of its map in `values`, and in columns 5 and 6 where that begins in the
    picture, of `size`: far from the silhouette there is no map, and the loss is its most.
    """
    loss = 0.0
    for limb in range(quads.shape[0]):
        if not usable[limb]:
            continue
        for side in range(3 if ends[limb] else 2):
            first, second = FIRST_CORNER[side], SECOND_CORNER[side]
            for sample in range(SAMPLES_A_SIDE):
                u = (sample + 0.5) / SAMPLES_A_SIDE
                x = (1.0 - u) * quads[limb, first, 0] + u * quads[limb, second, 0]
                y = (1.0 - u) * quads[limb, first, 1] + u * quads[limb, second, 1]
                if not (0.0 <= x < size[0] - 1.0 and 0.0 <= y < size[1] - 1.0):
                    continue
                if in_another(x, y, quads, usable, turns, limb):
                    continue
                there, value, nx, ny = read_map(x - view[5], y - view[6], values, view[0], view[1], view[2])
                if not there:
                    loss += part * scale * scale
                    continue
                ratio = (value * mm / scale) ** 2
                loss += part * scale * scale * ratio / (1.0 + ratio)
                share = part / ((1.0 + ratio) * (1.0 + ratio))
                add_point(
                    share, value * mm, nx * mm, ny * mm, slopes[limb], first, second, u, row, matrix, gradient
                )
    return loss


@njit(**OPTIONS)
def look_at_limbs(quads, slopes, usable, turns):
    """Fill usable (L,), whether a limb is seen, and turns (L,), which way round it runs, of one view's limbs."""
    for limb in range(quads.shape[0]):
        usable[limb] = np.isfinite(quads[limb].sum()) and np.isfinite(slopes[limb].sum())
        turns[limb] = turning(quads[limb])


@njit(**OPTIONS)
def mirror_lower_half(matrix):
    """Make a matrix symmetric whose lower half was filled."""
    for p in range(matrix.shape[0]):
        for q in range(p):
            matrix[q, p] = matrix[p, q]


@njit(**OPTIONS)
def normal_equations(quads, slopes, ends, maps, views, sizes, border, mm, scales, part, matrix, gradient):
    """Fill matrix (D, D) and gradient (D,) of half the squared loss; returns the loss.

    quads : (V, L, 4, 2) pixels, NaN for limbs that are not seen. slopes : (V, L, 4, 2, D) per unit of each parameter.
    ends : (L,) whether a limb's far end may be border. maps : flat signed distances. views : (V, 7) where each begins,
    its width and height, its first and last border point, its left and top in the picture, whose width and height are
    sizes (V, 2). border : (K, 4). mm : (V,) mm per pixel. scales :
    (V,) c of the loss, mm.
    """
    limbs, size = quads.shape[1], slopes.shape[4]
    row, usable, turns = np.zeros(size), np.zeros(limbs, np.bool_), np.zeros(limbs)
    matrix[:] = 0.0
    gradient[:] = 0.0
    loss = 0.0
    for v in range(quads.shape[0]):
        look_at_limbs(quads[v], slopes[v], usable, turns)
        seen = border[views[v, 3] : views[v, 4]]
        loss += add_border(
            seen, quads[v], slopes[v], usable, turns, ends, mm[v], scales[v], row, matrix, gradient
        )
        loss += add_outline(
            maps,
            views[v],
            sizes[v],
            quads[v],
            slopes[v],
            usable,
            turns,
            ends,
            mm[v],
            scales[v],
            part,
            row,
            matrix,
            gradient,
        )
    mirror_lower_half(matrix)
    return loss
