# pyright: standard
"""From one depth of the hull's octree to the next, voxels' colours, and masks' summed areas."""

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.hull_kernels import KEPT, SPLIT, Rules, Sights
from studio.evidence.volume.hull_projection import (
    BOUND_X,
    BOUND_Y,
    COUNT,
    LANES,
    ROWS,
    SEEN,
    U,
    V,
    count_samples,
    place_voxels,
    sample_pixels,
    set_centre,
    set_centres,
)
from studio.foundations.arrays import Array, Bytes, Floats, Indices
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_in_threads import EXACT, KERNEL, njit


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
    place, half = np.ones(ROWS * LANES), 0.5 * edge
    for begin in range(0, len(nodes), LANES):
        lanes = min(LANES, len(nodes) - begin)
        for lane in range(lanes):
            x = corner[0] + nodes[begin + lane, 0] * edge + half
            y = corner[1] + nodes[begin + lane, 1] * edge + half
            z = corner[2] + nodes[begin + lane, 2] * edge + half
            set_centre(place, lane, x, y, z)
        for view in range(cameras.shape[0]):
            width, height = cameras[view].size[0] - 1.0, cameras[view].size[1] - 1.0
            place_voxels(cameras, view, half, place)
            count_samples(place, lanes, sampling)
            for lane in range(lanes):
                index = begin + lane
                if place[SEEN * LANES + lane] == 0.0:
                    states[index, 1] |= np.uint32(1) << np.uint32(view)
                    continue
                samples[index] = max(samples[index], int(place[COUNT * LANES + lane]))
                u, v = place[U * LANES + lane], place[V * LANES + lane]
                across, down = place[BOUND_X * LANES + lane], place[BOUND_Y * LANES + lane]
                left, right, top, bottom = u - across, u + across, v - down, v + down
                if right < -0.5 or bottom < -0.5 or left > width + 0.5 or top > height + 0.5:
                    states[index, 1] |= np.uint32(1) << np.uint32(view)
                elif left >= 0.0 and top >= 0.0 and right <= width and bottom <= height:
                    states[index, 2] = view


@njit(**KERNEL)
def kept_nodes(nodes: NDArray[np.int32], verdicts: Bytes) -> NDArray[np.int32]:
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
    nodes: NDArray[np.int32], states: NDArray[np.uint32], verdicts: Bytes, limits: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.uint32]]:
    """The octants (M, 3) of the voxels that are split, and their states (M, 3), in the order of their parents.

    limits : (2, 3) least and greatest index in the children's grid that lies in the tracking space.
    """
    most = 8 * np.count_nonzero(verdicts == SPLIT)
    cells, inherited = np.empty((most, 3), np.int32), np.empty((most, 3), np.uint32)
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
            cells[count, 0], cells[count, 1], cells[count, 2] = x, y, z
            inherited[count] = states[index]
            count += 1
    return cells[:count], inherited[:count]


@njit(**KERNEL)
def summed_areas(mask: Bytes, sums: NDArray[np.int32]) -> None:
    """How many pixels of a mask (H, W) lie above and left of each corner. sums : ((H + 1) (W + 1),) filled."""
    height, width = mask.shape
    row_length = width + 1
    for x in range(row_length):
        sums[x] = 0
    for y in range(height):
        before, current = y * row_length, (y + 1) * row_length
        along = np.int32(0)
        sums[current] = 0
        for x in range(width):
            along += np.int32(mask[y, x] >= 128)
            sums[current + x + 1] = sums[before + x + 1] + along


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
    place, pixels = np.ones(ROWS * LANES), np.empty(seen.heights.shape[0] * LANES)
    one, none = np.float32(1.0), np.float32(np.nan)
    # Of each lane: sums of B, G and R over the views that show it, and over all samples; how many these are.
    shown, everything = np.empty((LANES, 3), np.float32), np.empty((LANES, 3), np.float32)
    showing, looked = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    index = first
    while index < end:
        lanes = set_centres(place, centres, edges, index, end)
        shown[:], everything[:], showing[:], looked[:] = 0.0, 0.0, 0, 0
        for view in range(cameras.shape[0]):
            width, height = float(cameras[view].size[0]), float(cameras[view].size[1])
            row_length, first_pixel, first_sum = int(width), starts[0, view], starts[1, view]
            place_voxels(cameras, view, 0.5 * edges[index], place)
            most = count_samples(place, lanes, rules.sampling)
            sample_pixels(place, most, width, height, seen.heights, pixels)
            for lane in range(lanes):
                count, chosen = 0, 0
                if place[SEEN * LANES + lane] > 0.0:
                    count = int(place[COUNT * LANES + lane])
                b = g = r = np.float32(0.0)
                for number in range(count):
                    pixel = np.int64(pixels[number * LANES + lane])
                    if pixel < 0:
                        continue
                    at = first_pixel + pixel
                    if seen.by_pixels:
                        differs = seen.distances[at] > rules.single
                    else:
                        above = first_sum + pixel + pixel // row_length
                        below = above + row_length + 1
                        differs = sums[below + 1] - sums[below] - sums[above + 1] + sums[above] > 0
                    pb, pg, pr = (
                        np.float32(picture[at, 0]),
                        np.float32(picture[at, 1]),
                        np.float32(picture[at, 2]),
                    )
                    everything[lane, 0] += pb
                    everything[lane, 1] += pg
                    everything[lane, 2] += pr
                    looked[lane] += 1
                    if differs:
                        b, g, r, chosen = b + pb, g + pg, r + pr, chosen + 1
                amount = one / np.float32(chosen) if chosen else none
                views[index + lane, view, 0] = b * amount
                views[index + lane, view, 1] = g * amount
                views[index + lane, view, 2] = r * amount
                if chosen:
                    shown[lane, 0] += b * amount
                    shown[lane, 1] += g * amount
                    shown[lane, 2] += r * amount
                    showing[lane] += 1
        for lane in range(lanes):
            total, number = (shown, showing[lane]) if showing[lane] else (everything, looked[lane])
            amount = one / np.float32(number)
            for channel in range(3):
                means[index + lane, channel] = total[lane, channel] * amount
        index += lanes
