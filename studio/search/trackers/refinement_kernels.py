# pyright: standard
"""Normal equations of outlines against silhouettes, solved by each step of `refinement`.

Outlines are the quadrilaterals A0 A1 B1 B0 of the limbs in each view (`likelihood.outlines`). Only what lies on the
border of their union counts: points of an outline inside another limb do not. Every distance is in mm at the
body (pixels times the view's mm per pixel); its loss is that of Geman & McClure, ρ(d) = d² / (1 + d² / c²), so that
pixels that the body does not explain (hair, a shadow in the mask) pull little.
"""

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.numba_in_threads import EXACT, njit

MARGIN = 1.0
"""Pixels that a point may lie inside another limb and still count as border."""
FIRST_CORNER, SECOND_CORNER = (0, 3, 1), (1, 2, 2)
"""First and last corners of an outline's edges: side A, side B, far end."""
SAMPLES_A_SIDE = 12
SAME_WAY = 0.3
"""Least cosine between the outward directions of a border point and of the edge that explains it."""


@njit(**EXACT)
def turning(quad):
    """+1 or -1: the orientation of a quadrilateral (4, 2)."""
    ax, ay = quad[2, 0] - quad[0, 0], quad[2, 1] - quad[0, 1]
    bx, by = quad[3, 0] - quad[1, 0], quad[3, 1] - quad[1, 1]
    return 1.0 if ax * by - ay * bx > 0.0 else -1.0


@njit(**EXACT)
def is_seen(quad):
    """Whether a quadrilateral (4, 2) has a place: NaN where its limb is not seen."""
    seen = True
    for corner in range(4):
        seen &= np.isfinite(quad[corner, 0]) and np.isfinite(quad[corner, 1])
    return seen


@njit(**EXACT)
def box_of(quad):
    """Left, top, right and bottom of a quadrilateral (4, 2)."""
    left, top, right, bottom = quad[0, 0], quad[0, 1], quad[0, 0], quad[0, 1]
    for corner in range(1, 4):
        left, right = min(left, quad[corner, 0]), max(right, quad[corner, 0])
        top, bottom = min(top, quad[corner, 1]), max(bottom, quad[corner, 1])
    return left, top, right, bottom


@njit(**EXACT)
def in_another(x, y, quads, usable, sides, boxes, own):
    """Whether a point lies inside (by MARGIN pixels) the quadrilateral of another limb than `own`."""
    for limb in range(quads.shape[0]):
        if limb == own or not usable[limb]:
            continue
        if x < boxes[limb, 0] or x > boxes[limb, 2] or y < boxes[limb, 1] or y > boxes[limb, 3]:
            continue
        inside = True
        for corner in range(4):
            ex, ey, least = sides[limb, corner, 0], sides[limb, corner, 1], sides[limb, corner, 2]
            across = ex * (y - quads[limb, corner, 1]) - ey * (x - quads[limb, corner, 0])
            if across <= least:
                inside = False
                break
        if inside:
            return True
    return False


@njit(**EXACT)
def add_point(share, residual, nx, ny, first, second, u, normal, pull):
    """Add one residual to its limb's equations: it is that of the point at u between two corners, along (nx, ny).

    normal : (8, 8), its lower half, pull : (8,) over the limb's corners, x and y of each.
    """
    if first > second:
        first, second, u = second, first, 1.0 - u
    i, j = 2 * first, 2 * second
    ax, ay, bx, by = (1.0 - u) * nx, (1.0 - u) * ny, u * nx, u * ny
    scaled = share * residual
    pull[i] += scaled * ax
    pull[i + 1] += scaled * ay
    pull[j] += scaled * bx
    pull[j + 1] += scaled * by
    normal[i, i] += share * ax * ax
    normal[i + 1, i] += share * ax * ay
    normal[i + 1, i + 1] += share * ay * ay
    normal[j, i] += share * ax * bx
    normal[j + 1, i] += share * ax * by
    normal[j, i + 1] += share * ay * bx
    normal[j + 1, i + 1] += share * ay * by
    normal[j, j] += share * bx * bx
    normal[j + 1, j] += share * bx * by
    normal[j + 1, j + 1] += share * by * by


