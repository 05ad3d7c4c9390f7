# pyright: standard
"""What searches on a CUDA device share: memory that stays, recorded launches, rows of a set for the host, and layers
that are launched ahead.

R runs are searched side by side; particle n of run r is column r N + n of poses (D, R N).

What a record says is copied on a stream of its own, from arrays and into pinned ones of which there are two in turn,
while the card does the next layer. Which layer that is depends on knobs that may still move, so it is launched as if
none did, and launched again where one has, from a set that it left as it was. Who stops in between, or goes on
elsewhere, has that set: nobody sees a layer that was launched too early.
"""

import dataclasses
import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Mask
from studio.foundations.numba_on_devices import cuda, record_launches
from studio.search.likelihood.device_weighing import WeighingDevice
from studio.search.trackers import device_search_kernels, device_swarm_kernels, device_tempered_kernels
from studio.search.trackers.device_search_kernels import MOMENTS
from studio.search.trackers.random_numbers import RandomNumbers
from studio.search.trackers.tracker import AnyTracker, LayerRecord, SearchSpace

THREADS = 128
RECORDED = 4096
"""Particles of a layer's record at most."""
FIRST_TIME, SECOND_TIME, ONE_BY_ONE = "first time", "second time", "one by one"


@functools.cache
def kernel(name: str) -> Any:  # noqa: ANN401 - Numba's
    """A kernel of filters or swarms, compiled by its first launch in a process."""
    modules = device_search_kernels, device_swarm_kernels, device_tempered_kernels
    return cuda.jit(next(getattr(module, name) for module in modules if hasattr(module, name)))


class Moment(NamedTuple):
    """Which random numbers a run's layer uses."""

    seed: int
    frame: int
    layer: int


class OnTheWay:
    """Arrays by name on their way to the host. They have to arrive before the next but one are sent."""

    def __init__(self, pinned: Mapping[str, NDArray[Any]], arrived: Any) -> None:  # noqa: ANN401
        self._pinned, self._arrived = pinned, arrived

    def arrive(self) -> dict[str, NDArray[Any]]:
        """The arrays, once all of them are there; nobody else's."""
        self._arrived.synchronize()
        return {name: values.copy() for name, values in self._pinned.items()}


