"""Kernels of the visual hull: what pictures say of voxels (Caillette et al. 2007, Eq. 6), and what becomes of these."""

import math

import numpy as np

from studio.numba_in_threads import njit, prange
from studio.volume.distance_kernels import look_at_tile
from studio.volume.hull_cameras import HEIGHT, WIDTH
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
from studio.volume.hull_rules import (
    DEPTH_IS_LAST,
    EDGE_SHARE,
    LEAST_VIEWS,
    PIXELS,
    POLYNOMIAL,
    SAMPLING,
    SINGLE,
)

BACKGROUND, EDGE, FOREGROUND, UNSEEN = 0, 1, 2, 3
CARVED, KEPT, SPLIT = 0, 1, 2
BLOCK = 64
"""Voxels dealt out to a thread at a time."""


@njit(cache=True, nogil=True)
def shares_of(count, share, shares):
    """How many of `count` things one of several threads gets when blocks of BLOCK are dealt out in turn."""
    whole, rest = divmod(count, BLOCK * shares)
    return whole * BLOCK + min(max(rest - share * BLOCK, 0), BLOCK)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def look_at_mask(cameras, view, starts, sums, last, share, place):
    """What a mask says of a voxel. sums : summed areas of all masks, this one's (H + 1, W + 1) from
    starts[1, view].

    Above the last depth every pixel of the rectangle around the voxel counts, so nothing is carved that covers a
    mask pixel. At the last depth: of the rectangle of the voxel's own area.
    """
    width, height = int(cameras[view, WIDTH]), int(cameras[view, HEIGHT])
    across, down = place[BOUND_X], place[BOUND_Y]
    if last:
        shrunk = math.sqrt(place[AREA] / (4.0 * across * down))
        across, down = across * shrunk, down * shrunk
    left, right = math.floor(place[U] - across + 0.5), math.floor(place[U] + across + 0.5)
    top, bottom = math.floor(place[V] - down + 0.5), math.floor(place[V] + down + 0.5)
    if right < 0 or bottom < 0 or left >= width or top >= height:
        return UNSEEN
    partly = left < 0 or top < 0 or right >= width or bottom >= height
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, width - 1), min(bottom, height - 1)
    start = starts[1, view]
    upper, lower = start + top * (width + 1), start + (bottom + 1) * (width + 1)
    found = sums[lower + right + 1] - sums[lower + left] - sums[upper + right + 1] + sums[upper + left]
    pixels = (right - left + 1) * (bottom - top + 1)
    if last:
        if place[U] < -0.5 or place[V] < -0.5 or place[U] >= width - 0.5 or place[V] >= height - 0.5:
            return UNSEEN
        return FOREGROUND if found > 0 and found >= share * pixels else BACKGROUND
    place[SHARE] = found / pixels
    if found == 0 and not partly:
        return BACKGROUND
    return FOREGROUND if found == pixels and not partly else EDGE


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def look_at_pixels(cameras, view, starts, picture, gaussians, distances, heights, rules, place):
    """Eq. 6 for one voxel in one picture. distances : of all views' pixels, this one's from starts[0, view]; NaN
    where nobody has looked yet.
    """
    # One way out, as functions with several count their array arguments in and out at each call.
    width, height, start = int(cameras[view, WIDTH]), int(cameras[view, HEIGHT]), starts[0, view]
    last, single = rules[DEPTH_IS_LAST] > 0.0, np.float32(rules[SINGLE])
    count = sample_count(place, rules[SAMPLING])
    enough = rules[POLYNOMIAL] + count * (rules[POLYNOMIAL + 1] + count * rules[POLYNOMIAL + 2])
    total, inside, far, decided = np.float32(0.0), 0, 0, False
    for number in range(count):
        x, y = sample_pixel(place, number, count, heights)
        if x >= 0 and y >= 0 and x < width and y < height:
            at = start + y * width + x
            distance = distances[at]
            if distance != distance:
                look_at_tile(cameras, view, starts, x, y, picture, gaussians, rules, distances)
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
        usual = rules[POLYNOMIAL] + inside * (rules[POLYNOMIAL + 1] + inside * rules[POLYNOMIAL + 2])
        if total <= usual:
            answer = EDGE if partly and not last else BACKGROUND
        elif last:
            answer = FOREGROUND if far >= rules[EDGE_SHARE] * inside else BACKGROUND
        elif far == inside and not partly:
            answer = FOREGROUND
    place[SHARE] = far / max(inside, 1)
    return answer


@njit(cache=True, nogil=True, error_model="numpy")
def judge_share(
    share, shares, nodes, states, verdicts, corner, edge, cameras, starts, sums, picture, gaussians, distances, heights,
    rules
):  # fmt: skip
    """CARVED, KEPT or SPLIT for every `shares`-th block of the voxels (N, 3), beginning with block `share`.

    verdicts : (N,) filled. states : (N, 3) bits of the views in which each is foreground for good (masks only), bits of
    those that do not see it, and the view to look at first: that in which its parent was the least foreground, the
    likeliest to carve it. They are brought up to date; they change how much is looked at, never what comes out.
    """
    # One loop, not a function a voxel: array arguments of one with several exits are counted in and out at each call.
    place, half, views = np.empty(PLACE), 0.5 * edge, cameras.shape[0]
    last, by_pixels, edge_share = rules[DEPTH_IS_LAST] > 0.0, rules[PIXELS] > 0.0, rules[EDGE_SHARE]
    for number in range(shares_of(len(nodes), share, shares)):
        index = (number // BLOCK * shares + share) * BLOCK + number % BLOCK
        x = corner[0] + nodes[index, 0] * edge + half
        y = corner[1] + nodes[index, 1] * edge + half
        z = corner[2] + nodes[index, 2] * edge + half
        settled, unseen, view = states[index, 0], states[index, 1], int(states[index, 2]) - 1
        seen, edges, least, answer = 0, 0, 2.0, EDGE
        for _ in range(views):
            view = view + 1 if view + 1 < views else 0
            bit = np.uint32(1) << np.uint32(view)
            if unseen & bit:
                continue
            if settled & bit:
                seen += 1
                continue
            if not place_voxel(cameras, view, x, y, z, half, place):
                answer = UNSEEN
            elif by_pixels:
                answer = look_at_pixels(
                    cameras, view, starts, picture, gaussians, distances, heights, rules, place
                )
            else:
                answer = look_at_mask(cameras, view, starts, sums, last, edge_share, place)
            if answer == BACKGROUND:
                break
            if answer == UNSEEN:
                unseen |= bit
                continue
            seen += 1
            if place[SHARE] < least:
                least = place[SHARE]
                states[index, 2] = view
            if answer == EDGE:
                edges += 1
            elif not by_pixels:
                settled |= bit
        states[index, 0], states[index, 1] = settled, unseen
        if answer == BACKGROUND or seen < rules[LEAST_VIEWS]:
            verdicts[index] = CARVED
        else:
            verdicts[index] = SPLIT if edges else KEPT


@njit(cache=True, nogil=True, parallel=True)
def judge_all(
    threads,
    nodes,
    states,
    verdicts,
    corner,
    edge,
    cameras,
    starts,
    sums,
    picture,
    gaussians,
    distances,
    heights,
    rules,
):
    """All voxels, their blocks dealt out to the threads in turn."""
    for thread in prange(threads):
        judge_share(
            thread, threads, nodes, states, verdicts, corner, edge, cameras, starts, sums, picture, gaussians,
            distances, heights, rules,
        )  # fmt: skip
