"""Layers, frames and checkpoints as compressed blobs, and back, bit for bit; and their checksums.

A blob is a zstd frame around named arrays in MessagePack, each its type, its shape and its bytes: a frame of eleven
blobs is packed in a tenth of the time that as many npz archives take. The single numbers of a record share one array,
and those per parameter another. Stores of the first version hold npz archives (`allow_pickle=False`); nothing in
either can run.

A frame's checksums lie in one row: of its numbers and pose ("row"), of its result's blob ("result") and of each layer's
("layers"). Older rows have none and count as unchecked. `Verified` remembers which parts this process found intact.
"""

import io
import json
import math
import threading
import zlib
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zstandard
from numpy.typing import NDArray

from studio.foundations.arrays import Array, Indices, read_archive
from studio.foundations.errors import SessionError
from studio.foundations.typed_decoding import is_table
from studio.search.trackers.tracker import (
    TRACKING_STATES,
    Estimate,
    FilterState,
    FrameResult,
    LayerRecord,
    ParticleSet,
)

LEVEL = -1
LARGEST_BLOB = 128 << 20
_NPZ = b"PK"
"""Begins the archives of a store's first version."""


class _Packed(msgspec.Struct, array_like=True, frozen=True):
    """dtype : with its byte order, "<f8"."""

    dtype: str
    shape: tuple[int, ...]
    content: bytes


_ENCODER, _DECODER = msgspec.msgpack.Encoder(), msgspec.msgpack.Decoder(dict[str, _Packed])


class _Zstandard(threading.local):
    """One of each a thread: to make one takes four times as long as to compress a layer."""

    def __init__(self) -> None:
        self.compressor = zstandard.ZstdCompressor(level=LEVEL)
        self.decompressor = zstandard.ZstdDecompressor()


_ZSTANDARD = _Zstandard()


