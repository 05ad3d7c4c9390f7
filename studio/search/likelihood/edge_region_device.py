# pyright: standard
"""Edge and region sums of Eq. 14 and 15 on a CUDA device: particles times cameras side by side.

One thread finds the limbs' frames of a pose; then a block of threads has one pose in one view, finds the limbs'
outlines and shares their samples out. Outlines, lines, places and pixels come from the scalar helpers of
`outline_kernels` and `edge_region_kernels`, compiled for the device from the same source.

**Equal to the processor's.** Sums are of whole numbers, so their order changes nothing: they differ only where a place
that both round in single precision falls on either side of a pixel's border, which one sample in ten thousand does.
Each such sample changes Σe or Σr by at most 1 / N.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import StudioError
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_on_devices import cuda, missing
from studio.search.likelihood.edge_region_kernels import (
    EDGE_LINES,
    FIRST_STRIP,
    NOTHING_SEEN,
    REGION_LINES,
    SECOND_STRIP,
    THIRD_STRIP,
    line_between,
    sides_of,
    stepped,
)
from studio.search.likelihood.kinematic_program import FIXED_MOVE, KinematicProgram
from studio.search.likelihood.outline_kernels import (
    FULL_TURN,
    HALF,
    ONE,
    TURNS,
    ZERO,
    combined,
    outline_of,
    rotated,
    sine_cosine,
    view_of,
)
from studio.search.likelihood.picture_maps import Maps

__all__ = ["DeviceLimbs", "EdgeRegionDevice", "missing"]

FRAME, OUTLINE = 12, 9
"""Numbers of a limb's frame, and of its outline without the depth."""
MOST_LIMBS = 64
THREADS = 128
POSES_AT_ONCE = 1 << 16
"""Their frames take 50 MB of a body with fifteen joints."""


def find_frames(poses, parent, first, kinds, parameters, values, fixed, frames):
    """World frames (F, 12, N), rows of (3, 4), of poses (D, N): a thread for each pose."""
    pose = cuda.grid(1)
    if pose >= poses.shape[1]:
        return
    frame = cuda.local.array(FRAME, np.float32)
    for joint in range(parent.shape[0]):
        before = parent[joint]
        for i in range(FRAME):
            if before >= 0:
                frame[i] = frames[before, i, pose]
            else:
                frame[i] = ONE if i % 5 == 0 else ZERO
        for k in range(first[joint], first[joint + 1]):
            kind = kinds[k]
            if kind < 3:
                angle = np.float64(values[k]) * poses[parameters[k], pose]
                sine, cosine = sine_cosine(np.float32(angle - FULL_TURN * math.floor(angle * TURNS + 0.5)))
                second, third = (kind + 1) % 3, (kind + 2) % 3
                for row in range(0, FRAME, 4):
                    a, b = rotated(cosine, sine, frame[row + second], frame[row + third])
                    frame[row + second], frame[row + third] = a, b
            elif kind < FIXED_MOVE:
                distance = np.float32(np.float64(values[k]) * poses[parameters[k], pose])
                for row in range(0, FRAME, 4):
                    frame[row + 3] += frame[row + kind - 3] * distance
            else:
                for row in range(0, FRAME, 4):
                    x, y, z = frame[row], frame[row + 1], frame[row + 2]
                    if kind != FIXED_MOVE:
                        for column in range(3):
                            frame[row + column] = combined(
                                x, y, z, fixed[k, 0, column], fixed[k, 1, column], fixed[k, 2, column]
                            )
                    frame[row + 3] += combined(x, y, z, fixed[k, 0, 3], fixed[k, 1, 3], fixed[k, 2, 3])
        for i in range(FRAME):
            frames[joint, i, pose] = frame[i]