@njit(**EXACT)
def add_limbs(normals, pulls, slopes, usable, which, matrix, gradient):
    """Add the equations of one view's limb corners to those of the parameters, lower half.

    normals : (L, 8, 8) lower halves, pulls : (L, 8). slopes : (L, 4, 2, D) of the corners. which : (D,) scratch.
    """
    mirrored, product = np.zeros((8, 8)), np.zeros(8)
    moving, row = np.zeros((8, len(which))), np.zeros(len(which))
    m0, m1, m2, m3 = moving[0], moving[1], moving[2], moving[3]
    m4, m5, m6, m7 = moving[4], moving[5], moving[6], moving[7]
    for limb in range(slopes.shape[0]):
        if not usable[limb]:
            continue
        own = slopes[limb].reshape(8, len(which))
        count = 0
        for p in range(len(which)):
            moves = False
            for i in range(8):
                moves |= own[i, p] != 0.0
            if moves:
                which[count] = p
                for i in range(8):
                    moving[i, count] = own[i, p]
                count += 1
        for i in range(8):
            for j in range(i + 1):
                mirrored[i, j] = mirrored[j, i] = normals[limb, i, j]
        for a in range(count):
            p = which[a]
            product[:] = 0.0
            for i in range(8):
                for j in range(8):
                    product[j] += mirrored[i, j] * moving[i, a]
            for j in range(8):
                gradient[p] += pulls[limb, j] * moving[j, a]
            q0, q1, q2, q3 = product[0], product[1], product[2], product[3]
            q4, q5, q6, q7 = product[4], product[5], product[6], product[7]
            for b in range(a + 1):
                row[b] = matrix[p, which[b]]
            for b in range(a + 1):
                total = row[b] + q0 * m0[b]
                total = total + q1 * m1[b]
                total = total + q2 * m2[b]
                total = total + q3 * m3[b]
                total = total + q4 * m4[b]
                total = total + q5 * m5[b]
                total = total + q6 * m6[b]
                row[b] = total + q7 * m7[b]
            for b in range(a + 1):
                matrix[p, which[b]] = row[b]


@njit(**EXACT)
def nearest_edge(x, y, ox, oy, quads, usable, turns, sides, boxes, ends, reach):
    """Limb, edge, place along it and squared distance (pixels) of the union's border nearest to a point with outward
    direction (ox, oy); limb -1 where none is within reach.
    """
    found, edge, place, nearest = -1, 0, 0.0, reach * reach
    for limb in range(quads.shape[0]):
        if not usable[limb]:
            continue
        aside = max(boxes[limb, 0] - x, x - boxes[limb, 2], 0.0)
        above = max(boxes[limb, 1] - y, y - boxes[limb, 3], 0.0)
        if aside * aside + above * above >= nearest:
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
            # Side B runs against the orientation, from B0 to B1.
            sign = -turns[limb] if side == 1 else turns[limb]
            if sign * (ox * ey - oy * ex) < SAME_WAY * np.sqrt(squared):
                continue
            if in_another(px, py, quads, usable, sides, boxes, limb):
                continue
            found, edge, place, nearest = limb, side, u, distance
    return found, edge, place, nearest


@njit(**EXACT)
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


@njit(**EXACT)
def beyond(distance, slack):
    """The part of a signed distance beyond a slack."""
    return np.sign(distance) * max(0.0, abs(distance) - slack)


@njit(**EXACT)
def add_border(border, quads, usable, turns, sides, boxes, ends, slack, mm, scale, normals, pulls):
    """Border points (K, 4: place, outward) of one view to the outlines; returns their loss. slack : (L,) mm by which
    a limb's outline may be off at no cost. scale : c, mm.
    """
    loss = 0.0
    for k in range(border.shape[0]):
        x, y = border[k, 0], border[k, 1]
        limb, side, u, squared = nearest_edge(
            x, y, border[k, 2], border[k, 3], quads, usable, turns, sides, boxes, ends, 4.0 * scale / mm
        )
        away = np.sqrt(squared) * mm
        if limb >= 0:
            away = beyond(away, slack[limb])
        ratio = (away / scale) ** 2
        loss += scale * scale * ratio / (1.0 + ratio)
        if limb < 0 or away == 0.0:
            continue
        first, second = FIRST_CORNER[side], SECOND_CORNER[side]
        ex = quads[limb, second, 0] - quads[limb, first, 0]
        ey = quads[limb, second, 1] - quads[limb, first, 1]
        length = np.sqrt(ex * ex + ey * ey)
        nx, ny = ey / length, -ex / length
        px, py = quads[limb, first, 0] + u * ex, quads[limb, first, 1] + u * ey
        residual = beyond((nx * (px - x) + ny * (py - y)) * mm, slack[limb])
        share = 1.0 / ((1.0 + ratio) * (1.0 + ratio))
        add_point(share, residual, nx * mm, ny * mm, first, second, u, normals[limb], pulls[limb])
    return loss


