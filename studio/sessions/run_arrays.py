"""A run's particles as one `xarray.Dataset`, layers as a dimension, for notebooks.

xarray is no part of the studio: `pip install "capture-studio[notebook]"` brings it.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from studio.foundations.errors import RunError
from studio.foundations.extras import load_extra
from studio.search.trackers.tracker import FrameResult, LayerRecord
from studio.sessions.run_record import RunRecord

EXTRA = "notebook"
LARGEST_BYTES = 4 << 30
OF_LAYERS = ("beta", "alpha_wanted", "alpha_reached", "milliseconds", "temper", "acceptance", "log_evidence")


def particles_dataset(
    record: RunRecord, frames: Sequence[int], stored: Iterable[tuple[Sequence[LayerRecord], FrameResult]]
) -> Any:  # noqa: ANN401 - xarray.Dataset
    """The frames (K) with at most L layers of at most N stored particles each.

    stored : of each frame. In the dataset: pose (frame, layer, particle, parameter), rad and mm; log_weight (frame,
    layer, particle), raw; number (frame, layer, particle), of the particle in its set; beta, alpha_wanted,
    alpha_reached, milliseconds, temper, acceptance, log_evidence (frame, layer); parent (frame, layer, particle,
    which) numbers in the layer before, -1 for none; estimate (frame, parameter). What is missing is NaN or -1. Raises
    StudioError without xarray, RunError for a run without frames, or one that takes more than 4 GB: name fewer frames.
    """
    xarray = load_extra("xarray", EXTRA)
    whole = list(stored)
    if not whole:
        raise RunError(f"Run '{record.name}' has no finished frame.", "Track it first.")
    depth = max(len(layers) for layers, _ in whole)
    width = max(len(layer.poses) for layers, _ in whole for layer in layers)
    shape, size = (len(whole), depth, width), len(record.parameters)
    if 8 * np.prod([*shape, size], dtype=np.int64) > LARGEST_BYTES:
        raise RunError(
            f"{len(whole)} frames of run '{record.name}' take more than 4 GB.",
            "Name fewer: to_xarray(frames=…).",
        )
    poses, weights = np.full((*shape, size), np.nan), np.full(shape, np.nan)
    numbers, parents = np.full(shape, -1, dtype=np.int64), np.full((*shape, 2), -1, dtype=np.int64)
    single = {name: np.full(shape[:2], np.nan) for name in OF_LAYERS}
    for at, (layers, _) in enumerate(whole):
        drawn: np.ndarray[Any, np.dtype[np.int64]] = np.zeros((2, 0), dtype=np.int64)
        for level, layer in enumerate(layers):
            count = len(layer.poses)
            own = layer.rows if len(layer.rows) else np.arange(count)
            poses[at, level, :count], weights[at, level, :count] = layer.poses, layer.log_weights
            numbers[at, level, :count] = own
            if drawn.shape[1] > own.max(initial=-1):
                parents[at, level, :count] = drawn[:, own].T
            for name, values in single.items():
                values[at, level] = getattr(layer, name)
            drawn = layer.parents
    dims = ("frame", "layer", "particle")
    return xarray.Dataset(
        {
            "pose": ((*dims, "parameter"), poses),
            "log_weight": (dims, weights),
            "number": (dims, numbers),
            "parent": ((*dims, "which"), parents),
            **{name: (dims[:2], values) for name, values in single.items()},
            "estimate": (("frame", "parameter"), np.stack([result.estimate.pose for _, result in whole])),
        },
        coords={
            "frame": list(frames),
            "layer": np.arange(depth),
            "particle": np.arange(width),
            "parameter": list(record.parameters),
            "which": ["first", "second"],
        },
        attrs={
            "session": record.session,
            "run": record.name,
            "tracker": record.tracker,
            "likelihood": record.weighting,
            "seed": record.seed,
            "fps": record.fps,
            "software": record.software,
        },
    )
