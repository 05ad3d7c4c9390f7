# pyright: standard
"""From one depth of the hull's octree to the next, voxels' colours, and masks' summed areas."""

import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array, Bytes, Floats, Indices
from studio.geometry.camera_table import CameraTable
from studio.numba_in_threads import EXACT, KERNEL, njit
from studio.volume.hull_kernels import KEPT, SPLIT, Rules, Sights, look_at_tile
from studio.volume.hull_projection import (
    BOUND_X,
    BOUND_Y,
    PLACE,
    U,
    V,
    place_voxel,
    sample_count,
    sample_pixel,
)


@njit(**EXACT)
def first_look(
    nodes: NDArray[np.int32],
    corner: Array,
    edge: float,
    cameras: CameraTable,
    sampling: float,
    states: NDArray[np.uint32],
    samples: Indices,
) -> None:
    """Initialise states without pictures: bits of the views that cannot see each voxel (N, 3) in states[:, 1], a view
    that sees all of it in states[:, 2]; its most samples in a view in samples.
    """
    place, half = np.empty(PLACE), 0.5 * edge
    for index in range(len(nodes)):
        x = corner[0] + nodes[index, 0] * edge + half
        y = corner[1] + nodes[index, 1] * edge + half
        z = corner[2] + nodes[index, 2] * edge + half
        for view in range(cameras.shape[0]):
            width, height = cameras[view].size[0] - 1.0, cameras[view].size[1] - 1.0
            if not place_voxel(cameras, view, x, y, z, half, place):
                states[index, 1] |= np.uint32(1) << np.uint32(view)
                continue
            samples[index] = max(samples[index], sample_count(place, sampling))
            left, right = place[U] - place[BOUND_X], place[U] + place[BOUND_X]
            top, bottom = place[V] - place[BOUND_Y], place[V] + place[BOUND_Y]
            if right < -0.5 or bottom < -0.5 or left > width + 0.5 or top > height + 0.5:
                states[index, 1] |= np.uint32(1) << np.uint32(view)
            elif left >= 0.0 and top >= 0.0 and right <= width and bottom <= height:
                states[index, 2] = view


@njit(**KERNEL)
def kept_nodes(
    nodes: NDArray[np.int32],
    verdicts: Bytes,
) -> NDArray[np.int32]:
    """(K, 3) the voxels kept at this depth."""
    out = np.empty((np.count_nonzero(verdicts == KEPT), 3), np.int32)
    count = 0
    for index in range(len(nodes)):
        if verdicts[index] == KEPT:
            out[count] = nodes[index]
            count += 1
    return out


@njit(**KERNEL)
def children(
    nodes: NDArray[np.int32],
    states: NDArray[np.uint32],
    verdicts: Bytes,
    limits: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.uint32]]:
    """The octants (M, 3) of the voxels that are split, and their states (M, 3), in the order of their parents.

    limits : (2, 3) least and greatest index in the children's grid that lies in the tracking space.
    """
    most = 8 * np.count_nonzero(verdicts == SPLIT)
    found, inherited = np.empty((most, 3), np.int32), np.empty((most, 3), np.uint32)
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
            inherited[count] = states[index]
            count += 1
    return found[:count], inherited[:count]


@njit(**KERNEL)
def summed_areas(
    mask: Bytes,
    sums: NDArray[np.int32],
) -> None:
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


@njit(**EXACT)
def colour(
    first: int,
    end: int,
    centres: Array,
    edges: Array,
    seen: Sights,
    rules: Rules,
    views: Floats,
    means: Floats,
) -> None:
    """Colours of the voxels first to end - 1. views : (K, V, 3), means : (K, 3), both filled.

    A voxel's colour in a view is the mean BGR of its samples that are not background, NaN where there are none; its
    own colour the mean of these, or that of all samples where no view has any.
    """
    cameras, starts, sums, picture = seen.cameras, seen.starts, seen.sums, seen.picture
    distances, place = seen.distances, np.empty(PLACE)
    one, none = np.float32(1.0), np.float32(np.nan)
    for index in range(first, end):
        x, y, z = centres[index, 0], centres[index, 1], centres[index, 2]
        blue = green = red = any_blue = any_green = any_red = np.float32(0.0)
        showing, looked = 0, 0
        for view in range(cameras.shape[0]):
            width, height = int(cameras[view].size[0]), int(cameras[view].size[1])
            count, chosen = 0, 0
            if place_voxel(cameras, view, x, y, z, 0.5 * edges[index], place):
                count = sample_count(place, rules.sampling)
            b = g = r = np.float32(0.0)
            for number in range(count):
                column, row = sample_pixel(place, number, count, seen.heights)
                if column < 0 or row < 0 or column >= width or row >= height:
                    continue
                at = starts[0, view] + row * width + column
                if seen.by_pixels:
                    if distances[at] != distances[at]:
                        look_at_tile(seen, view, column, row, rules)
                    differs = distances[at] > rules.single
                else:
                    above = starts[1, view] + row * (width + 1) + column
                    below = above + width + 1
                    differs = sums[below + 1] - sums[below] - sums[above + 1] + sums[above] > 0
                pb, pg, pr = (
                    np.float32(picture[at, 0]),
                    np.float32(picture[at, 1]),
                    np.float32(picture[at, 2]),
                )
                any_blue, any_green, any_red, looked = any_blue + pb, any_green + pg, any_red + pr, looked + 1
                if differs:
                    b, g, r, chosen = b + pb, g + pg, r + pr, chosen + 1
            amount = one / np.float32(chosen) if chosen else none
            views[index, view, 0], views[index, view, 1], views[index, view, 2] = (
                b * amount,
                g * amount,
                r * amount,
            )
            if chosen:
                blue, green, red, showing = (
                    blue + b * amount,
                    green + g * amount,
                    red + r * amount,
                    showing + 1,
                )
        if showing == 0:
            blue, green, red, showing = any_blue, any_green, any_red, looked
        amount = one / np.float32(showing)
        means[index, 0], means[index, 1], means[index, 2] = blue * amount, green * amount, red * amount