@njit(**EXACT)
def add_outline(
    values, view, size, quads, usable, sides, boxes, ends, slack, mm, scale, part, normals, pulls
):
    """Samples of one view's outlines to the silhouette's border; returns their loss. part : weight of a sample relative
    to a border point. view : start, width, height of its map in `values`, and in columns 5 and 6 where that begins in
    the picture, of `size`: far from the silhouette there is no map, and the loss is its maximum.
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
                if in_another(x, y, quads, usable, sides, boxes, limb):
                    continue
                there, value, nx, ny = read_map(x - view[5], y - view[6], values, view[0], view[1], view[2])
                if not there:
                    loss += part * scale * scale
                    continue
                away = beyond(value * mm, slack[limb])
                ratio = (away / scale) ** 2
                loss += part * scale * scale * ratio / (1.0 + ratio)
                share = part / ((1.0 + ratio) * (1.0 + ratio))
                add_point(share, away, nx * mm, ny * mm, first, second, u, normals[limb], pulls[limb])
    return loss


@njit(**EXACT)
def all_finite(values):
    """Whether all of (K,) are finite: a sum would be made one after the other."""
    wrong = 0
    for k in range(values.shape[0]):
        wrong += values[k] - values[k] != 0.0
    return wrong == 0


@njit(**EXACT)
def look_at_limbs(quads, slopes, usable, turns, sides, boxes):
    """Fill, of one view's limbs, usable (L,), whether it is seen, turns (L,), its orientation, sides (L, 4, 3): of each
    side its direction, turned so that inside is on its left, and MARGIN times its length; and boxes (L, 4): left, top,
    right, bottom.
    """
    for limb in range(quads.shape[0]):
        usable[limb] = is_seen(quads[limb]) and all_finite(slopes[limb].reshape(-1))
        turns[limb] = turning(quads[limb])
        boxes[limb, 0], boxes[limb, 1], boxes[limb, 2], boxes[limb, 3] = box_of(quads[limb])
        for corner in range(4):
            following = (corner + 1) & 3
            ex = quads[limb, following, 0] - quads[limb, corner, 0]
            ey = quads[limb, following, 1] - quads[limb, corner, 1]
            sides[limb, corner, 0], sides[limb, corner, 1] = turns[limb] * ex, turns[limb] * ey
            sides[limb, corner, 2] = MARGIN * np.sqrt(ex * ex + ey * ey)


@njit(**EXACT)
def mirror_lower_half(matrix):
    """Copy the lower half of a matrix to its upper half."""
    for p in range(matrix.shape[0]):
        for q in range(p):
            matrix[q, p] = matrix[p, q]


@njit(**EXACT)
def normal_equations(
    quads: Array,
    slopes: Array,
    ends: NDArray[np.bool_],
    slack: Array,
    maps: Floats,
    views: Indices,
    sizes: Indices,
    border: Array,
    mm: Array,
    scales: Array,
    part: float,
    matrix: Array,
    gradient: Array,
) -> float:
    """Fill matrix (D, D) and gradient (D,) of half the squared loss; returns the loss.

    quads : (V, L, 4, 2) pixels, NaN for limbs that are not seen. slopes : (V, L, 4, 2, D) per unit of each parameter.
    ends : (L,) whether a limb's far end may be border. slack : (L,) mm by which a limb may be off at no cost.
    maps : flat signed distances. views : (V, 7) where each begins, its width and height, its first and last border
    point, its left and top in the picture, whose width and height are sizes (V, 2). border : (K, 4). mm : (V,) mm per
    pixel. scales : (V,) c of the loss, mm. part : weight of an outline's sample relative to a border
    point; at 0 there are no maps.
    """
    limbs = quads.shape[1]
    normals, pulls = np.zeros((limbs, 8, 8)), np.zeros((limbs, 8))
    sides, boxes = np.zeros((limbs, 4, 3)), np.zeros((limbs, 4))
    usable, turns, which = np.zeros(limbs, np.bool_), np.zeros(limbs), np.zeros(slopes.shape[4], np.int64)
    matrix[:] = 0.0
    gradient[:] = 0.0
    loss = 0.0
    for v in range(quads.shape[0]):
        look_at_limbs(quads[v], slopes[v], usable, turns, sides, boxes)
        normals[:], pulls[:] = 0.0, 0.0
        view, limits = quads[v], (sides, boxes, ends, slack, mm[v], scales[v])
        seen = border[views[v, 3] : views[v, 4]]
        loss += add_border(seen, view, usable, turns, *limits, normals, pulls)
        if part > 0.0:
            loss += add_outline(maps, views[v], sizes[v], view, usable, *limits, part, normals, pulls)
        add_limbs(normals, pulls, slopes[v], usable, which, matrix, gradient)
    mirror_lower_half(matrix)
    return loss
