# pyright: standard
"""A hull as a camera would see it: its silhouette."""

import math

import numpy as np
from numpy.typing import NDArray

from studio.evidence.volume.hull import Hull
from studio.evidence.volume.hull_projection import (
    AXES,
    BOUND_X,
    BOUND_Y,
    LANES,
    ROWS,
    SEEN,
    U,
    V,
    place_voxels,
    set_centres,
)
from studio.foundations.geometry.camera import Camera
from studio.foundations.geometry.camera_table import camera_table, picture_limit
from studio.foundations.numba_in_threads import EXACT, njit


def silhouette(hull: Hull, camera: Camera) -> NDArray[np.uint8]:
    """(H, W) uint8, 255 where a voxel lies behind the pixel's centre, or a voxel's own centre is in the pixel."""
    picture = np.zeros((camera.height, camera.width), dtype=np.uint8)
    draw_voxels(camera_table((camera,), picture_limit), hull.centres, hull.edges, picture)
    return picture


@njit(**EXACT)
def draw_voxels(cameras, centres, edges, picture):
    """Set the pixels of each voxel's hexagon to 255. cameras : a table of one. picture : (H, W) uint8.

    A hexagon is all sums of its three half axes a times -1 to 1: a pixel at d from the centre is inside when for the
    normal n of each axis |n d| is at most the sum of |n a|.
    """
    height, width = picture.shape
    places = np.ones(ROWS * LANES)
    rows, index = places.reshape((ROWS, LANES)), 0
    while index < len(centres):
        lanes = set_centres(places, centres, edges, index, len(centres))
        place_voxels(cameras, 0, 0.5 * edges[index], places)
        index += lanes
        for lane in range(lanes):
            place = rows[:, lane]
            if place[SEEN] == 0.0:
                continue
            u, v, across, down = place[U], place[V], place[BOUND_X], place[BOUND_Y]
            column, row = math.floor(u + 0.5), math.floor(v + 0.5)
            if 0 <= column < width and 0 <= row < height:
                picture[row, column] = 255
            for y in range(max(0, math.ceil(v - down)), min(height, math.floor(v + down) + 1)):
                for x in range(max(0, math.ceil(u - across)), min(width, math.floor(u + across) + 1)):
                    if picture[y, x] == 0 and in_hexagon(place, x - u, y - v):
                        picture[y, x] = 255


@njit(**EXACT)
def in_hexagon(place, dx, dy):
    """Whether a pixel at (dx, dy) from a voxel's centre lies in its projection."""
    for axis in range(3):
        normal_x, normal_y = -place[AXES + 2 * axis + 1], place[AXES + 2 * axis]
        reach = 0.0
        for other in range(3):
            reach += abs(normal_x * place[AXES + 2 * other] + normal_y * place[AXES + 2 * other + 1])
        if abs(normal_x * dx + normal_y * dy) > reach:
            return False
    return True
