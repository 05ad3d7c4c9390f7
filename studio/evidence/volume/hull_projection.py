# pyright: standard
"""Voxels' projections into a picture, and samples spread over each, sixteen voxels at a time (structures of arrays, so
that all of it vectorises: see `search.likelihood.outline_kernels`).

It is computed at the voxel's centre: with the derivative of the lens's projection there (distortion included) its three
half axes become three vectors in the picture, its silhouette a hexagon that the projections of the three faces turned
to the camera tile exactly. Seen by a pinhole a point at d from the centre lies at the derivative times d, scaled by
depth / (depth + d's depth): samples use that factor, bounds its largest value, so both are exact for a pinhole; the
error by distortion within one voxel is hundredths of a pixel.
"""

import numpy as np

from studio.foundations.geometry import projection
from studio.foundations.numba_in_threads import EXACT, EXACT_INLINED, njit

LANES = 16
U, V, DEPTH, AXES, SINKS, BOUND_X, BOUND_Y, AREA, FACES, SHARE, SEEN, CENTRE, COUNT, ROWS = (
    0, 1, 2, 3, 9, 12, 13, 14, 15, 18, 19, 20, 23, 24,
)  # fmt: skip
"""Rows of projections, of sixteen lanes each: centre (pixels), depth (mm), x and y of the half axes towards the camera,
their depths, half sides of the upright rectangle around the hexagon, area, area of the three faces (pixels²), the share
of foreground that was found there, whether the camera sees the voxel, the voxel's centre in the world (mm), and its
number of samples."""
NEAR = 100.0
"""mm: voxels nearer to a camera's plane than this are not seen by it."""

distorted = njit(**EXACT_INLINED)(projection.distorted)


@njit(**EXACT_INLINED)
def half_axis(away, half, turned, at, slopes, lens):
    """Across and down (pixels) and depth of a voxel's half axis towards the camera, which is `away` along it. turned :
    that axis in the camera's. at : a, b, 1 / depth. slopes : of the lens there. lens : fx, skew, fy.
    """
    step = half if away >= 0.0 else -half
    sink = step * turned[2]
    along_a = (step * turned[0] - at[0] * sink) * at[2]
    along_b = (step * turned[1] - at[1] * sink) * at[2]
    along_x = slopes[0] * along_a + slopes[1] * along_b
    along_y = slopes[1] * along_a + slopes[2] * along_b
    return lens[0] * along_x + lens[1] * along_y, lens[2] * along_y, sink


@njit(**EXACT_INLINED)
def face_area(ax, ay, bx, by):
    """Of the face between two half axes."""
    return 4.0 * abs(ax * by - ay * bx)


@njit(**EXACT)
def place_voxels(cameras, view, half, place):
    """Fill the projections (24 · 16,) of sixteen voxels from their centres. half : of their edge, mm."""
    camera = cameras[view]
    r, t, m, k, eye = camera.rotation, camera.translation, camera.matrix, camera.lens, camera.centre
    r00, r01, r02, r10, r11, r12 = r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2]
    r20, r21, r22, t0, t1, t2 = r[2, 0], r[2, 1], r[2, 2], t[0], t[1], t[2]
    fx, skew, cx, fy, cy = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2]
    k1, k2, p1, p2, k3 = k[0], k[1], k[2], k[3], k[4]
    ex, ey, ez, limit = eye[0], eye[1], eye[2], camera.limit
    reach = half * (abs(r20) + abs(r21) + abs(r22))
    for lane in range(LANES):
        x, y, z = (
            place[CENTRE * LANES + lane],
            place[(CENTRE + 1) * LANES + lane],
            place[(CENTRE + 2) * LANES + lane],
        )
        depth = r20 * x + r21 * y + r22 * z + t2
        near = 1.0 / depth
        a = (r00 * x + r01 * y + r02 * z + t0) * near
        b = (r10 * x + r11 * y + r12 * z + t1) * near
        square = a * a + b * b
        xd, yd, radial = distorted(a, b, (k1, k2, p1, p2, k3))
        slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
        slopes = (
            radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a,
            a * b * slope + 2.0 * p1 * a + 2.0 * p2 * b,
            radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a,
        )
        place[U * LANES + lane] = fx * xd + skew * yd + cx
        place[V * LANES + lane] = fy * yd + cy
        place[DEPTH * LANES + lane] = depth
        at, lens = (a, b, near), (fx, skew, fy)
        ax, ay, a_sink = half_axis(ex - x, half, (r00, r10, r20), at, slopes, lens)
        bx, by, b_sink = half_axis(ey - y, half, (r01, r11, r21), at, slopes, lens)
        gx, gy, g_sink = half_axis(ez - z, half, (r02, r12, r22), at, slopes, lens)
        place[AXES * LANES + lane], place[(AXES + 1) * LANES + lane] = ax, ay
        place[(AXES + 2) * LANES + lane], place[(AXES + 3) * LANES + lane] = bx, by
        place[(AXES + 4) * LANES + lane], place[(AXES + 5) * LANES + lane] = gx, gy
        place[SINKS * LANES + lane] = a_sink
        place[(SINKS + 1) * LANES + lane] = b_sink
        place[(SINKS + 2) * LANES + lane] = g_sink
        scale = depth / (depth - reach)
        place[BOUND_X * LANES + lane] = (abs(ax) + abs(bx) + abs(gx)) * scale
        place[BOUND_Y * LANES + lane] = (abs(ay) + abs(by) + abs(gy)) * scale
        first, second, third = face_area(bx, by, gx, gy), face_area(gx, gy, ax, ay), face_area(ax, ay, bx, by)
        place[FACES * LANES + lane] = first
        place[(FACES + 1) * LANES + lane] = second
        place[(FACES + 2) * LANES + lane] = third
        place[AREA * LANES + lane] = first + second + third
        place[SEEN * LANES + lane] = 1.0 if (depth - reach >= NEAR) & (square <= limit) else 0.0


