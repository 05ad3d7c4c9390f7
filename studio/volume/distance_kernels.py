"""How far pixels are from their background, found where and when somebody looks.

A voxel needs scattered pixels, one of few in a cache line, each with nine numbers of background from memory. So when
the first sample falls into a tile of 32 × 8 pixels the whole tile is computed, in rows, which takes less time than five
scattered ones; its distances then serve all voxels of all depths. Distances nobody has asked for are NaN. Two threads
may compute the same tile: each writes the same numbers, and whoever reads sees either NaN or the number.
"""

import numpy as np

from studio.numba_in_threads import njit
from studio.volume.hull_cameras import HEIGHT, WIDTH
from studio.volume.hull_rules import DEEPEST, SHADOW

TILE_WIDTH, TILE_HEIGHT = 32, 8


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def row_distances(first, end, picture, gaussians, shadow, deepest, distances):
    """Squared Mahalanobis distances of pixels first to end - 1 from the background, lit or in shadow.

    picture : (N, 3) uint8 BGR. gaussians : (9, N) `YuvBackground.packed`. distances : (N,) filled. The formula is
    `YuvBackground.squared_distances`.
    """
    one = np.float32(1.0)
    for at in range(first, end):
        b, g, r = np.float32(picture[at, 0]), np.float32(picture[at, 1]), np.float32(picture[at, 2])
        y = np.float32(0.114) * b + np.float32(0.587) * g + np.float32(0.299) * r
        u, v = np.float32(0.492) * (b - y), np.float32(0.877) * (r - y)
        my, mu, mv = gaussians[0, at], gaussians[1, at], gaussians[2, at]
        p00, p11, p22 = gaussians[3, at], gaussians[4, at], gaussians[5, at]
        p01, p02, p12 = gaussians[6, at], gaussians[7, at], gaussians[8, at]
        in_shadow = y < (one - np.float32(0.5) * shadow) * my
        dy, du, dv = y - ((one - shadow) * my if in_shadow else my), u - mu, v - mv
        found = dy * dy * p00 + du * du * p11 + dv * dv * p22
        found += np.float32(2.0) * (dy * (du * p01 + dv * p02) + du * dv * p12)
        if in_shadow and deepest > np.float32(0.0):
            left = max(y / max(my, one), one - deepest)
            dy, du, dv = y - left * my, u - left * mu, v - left * mv
            darker = dy * dy * p00 + du * du * p11 + dv * dv * p22
            darker += np.float32(2.0) * (dy * (du * p01 + dv * p02) + du * dv * p12)
            found = min(found, darker)
        distances[at] = found


@njit(cache=True, nogil=True, error_model="numpy")
def look_at_tile(cameras, view, starts, x, y, picture, gaussians, rules, distances):
    """Fill in the distances of the tile around pixel (x, y) of a view."""
    width, height, start = int(cameras[view, WIDTH]), int(cameras[view, HEIGHT]), starts[0, view]
    shadow, deepest = np.float32(rules[SHADOW]), np.float32(rules[DEEPEST])
    left, top = x // TILE_WIDTH * TILE_WIDTH, y // TILE_HEIGHT * TILE_HEIGHT
    right = min(left + TILE_WIDTH, width)
    for row in range(top, min(top + TILE_HEIGHT, height)):
        first = start + row * width
        row_distances(first + left, first + right, picture, gaussians, shadow, deepest, distances)
