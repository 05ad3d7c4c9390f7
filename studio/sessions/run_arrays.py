"""A run's particles as one `xarray.Dataset`, layers as a dimension, for notebooks.

Of several runs that differ by seed, an `arviz.InferenceData` with their last clouds as chains. xarray and ArviZ are no
part of the studio: `pip install "capture-studio[notebook]"` brings them.
"""

import warnings
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import RunError
from studio.foundations.extras import load_extra
from studio.search.trackers.annealing import normalised
from studio.search.trackers.particle_kernels import drawn
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


def inference_data(datasets: Sequence[Any]) -> Any:  # noqa: ANN401 - of xarray.Dataset to arviz.InferenceData
    """Runs of the same frames and parameters as chains of one `arviz.InferenceData`.

    datasets : of `particles_dataset`, one a run. Groups: posterior (pose: chain, draw, frame, parameter), N members of
    each frame's last cloud, drawn by weight so that all count alike; sample_stats (lp, which is log w, and weight in
    the cloud: chain, draw, frame; log_evidence: chain, frame); layers (as given, with a dimension chain). The chains
    have a coordinate seed. Raises StudioError without ArviZ, RunError for runs that do not fit together.
    """
    xarray = load_extra("xarray", EXTRA)
    with warnings.catch_warnings():
        # Its import announces changes of its next version, which the extra excludes.
        warnings.simplefilter("ignore", FutureWarning)
        arviz = load_extra("arviz", EXTRA)
    first = datasets[0]
    for one in datasets[1:]:
        for name in ("frame", "parameter", "layer", "particle"):
            if not one[name].equals(first[name]):
                raise RunError(
                    f"Runs '{first.attrs['run']}' and '{one.attrs['run']}' differ in their {name}s.",
                    "Choose runs of one body and as many layers and particles, or name frames that all have.",
                )
    seeds = [one.attrs["seed"] for one in datasets]
    clouds = [_last_clouds(one) for one in datasets]
    coords = {"chain": np.arange(len(datasets)), "seed": ("chain", seeds)}
    across: dict[str, Any] = {"frame": first["frame"], "draw": np.arange(first.sizes["particle"])}
    dims = ("chain", "draw", "frame")
    return arviz.InferenceData(
        warn_on_custom_groups=False,
        posterior=xarray.Dataset(
            {"pose": ((*dims, "parameter"), np.stack([cloud[0] for cloud in clouds]))},
            coords={**coords, **across, "parameter": first["parameter"]},
            attrs=first.attrs,
        ),
        sample_stats=xarray.Dataset(
            {
                "lp": (dims, np.stack([cloud[1] for cloud in clouds])),
                "weight": (dims, np.stack([cloud[2] for cloud in clouds])),
                "log_evidence": (("chain", "frame"), np.stack([cloud[3] for cloud in clouds])),
            },
            coords={**coords, **across},
        ),
        layers=xarray.concat(list(datasets), "chain", combine_attrs="override").assign_coords(coords),
    )


def _last_clouds(dataset: Any) -> tuple[Array, Array, Array, Array]:  # noqa: ANN401 - xarray.Dataset
    """Of each frame's last layer N draws: poses (N, K, D), log w (N, K) and weights (N, K); log evidence (K,)."""
    poses, logs, betas = (dataset[name].to_numpy() for name in ("pose", "log_weight", "beta"))
    count, frames = int(poses.shape[2]), len(poses)
    clouds = np.empty((count, frames, poses.shape[3]))
    lp, weight, evidence = np.empty((count, frames)), np.empty((count, frames)), np.empty(frames)
    for at in range(frames):
        last = int(np.flatnonzero(np.isfinite(logs[at]).any(axis=1))[-1])
        known = np.flatnonzero(np.isfinite(logs[at, last]))
        beta = betas[at, last]
        own = logs[at, last, known]
        weights = np.exp(normalised(own, beta if np.isfinite(beta) else 0.0))
        rows = drawn(weights, (np.arange(count) + 0.5) / count)
        clouds[:, at], lp[:, at], weight[:, at] = poses[at, last, known[rows]], own[rows], weights[rows]
        evidence[at] = dataset["log_evidence"].to_numpy()[at, last]
    return clouds, lp, weight, evidence