@njit(**EXACT_INLINED)
def set_centre(place, lane, x, y, z):
    """A voxel's centre in the world (mm)."""
    place[CENTRE * LANES + lane] = x
    place[(CENTRE + 1) * LANES + lane] = y
    place[(CENTRE + 2) * LANES + lane] = z


@njit(**EXACT)
def set_centres(place, centres, edges, first, end):
    """Set the centres of as many of the voxels from `first` on as have the same edge; returns their number."""
    lanes = 0
    while lanes < LANES and first + lanes < end and edges[first + lanes] == edges[first]:
        index = first + lanes
        set_centre(place, lanes, centres[index, 0], centres[index, 1], centres[index, 2])
        lanes += 1
    return lanes


@njit(**EXACT)
def count_samples(place, lanes, sampling):
    """Fill in each voxel's number of samples: the square root of its pixels, at least one; returns the most."""
    for lane in range(LANES):
        area = place[AREA * LANES + lane]
        place[COUNT * LANES + lane] = max(1.0, np.ceil(sampling * np.sqrt(area) - 1e-9))
    most = 0
    for lane in range(lanes):
        if place[SEEN * LANES + lane] > 0.0:
            most = max(most, int(place[COUNT * LANES + lane]))
    return most


@njit(**EXACT)
def sample_pixels(place, most, width, height, heights, pixels):
    """Fill pixels (most · 16,) with the places in the picture, row by row, -1 outside, of each voxel's first samples,
    spread evenly over its area (Hammersley's points on the faces); what lies behind its last sample is none.

    heights : the radical inverse of each sample's number in base 2.
    """
    for number in range(most):
        q = 2.0 * heights[number] - 1.0
        for lane in range(LANES):
            u, v, depth = place[U * LANES + lane], place[V * LANES + lane], place[DEPTH * LANES + lane]
            ax, ay = place[AXES * LANES + lane], place[(AXES + 1) * LANES + lane]
            bx, by = place[(AXES + 2) * LANES + lane], place[(AXES + 3) * LANES + lane]
            cx, cy = place[(AXES + 4) * LANES + lane], place[(AXES + 5) * LANES + lane]
            a_sink, b_sink = place[SINKS * LANES + lane], place[(SINKS + 1) * LANES + lane]
            c_sink, first_area = place[(SINKS + 2) * LANES + lane], place[FACES * LANES + lane]
            second_area, third_area = place[(FACES + 1) * LANES + lane], place[(FACES + 2) * LANES + lane]
            count = place[COUNT * LANES + lane]
            at = (number + 0.5) / count * place[AREA * LANES + lane]
            beyond = at >= first_area
            at = at - first_area if beyond else at
            last = beyond & (at >= second_area)
            at = at - second_area if last else at
            p = 2.0 * at / (third_area if last else second_area if beyond else first_area) - 1.0
            # On the first face the half axes are a, b, c; on the second b, c, a; on the third c, a, b.
            sink = (c_sink if last else b_sink if beyond else a_sink) + p * (
                a_sink if last else c_sink if beyond else b_sink
            )
            sink = sink + q * (b_sink if last else a_sink if beyond else c_sink)
            scale = depth / (depth + sink)
            x = (cx if last else bx if beyond else ax) + p * (ax if last else cx if beyond else bx)
            y = (cy if last else by if beyond else ay) + p * (ay if last else cy if beyond else by)
            x = u + scale * (x + q * (bx if last else ax if beyond else cx))
            y = v + scale * (y + q * (by if last else ay if beyond else cy))
            column, row = (
                np.floor((u if count == 1.0 else x) + 0.5),
                np.floor((v if count == 1.0 else y) + 0.5),
            )
            inside = (column >= 0.0) & (row >= 0.0) & (column < width) & (row < height)
            pixels[number * LANES + lane] = row * width + column if inside else -1.0