class DeviceRuns:
    """R runs of one body, side by side: what they keep there."""

    def __init__(self, device: WeighingDevice, space: SearchSpace, runs: int) -> None:
        self.device, self.space, self.runs = device, space, runs
        self._arrays = device.lend_arrays(self)
        for name in ("stream", "copying"):
            if name not in self._arrays:
                self._arrays[name] = cuda.stream()
        self._stream, self._copying = self._arrays["stream"], self._arrays["copying"]
        self._moments = self._memory("moments", (MOMENTS, runs, len(space.names)), np.float64)
        self._sent = 0

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

    def _send(self, arrays: Mapping[str, Any]) -> OnTheWay:
        """Send arrays as they are now, while what is launched after them changes them."""
        self._sent = 1 - self._sent
        own = dict[str, Any]()
        for name, there in arrays.items():
            own[name] = self._memory(f"{name} sent {self._sent}", there.shape, there.dtype.type)
            own[name].copy_to_device(there, stream=self._stream)
        ready, arrived = cuda.event(), cuda.event()
        ready.record(self._stream)
        ready.wait(self._copying)
        pinned = dict[str, NDArray[Any]]()
        for name, there in own.items():
            key = "pinned", f"{name} {self._sent}", there.shape, there.dtype.type
            if key not in self._arrays:
                self._arrays[key] = cuda.pinned_array(there.shape, there.dtype)
            pinned[name] = there.copy_to_host(self._arrays[key], stream=self._copying)
        arrived.record(self._copying)
        return OnTheWay(pinned, arrived)

    def _rows(self, poses: Any, weights: Any, numbers: Any, count: int, step: int) -> dict[str, Any]:  # noqa: ANN401
        """Every step-th of each run's `count` particles and the best, which numbers (R, 5) name, there: rows
        (R, K + 1, D), and values (2, R, K + 1), what these weigh.
        """
        rows = -(-count // step) + 1
        taken = self._memory("rows", (self.runs, rows, len(self.space.names)), np.float64)
        values = self._memory("values", (2, self.runs, rows), np.float64)
        kernel("take_rows")[-(-self.runs * rows // THREADS), THREADS, self._stream](
            poses, weights, numbers, count, step, taken, values
        )
        return {"rows": taken, "values": values}

    def _copied(self, name: str, values: NDArray[Any]) -> Any:  # noqa: ANN401
        there = self._memory(name, values.shape, values.dtype.type)
        there.copy_to_device(values, stream=self._stream)
        return there

    def _memory(self, name: str, shape: tuple[int, ...], kind: type[np.generic]) -> Any:  # noqa: ANN401
        key = name, shape, kind
        if key not in self._arrays:
            self._arrays[key] = cuda.device_array(shape, kind)
        return self._arrays[key]

    def _poses(self, count: int, turn: int) -> Any:  # noqa: ANN401
        """Where a set goes: one made from it, whose turn is the other, goes elsewhere."""
        return self._memory(f"poses {turn}", (len(self.space.names), self.runs * count), np.float32)


Set = TypeVar("Set")
"""What a search keeps there of its particles."""


@dataclass(frozen=True, slots=True, eq=False)
class Launched(Generic[Set]):
    """A layer that a card does, or has done. following : the set after it. evaluated : poses that it weighs. records :
    waits for its records. layer, moments, settings : which it is.
    """

    following: Set
    evaluated: int
    records: Callable[[], list[LayerRecord]]
    layer: int = -1
    moments: tuple[Moment, ...] = ()
    settings: tuple[Any, ...] = ()


class LayersAhead(ABC, Generic[Set]):
    """Searches of one frame on a device, a layer at a time, each launched before the records of the one before are
    waited for. evaluated : poses of each search that the last layer weighed.
    """

    def __init__(self, tracker: AnyTracker, spaces: Sequence[SearchSpace]) -> None:
        """spaces : of the runs, which differ in σ0 alone."""
        self.evaluated = 0
        self._tracker, self._spaces = tracker, spaces
        self._set: Set | None = None
        """What the next layer weighs."""
        self._ahead: Launched[Set] | None = None

    def step(
        self, layer: int, numbers: Sequence[RandomNumbers], settings: Sequence[Any]
    ) -> list[LayerRecord]:
        """Do a layer and return its records. settings : one a run."""
        assert self._set is not None
        settings, moments = tuple(settings), tuple(Moment(*one.key) for one in numbers)
        done, self._ahead = self._ahead, None
        if done is None or (done.layer, done.moments, done.settings) != (layer, moments, settings):
            given = self._set if done is None else self._put_back(self._set)
            done = self._launch(given, layer, moments, settings)
        self._set, self.evaluated = done.following, done.evaluated
        if self._may_follow(layer + 1, settings):
            self._set = self._kept(done.following)
            following = tuple(Moment(*dataclasses.replace(one, layer=one.layer + 1).key) for one in numbers)
            ahead = self._launch(done.following, layer + 1, following, settings)
            self._ahead = dataclasses.replace(ahead, layer=layer + 1, moments=following, settings=settings)
        records = done.records()
        if self._heed(records, settings) and self._ahead is not None:
            self._set, self._ahead = self._put_back(self._set), None
        return records

    @abstractmethod
    def _launch(
        self, given: Set, layer: int, moments: Sequence[Moment], settings: Sequence[Any]
    ) -> Launched[Set]:
        """Launch a layer."""

    def _may_follow(self, layer: int, settings: Sequence[Any]) -> bool:
        """Whether there is such a layer, which a device does, too."""
        if layer >= self._tracker.layer_count(settings[0]):
            return False
        fits = self._tracker.fits_device
        return all(fits(layer, space, own, {}) for space, own in zip(self._spaces, settings, strict=True))

    def _kept(self, given: Set) -> Set:
        """A set that stays as it is while a layer is done from the one given."""
        return given

    def _put_back(self, kept: Set) -> Set:
        """A set that a layer can be done from, of one that was kept."""
        return kept

    def _heed(self, records: Sequence[LayerRecord], settings: Sequence[Any]) -> bool:
        """Whether the next layer is another than the one that would have been done without these records."""
        return False


def limits_there(space: SearchSpace, kept: bool) -> Array:
    """(2, D) lowest and highest values as a card has them, infinite where limits are not kept. Between limits that
    leave single precision no room lies its number nearest to the lower one.
    """
    if not kept:
        return np.array([[-np.inf], [np.inf]]).repeat(len(space.names), axis=1)
    there = np.stack([inwards(space.lower, np.inf), inwards(space.upper, -np.inf)])
    there[:, without_room(space)] = space.lower[without_room(space)].astype(np.float32)
    return there


def without_room(space: SearchSpace) -> Mask:
    """(D,) whether no number of single precision lies within a parameter's limits."""
    return inwards(space.lower, np.inf) > inwards(space.upper, -np.inf)


def put_within(poses: Array, space: SearchSpace) -> Array:
    """Poses (..., D) of a card, in which parameters whose limits leave single precision no room are set on these
    limits where the card had them as near as it can.
    """
    narrow = without_room(space)
    if narrow.any():
        own, lower, upper = poses[..., narrow], space.lower[narrow], space.upper[narrow]
        poses[..., narrow] = np.where(own == lower.astype(np.float32), np.clip(own, lower, upper), own)
    return poses


def inwards(limits: Array, towards: float) -> Array:
    """Limits (D,) as single precision has them, none of them wider."""
    rounded = limits.astype(np.float32)
    wider = rounded < limits if towards > 0 else rounded > limits
    return np.where(wider, np.nextafter(rounded, np.float32(towards)), rounded).astype(np.float64)
