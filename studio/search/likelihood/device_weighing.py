# pyright: standard
"""Weights of poses on a CUDA device, from poses and a frame that lie there or come from the host.

A frame's maps and silhouettes are copied once. Poses of the host are copied in parts: a part's way to the card goes on
beside the weighing of the part before. Memory that weighing needs is kept for the next call, as taking it from a
card's driver takes longer than weighing.
"""

import functools
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from cachetools import LRUCache
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.errors import BodyError, StudioError
from studio.foundations.geometry.camera_table import CameraTable
from studio.foundations.numba_in_threads import KERNEL, njit, parallel_blocks
from studio.foundations.numba_on_devices import cuda, missing
from studio.search.likelihood.area_kernels import WINDOW_STEP
from studio.search.likelihood.device_weighing_kernels import (
    DRAWN,
    EDGE_SUM,
    FRAME,
    LOST,
    MOST_LIMBS,
    OBSERVED,
    OUTSIDE,
    PLACES,
    REGION_SUM,
    SHARED,
    SUMS,
    THREADS,
    WIDTH,
    WORD,
    WORDS,
    frames_kernel,
    terms_kernel,
    turn_poses,
    weigh_poses,
)
from studio.search.likelihood.edge_region_kernels import CHUNK, EDGE_LINES, REGION_LINES, WORST
from studio.search.likelihood.kinematic_program import KinematicProgram
from studio.search.likelihood.picture_maps import Maps
from studio.search.likelihood.silhouette_areas import Areas, Silhouettes

__all__ = ["FrameOnDevice", "ProblemOnDevice", "WeighingDevice", "missing"]

Memory = Callable[[str, tuple[int, ...], type[np.generic]], Any]
"""Gives an array there of a name, shape and kind, the same at every call."""

