"""Kernels of the visual hull: a voxel in a picture, and what the picture says of it.

A voxel's projection is computed at its centre: with the derivative of the lens's projection there (distortion
included) its three half axes become three vectors in the picture, its silhouette a hexagon that the projections of
the three faces turned to the camera tile exactly. Seen by a pinhole a point at d from the centre lies at the
derivative times d, scaled by depth / (depth + d's depth): samples use that factor, bounds its largest value, so
both are exact for a pinhole; what distortion adds within one voxel is hundredths of a pixel.
"""

import math

import numpy as np
from numba import njit, prange

from studio.volume.hull_cameras import (
    CENTRE,
    DISTORTION,
    HEIGHT,
    MATRIX,
    RADIUS,
    ROTATION,
    TRANSLATION,
    WIDTH,
)

U, V, DEPTH, AXES, SINKS, BOUND_X, BOUND_Y, AREA, FACES, SHARE, PLACE = 0, 1, 2, 3, 9, 12, 13, 14, 15, 18, 19
"""Of a voxel's place in a picture: centre (pixels), depth (mm), x and y of the half axes towards the camera, their
depths, half sides of the upright rectangle around the hexagon, area, area of the three faces (pixels²), and
the share of foreground that was found there."""
NEAR = 100.0
"""mm: a voxel that comes nearer to a camera's plane than this is not seen by it."""

BACKGROUND, EDGE, FOREGROUND, UNSEEN = 0, 1, 2, 3
CARVED, KEPT, SPLIT = 0, 1, 2

DEPTH_IS_LAST, PIXELS, LEAST_VIEWS, EDGE_SHARE, SAMPLING = 0, 1, 2, 3, 4
SHADOW, DEEPEST, SINGLE, POLYNOMIAL, RULES = 5, 6, 7, 8, 11
"""Of a row of rules: is this the last depth, are pixels the evidence, fewest views that see a voxel, share of the
samples at the last depth, samples / √area, the shadow's share, the deepest
shadow's, T_1, and T_k's three coefficients."""
BLOCK = 64


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def place_voxel(cameras, view, x, y, z, half, place):
    """Fill `place` with a voxel's projection; False where the camera cannot see it. half : of its edge, mm."""
    r, t = ROTATION, TRANSLATION
    depth = (
        cameras[view, r + 6] * x + cameras[view, r + 7] * y + cameras[view, r + 8] * z + cameras[view, t + 2]
    )
    reach = half * (abs(cameras[view, r + 6]) + abs(cameras[view, r + 7]) + abs(cameras[view, r + 8]))
    if depth - reach < NEAR:
        return False
    near = 1.0 / depth
    a = (cameras[view, r] * x + cameras[view, r + 1] * y + cameras[view, r + 2] * z + cameras[view, t]) * near
    b = (
        cameras[view, r + 3] * x + cameras[view, r + 4] * y + cameras[view, r + 5] * z + cameras[view, t + 1]
    ) * near
    square = a * a + b * b
    if square > cameras[view, RADIUS]:
        return False
    k1, k2, p1 = cameras[view, DISTORTION], cameras[view, DISTORTION + 1], cameras[view, DISTORTION + 2]
    p2, k3 = cameras[view, DISTORTION + 3], cameras[view, DISTORTION + 4]
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    slope = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
    xd = a * radial + 2.0 * p1 * a * b + p2 * (square + 2.0 * a * a)
    yd = b * radial + p1 * (square + 2.0 * b * b) + 2.0 * p2 * a * b
    xx = radial + a * a * slope + 2.0 * p1 * b + 6.0 * p2 * a
    xy = a * b * slope + 2.0 * p1 * a + 2.0 * p2 * b
    yy = radial + b * b * slope + 6.0 * p1 * b + 2.0 * p2 * a
    fx, skew, fy = cameras[view, MATRIX], cameras[view, MATRIX + 1], cameras[view, MATRIX + 3]
    place[U] = fx * xd + skew * yd + cameras[view, MATRIX + 2]
    place[V] = fy * yd + cameras[view, MATRIX + 4]
    place[DEPTH] = depth
    bound_x, bound_y = 0.0, 0.0
    for axis in range(3):
        away = cameras[view, CENTRE + axis] - (x if axis == 0 else y if axis == 1 else z)
        step = half if away >= 0.0 else -half
        sink = step * cameras[view, r + 6 + axis]
        along_a = (step * cameras[view, r + axis] - a * sink) * near
        along_b = (step * cameras[view, r + 3 + axis] - b * sink) * near
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


