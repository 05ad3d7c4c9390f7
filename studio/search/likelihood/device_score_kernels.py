# pyright: standard
"""Kernels that weigh poses by the benchmark's score on a CUDA device (`bodytrack` says what it is).

`score_kernel` makes the kernel that gives a block of threads to each pose in each view. Lines have as many samples as
they are long, so the block takes one line, or the grid within one limb, after the other, a thread for every
thirty-second sample. Sums are of whole numbers, and exact until they are added up over views; places are in single
precision, so that one sample in ten thousand is of the next pixel. Left out are lines and grids of more than
MOST_SAMPLES samples: a limb so near to a camera would fill a picture of six million pixels. The processor leaves out
what its buffer cannot hold, so that the two may differ by more there.
"""

import functools
import math
from typing import Any

import numpy as np

from studio.foundations.numba_on_devices import cuda
from studio.search.likelihood.bodytrack_kernels import EDGE_STEP, INSIDE_STEP, LEAST, MOST
from studio.search.likelihood.device_weighing_kernels import (
    ALL_ON,
    CORNER,
    CORNERS,
    EDGE_BASE,
    FAST_HERE,
    HEIGHT,
    ONE_ON,
    PADDED,
    REGION_BASE,
    SUMS,
    THREADS,
    WIDTH,
    fill_corners,
)
from studio.search.likelihood.outline_kernels import HALF, ONE, ZERO, view_of

MOST_SAMPLES = np.float32(1 << 16)
ERRORS, ON_EDGES, EMPTY, INSIDE = range(4)
COUNTED = 4
"""The first of a view's sums: the edge map, its samples, the inside map, its samples."""
FULL = 255.0 * 255.0
"""The worst value of the edge map."""
FEWEST = np.float32(LEAST)
NOWHERE = np.int64(-1)


@cuda.jit(device=True, fastmath=FAST_HERE)
def intervals_of(x, y, step):
    """As `bodytrack_kernels.intervals`, single precision."""
    return max(FEWEST, np.float32(math.floor(min(math.sqrt(x * x + y * y) / step, MOST) + HALF)))


@cuda.jit(device=True, fastmath=FAST_HERE)
def pixel_at(x, y, wide, high):
    """Number of the pixel at a place (pixels, half a pixel on) of a picture, NOWHERE beyond it."""
    if x >= ZERO and x < np.float32(wide) and y >= ZERO and y < np.float32(high):
        return np.int64(np.int32(y)) * np.int64(wide) + np.int64(np.int32(x))
    return NOWHERE


@functools.cache
def score_kernel(limbs: int) -> Any:  # noqa: ANN401
    """The kernel `add_scores` for bodies of so many drawn limbs."""
    all_corners = CORNERS * limbs
    corner_count = np.uint32(all_corners)

    def add_scores(
        frames, limb_frame, limb_shape, edge_limb, cameras, places, values, words, every, scale, sums
    ):
        """Sums (N, V, 6) of poses, of which the first four are COUNTED; arguments as of `add_terms`, of which the limbs
        whose edges count, words and scale are not read.
        """
        pose, number = np.uint32(cuda.blockIdx.x), np.uint32(cuda.blockIdx.y)
        thread = np.uint32(cuda.threadIdx.x)
        corners = cuda.shared.array((all_corners, CORNER), np.float32)
        parts = cuda.shared.array((COUNTED, PADDED), np.int64)
        problem = np.uint32(pose // np.uint32(every))
        wide, high = places[problem, number, WIDTH], places[problem, number, HEIGHT]
        edge_base, inside_base = (
            np.int64(places[problem, number, EDGE_BASE]),
            np.int64(places[problem, number, REGION_BASE]),
        )
        fill_corners(
            frames, limb_frame, limb_shape, view_of(cameras[number]), pose, thread, corner_count, corners
        )
        cuda.syncthreads()
        errors, on_edges, empty, inside = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
        for limb in range(limbs):
            a0 = CORNERS * limb
            a1, b1, b0 = a0 + 1, a0 + 2, a0 + 3
            if min(min(corners[a0, 2], corners[a1, 2]), min(corners[b1, 2], corners[b0, 2])) < -HALF:
                continue
            ax, ay, bx, by = (
                corners[a0, 0] + HALF,
                corners[a0, 1] + HALF,
                corners[a1, 0] + HALF,
                corners[a1, 1] + HALF,
            )
            cx, cy, ex, ey = (
                corners[b1, 0] + HALF,
                corners[b1, 1] + HALF,
                corners[b0, 0] + HALF,
                corners[b0, 1] + HALF,
            )
            for side in range(2):
                x, y, dx, dy = ax, ay, bx - ax, by - ay
                if side == 1:
                    x, y, dx, dy = ex, ey, cx - ex, cy - ey
                count = intervals_of(dx, dy, EDGE_STEP)
                at = thread
                while count <= MOST_SAMPLES and np.float32(np.int32(at)) <= count:
                    along = np.float32(np.int32(at)) / count
                    pixel = pixel_at(x + along * dx, y + along * dy, wide, high)
                    if pixel >= 0:
                        errors += np.int64(values[edge_base + pixel])
                        on_edges += 1
                    at = np.uint32(at + ALL_ON)
            rows = intervals_of(bx - ax, by - ay, INSIDE_STEP)
            columns = intervals_of(HALF * (ex + cx - ax - bx), HALF * (ey + cy - ay - by), INSIDE_STEP)
            samples = (rows + ONE) * columns
            height = np.uint32(np.uint32(np.int32(rows)) + ONE_ON)
            at = thread
            while samples <= MOST_SAMPLES and np.float32(np.int32(at)) < samples:
                column = np.uint32(at // height)
                row = np.uint32(at - np.uint32(column * height))
                across, along = np.float32(np.int32(column)) / columns, np.float32(np.int32(row)) / rows
                x, y = ax + across * (ex - ax), ay + across * (ey - ay)
                dx, dy = bx + across * (cx - bx) - x, by + across * (cy - by) - y
                pixel = pixel_at(x + along * dx, y + along * dy, wide, high)
                if pixel >= 0:
                    empty += np.int64(values[inside_base + pixel])
                    inside += 1
                at = np.uint32(at + ALL_ON)
        parts[ERRORS, thread], parts[ON_EDGES, thread] = errors, on_edges
        parts[EMPTY, thread], parts[INSIDE, thread] = empty, inside
        cuda.syncthreads()
        if thread < np.uint32(SUMS):
            total = np.int64(0)
            if thread < np.uint32(COUNTED):
                for other in range(THREADS):
                    total += parts[thread, other]
            sums[pose, number, thread] = np.float32(total)

    return cuda.jit(fastmath=FAST_HERE)(add_scores)


def weigh_scores(sums, factors, found):
    """Log-weights (2, N), twice, of poses from their sums (N, V, 6), pooled over views. factors : (3,) of E_edge, of
    E_inside, and one that is not used.
    """
    pose = cuda.grid(1)
    if pose >= sums.shape[0]:
        return
    errors, on_edges, empty, inside = 0.0, 0.0, 0.0, 0.0
    for view in range(sums.shape[1]):
        errors += np.float64(sums[pose, view, ERRORS])
        on_edges += np.float64(sums[pose, view, ON_EDGES])
        empty += np.float64(sums[pose, view, EMPTY])
        inside += np.float64(sums[pose, view, INSIDE])
    edge = errors / (FULL * on_edges) if on_edges > 0.0 else 1.0
    within = empty / inside if inside > 0.0 else 1.0
    weight = -(factors[0] * edge + factors[1] * within)
    found[0, pose], found[1, pose] = weight, weight
