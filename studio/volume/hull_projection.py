# pyright: standard
"""A voxel's projection into a picture, and samples spread over it.

It is computed at the voxel's centre: with the derivative of the lens's projection there (distortion included) its three
half axes become three vectors in the picture, its silhouette a hexagon that the projections of the three faces turned
to the camera tile exactly. Seen by a pinhole a point at d from the centre lies at the derivative times d, scaled by
depth / (depth + d's depth): samples use that factor, bounds its largest value, so both are exact for a pinhole; the
error by distortion within one voxel is hundredths of a pixel.
"""

import math

from studio.geometry import projection
from studio.numba_in_threads import EXACT_INLINED, njit

U, V, DEPTH, AXES, SINKS, BOUND_X, BOUND_Y, AREA, FACES, SHARE, PLACE = 0, 1, 2, 3, 9, 12, 13, 14, 15, 18, 19
"""Entries of a voxel's projection: centre (pixels), depth (mm), x and y of the half axes towards the camera, their
depths, half sides of the upright rectangle around the hexagon, area, area of the three faces (pixels²), and
the share of foreground that was found there."""
NEAR = 100.0
"""mm: voxels nearer to a camera's plane than this are not seen by it."""

distorted = njit(**EXACT_INLINED)(projection.distorted)


@njit(**EXACT_INLINED)
def place_voxel(cameras, view, x, y, z, half, place):
    """Fill `place` with a voxel's projection; False where the camera cannot see it. half : of its edge, mm."""
    camera = cameras[view]
    r, t, m, k = camera.rotation, camera.translation, camera.matrix, camera.lens
    depth = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z + t[2]
    reach = half * (abs(r[2, 0]) + abs(r[2, 1]) + abs(r[2, 2]))
    if depth - reach < NEAR:
        return False
    near = 1.0 / depth
    a = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z + t[0]) * near
    b = (r[1, 0] * x + r[1, 1] * y + r[1, 2] * z + t[1]) * near
    square = a * a + b * b
    if square > camera.limit:
        return False
    k1, k2, p1, p2, k3 = k[0], k[1], k[2], k[3], k[4]
    xd, yd, radial = distorted(a, b, (k1, k2, p1, p2, k3))
    slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
    xx = radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a
    xy = a * b * slope + 2.0 * p1 * a + 2.0 * p2 * b
    yy = radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a
    fx, skew, fy = m[0, 0], m[0, 1], m[1, 1]
    place[U] = fx * xd + skew * yd + m[0, 2]
    place[V] = fy * yd + m[1, 2]
    place[DEPTH] = depth
    bound_x, bound_y = 0.0, 0.0
    for axis in range(3):
        away = camera.centre[axis] - (x if axis == 0 else y if axis == 1 else z)
        step = half if away >= 0.0 else -half
        sink = step * r[2, axis]
        along_a = (step * r[0, axis] - a * sink) * near
        along_b = (step * r[1, axis] - b * sink) * near
        along_x, along_y = xx * along_a + xy * along_b, xy * along_a + yy * along_b
        across, down = fx * along_x + skew * along_y, fy * along_y
        place[AXES + 2 * axis], place[AXES + 2 * axis + 1], place[SINKS + axis] = across, down, sink
        bound_x += abs(across)
        bound_y += abs(down)
    scale = depth / (depth - reach)
    place[BOUND_X], place[BOUND_Y] = bound_x * scale, bound_y * scale
    place[AREA] = 0.0
    for axis in range(3):
        one, two = AXES + 2 * ((axis + 1) % 3), AXES + 2 * ((axis + 2) % 3)
        face = 4.0 * abs(place[one] * place[two + 1] - place[one + 1] * place[two])
        place[FACES + axis] = face
        place[AREA] += face
    return True


@njit(**EXACT_INLINED)
def sample_count(place, sampling):
    """Number of samples for a voxel's area: the square root of its pixels, at least one."""
    return max(1, math.ceil(sampling * math.sqrt(place[AREA]) - 1e-9))


@njit(**EXACT_INLINED)
def sample_pixel(place, number, count, heights):
    """Column and row of one of `count` samples spread evenly over a voxel's area (Hammersley's points on the faces).

    heights : the radical inverse of each sample's number in base 2.
    """
    if count == 1:
        return math.floor(place[U] + 0.5), math.floor(place[V] + 0.5)
    at = (number + 0.5) / count * place[AREA]
    face = 0
    while face < 2 and at >= place[FACES + face]:
        at -= place[FACES + face]
        face += 1
    p = 2.0 * at / place[FACES + face] - 1.0
    q = 2.0 * heights[number] - 1.0
    one, two = (face + 1) % 3, (face + 2) % 3
    sink = place[SINKS + face] + p * place[SINKS + one] + q * place[SINKS + two]
    scale = place[DEPTH] / (place[DEPTH] + sink)
    f, g, h = AXES + 2 * face, AXES + 2 * one, AXES + 2 * two
    x = place[U] + scale * (place[f] + p * place[g] + q * place[h])
    y = place[V] + scale * (place[f + 1] + p * place[g + 1] + q * place[h + 1])
    return math.floor(x + 0.5), math.floor(y + 0.5)
