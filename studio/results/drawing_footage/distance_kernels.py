# pyright: standard
"""The person as a signed distance field: swept spheres, blended within a group, folded where they are cloth. Pieces
with an edge are truncated cones with flat ends, their edges rounded by so much (a robot's links).

Distances (mm) are lower bounds of the true ones up to the folds' depth, so marching at SAFETY × distance never passes
through. Smooth union: I. Quilez, "Smooth minimum" (quadratic polynomial). Piece columns: see `flesh.py`.
"""

import math

import numpy as np

from studio.foundations.numba_in_threads import njit
from studio.results.drawing_footage.flesh import (
    AXES,
    BOUND,
    BOUND_RADIUS,
    BULGE,
    EDGE,
    FOLD,
    FOLD_PERIOD,
    FOLD_PHASE,
    LENGTH,
    RADIUS_END,
    RADIUS_START,
    SCALE_X,
    SCALE_Y,
    START,
)

MELT_WITHIN, MELT_BETWEEN = 26.0, 8.0
FAR = 1e9


@njit(error_model="numpy", fastmath=True, inline="always")
def soft_minimum(a, b, width):
    """The smaller of two distances, rounded off where they differ by less than `width`."""
    gap = max(width - abs(a - b), 0.0) / width
    return min(a, b) - gap * gap * width * 0.25


@njit(error_model="numpy", fastmath=True)
def local_point(px, py, pz, piece):
    """A world point in the piece's frame: x forward, y sideways, z along it."""
    x, y, z = px - piece[START], py - piece[START + 1], pz - piece[START + 2]
    return (
        piece[AXES] * x + piece[AXES + 1] * y + piece[AXES + 2] * z,
        piece[AXES + 3] * x + piece[AXES + 4] * y + piece[AXES + 5] * z,
        piece[AXES + 6] * x + piece[AXES + 7] * y + piece[AXES + 8] * z,
    )


@njit(error_model="numpy", fastmath=True)
def cone_distance(px, py, pz, piece):
    """Signed distance from a world point to a truncated cone with rounded edges."""
    x, y, z = local_point(px, py, pz, piece)
    length, edge, sx, sy = piece[LENGTH], piece[EDGE], piece[SCALE_X], piece[SCALE_Y]
    slope = (piece[RADIUS_END] - piece[RADIUS_START]) / length
    radius = piece[RADIUS_START] + slope * min(max(z, 0.0), length)
    across, side = x / sx, y / sy
    outside = (math.sqrt(across * across + side * side) - radius) / math.sqrt(1.0 + slope * slope) + edge
    beyond = abs(z - 0.5 * length) - 0.5 * length + edge
    out, past = max(outside, 0.0), max(beyond, 0.0)
    return (math.sqrt(out * out + past * past) + min(max(outside, beyond), 0.0) - edge) * min(sx, sy, 1.0)


@njit(error_model="numpy", fastmath=True)
def piece_distance(px, py, pz, piece):
    """Signed distance from a world point to one piece."""
    if piece[EDGE] > 0.0:
        return cone_distance(px, py, pz, piece)
    x, y, z = local_point(px, py, pz, piece)
    length = piece[LENGTH]
    share = min(max(z / length, 0.0), 1.0) if length > 0.0 else 0.0
    early = share * (1.6 - 0.6 * share)
    radius = piece[RADIUS_START] + (piece[RADIUS_END] - piece[RADIUS_START]) * share
    radius += piece[BULGE] * 4.0 * early * (1.0 - early)
    sx, sy = piece[SCALE_X], piece[SCALE_Y]
    across, side, beyond = x / sx, y / sy, z - share * length
    distance = (math.sqrt(across * across + side * side + beyond * beyond) - radius) * min(sx, sy, 1.0)
    if piece[FOLD] > 0.0 and distance < 4.0 * piece[FOLD]:
        turn = 2.0 * math.pi / piece[FOLD_PERIOD]
        wave = math.sin(turn * (z + 0.6 * x) + piece[FOLD_PHASE]) * math.sin(
            turn * (0.9 * y - 0.35 * z) + 1.3
        )
        distance -= (
            0.5 * piece[FOLD] * (wave + 0.5 * math.sin(2.3 * turn * (y - 0.8 * z) + piece[FOLD_PHASE]))
        )
    return distance


@njit(error_model="numpy", fastmath=True, inline="always")
def beyond(px, py, pz, piece, limit):
    """Whether a point is further than `limit` from the ball around a piece, which can then be skipped."""
    x, y, z = px - piece[BOUND], py - piece[BOUND + 1], pz - piece[BOUND + 2]
    reach = limit + piece[BOUND_RADIUS]
    return reach > 0.0 and x * x + y * y + z * z > reach * reach


@njit(error_model="numpy", fastmath=True)
def body_distance(px, py, pz, pieces, labels, active, count):
    """Signed distance to the union of the first `count` pieces named in `active` (in order of their groups)."""
    total, group_distance, group = FAR, FAR, -1
    for index in range(count):
        piece = active[index]
        if beyond(px, py, pz, pieces[piece], min(total, group_distance) + MELT_WITHIN):
            continue
        distance = piece_distance(px, py, pz, pieces[piece])
        if labels[piece, 1] == group:
            group_distance = soft_minimum(group_distance, distance, MELT_WITHIN)
        else:
            total = soft_minimum(total, group_distance, MELT_BETWEEN)
            group_distance, group = distance, labels[piece, 1]
    return soft_minimum(total, group_distance, MELT_BETWEEN)


