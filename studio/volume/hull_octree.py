"""From one depth of the hull's octree to the next, voxels' colours, and masks' summed areas."""

import numpy as np
from numba import njit, prange

from studio.volume.hull_cameras import HEIGHT, WIDTH
from studio.volume.hull_kernels import (
    BLOCK,
    KEPT,
    PIXELS,
    PLACE,
    SAMPLING,
    SHADOW,
    SINGLE,
    SPLIT,
    place_voxel,
    sample_count,
    sample_pixel,
    squared_distance,
)


@njit(cache=True, nogil=True)
def kept_nodes(nodes, verdicts):
    """(K, 3) the voxels kept at this depth."""
    out = np.empty((np.count_nonzero(verdicts == KEPT), 3), np.int32)
    count = 0
    for index in range(len(nodes)):
        if verdicts[index] == KEPT:
            out[count] = nodes[index]
            count += 1
    return out


@njit(cache=True, nogil=True)
def children(nodes, states, verdicts, limits):
    """The octants (M, 3) of the voxels that are split, and their states (M, 2), in the order of their parents.

    limits : (2, 3) least and greatest place in the children's grid that lies in the tracking space.
    """
    most = 8 * np.count_nonzero(verdicts == SPLIT)
    found, inherited = np.empty((most, 3), np.int32), np.empty((most, 2), np.uint32)
    count = 0
    for index in range(len(nodes)):
        if verdicts[index] != SPLIT:
            continue
        for octant in range(8):
            x = 2 * nodes[index, 0] + (octant & 1)
            y = 2 * nodes[index, 1] + ((octant >> 1) & 1)
            z = 2 * nodes[index, 2] + (octant >> 2)
            if x < limits[0, 0] or y < limits[0, 1] or z < limits[0, 2]:
                continue
            if x > limits[1, 0] or y > limits[1, 1] or z > limits[1, 2]:
                continue
            found[count, 0], found[count, 1], found[count, 2] = x, y, z
            inherited[count, 0], inherited[count, 1] = states[index, 0], states[index, 1]
            count += 1
    return found[:count], inherited[:count]


@njit(cache=True, nogil=True)
def summed_areas(mask, sums):
    """How many pixels of a mask (H, W) lie above and left of each corner. sums : ((H + 1) (W + 1),) filled."""
    height, width = mask.shape
    row_length = width + 1
    for x in range(row_length):
        sums[x] = 0
    for y in range(height):
        before, here = y * row_length, (y + 1) * row_length
        along = np.int32(0)
        sums[here] = 0
        for x in range(width):
            along += np.int32(mask[y, x] >= 128)
            sums[here + x + 1] = sums[before + x + 1] + along


@njit(cache=True, nogil=True, error_model="numpy")
def mean_colour(place, width, height, start, sums_start, sums, picture, gaussians, heights, rules, out):
    """Mean BGR of a voxel's samples that are not background, else of all; NaN where none is in the picture."""
    count = sample_count(place, rules[SAMPLING])
    shadow = np.float32(rules[SHADOW])
    far_blue = far_green = far_red = blue = green = red = np.float32(0.0)
    inside, far = 0, 0
    for number in range(count):
        x, y = sample_pixel(place, number, count, heights)
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        at = start + y * width + x
        b, g, r = np.float32(picture[at, 0]), np.float32(picture[at, 1]), np.float32(picture[at, 2])
        blue, green, red, inside = blue + b, green + g, red + r, inside + 1
        if rules[PIXELS] > 0.0:
            differs = squared_distance(b, g, r, gaussians[at], shadow) > rules[SINGLE]
        else:
            above = sums_start + y * (width + 1) + x
            below = above + width + 1
            differs = sums[below + 1] - sums[below] - sums[above + 1] + sums[above] > 0
        if differs:
            far_blue, far_green, far_red, far = far_blue + b, far_green + g, far_red + r, far + 1
    if far > 0:
        out[0], out[1], out[2] = far_blue / far, far_green / far, far_red / far
    elif inside > 0:
        out[0], out[1], out[2] = blue / inside, green / inside, red / inside


@njit(cache=True, nogil=True)
def colour_share(share, shares, centres, edges, cameras, starts, sums, picture, gaussians, heights, rules, views,
                 means):  # fmt: skip
    """Every `shares`-th block of the voxels' colours. views : (K, V, 3) NaN, means : (K, 3), both filled."""
    place = np.empty(PLACE)
    for first in range(share * BLOCK, len(centres), shares * BLOCK):
        for index in range(first, min(first + BLOCK, len(centres))):
            total = np.zeros(3, np.float32)
            seen = np.float32(0.0)
            for view in range(len(cameras)):
                camera, out = cameras[view], views[index, view]
                x, y, z = centres[index, 0], centres[index, 1], centres[index, 2]
                out[:] = np.nan
                if not place_voxel(camera, x, y, z, 0.5 * edges[index], place):
                    continue
                mean_colour(
                    place, int(camera[WIDTH]), int(camera[HEIGHT]), starts[0, view], starts[1, view], sums, picture,
                    gaussians, heights, rules, out,
                )  # fmt: skip
                if out[0] == out[0]:
                    for channel in range(3):
                        total[channel] += out[channel]
                    seen += np.float32(1.0)
            for channel in range(3):
                means[index, channel] = total[channel] / seen


@njit(cache=True, nogil=True, parallel=True)
def colour_all(threads, centres, edges, cameras, starts, sums, picture, gaussians, heights, rules, views,
               means):  # fmt: skip
    """All voxels' colours, their blocks dealt out to the threads in turn."""
    for thread in prange(threads):
        colour_share(
            thread,
            threads,
            centres,
            edges,
            cameras,
            starts,
            sums,
            picture,
            gaussians,
            heights,
            rules,
            views,
            means,
        )