def add_samples(frames, limb_frame, limb_shape, cameras, values, views, edge_samples, region_samples, sums):
    """Sums (N, V, 2) of the edge and the region map over all limbs: a block of threads for each pose and view."""
    pose, number = cuda.blockIdx.x, cuda.blockIdx.y
    thread, threads = cuda.threadIdx.x, cuda.blockDim.x
    outlines = cuda.shared.array((MOST_LIMBS, OUTLINE), np.float32)
    totals = cuda.shared.array(2, np.int32)
    if thread < 2:
        totals[thread] = 0
    view = view_of(cameras[number])
    for limb in range(thread, limb_frame.shape[0], threads):
        joint = limb_frame[limb]
        frame = (
            frames[joint, 0, pose], frames[joint, 1, pose], frames[joint, 2, pose], frames[joint, 3, pose],
            frames[joint, 4, pose], frames[joint, 5, pose], frames[joint, 6, pose], frames[joint, 7, pose],
            frames[joint, 8, pose], frames[joint, 9, pose], frames[joint, 10, pose], frames[joint, 11, pose],
        )  # fmt: skip
        shape = (
            limb_shape[limb, 0],
            limb_shape[limb, 1],
            limb_shape[limb, 2],
            limb_shape[limb, 3],
            limb_shape[limb, 4],
        )
        ax, ay, bx, by, cx, cy, ex, ey, seen, _ = outline_of(frame, shape, view)
        outlines[limb, 0], outlines[limb, 1], outlines[limb, 2], outlines[limb, 3] = ax, ay, bx, by
        outlines[limb, 4], outlines[limb, 5], outlines[limb, 6], outlines[limb, 7] = cx, cy, ex, ey
        outlines[limb, 8] = seen
    cuda.syncthreads()
    edge_base, region_base = views[number, 0], views[number, 1]
    nothing = views[number, 2] * views[number, 3] + NOTHING_SEEN
    width, height = np.float32(views[number, 2]), np.float32(views[number, 3])
    on_edges = EDGE_LINES * edge_samples
    samples = on_edges + REGION_LINES * region_samples
    edge, region = np.int32(0), np.int32(0)
    for at in range(thread, limb_frame.shape[0] * samples, threads):
        limb, sample = at // samples, at % samples
        corners = (
            outlines[limb, 0], outlines[limb, 1], outlines[limb, 2], outlines[limb, 3],
            outlines[limb, 4], outlines[limb, 5], outlines[limb, 6], outlines[limb, 7],
        )  # fmt: skip
        a, b = sides_of(corners)
        on_edge = sample < on_edges
        if on_edge:
            fraction = ONE if sample >= edge_samples else ZERO
            step, count = sample % edge_samples, edge_samples
        else:
            strip = (sample - on_edges) // region_samples
            fraction = FIRST_STRIP if strip == 0 else (SECOND_STRIP if strip == 1 else THIRD_STRIP)
            step, count = (sample - on_edges) % region_samples, region_samples
        x, y = stepped(line_between(a, b, fraction, np.float32(count)), np.float32(step))
        index = nothing
        if outlines[limb, 8] > -HALF and x >= ZERO and x < width and y >= ZERO and y < height:
            index = np.int64(y) * views[number, 2] + np.int64(x)
        if on_edge:
            edge += np.int32(values[edge_base + index])
        else:
            region += np.int32(values[region_base + index])
    cuda.atomic.add(totals, 0, edge)
    cuda.atomic.add(totals, 1, region)
    cuda.syncthreads()
    if thread < 2:
        sums[pose, number, thread] = totals[thread]


class DeviceLimbs(NamedTuple):
    """Some limbs of a body, on the device. frame : (L,). shape : (L, 5)."""

    frame: Any
    shape: Any


@functools.cache
def kernels() -> tuple[Any, Any]:
    """`find_frames` and `add_samples` for the device, compiled by their first launch in a process."""
    return cuda.jit(find_frames), cuda.jit(add_samples)


class EdgeRegionDevice:
    """The sums of one body in some cameras."""

    def __init__(self, program: KinematicProgram, cameras: CameraTable, samples: tuple[int, int]) -> None:
        """samples : on each side, on each inner line. Raises StudioError for a body with too many limbs."""
        self._program, self._samples, self._views = program, samples, len(cameras)
        self._cameras = cuda.to_device(cameras)
        given = (
            program.parent,
            program.first_operation,
            program.kind,
            program.parameter,
            program.value,
            program.fixed,
        )
        self._tables = tuple(cuda.to_device(np.ascontiguousarray(table)) for table in given)
        self._limbs: dict[bytes, DeviceLimbs] = {}
        count = len(program.limb_frame)
        if count > MOST_LIMBS:
            raise StudioError(
                f"A GPU takes bodies of at most {MOST_LIMBS} limbs, not {count}.", "Set device to cpu."
            )

    def limbs(self, chosen: NDArray[np.int64] | None = None) -> DeviceLimbs:
        """The limbs of some numbers, of all if None."""
        numbers = np.arange(len(self._program.limb_frame)) if chosen is None else chosen
        key = numbers.tobytes()
        if key not in self._limbs:
            frame, shape = self._program.limb_frame[numbers], self._program.limb_shape[numbers]
            self._limbs[key] = DeviceLimbs(cuda.to_device(frame), cuda.to_device(np.ascontiguousarray(shape)))
        return self._limbs[key]

    def maps(self, maps: Maps) -> Maps:
        """A frame's maps, on the device."""
        return Maps(cuda.to_device(maps.values), cuda.to_device(maps.views))

    def sums(self, poses: Array, maps: Maps, limbs: DeviceLimbs) -> NDArray[np.int32]:
        """(N, V, 2) sums of the edge and the region map of poses (N, D)."""
        find, add = kernels()
        found = np.empty((len(poses), self._views, 2), dtype=np.int32)
        for first in range(0, len(poses), POSES_AT_ONCE):
            some = np.ascontiguousarray(poses[first : first + POSES_AT_ONCE].T, dtype=np.float64)
            count = some.shape[1]
            frames = cuda.device_array((len(self._program.parent), FRAME, count), np.float32)
            sums = cuda.device_array((count, self._views, 2), np.int32)
            find[-(-count // THREADS), THREADS](cuda.to_device(some), *self._tables, frames)
            add[(count, self._views), THREADS](
                frames, limbs.frame, limbs.shape, self._cameras, maps.values, maps.views, *self._samples, sums
            )
            found[first : first + count] = sums.copy_to_host()
        return found
