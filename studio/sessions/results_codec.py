"""Layers, frames and checkpoints as compressed blobs, and back, bit for bit.

A blob is a zstd frame around an npz archive (`allow_pickle=False`: nothing in it can run). The numbers of a
record that are single values share one array and those that are per parameter another, so that an archive has
few entries.
"""

import io
import math
from typing import Any

import numpy as np
import zstandard

from studio.arrays import Array, Indices, read_archive
from studio.errors import SessionError
from studio.tracking.tracker import TRACKING_STATES, Carried, Estimate, FrameResult, LayerRecord, ParticleSet

LEVEL = 1
LARGEST_BLOB = 1 << 30


def pack(arrays: dict[str, Array]) -> bytes:
    """Named arrays as one compressed blob."""
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)  # pyright: ignore[reportArgumentType]
    return zstandard.ZstdCompressor(level=LEVEL).compress(stream.getbuffer())


def unpack(blob: bytes) -> dict[str, Array]:
    """The arrays of a blob. Raises SessionError if it is damaged."""
    try:
        plain = zstandard.ZstdDecompressor().decompress(blob, max_output_size=LARGEST_BLOB)
        return read_archive(io.BytesIO(plain))
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
)  # fmt: skip
LAYER_VECTORS = ("variance_weighed", "variance_resampled", "variance_diffused", "best", "mean")
"""Fields of a layer's record in the order in which they are stored; layers that were stored before there were behaviour
models have one number less.
"""


def pack_layer(record: LayerRecord, particles: int | None = None) -> bytes:
    """A layer's record with at most `particles` of its set (None: all)."""
    rows = kept_rows(record.log_weights, len(record.poses) if particles is None else particles)
    return pack(
        {
            "numbers": np.array([getattr(record, name) for name in LAYER_NUMBERS], dtype=np.float64),
            "vectors": np.stack([getattr(record, name) for name in LAYER_VECTORS]),
            "poses": record.poses[rows],
            "log_weights": record.log_weights[rows],
        }
    )


def unpack_layer(blob: bytes) -> LayerRecord:
    """The inverse of `pack_layer`."""
    arrays = unpack(blob)
    numbers: dict[str, Any] = dict(zip(LAYER_NUMBERS, arrays["numbers"].tolist(), strict=False))
    numbers |= {name: int(numbers[name]) for name in LAYER_COUNTS}
    vectors = dict(zip(LAYER_VECTORS, arrays["vectors"], strict=True))
    sets = {name: arrays[name] for name in ("poses", "log_weights")}
    return LayerRecord(**{"model_free_share": math.nan, **numbers, **vectors, **sets})


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
        disagreement=dict(zip(map(str, arrays["limbs"]), map(float, arrays["disagreement"]), strict=True))
        if "limbs" in arrays
        else {},
    )


def carried_arrays(carried: Carried) -> dict[str, Array]:
    """What goes from one frame to the next, as named arrays; what is None has no entry."""
    arrays: dict[str, Array] = {}
    if carried.estimate is not None:
        arrays["estimate"] = carried.estimate
    if carried.previous_estimate is not None:
        arrays["previous_estimate"] = carried.previous_estimate
    if carried.particles is not None:
        arrays.update(particle_arrays(carried.particles))
    arrays.update({f"memory_{name}": values for name, values in carried.memory.items()})
    return arrays


def carried_from(arrays: dict[str, Array]) -> Carried:
    """The inverse of `carried_arrays`."""
    particles = particles_from(arrays) if "set_poses" in arrays else None
    return Carried(
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
