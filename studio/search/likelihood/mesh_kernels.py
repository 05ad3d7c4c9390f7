# pyright: standard
"""Triangles of meshes drawn into pictures: the nearest one a pixel, or how a silhouette differs from a mask's."""

from typing import Any

import numpy as np

from studio.foundations.arrays import Array, Floats, Indices
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.geometry.projection import distorted
from studio.foundations.numba_in_threads import EXACT, EXACT_INLINED, njit

NEAREST_DEPTH = 1.0
EDGE = -1e-9
"""Barycentric coordinate from which on a pixel's centre lies in a triangle."""

distorted_in_kernel = njit(**EXACT)(distorted)


@njit(**EXACT)
def project_points(
    points: Array,
    frames: Array,
    joints: Indices,
    camera: Any,  # noqa: ANN401 - a record
    shrink: float,
    seen: Array,
) -> None:
    """Fill seen (V, 3): pixels of a picture that is `shrink` times smaller, and depth, NaN where that is too near.

    points : (V, 3) in the frames (F, 3, 4) of joints (V,). camera : a row of a `CameraTable`.
    """
    rotation, translation, matrix, lens = camera.rotation, camera.translation, camera.matrix, camera.lens
    for k in range(points.shape[0]):
        frame = frames[joints[k]]
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        wx = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z + frame[0, 3]
        wy = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z + frame[1, 3]
        wz = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z + frame[2, 3]
        cx = rotation[0, 0] * wx + rotation[0, 1] * wy + rotation[0, 2] * wz + translation[0]
        cy = rotation[1, 0] * wx + rotation[1, 1] * wy + rotation[1, 2] * wz + translation[1]
        cz = rotation[2, 0] * wx + rotation[2, 1] * wy + rotation[2, 2] * wz + translation[2]
        if cz < NEAREST_DEPTH or (cx * cx + cy * cy) > camera.limit * cz * cz:
            seen[k, 0] = seen[k, 1] = seen[k, 2] = np.nan
            continue
        xd, yd, _ = distorted_in_kernel(cx / cz, cy / cz, (lens[0], lens[1], lens[2], lens[3], lens[4]))
        u = matrix[0, 0] * xd + matrix[0, 1] * yd + matrix[0, 2]
        v = matrix[1, 1] * yd + matrix[1, 2]
        seen[k, 0], seen[k, 1], seen[k, 2] = (u + 0.5) / shrink - 0.5, (v + 0.5) / shrink - 0.5, cz


@njit(**EXACT)
def box_of_triangle(a, b, c, width, height):
    """Left, top, right and bottom (one past the last) of the pixels whose centres a triangle may hold."""
    if np.isnan(a[0] + b[0] + c[0]):
        return 0, 0, 0, 0
    left = max(0.0, np.ceil(min(a[0], b[0], c[0])))
    top = max(0.0, np.ceil(min(a[1], b[1], c[1])))
    right = min(width - 1.0, np.floor(max(a[0], b[0], c[0])))
    bottom = min(height - 1.0, np.floor(max(a[1], b[1], c[1])))
    return int(left), int(top), int(right) + 1, int(bottom) + 1


@njit(**EXACT_INLINED)
def shares_of_corners(a, b, c, area, x, y):
    """Barycentric coordinates of a pixel's centre in a triangle of twice the signed `area`."""
    u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
    v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
    return u, v, 1.0 - u - v


@njit(**EXACT)
def draw_triangles(seen: Array, triangles: Indices, owner: Indices, depth: Floats) -> None:
    """Fill owner (H, W), the nearest triangle (F, 3) of points (V, 3: pixel and depth) at each pixel's centre, -1 where
    there is none, and its depth (H, W), mm, infinite there.
    """
    height, width = owner.shape
    owner[:] = -1
    depth[:] = np.float32(np.inf)
    for t in range(triangles.shape[0]):
        a, b, c = seen[triangles[t, 0]], seen[triangles[t, 1]], seen[triangles[t, 2]]
        left, top, right, bottom = box_of_triangle(a, b, c, width, height)
        if left >= right or top >= bottom:
            continue
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        for y in range(top, bottom):
            for x in range(left, right):
                u, v, w = shares_of_corners(a, b, c, area, x, y)
                if u >= EDGE and v >= EDGE and w >= EDGE:
                    here = np.float32(1.0 / (u / a[2] + v / b[2] + w / c[2]))
                    if here < depth[y, x]:
                        depth[y, x], owner[y, x] = here, t


@njit(**EXACT)
def compare_silhouettes(
    frames: Array,
    points: Array,
    joints: Indices,
    triangles: Indices,
    cameras: CameraTable,
    shrink: Indices,
    masks: Floats,
    sizes: Indices,
    wrong: Array,
) -> None:
    """Add to wrong (N,) the share of all masks' area by which the silhouettes of N poses differ from them.

    frames : (N, F, 3, 4). cameras : V rows of a `CameraTable`. shrink : (V,) how many times smaller the masks are, flat
    one after the other, shares of pixels, of sizes (V, 2) height and width.
    """
    seen = np.empty((points.shape[0], 3))
    stamp = np.full(masks.shape[0], -1, np.int64)
    whole = 0.0
    for k in range(masks.shape[0]):
        whole += masks[k]
    for n in range(frames.shape[0]):
        start, share = 0, 0.0
        for v in range(cameras.shape[0]):
            height, width = sizes[v, 0], sizes[v, 1]
            project_points(points, frames[n], joints, cameras[v], shrink[v], seen)
            for t in range(triangles.shape[0]):
                a, b, c = seen[triangles[t, 0]], seen[triangles[t, 1]], seen[triangles[t, 2]]
                left, top, right, bottom = box_of_triangle(a, b, c, width, height)
                if left >= right or top >= bottom:
                    continue
                area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
                if area == 0.0:
                    continue
                for y in range(top, bottom):
                    for x in range(left, right):
                        at = start + y * width + x
                        if stamp[at] == n:
                            continue
                        u, v, w = shares_of_corners(a, b, c, area, x, y)
                        if u >= EDGE and v >= EDGE and w >= EDGE:
                            stamp[at] = n
            for at in range(start, start + height * width):
                share += 1.0 - masks[at] if stamp[at] == n else masks[at]
            start += height * width
        wrong[n] = share / max(whole, 1.0)