POSES_A_BLOCK = 128
POSES_AT_ONCE = 1 << 16
"""Of the host's: their frames take 50 MB of a body with fifteen joints."""
WIDEST_PICTURE = WORD * WORDS
ROWS_A_BLOCK, BLOCKS_A_THREAD = 64, 256
"""Poses that a thread of the host makes narrower at once, and how often that is worth a thread."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class FrameOnDevice:
    """The maps of one frame, or of several problems side by side, on the device.

    places : (P, V, 9), see `device_weighing_kernels`. values, words : maps and silhouettes. scale : pixels of the
    silhouettes a pixel of the pictures. observed : (P, V) pixels in the silhouettes, on the host. memory : number of
    where they lie, the same for frames that take turns in one place.
    """

    places: Any
    values: Any
    words: Any
    scale: np.float32
    observed: NDArray[np.int64]
    memory: int


@dataclass(frozen=True, slots=True, eq=False)
class ProblemOnDevice:
    """One frame's likelihood there.

    factors : of the edge, the region and the silhouette term. trunk : the limbs, by number, whose edges count alone
    while only the trunk is searched; None: all count. ranked : which row of the weights (2, N) a swarm maximises, 0 the
    fitness, 1 the log-weight.
    """

    device: "WeighingDevice"
    frame: FrameOnDevice
    factors: tuple[float, float, float]
    trunk: NDArray[np.int64] | None = None
    ranked: int = 0


@functools.cache
def pose_kernels() -> tuple[Any, Any]:
    """`turn_poses` and `weigh_poses` for the device, compiled by their first launch in a process."""
    return cuda.jit(turn_poses), cuda.jit(weigh_poses)


class WeighingDevice:
    """Weights of one body in some cameras."""

    def __init__(
        self,
        program: KinematicProgram,
        cameras: CameraTable,
        chunks: tuple[int, int],
        areas: bool = False,
        occlusion: bool = False,
    ) -> None:
        """chunks : sixteens of samples on each side, on each inner line. Raises StudioError for a body with too many
        limbs.
        """
        limbs = len(program.limb_frame)
        if limbs > MOST_LIMBS:
            raise StudioError(
                f"A GPU takes bodies of at most {MOST_LIMBS} limbs, not {limbs}.", "Set device to cpu."
            )
        self.views, self.limb_count = len(cameras), limbs
        self._joints, self._chunks = len(program.parent), chunks
        self._kernel = terms_kernel(limbs, *chunks, areas, occlusion)
        self._frames_kernel, self._poses_a_block = frames_kernel(self._joints)
        self._cameras = cuda.to_device(cameras)
        tables = program.parent, program.first_operation, program.kind, program.parameter
        self._tables = (
            *(cuda.to_device(table.astype(np.int32)) for table in tables),
            *(cuda.to_device(np.ascontiguousarray(table)) for table in (program.value, program.fixed)),
        )
        self._limbs = (
            cuda.to_device(program.limb_frame.astype(np.int32)),
            cuda.to_device(np.ascontiguousarray(program.limb_shape)),
        )
        self._chosen: dict[bytes, Any] = {}
        self._constants: dict[tuple[float, ...], Any] = {}
        self._memory: LRUCache[tuple[object, ...], Any] = LRUCache(64)
        self._turn = threading.RLock()
        self._lent: dict[str, list[dict[Any, Any]]] = {"frame": [], "search": []}
        self._copying, self._weighing = cuda.stream(), cuda.stream()

    def frame(self, maps: Maps, silhouettes: Silhouettes | None = None) -> FrameOnDevice:
        """A frame's maps, and silhouettes where areas are found, on the device."""
        return self.frames([(maps, silhouettes)])

    def frames(self, given: Sequence[tuple[Maps, Silhouettes | None]]) -> FrameOnDevice:
        """The maps of several problems, whose poses are weighed side by side."""
        places = np.zeros((len(given), self.views, PLACES), dtype=np.int32)
        values: list[NDArray[Any]] = []
        words = [np.zeros(1, np.uint32)]
        filled, packed = 0, 1
        for rows, (maps, silhouettes) in zip(places, given, strict=True):
            rows[:, :4] = maps.views
            rows[:, :2] += filled
            values.append(maps.values)
            filled += len(maps.values)
            if silhouettes is None:
                continue
            for row, picture in zip(rows, rows_of_words(silhouettes), strict=True):
                row[4:6] = packed, picture.shape[1]
                words.append(picture.ravel())
                packed += picture.size
            rows[:, 6:8], rows[:, OBSERVED] = silhouettes.sizes, silhouettes.pixels
        if places[..., WIDTH].max() > WIDEST_PICTURE:
            raise StudioError(
                f"A GPU takes pictures of at most {WIDEST_PICTURE} pixels across.", "Set device to cpu."
            )
        memory = self._lent["frame"].pop() if self._lent["frame"] else {}
        joined = values[0] if len(values) == 1 else np.concatenate(values)
        scale = 1.0 if given[0][1] is None else given[0][1].scale
        frame = FrameOnDevice(
            copied(memory, "places", places),
            copied(memory, "values", joined),
            copied(memory, "words", np.concatenate(words)),
            np.float32(scale),
            places[..., OBSERVED].astype(np.int64),
            id(memory),
        )
        weakref.finalize(frame, self._lent["frame"].append, memory)
        return frame

    def edges_of(self, limbs: NDArray[np.int64] | None) -> Any:  # noqa: ANN401 - an array on the device
        """The limbs, by number (None: all), whose edges count, on the device."""
        numbers = np.arange(self.limb_count) if limbs is None else limbs
        key = numbers.tobytes()
        if key not in self._chosen:
            self._chosen[key] = cuda.to_device(numbers.astype(np.int32))
        return self._chosen[key]

    def samples(self, edge_limbs: int) -> tuple[float, float]:
        """Edge and region samples of a view."""
        edge, region = self._chunks
        return float(CHUNK * EDGE_LINES * edge * edge_limbs), float(
            CHUNK * REGION_LINES * region * self.limb_count
        )

    def constant(self, *numbers: float) -> Any:  # noqa: ANN401
        """Some numbers, there, copied once."""
        if numbers not in self._constants:
            self._constants[numbers] = cuda.to_device(np.array(numbers, np.float64))
        return self._constants[numbers]

    def memory(self, name: str, shape: tuple[int, ...], kind: type[np.generic]) -> Any:  # noqa: ANN401
        """An array there of that name, shape and kind, the same at every call; its content is anybody's."""
        key = name, shape, kind
        if key not in self._memory:
            self._memory[key] = cuda.device_array(shape, kind)
        return self._memory[key]

    def lend_arrays(self, borrower: object) -> dict[Any, Any]:
        """Arrays there by name, shape and kind, that nobody else uses while the borrower lives."""
        arrays = self._lent["search"].pop() if self._lent["search"] else {}
        weakref.finalize(borrower, self._lent["search"].append, arrays)
        return arrays

    def sum_maps(
        self,
        poses: Any,  # noqa: ANN401
        frame: FrameOnDevice,
        edges: Any,  # noqa: ANN401
        every: int,
        stream: Any,  # noqa: ANN401
        memory: Memory,
    ) -> Any:  # noqa: ANN401
        """(N, V, 6) sums, there, of poses (D, N) there, `every` of them for each of the frame's problems.

        memory : gives arrays to work in.
        """
        count = poses.shape[1]
        frames = memory("frames", (count, self._joints * FRAME), np.float32)
        sums = memory("sums", (count, self.views, SUMS), np.float32)
        together = self._poses_a_block
        self._frames_kernel[-(-count // together), together, stream](poses, *self._tables, frames)
        self._kernel[(count, self.views), THREADS, stream](
            frames, *self._limbs, edges, self._cameras, frame.places, frame.values, frame.words, every, frame.scale,
            sums,
        )  # fmt: skip
        return sums

    def weigh(
        self,
        poses: Any,  # noqa: ANN401
        problem: ProblemOnDevice,
        edges: Any,  # noqa: ANN401
        every: int,
        found: Any,  # noqa: ANN401
        stream: Any,  # noqa: ANN401
        memory: Memory,
    ) -> None:
        """Fill found (2, N) there with fitness and log-weights of poses (D, N) there; as `sum_maps`."""
        sums = self.sum_maps(poses, problem.frame, edges, every, stream, memory)
        samples, factors = self.constant(*self.samples(edges.shape[0])), self.constant(*problem.factors)
        pose_kernels()[1][-(-poses.shape[1] // POSES_A_BLOCK), POSES_A_BLOCK, stream](
            sums, problem.frame.places, every, samples, factors, found
        )

    def weights(
        self,
        poses: Array,
        frame: FrameOnDevice,
        limbs: NDArray[np.int64] | None,
        factors: tuple[float, float, float],
    ) -> tuple[Array, Array]:
        """(N,) fitness and (N,) log-weights of poses (N, D). Raises BodyError where one is not finite."""
        weights = np.empty((2, len(poses)))
        edges, problem = self.edges_of(limbs), ProblemOnDevice(self, frame, factors)
        with self._turn:
            parts: list[Any] = []
            for there in self._brought(poses):
                part = self.memory(f"weights {len(parts)}", (2, there.shape[1]), np.float64)
                self.weigh(there, problem, edges, there.shape[1], part, self._weighing, self.memory)
                parts.append(part)
            first = 0
            for part in parts:
                weights[:, first : first + part.shape[1]] = part.copy_to_host(stream=self._weighing)
                first += part.shape[1]
            self._weighing.synchronize()
        return weights[0], weights[1]

    def terms(
        self, poses: Array, frame: FrameOnDevice, limbs: NDArray[np.int64] | None = None
    ) -> tuple[Array, Array, Areas]:
        """Σe and Σr, each (N, V), and the areas of poses (N, D). Raises BodyError where one is not finite."""
        edges = self.edges_of(limbs)
        sums = np.empty((len(poses), self.views, SUMS))
        with self._turn:
            first = 0
            for there in self._brought(poses):
                count = there.shape[1]
                of_part = self.sum_maps(there, frame, edges, count, self._weighing, self.memory)
                sums[first : first + count] = of_part.copy_to_host(stream=self._weighing)
                first += count
            self._weighing.synchronize()
        on_edges, within = self.samples(edges.shape[0])
        counted = on_edges - sums[..., LOST]
        edge = np.where(counted > 0, sums[..., EDGE_SUM] / (WORST * np.maximum(counted, 1)), 1.0)
        areas = Areas(
            sums[..., SHARED].astype(np.int64),
            sums[..., DRAWN].astype(np.int64),
            frame.observed[0],
            np.ascontiguousarray(sums[..., OUTSIDE]),
        )
        return edge, sums[..., REGION_SUM] / (WORST * within), areas

    def bring(self, poses: Array, there: Any) -> None:  # noqa: ANN401
        """Fill `there` (D, N) with poses (N, D) of the host. Raises BodyError where one is not finite."""
        with self._turn:
            given = self._sent("all", poses, self._weighing)
            grid = -(-len(poses) // POSES_A_BLOCK), POSES_A_BLOCK, self._weighing
            pose_kernels()[0][grid](given, there)
            self._weighing.synchronize()

    def _brought(self, poses: Array) -> Iterator[Any]:
        """Parts of poses (N, D) of the host as (D, N') there, each usable until the next but one."""
        turn_them = pose_kernels()[0]
        used: list[Any] = [None, None]
        for number, first in enumerate(range(0, len(poses), POSES_AT_ONCE)):
            part = poses[first : first + POSES_AT_ONCE]
            turn = number % 2
            if used[turn] is not None:
                used[turn].synchronize()
            given = self._sent(f"part {turn}", part, self._copying)
            arrived = cuda.event()
            arrived.record(self._copying)
            arrived.wait(self._weighing)
            there = self.memory(f"poses {turn}", part.shape[::-1], np.float32)
            turn_them[-(-len(part) // POSES_A_BLOCK), POSES_A_BLOCK, self._weighing](given, there)
            used[turn] = cuda.event()
            used[turn].record(self._weighing)
            yield there

    def _sent(self, name: str, poses: Array, stream: Any) -> Any:  # noqa: ANN401
        """Poses (N, D) of the host on their way, in single precision, through memory of that name."""
        key = name, poses.shape
        if key not in self._memory:
            self._memory[key] = cuda.pinned_array(poses.shape, np.float32)
        pinned = self._memory[key]
        narrow(poses, pinned)
        given = self.memory(name, poses.shape, np.float32)
        given.copy_to_device(pinned, stream=stream)
        return given


def copied(memory: dict[str, Any], name: str, values: NDArray[Any]) -> Any:  # noqa: ANN401
    """Values of the host in the array there that has their name, or in a new one where none has their shape."""
    if name not in memory or memory[name].shape != values.shape:
        memory[name] = cuda.device_array(values.shape, values.dtype)
    memory[name].copy_to_device(values)
    return memory[name]


def narrow(poses: Array, narrower: NDArray[np.float32]) -> None:
    """Fill `narrower` with poses (N, D) in single precision. Raises BodyError where one is not finite."""
    wrong = np.zeros(1, np.uint8)
    blocks = -(-len(poses) // ROWS_A_BLOCK)
    parallel_blocks(narrow_blocks, blocks, BLOCKS_A_THREAD, poses, narrower, wrong)
    if wrong[0]:
        raise BodyError(
            "A pose has a number that is not finite.", "Check the start pose and the calibration."
        )


@njit(**KERNEL)
def narrow_blocks(
    first: int, last: int, poses: Array, narrower: NDArray[np.float32], wrong: NDArray[np.uint8]
) -> None:
    """As `narrow`, of blocks of ROWS_A_BLOCK poses."""
    for pose in range(first * ROWS_A_BLOCK, min(last * ROWS_A_BLOCK, poses.shape[0])):
        for entry in range(poses.shape[1]):
            value = np.float32(poses[pose, entry])
            if not np.isfinite(value):
                wrong[0] = 1
            narrower[pose, entry] = value


def rows_of_words(silhouettes: Silhouettes) -> list[NDArray[np.uint32]]:
    """Each view's silhouette as rows of 32-bit words: bit k of word w is pixel 32 w + k."""
    pictures: list[NDArray[np.uint32]] = []
    for base, words, width, height in silhouettes.maps.views.tolist():
        columns = -(-width // WINDOW_STEP)
        windows = silhouettes.maps.values[base : base + columns * words].reshape(columns, words)
        rows = windows[:: WORD // WINDOW_STEP, :height].T.astype(np.uint32)
        pictures.append(np.ascontiguousarray(rows))
    return pictures
