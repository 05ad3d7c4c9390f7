# pyright: standard
"""Kernels of the visual hull: classification of voxels by pictures or masks (Caillette et al. 2007, Eq. 6).

**Pixels.** A voxel needs scattered pixels, one of few in a cache line, each with nine numbers of background from
memory. So when the first sample falls into a tile of 32 × 8 pixels the whole tile is computed, in rows, which takes
less time than five scattered ones; its distances then serve all voxels of all depths. Distances that were not needed
yet are NaN. Two threads may compute the same tile: each writes the same numbers, and a reader sees either NaN or the
number.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Bytes
from studio.geometry.camera_table import CameraTable
from studio.numba_in_threads import EXACT, EXACT_INLINED, njit
from studio.volume.hull_projection import (
    AREA,
    BOUND_X,
    BOUND_Y,
    PLACE,
    SHARE,
    U,
    V,
    place_voxel,
    sample_count,
    sample_pixel,
)

BACKGROUND, EDGE, FOREGROUND, UNSEEN = 0, 1, 2, 3
CARVED, KEPT, SPLIT = 0, 1, 2
TILE_WIDTH, TILE_HEIGHT = 32, 8


class Rules(NamedTuple):
    """The rules of carving. last : whether this is the last depth. least_views : fewest that see a voxel. edge_share :
    of the samples at the last depth. sampling : samples / √area. shadow, deepest : shares of the luminance. single :
    T_1. polynomial : T_k's three coefficients.
    """

    last: bool
    least_views: int
    edge_share: float
    sampling: float
    shadow: float
    deepest: float
    single: float
    polynomial: tuple[float, float, float]


class Sights(NamedTuple):
    """A frame's pixels or masks, all views one after another.

    by_pixels : not by masks. starts : (2, V + 1) offsets of a view's pixels, and of its sums. sums : summed areas of
    the masks, (H + 1, W + 1) each. picture : (N, 3) uint8 BGR. gaussians : (9, N) `YuvBackground.packed`. distances :
    (N,) from the background, NaN where not computed yet. heights : the radical inverse of each sample's number.
    """

    by_pixels: bool
    cameras: CameraTable
    starts: NDArray[np.int64]
    sums: NDArray[np.int32]
    picture: NDArray[np.uint8]
    gaussians: NDArray[np.float32]
    distances: NDArray[np.float32]
    heights: NDArray[np.float64]


@njit(**EXACT, fastmath=True)
def row_distances(first, end, picture, gaussians, shadow, deepest, distances):
    """Squared Mahalanobis distances of pixels first to end - 1 from the background, lit or in shadow.

    picture : (N, 3) uint8 BGR. gaussians : (9, N) `YuvBackground.packed`. distances : (N,) filled. The formula is
    `YuvBackground.squared_distances`.
    """
    one = np.float32(1.0)
    for number in range(end - first):
        # Without a sign, so that no place counts from the end and the loop vectorises.
        at = np.uint64(first) + np.uint64(number)
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


@njit(**EXACT)
def look_at_tile(seen, view, x, y, rules):
    """Fill in the distances of the tile around pixel (x, y) of a view."""
    width, height = int(seen.cameras[view].size[0]), int(seen.cameras[view].size[1])
    shadow, deepest = np.float32(rules.shadow), np.float32(rules.deepest)
    left, top = x // TILE_WIDTH * TILE_WIDTH, y // TILE_HEIGHT * TILE_HEIGHT
    right = min(left + TILE_WIDTH, width)
    for row in range(top, min(top + TILE_HEIGHT, height)):
        first = seen.starts[0, view] + row * width
        row_distances(
            first + left, first + right, seen.picture, seen.gaussians, shadow, deepest, seen.distances
        )


@njit(**EXACT_INLINED)
def look_at_mask(seen, view, rules, place):
    """Classify a voxel by a mask.

    Above the last depth every pixel of the rectangle around the voxel counts, so a voxel that covers a mask pixel is
    not carved. At the last depth: of the rectangle of the voxel's own area.
    """
    width, height = int(seen.cameras[view].size[0]), int(seen.cameras[view].size[1])
    sums, across, down = seen.sums, place[BOUND_X], place[BOUND_Y]
    if rules.last:
        shrunk = math.sqrt(place[AREA] / (4.0 * across * down))
        across, down = across * shrunk, down * shrunk
    left, right = math.floor(place[U] - across + 0.5), math.floor(place[U] + across + 0.5)
    top, bottom = math.floor(place[V] - down + 0.5), math.floor(place[V] + down + 0.5)
    if right < 0 or bottom < 0 or left >= width or top >= height:
        return UNSEEN
    partly = left < 0 or top < 0 or right >= width or bottom >= height
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, width - 1), min(bottom, height - 1)
    start = seen.starts[1, view]
    upper, lower = start + top * (width + 1), start + (bottom + 1) * (width + 1)
    found = sums[lower + right + 1] - sums[lower + left] - sums[upper + right + 1] + sums[upper + left]
    pixels = (right - left + 1) * (bottom - top + 1)
    if rules.last:
        if place[U] < -0.5 or place[V] < -0.5 or place[U] >= width - 0.5 or place[V] >= height - 0.5:
            return UNSEEN
        return FOREGROUND if found > 0 and found >= rules.edge_share * pixels else BACKGROUND
    place[SHARE] = found / pixels
    if found == 0 and not partly:
        return BACKGROUND
    return FOREGROUND if found == pixels and not partly else EDGE


@njit(**EXACT_INLINED)
def look_at_pixels(seen, view, rules, place):
    """Eq. 6 for one voxel in one picture."""
    # A single return: functions with several count references to their array arguments at each call.
    width, height = int(seen.cameras[view].size[0]), int(seen.cameras[view].size[1])
    start, distances = seen.starts[0, view], seen.distances
    last, single, (one, linear, square) = rules.last, np.float32(rules.single), rules.polynomial
    count = sample_count(place, rules.sampling)
    enough = one + count * (linear + count * square)
    total, inside, far, decided = np.float32(0.0), 0, 0, False
    for number in range(count):
        x, y = sample_pixel(place, number, count, seen.heights)
        if x >= 0 and y >= 0 and x < width and y < height:
            at = start + y * width + x
            distance = distances[at]
            if distance != distance:
                look_at_tile(seen, view, x, y, rules)
                distance = distances[at]
            total += distance
            inside += 1
            far += int(distance > single)
            decided = not last and total > enough and far < inside
            if decided:
                break
    answer = EDGE
    if inside == 0:
        beyond_x = place[U] + place[BOUND_X] < 0.0 or place[U] - place[BOUND_X] > width - 1.0
        beyond_y = place[V] + place[BOUND_Y] < 0.0 or place[V] - place[BOUND_Y] > height - 1.0
        answer = UNSEEN if last or beyond_x or beyond_y else EDGE
    elif not decided:
        partly = inside < count
        usual = one + inside * (linear + inside * square)
        if total <= usual:
            answer = EDGE if partly and not last else BACKGROUND
        elif last:
            answer = FOREGROUND if far >= rules.edge_share * inside else BACKGROUND
        elif far == inside and not partly:
            answer = FOREGROUND
    place[SHARE] = far / max(inside, 1)
    return answer


@njit(**EXACT)
def judge(
    first: int,
    end: int,
    nodes: NDArray[np.int32],
    states: NDArray[np.uint32],
    verdicts: Bytes,
    corner: Array,
    edge: float,
    seen: Sights,
    rules: Rules,
) -> None:
    """CARVED, KEPT or SPLIT for the voxels first to end - 1 of nodes (N, 3).

    verdicts : (N,) filled. states : (N, 3) bits of the views in which each is certainly foreground (masks only), bits
    of those that do not see it, and the view to test first: that in which its parent was least foreground, the
    likeliest to carve it. They are updated; they change the amount of work, never the result.
    """
    # One loop, not a function per voxel: with several returns references to array arguments are counted at each call.
    cameras, place, half = seen.cameras, np.empty(PLACE), 0.5 * edge
    views, by_pixels = cameras.shape[0], seen.by_pixels
    for index in range(first, end):
        x = corner[0] + nodes[index, 0] * edge + half
        y = corner[1] + nodes[index, 1] * edge + half
        z = corner[2] + nodes[index, 2] * edge + half
        settled, unseen, view = states[index, 0], states[index, 1], int(states[index, 2]) - 1
        looked, edges, least, answer = 0, 0, 2.0, EDGE
        for _ in range(views):
            view = view + 1 if view + 1 < views else 0
            bit = np.uint32(1) << np.uint32(view)
            if unseen & bit:
                continue
            if settled & bit:
                looked += 1
                continue
            if not place_voxel(cameras, view, x, y, z, half, place):
                answer = UNSEEN
            elif by_pixels:
                answer = look_at_pixels(seen, view, rules, place)
            else:
                answer = look_at_mask(seen, view, rules, place)
            if answer == BACKGROUND:
                break
            if answer == UNSEEN:
                unseen |= bit
                continue
            looked += 1
            if place[SHARE] < least:
                least = place[SHARE]
                states[index, 2] = view
            if answer == EDGE:
                edges += 1
            elif not by_pixels:
                settled |= bit
        states[index, 0], states[index, 1] = settled, unseen
        if answer == BACKGROUND or looked < rules.least_views:
            verdicts[index] = CARVED
        else:
            verdicts[index] = SPLIT if edges else KEPT
