# pyright: standard
"""Kernels of the visual hull: classification of voxels by pictures or masks (Caillette et al. 2007, Eq. 6).

Voxels are looked at view by view, sixteen at a time of those that await the same view next, so that their projections
vectorise; each still meets its views in its own order, and none after the one that carves it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.hull_projection import (
    AREA,
    BOUND_X,
    BOUND_Y,
    COUNT,
    LANES,
    ROWS,
    SEEN,
    SHARE,
    U,
    V,
    count_samples,
    place_voxels,
    sample_pixels,
    set_centre,
)
from studio.foundations.arrays import Array, Bytes
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_in_threads import EXACT, EXACT_INLINED, njit

BACKGROUND, EDGE, FOREGROUND, UNSEEN = 0, 1, 2, 3
CARVED, KEPT, SPLIT = 0, 1, 2
BLOCK = 4096
"""Pixels whose distances are found at a time."""


class Rules(NamedTuple):
    """The rules of carving. last : whether this is the last depth. least_views : fewest that see a voxel. edge_share :
    of the samples at the last depth. sampling : samples / √area. single : T_1. polynomial : T_k's three coefficients.
    """

    last: bool
    least_views: int
    edge_share: float
    sampling: float
    single: float
    polynomial: tuple[float, float, float]


class Sights(NamedTuple):
    """A frame's pixels or masks, all views one after another.

    by_pixels : not by masks. starts : (2, V + 1) offsets of a view's pixels, and of its sums. sums : summed areas of
    the masks, (H + 1, W + 1) each. picture : (N, 3) uint8 BGR. distances : (N,) from the background. heights : the
    radical inverse of each sample's number.
    """

    by_pixels: bool
    cameras: CameraTable
    starts: NDArray[np.int64]
    sums: NDArray[np.int32]
    picture: NDArray[np.uint8]
    distances: NDArray[np.float32]
    heights: NDArray[np.float64]


@njit(**EXACT, fastmath=True)
def find_distances(
    first_block: int,
    end_block: int,
    picture: NDArray[np.uint8],
    gaussians: NDArray[np.float32],
    shadow: np.float32,
    deepest: np.float32,
    distances: NDArray[np.float32],
) -> None:
    """Squared Mahalanobis distances of some blocks of pixels from the background, lit or in shadow.

    picture : (N, 3) uint8 BGR. gaussians : (9, N) `YuvBackground.packed`. shadow, deepest : shares of the luminance.
    distances : (N,) filled. The formula is `YuvBackground.squared_distances`.
    """
    first, end = first_block * BLOCK, min(end_block * BLOCK, picture.shape[0])
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
        squared = dy * dy * p00 + du * du * p11 + dv * dv * p22
        squared += np.float32(2.0) * (dy * (du * p01 + dv * p02) + du * dv * p12)
        if in_shadow and deepest > np.float32(0.0):
            left = max(y / max(my, one), one - deepest)
            dy, du, dv = y - left * my, u - left * mu, v - left * mv
            darker = dy * dy * p00 + du * du * p11 + dv * dv * p22
            darker += np.float32(2.0) * (dy * (du * p01 + dv * p02) + du * dv * p12)
            squared = min(squared, darker)
        distances[at] = squared


@njit(**EXACT_INLINED)
def look_at_mask(seen, view, rules, place, lane):
    """Classify a voxel by a mask.

    Above the last depth every pixel of the rectangle around the voxel counts, so a voxel that covers a mask pixel is
    not carved. At the last depth: of the rectangle of the voxel's own area.
    """
    width, height = int(seen.cameras[view].size[0]), int(seen.cameras[view].size[1])
    sums, u, v = seen.sums, place[U * LANES + lane], place[V * LANES + lane]
    across, down = place[BOUND_X * LANES + lane], place[BOUND_Y * LANES + lane]
    if rules.last:
        shrunk = math.sqrt(place[AREA * LANES + lane] / (4.0 * across * down))
        across, down = across * shrunk, down * shrunk
    left, right = math.floor(u - across + 0.5), math.floor(u + across + 0.5)
    top, bottom = math.floor(v - down + 0.5), math.floor(v + down + 0.5)
    if right < 0 or bottom < 0 or left >= width or top >= height:
        return UNSEEN
    partly = left < 0 or top < 0 or right >= width or bottom >= height
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, width - 1), min(bottom, height - 1)
    start = seen.starts[1, view]
    upper, lower = start + top * (width + 1), start + (bottom + 1) * (width + 1)
    foreground = sums[lower + right + 1] - sums[lower + left] - sums[upper + right + 1] + sums[upper + left]
    pixels = (right - left + 1) * (bottom - top + 1)
    if rules.last:
        if u < -0.5 or v < -0.5 or u >= width - 0.5 or v >= height - 0.5:
            return UNSEEN
        return FOREGROUND if foreground > 0 and foreground >= rules.edge_share * pixels else BACKGROUND
    place[SHARE * LANES + lane] = foreground / pixels
    if foreground == 0 and not partly:
        return BACKGROUND
    return FOREGROUND if foreground == pixels and not partly else EDGE


@njit(**EXACT_INLINED)
def look_at_pixels(seen, view, rules, place, lane, pixels):
    """Eq. 6 for one voxel in one picture. pixels : of its samples."""
    # A single return: functions with several count references to their array arguments at each call.
    width, height = int(seen.cameras[view].size[0]), int(seen.cameras[view].size[1])
    start, distances = seen.starts[0, view], seen.distances
    last, single, (one, linear, square) = rules.last, np.float32(rules.single), rules.polynomial
    count = int(place[COUNT * LANES + lane])
    enough = one + count * (linear + count * square)
    total, inside, far, decided = np.float32(0.0), 0, 0, False
    for number in range(count):
        pixel = np.int64(pixels[number * LANES + lane])
        if pixel >= 0:
            distance = distances[start + pixel]
            total += distance
            inside += 1
            far += int(distance > single)
            decided = not last and total > enough and far < inside
            if decided:
                break
    answer = EDGE
    if inside == 0:
        u, v = place[U * LANES + lane], place[V * LANES + lane]
        across, down = place[BOUND_X * LANES + lane], place[BOUND_Y * LANES + lane]
        beyond_x = u + across < 0.0 or u - across > width - 1.0
        beyond_y = v + down < 0.0 or v - down > height - 1.0
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
    place[SHARE * LANES + lane] = far / max(inside, 1)
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
    # One kernel, not a function per voxel: with several returns references to array arguments are counted at each call.
    views, half, size = seen.cameras.shape[0], 0.5 * edge, seen.cameras["size"]
    place, pixels = np.ones(ROWS * LANES), np.empty(seen.heights.shape[0] * LANES)
    left, count = np.arange(first, end), end - first
    begins_with, least = states[first:end, 2].copy(), np.full(count, 2.0)
    looked, edges = np.zeros(count, np.int64), np.zeros(count, np.int64)
    waiting, lengths = np.empty((views, count), np.int64), np.empty(views, np.int64)
    for turn in range(views):
        lengths[:] = 0
        for number in range(count):
            index = left[number]
            view = (int(begins_with[index - first]) + turn) % views
            bit = np.uint32(1) << np.uint32(view)
            if states[index, 0] & bit:
                looked[index - first] += 1
            elif not states[index, 1] & bit:
                waiting[view, lengths[view]] = index
                lengths[view] += 1
        for number in range(count):
            verdicts[left[number]] = SPLIT
        for view in range(views):
            bit = np.uint32(1) << np.uint32(view)
            for begin in range(0, lengths[view], LANES):
                lanes = min(LANES, lengths[view] - begin)
                for lane in range(lanes):
                    index = waiting[view, begin + lane]
                    x = corner[0] + nodes[index, 0] * edge + half
                    y = corner[1] + nodes[index, 1] * edge + half
                    z = corner[2] + nodes[index, 2] * edge + half
                    set_centre(place, lane, x, y, z)
                place_voxels(seen.cameras, view, half, place)
                if seen.by_pixels:
                    most = count_samples(place, lanes, rules.sampling)
                    sample_pixels(place, most, size[view, 0], size[view, 1], seen.heights, pixels)
                for lane in range(lanes):
                    index = waiting[view, begin + lane]
                    answer = UNSEEN
                    if place[SEEN * LANES + lane] > 0.0:
                        if seen.by_pixels:
                            answer = look_at_pixels(seen, view, rules, place, lane, pixels)
                        else:
                            answer = look_at_mask(seen, view, rules, place, lane)
                    if answer == BACKGROUND:
                        verdicts[index] = CARVED
                        continue
                    if answer == UNSEEN:
                        states[index, 1] |= bit
                        continue
                    looked[index - first] += 1
                    if place[SHARE * LANES + lane] < least[index - first]:
                        least[index - first] = place[SHARE * LANES + lane]
                        states[index, 2] = view
                    if answer == EDGE:
                        edges[index - first] += 1
                    elif not seen.by_pixels:
                        states[index, 0] |= bit
        still = 0
        for number in range(count):
            if verdicts[left[number]] != CARVED:
                left[still] = left[number]
                still += 1
        count = still
    for number in range(count):
        index = left[number]
        if looked[index - first] < rules.least_views:
            verdicts[index] = CARVED
        else:
            verdicts[index] = SPLIT if edges[index - first] else KEPT
