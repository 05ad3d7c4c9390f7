# pyright: standard
"""What searches on a CUDA device share: memory that stays, recorded launches, and rows of a set for the host.

R runs are searched side by side; particle n of run r is column r N + n of poses (D, R N).
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array
from studio.foundations.numba_on_devices import cuda, record_launches
from studio.search.likelihood.device_weighing import WeighingDevice
from studio.search.trackers import device_search_kernels, device_swarm_kernels
from studio.search.trackers.device_search_kernels import MOMENTS
from studio.search.trackers.tracker import SearchSpace

THREADS = 128
RECORDED = 4096
"""Particles of a layer's record at most."""
FIRST_TIME, SECOND_TIME, ONE_BY_ONE = "first time", "second time", "one by one"


@functools.cache
def kernel(name: str) -> Any:  # noqa: ANN401 - Numba's
    """A kernel of filters or swarms, compiled by its first launch in a process."""
    return cuda.jit({**vars(device_search_kernels), **vars(device_swarm_kernels)}[name])


class Moment(NamedTuple):
    """Which random numbers a run's layer uses."""

    seed: int
    frame: int
    layer: int


class DeviceRuns:
    """R runs of one body, side by side: what they keep there."""

    def __init__(self, device: WeighingDevice, space: SearchSpace, runs: int) -> None:
        self.device, self.space, self.runs = device, space, runs
        self._arrays = device.lend_arrays(self)
        self._stream = self._arrays.setdefault("stream", None) or cuda.stream()
        self._arrays["stream"] = self._stream
        self._moments = self._memory("moments", (MOMENTS, runs, len(space.names)), np.float64)
        self._turn = 0

    def _launch(self, key: tuple[object, ...], launch: Callable[[], None]) -> None:
        """Launches one by one at their first time, recorded and made at once from the second on.

        What is kept of them holds no frame: its memory goes to the next one.
        """
        key = "recorded", *key
        again = self._arrays.setdefault(key, FIRST_TIME)
        if again is FIRST_TIME:
            self._arrays[key] = SECOND_TIME
        elif again is SECOND_TIME:
            again = self._arrays[key] = record_launches(launch, self._stream) or ONE_BY_ONE
        if isinstance(again, str):
            launch()
        else:
            again()

    def _fetched(self, there: Any) -> NDArray[Any]:  # noqa: ANN401
        """An array on the host, when all that was launched is done."""
        values = there.copy_to_host(stream=self._stream)
        self._stream.synchronize()
        return values

    def _rows(
        self,
        poses: Any,  # noqa: ANN401
        weights: Any,  # noqa: ANN401
        numbers: Any,  # noqa: ANN401
        count: int,
        step: int,
    ) -> tuple[Array, Array, Array]:
        """Every step-th of each run's `count` particles (R, K, D), what these weigh (2, R, K), and the best (R, D),
        which numbers (R, 5) name.
        """
        rows = -(-count // step) + 1
        taken = self._memory("rows", (self.runs, rows, len(self.space.names)), np.float64)
        values = self._memory("values", (2, self.runs, rows), np.float64)
        kernel("take_rows")[-(-self.runs * rows // THREADS), THREADS, self._stream](
            poses, weights, numbers, count, step, taken, values
        )
        kept = self._fetched(taken)
        return kept[:, :-1], self._fetched(values)[:, :, :-1], kept[:, -1]

    def _copied(self, name: str, values: NDArray[Any]) -> Any:  # noqa: ANN401
        there = self._memory(name, values.shape, values.dtype.type)
        there.copy_to_device(values, stream=self._stream)
        return there

    def _memory(self, name: str, shape: tuple[int, ...], kind: type[np.generic]) -> Any:  # noqa: ANN401
        key = name, shape, kind
        if key not in self._arrays:
            self._arrays[key] = cuda.device_array(shape, kind)
        return self._arrays[key]

    def _next_poses(self, count: int) -> Any:  # noqa: ANN401
        """Where the next set goes: never where the last one is."""
        self._turn = 1 - self._turn
        return self._memory(f"poses {self._turn}", (len(self.space.names), self.runs * count), np.float32)


def limits_there(space: SearchSpace, kept: bool) -> Array:
    """(2, D) lowest and highest values as a card has them, infinite where limits are not kept."""
    if kept:
        return np.stack([inwards(space.lower, np.inf), inwards(space.upper, -np.inf)])
    return np.array([[-np.inf], [np.inf]]).repeat(len(space.names), axis=1)


def inwards(limits: Array, towards: float) -> Array:
    """Limits (D,) as single precision has them, none of them wider."""
    rounded = limits.astype(np.float32)
    wider = rounded < limits if towards > 0 else rounded > limits
    return np.where(wider, np.nextafter(rounded, np.float32(towards)), rounded).astype(np.float64)