@njit(error_model="numpy", fastmath=True)
def nearest_piece(px, py, pz, pieces, active, count):
    """The piece whose own surface is closest: its material is used."""
    best, nearest = FAR, -1
    for index in range(count):
        if beyond(px, py, pz, pieces[active[index]], best):
            continue
        distance = piece_distance(px, py, pz, pieces[active[index]])
        if distance < best:
            best, nearest = distance, active[index]
    return nearest


@njit(error_model="numpy", fastmath=True)
def gather(ox, oy, oz, dx, dy, dz, pieces, margin, active):
    """The pieces that a ray may touch: fills `active`, returns their count and the ray's stretch."""
    count, first, last = 0, FAR, 0.0
    for piece in range(len(pieces)):
        x, y, z = pieces[piece, BOUND] - ox, pieces[piece, BOUND + 1] - oy, pieces[piece, BOUND + 2] - oz
        along = x * dx + y * dy + z * dz
        reach = pieces[piece, BOUND_RADIUS] + margin
        left = reach * reach - (x * x + y * y + z * z - along * along)
        if left > 0.0:
            half = math.sqrt(left)
            if along + half > 0.0:
                active[count] = piece
                count += 1
                first, last = min(first, along - half), max(last, along + half)
    return count, max(first, 0.0), last


@njit(error_model="numpy", fastmath=True)
def gather_beam(origin, dx, dy, dz, spread, pieces, margin, active):
    """Like `gather` for all rays that stray no further than spread × distance from one."""
    count, first, last = 0, FAR, 0.0
    for piece in range(len(pieces)):
        x, y = pieces[piece, BOUND] - origin[0], pieces[piece, BOUND + 1] - origin[1]
        z = pieces[piece, BOUND + 2] - origin[2]
        along = x * dx + y * dy + z * dz
        # The piece is hit, if at all, within its own reach of `along`; there the beam is this wide.
        reach = pieces[piece, BOUND_RADIUS] + margin
        reach += spread * (abs(along) + reach)
        left = reach * reach - (x * x + y * y + z * z - along * along)
        if left > 0.0:
            half = math.sqrt(left)
            if along + half > 0.0:
                active[count] = piece
                count += 1
                first, last = min(first, along - half), max(last, along + half)
    return count, max(first, 0.0), last


@njit(error_model="numpy", fastmath=True)
def gather_among(origin, dx, dy, dz, pieces, nearby, near_count, margin, active):
    """Like `gather` among the first `near_count` pieces named in `nearby`."""
    count, first, last = 0, FAR, 0.0
    for index in range(near_count):
        piece = nearby[index]
        x, y = pieces[piece, BOUND] - origin[0], pieces[piece, BOUND + 1] - origin[1]
        z = pieces[piece, BOUND + 2] - origin[2]
        along = x * dx + y * dy + z * dz
        reach = pieces[piece, BOUND_RADIUS] + margin
        left = reach * reach - (x * x + y * y + z * z - along * along)
        if left > 0.0:
            half = math.sqrt(left)
            if along + half > 0.0:
                active[count] = piece
                count += 1
                first, last = min(first, along - half), max(last, along + half)
    return count, max(first, 0.0), last


@njit(error_model="numpy", fastmath=True)
def body_normal(px, py, pz, pieces, labels, active, count):
    """Outward unit normal by four samples on a tetrahedron."""
    step = 1.5
    one = body_distance(px + step, py - step, pz - step, pieces, labels, active, count)
    two = body_distance(px - step, py - step, pz + step, pieces, labels, active, count)
    three = body_distance(px - step, py + step, pz - step, pieces, labels, active, count)
    four = body_distance(px + step, py + step, pz + step, pieces, labels, active, count)
    x, y, z = one - two - three + four, -one - two + three + four, -one + two - three + four
    size = math.sqrt(x * x + y * y + z * z) + 1e-12
    return x / size, y / size, z / size


@njit(error_model="numpy", fastmath=True)
def light_share(px, py, pz, light, light_radius, pieces, labels, active):
    """Share of a round lamp that a point sees past the person: 0 in full shadow, 1 in the open.

    Distance over distance marched, against the lamp's angular size: I. Quilez, "Soft shadows in raymarched SDFs".
    """
    x, y, z = light[0] - px, light[1] - py, light[2] - pz
    reach = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / reach, y / reach, z / reach
    spread = light_radius / reach
    count, first, last = gather(px, py, pz, x, y, z, pieces, 260.0, active)
    if count == 0:
        return 1.0
    seen, t, last = 1.0, max(first, 14.0), min(last, reach)
    for _ in range(48):
        if t >= last:
            break
        distance = body_distance(px + t * x, py + t * y, pz + t * z, pieces, labels, active, count)
        seen = min(seen, 0.5 + 0.5 * distance / (spread * t))
        if seen <= 0.0:
            return 0.0
        t += max(0.8 * distance, 6.0)
    return seen * seen * (3.0 - 2.0 * seen)


@njit(error_model="numpy", fastmath=True)
def no_pieces(pieces):
    """An array for the indices that `gather` writes."""
    return np.zeros(len(pieces), np.int64)