def pack(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Named arrays of numbers or texts as one compressed blob."""
    plain = {name: _Packed(array.dtype.str, array.shape, array.tobytes()) for name, array in arrays.items()}
    return _ZSTANDARD.compressor.compress(_ENCODER.encode(plain))


def unpack(blob: bytes) -> dict[str, Array]:
    """The arrays of a blob. Raises SessionError if it is damaged."""
    try:
        # The limit counts only where the frame does not say its size itself.
        if zstandard.frame_content_size(blob) > LARGEST_BLOB:
            raise ValueError(f"it unpacks to more than {LARGEST_BLOB >> 20} MB")
        plain = _ZSTANDARD.decompressor.decompress(blob, max_output_size=LARGEST_BLOB)
        if plain.startswith(_NPZ):
            return read_archive(io.BytesIO(plain))
        # Copied, so that they are writable and aligned.
        return {
            name: np.frombuffer(array.content, np.dtype(array.dtype)).reshape(array.shape).copy()
            for name, array in _DECODER.decode(plain).items()
        }
    except Exception as error:
        raise SessionError(
            f"A stored result is damaged ({error}).", "Start the run again; the footage is not touched."
        ) from None


def kept_rows(log_weights: Array, wanted: int) -> Indices:
    """The rows of a set that are recorded when `wanted` are: the heaviest, in the order that they have in the
    set.

    Particles of equal weight are taken in that order too, so the choice is the same on every machine.
    """
    if wanted >= len(log_weights):
        return np.arange(len(log_weights))
    return np.sort(np.argsort(-log_weights, kind="stable")[:wanted])


LAYER_COUNTS = ("frame", "layer", "settings_version")
LAYER_NUMBERS = (
    *LAYER_COUNTS, "beta", "alpha_wanted", "alpha_reached", "best_log_weight", "milliseconds", "model_free_share",
    "temper", "acceptance", "log_evidence",
)  # fmt: skip
LAYER_VECTORS = ("variance_weighed", "variance_resampled", "variance_diffused", "best", "mean")
"""Fields of a layer's record in the order in which they are stored; layers that were stored before there were behaviour
models or sampled posteriors have fewer numbers.
"""


def pack_layer(record: LayerRecord, particles: int | None = None) -> bytes:
    """A layer's record with at most `particles` of its set (None: all), and the parents of all of the next."""
    rows = kept_rows(record.log_weights, len(record.poses) if particles is None else particles)
    numbers = record.rows[rows] if len(record.rows) else rows
    arrays: dict[str, NDArray[Any]] = {
        "numbers": np.array([getattr(record, name) for name in LAYER_NUMBERS], dtype=np.float64),
        "vectors": np.stack([getattr(record, name) for name in LAYER_VECTORS]),
        "poses": record.poses[rows],
        "log_weights": record.log_weights[rows],
    }
    if record.parents.size:
        arrays["parents"] = record.parents.astype("<i4")
    if len(record.rows) or len(rows) < len(record.poses):
        arrays["rows"] = numbers.astype("<i4")
    return pack(arrays)


def unpack_layer(blob: bytes) -> LayerRecord:
    """The inverse of `pack_layer`."""
    arrays = unpack(blob)
    numbers: dict[str, Any] = dict(zip(LAYER_NUMBERS, arrays["numbers"].tolist(), strict=False))
    numbers |= {name: int(numbers[name]) for name in LAYER_COUNTS}
    vectors = dict(zip(LAYER_VECTORS, arrays["vectors"], strict=True))
    sets = {name: arrays[name] for name in ("poses", "log_weights")}
    later = {name: arrays[name].astype(np.int64) for name in ("parents", "rows") if name in arrays}
    entries: dict[str, Any] = {"model_free_share": math.nan, **numbers, **vectors, **sets, **later}
    return LayerRecord(**entries)


def pack_result(result: FrameResult) -> bytes:
    """A frame's result with everything that the next frame starts from, whole."""
    estimate = result.estimate
    arrays = carried_arrays(result.carried)
    numbers = [result.frame, result.layers, result.evaluations, result.settings_version, result.milliseconds]
    numbers += [estimate.log_weight, TRACKING_STATES.index(result.tracking), result.overlap, result.doubts]
    arrays["numbers"] = np.array(numbers, dtype=np.float64)
    if result.disagreement:
        arrays["limbs"] = np.array(list(result.disagreement))
        arrays["disagreement"] = np.array(list(result.disagreement.values()))
    if result.limb_loss:
        arrays["limbs_judged"] = np.array(list(result.limb_loss))
        arrays["limb_loss"] = np.array(list(result.limb_loss.values()))
    if result.notes:
        arrays["notes"] = np.array(result.notes)
    vectors = [estimate.pose, estimate.mean, estimate.mode]
    arrays["vectors"] = np.stack(vectors if estimate.searched is None else [*vectors, estimate.searched])
    return pack(arrays)


def unpack_result(blob: bytes) -> FrameResult:
    """The inverse of `pack_result`; frames that were stored before a loss could be noticed have six numbers."""
    arrays = unpack(blob)
    numbers, vectors = arrays["numbers"].tolist(), arrays["vectors"]
    state, overlap, doubts = (*numbers[6:], *(0.0, math.nan, 0.0)[len(numbers) - 6 :])
    frame, layers, evaluations, settings_version = map(int, numbers[:4])
    return FrameResult(
        frame=frame,
        estimate=Estimate(
            vectors[0], vectors[1], vectors[2], numbers[5], vectors[3] if len(vectors) > 3 else None
        ),
        layers=layers,
        evaluations=evaluations,
        settings_version=settings_version,
        milliseconds=numbers[4],
        carried=carried_from(arrays),
        tracking=TRACKING_STATES[int(state)],
        overlap=overlap,
        doubts=int(doubts),
        disagreement=_by_limb(arrays, "limbs", "disagreement"),
        limb_loss=_by_limb(arrays, "limbs_judged", "limb_loss"),
        notes=tuple(map(str, arrays["notes"])) if "notes" in arrays else (),
    )


def _by_limb(arrays: dict[str, Array], names: str, values: str) -> dict[str, float]:
    """Values by limb; empty where none are stored."""
    if names not in arrays:
        return {}
    return dict(zip(map(str, arrays[names]), map(float, arrays[values]), strict=True))


def carried_arrays(carried: FilterState) -> dict[str, Array]:
    """The state carried to the next frame, as named arrays; None has no entry."""
    arrays: dict[str, Array] = {}
    if carried.estimate is not None:
        arrays["estimate"] = carried.estimate
    if carried.previous_estimate is not None:
        arrays["previous_estimate"] = carried.previous_estimate
    if carried.particles is not None:
        arrays.update(particle_arrays(carried.particles))
    arrays.update({f"memory_{name}": values for name, values in carried.memory.items()})
    return arrays


def carried_from(arrays: dict[str, Array]) -> FilterState:
    """The inverse of `carried_arrays`."""
    particles = particles_from(arrays) if "set_poses" in arrays else None
    return FilterState(
        particles, arrays.get("estimate"), arrays.get("previous_estimate"), _with_prefix(arrays, "memory_")
    )


def particle_arrays(particles: ParticleSet) -> dict[str, Array]:
    """A whole set of particles as named arrays."""
    arrays = {
        "set_poses": particles.poses,
        "set_log_weights": particles.log_weights,
        "set_raw_log_weights": particles.raw_log_weights,
    }
    arrays.update({f"extra_{name}": values for name, values in particles.extra.items()})
    return arrays


def particles_from(arrays: dict[str, Array]) -> ParticleSet:
    """The inverse of `particle_arrays`."""
    extra = _with_prefix(arrays, "extra_")
    return ParticleSet(arrays["set_poses"], arrays["set_log_weights"], arrays["set_raw_log_weights"], extra)


def _with_prefix(arrays: dict[str, Array], prefix: str) -> dict[str, Array]:
    return {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}


FRAME, PARTIAL, SETTINGS = "frame", "partial", "settings"
"""Kinds of checksum rows."""
GIVEN_UP = "damaged"
"""Marks a frame without checksums whose content cannot be read, so that it is tracked again."""
STORES_REMEMBERED = 64


def checksum(values: Iterable[object]) -> int:
    """CRC-32 of values as SQLite gives them back: whole and real numbers, texts, bytes, None."""
    total = 0
    for value in values:
        content = value if isinstance(value, bytes) else repr(value).encode()
        total = zlib.crc32(content, zlib.crc32(f"{len(content)} ".encode(), total))
    return total


def sums_text(row: Iterable[object], blobs: Mapping[str, bytes], layers: Mapping[int, bytes]) -> str:
    """The stored checksums of one row and its blobs."""
    sums: dict[str, object] = {"row": checksum(row)}
    sums |= {name: checksum([blob]) for name, blob in blobs.items()}
    return json.dumps(sums | {"layers": {str(layer): checksum([blob]) for layer, blob in layers.items()}})


class Sums:
    """Stored checksums, read back. A damaged text matches nothing."""

    def __init__(self, text: str) -> None:
        try:
            stored = json.loads(text)
            self._sums: dict[str, object] = stored if isinstance(stored, dict) else {}
        except ValueError:
            self._sums = {}

    def row_fits(self, row: Iterable[object]) -> bool:
        return self._sums.get("row") == checksum(row)

    def fits(self, name: str, blob: bytes) -> bool:
        return self._sums.get(name) == checksum([blob])

    def wrong_layers(self, blobs: Mapping[int, bytes]) -> list[int]:
        """The layers that are missing, surplus or damaged."""
        sums = self._sums.get("layers")
        known: dict[str, Any] = sums if is_table(sums) else {}
        now = {str(layer): checksum([blob]) for layer, blob in blobs.items()}
        return sorted(int(layer) for layer in known.keys() | now.keys() if known.get(layer) != now.get(layer))


class CheckedStore:
    """Which frames of a store were found intact, and which damaged. Each method is one step of a dictionary."""

    def __init__(self) -> None:
        self._rows: dict[int, int] = {}
        self._blobs: dict[int, int] = {}
        self._damage: dict[int, tuple[int, str]] = {}

    def holds(self, frame: int, text: str) -> bool:
        """Whether the frame's blobs were found to match these checksums."""
        return self._blobs.get(frame) == hash(text)

    def holds_row(self, frame: int, text: str, row: tuple[object, ...]) -> bool:
        """Whether the frame's numbers were found to match these checksums."""
        return self._rows.get(frame) == hash((text, row))

    def add(self, frame: int, text: str) -> None:
        """Note that the frame's blobs match these checksums."""
        self._blobs[frame] = hash(text)
        self._damage.pop(frame, None)

    def add_row(self, frame: int, text: str, row: tuple[object, ...]) -> None:
        """Note that the frame's numbers match these checksums."""
        self._rows[frame] = hash((text, row))

    def add_damage(self, frame: int, text: str, part: str) -> None:
        """Note that a blob of the frame does not match its checksum. part : which, as text."""
        self._blobs.pop(frame, None)
        self._damage[frame] = hash(text), part

    def damage(self) -> dict[int, tuple[int, str]]:
        """The damaged blobs, by frame: the hash of the checksums, and the part as text."""
        return self._damage.copy()


class Verified:
    """What was found of which stores, so that a list need not read every blob again. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._stores: OrderedDict[Path, CheckedStore] = OrderedDict()
        self._reading: dict[Path, threading.Lock] = {}

    def of(self, path: Path) -> CheckedStore:
        """What was found of a store, until it is forgotten."""
        with self._lock:
            entries = self._stores.setdefault(path, CheckedStore())
            self._stores.move_to_end(path)
            if len(self._stores) > STORES_REMEMBERED:
                self._reading.pop(self._stores.popitem(last=False)[0], None)
            return entries

    def reading(self, path: Path) -> threading.Lock:
        """Held by the thread that checks a whole store: the next one finds it checked."""
        with self._lock:
            return self._reading.setdefault(path, threading.Lock())

    def forget(self, path: Path) -> None:
        """Something in the store was found damaged after all."""
        with self._lock:
            self._stores.pop(path, None)


VERIFIED = Verified()