@njit(cache=True, nogil=True)
def shares_of(count, share, shares):
    """How many of `count` things one of several threads gets when blocks of BLOCK are dealt out in turn."""
    whole, rest = divmod(count, BLOCK * shares)
    return whole * BLOCK + min(max(rest - share * BLOCK, 0), BLOCK)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def sample_count(place, sampling):
    """How many samples a voxel's area is worth: the square root of its pixels, at least one."""
    return max(1, math.ceil(sampling * math.sqrt(place[AREA]) - 1e-9))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
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


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def weighed(y, u, v, p00, p11, p22, p01, p02, p12):
    """A difference's square under a precision."""
    return y * y * p00 + u * u * p11 + v * v * p22 + np.float32(2.0) * (y * (u * p01 + v * p02) + u * v * p12)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def squared_distance(blue, green, red, gaussians, at, shadow, deepest):
    """Squared Mahalanobis distance of a pixel from its background, lit or in shadow (`evidence.yuv_background`)."""
    b, g, r = np.float32(blue), np.float32(green), np.float32(red)
    one = np.float32(1.0)
    y = np.float32(0.114) * b + np.float32(0.587) * g + np.float32(0.299) * r
    u, v = np.float32(0.492) * (b - y), np.float32(0.877) * (r - y)
    my, mu, mv = gaussians[at, 0], gaussians[at, 1], gaussians[at, 2]
    p00, p11, p22 = gaussians[at, 3], gaussians[at, 4], gaussians[at, 5]
    p01, p02, p12 = gaussians[at, 6], gaussians[at, 7], gaussians[at, 8]
    in_shadow = y < (one - np.float32(0.5) * shadow) * my
    mean = (one - shadow) * my if in_shadow else my
    found = weighed(y - mean, u - mu, v - mv, p00, p11, p22, p01, p02, p12)
    if in_shadow and deepest > np.float32(0.0):
        left = max(y / max(my, one), one - deepest)
        darker = weighed(y - left * my, u - left * mu, v - left * mv, p00, p11, p22, p01, p02, p12)
        found = min(found, darker)
    return found


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
def look_at_pixels(cameras, view, starts, picture, gaussians, heights, rules, place):
    """Eq. 6 for one voxel in one picture. picture, gaussians : all views' pixels, this one's from starts[0, view]."""
    width, height, start = int(cameras[view, WIDTH]), int(cameras[view, HEIGHT]), starts[0, view]
    last = rules[DEPTH_IS_LAST] > 0.0
    shadow, deepest, single = np.float32(rules[SHADOW]), np.float32(rules[DEEPEST]), np.float32(rules[SINGLE])
    count = sample_count(place, rules[SAMPLING])
    enough = rules[POLYNOMIAL] + count * (rules[POLYNOMIAL + 1] + count * rules[POLYNOMIAL + 2])
    total, inside, far = np.float32(0.0), 0, 0
    for number in range(count):
        x, y = sample_pixel(place, number, count, heights)
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        at = start + y * width + x
        distance = squared_distance(
            picture[at, 0], picture[at, 1], picture[at, 2], gaussians, at, shadow, deepest
        )
        total += distance
        inside += 1
        if distance > single:
            far += 1
        elif not last and total > enough:
            place[SHARE] = far / inside
            return EDGE
    partly = inside < count
    if inside == 0:
        beyond_x = place[U] + place[BOUND_X] < 0.0 or place[U] - place[BOUND_X] > width - 1.0
        beyond_y = place[V] + place[BOUND_Y] < 0.0 or place[V] - place[BOUND_Y] > height - 1.0
        return UNSEEN if last or beyond_x or beyond_y else EDGE
    place[SHARE] = far / inside
    if total <= rules[POLYNOMIAL] + inside * (rules[POLYNOMIAL + 1] + inside * rules[POLYNOMIAL + 2]):
        return EDGE if partly and not last else BACKGROUND
    if last:
        return FOREGROUND if far >= rules[EDGE_SHARE] * inside else BACKGROUND
    return FOREGROUND if far == inside and not partly else EDGE


@njit(cache=True, nogil=True, error_model="numpy")
def judge_share(
    share, shares, nodes, states, verdicts, corner, edge, cameras, starts, sums, picture, gaussians, heights, rules
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
                answer = look_at_pixels(cameras, view, starts, picture, gaussians, heights, rules, place)
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
    threads, nodes, states, verdicts, corner, edge, cameras, starts, sums, picture, gaussians, heights, rules
):
    """All voxels, their blocks dealt out to the threads in turn."""
    for thread in prange(threads):
        judge_share(
            thread, threads, nodes, states, verdicts, corner, edge, cameras, starts, sums, picture, gaussians, heights,
            rules,
        )  # fmt: skip
