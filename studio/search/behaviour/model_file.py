"""A behaviour model in one file: arrays in a zip archive (NumPy's), the rest as JSON inside it."""

import contextlib
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import read_archive
from studio.foundations.errors import BehaviourError
from studio.foundations.foreign_files import foreign_file
from studio.foundations.typed_decoding import decode_json
from studio.search.behaviour.automaton import Automaton
from studio.search.behaviour.feature_space import FeatureSpace
from studio.search.behaviour.gaussian_mixture import GaussianMixture
from studio.search.behaviour.model import BehaviourModel, Making
from studio.search.behaviour.prototypes import Prototypes
from studio.search.behaviour.reduction import Reduction
from studio.search.behaviour.root_motion import RootFrame, RootMotion
from studio.search.behaviour.settings import LearningSettings

VERSION = 2
# Models of before the knob have clusters without a floor.
WITHOUT_FLOOR = {"cluster_floor": 0.0}
KIND = "studio behaviour model"


class _Head(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The parts of a model that are not arrays."""

    kind: str
    version: int
    body: str = ""
    parameters: tuple[str, ...] = ()
    fps: float = 0.0
    kept: float = 1.0
    smoothing: float = 0.0
    back_off: float = 0.0
    settings: dict[str, bool | int | float | str] = {}
    sources: tuple[str, ...] = ()
    learnt_fps: float = 0.0
    entropy_train: float | None = None
    entropy_test: float | None = None
    heading: int = -1


def write_model(model: BehaviourModel, path: Path) -> None:
    """Writes the model; an older file of the name is replaced only when the new one is whole.

    Raises BehaviourError where the file cannot be written.
    """
    head, arrays = _head(model), cast("dict[str, Any]", _arrays(model))
    partial = path.with_name(f"{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez_compressed(file, head=np.frombuffer(head, dtype=np.uint8), **arrays)
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        raise BehaviourError(
            f"The behaviour model '{path.name}' cannot be written: {error.strerror or error}.",
            "Choose another place, or make room.",
        ) from error


def read_model(path: Path) -> BehaviourModel:
    """The model in a file.

    Raises BehaviourError for a file that is missing, damaged, not a behaviour model, or of another version.
    """
    if not path.exists():
        raise BehaviourError(
            f"There is no behaviour model '{path.name}'.", "List the models with `studio models`."
        )
    with foreign_file(path, BehaviourError, "a behaviour model", "Learn it again with `studio learn`."):
        arrays = read_archive(path)
        head = _checked_head(path, arrays.pop("head").tobytes())
        return _model(head, arrays)


def _head(model: BehaviourModel) -> bytes:
    making = model.making
    head = {
        "kind": KIND,
        "version": VERSION,
        "body": model.space.body,
        "parameters": model.space.parameters,
        "fps": model.space.fps,
        "kept": model.reduction.kept,
        "smoothing": model.automaton.smoothing,
        "back_off": model.automaton.back_off,
        "settings": asdict(making.settings),
        "sources": making.sources,
        "learnt_fps": making.learnt_fps,
        "entropy_train": _or_none(making.entropy_train),
        "entropy_test": _or_none(making.entropy_test),
        "heading": model.root.frame.heading if model.root else -1,
    }
    return json.dumps(head).encode()


def _checked_head(path: Path, content: bytes) -> _Head:
    """The head. Raises BehaviourError for another version."""
    known = json.loads(content)
    version = known.get("version")
    if known.get("kind") == KIND and version != VERSION:
        raise BehaviourError(
            f"'{path.name}' is a behaviour model of version {version}; this program reads version {VERSION}.",
            "Learn it again with `studio learn`.",
        )
    head = decode_json(content, _Head)
    if head.kind != KIND:
        raise ValueError(head.kind)
    return head


def _arrays(model: BehaviourModel) -> dict[str, NDArray[np.generic]]:
    automaton, prototypes = model.automaton, model.prototypes
    lengths = [len(context) for context in automaton.contexts]
    return {
        "columns": model.space.columns,
        "rest": model.space.rest,
        "turning": model.space.turning,
        "middle": model.space.middle,
        "reduction_mean": model.reduction.mean,
        "reduction_scale": model.reduction.scale,
        "reduction_loadings": model.reduction.loadings,
        **_mixture_arrays("mixture", model.mixture),
        **_mixture_arrays("dynamics", model.dynamics),
        **_root_arrays(model.root),
        "contexts": np.array([label for context in automaton.contexts for label in context], dtype=np.int64),
        "context_lengths": np.array(lengths, dtype=np.int64),
        "context_kept": automaton.kept,
        "next_state": automaton.next_state,
        "probabilities": automaton.probabilities,
        "start": automaton.start,
        "prototype_poses": prototypes.poses,
        "prototype_derivatives": prototypes.derivatives,
        "prototype_recordings": prototypes.recordings,
        "prototype_frames": prototypes.frames,
        "labels": np.concatenate(model.making.labels),
        "label_lengths": np.array([len(labels) for labels in model.making.labels], dtype=np.int64),
    }


def _mixture_arrays(name: str, mixture: GaussianMixture) -> dict[str, NDArray[np.generic]]:
    parts = {"weights": mixture.weights, "means": mixture.means, "covariances": mixture.covariances}
    return {f"{name}_{part}": values for part, values in parts.items()}


def _root_arrays(root: RootMotion | None) -> dict[str, NDArray[np.generic]]:
    if root is None:
        return {}
    frame = root.frame
    places = {"root_columns": frame.columns, "root_turning": frame.turning, "root_level": frame.level}
    return places | _mixture_arrays("root", root.changes)


def _root(head: _Head, arrays: dict[str, NDArray[Any]]) -> RootMotion | None:
    if "root_columns" not in arrays:
        return None
    frame = RootFrame(arrays["root_columns"], arrays["root_turning"], head.heading, arrays["root_level"])
    return RootMotion(frame, _mixture("root", arrays))


def _model(head: _Head, arrays: dict[str, NDArray[Any]]) -> BehaviourModel:
    """The model of a head and arrays. Raises ValueError, KeyError, IndexError or TypeError where they do not fit."""
    space = FeatureSpace(
        head.body,
        head.parameters,
        arrays["columns"],
        arrays["rest"],
        arrays["turning"],
        arrays["middle"],
        head.fps,
    )
    reduction = Reduction(
        arrays["reduction_mean"], arrays["reduction_scale"], arrays["reduction_loadings"], head.kept
    )
    mixture, dynamics = _mixture("mixture", arrays), _mixture("dynamics", arrays)
    contexts = _split(arrays["contexts"], arrays["context_lengths"])
    automaton = Automaton(
        contexts=tuple(tuple(int(label) for label in context) for context in contexts),
        kept=arrays["context_kept"],
        next_state=arrays["next_state"],
        probabilities=arrays["probabilities"],
        start=arrays["start"],
        smoothing=head.smoothing,
        back_off=head.back_off,
    )
    prototypes = Prototypes(
        *(arrays[f"prototype_{part}"] for part in ("poses", "derivatives", "recordings", "frames"))
    )
    labels = _split(arrays["labels"], arrays["label_lengths"])
    making = Making(
        settings=LearningSettings(**(WITHOUT_FLOOR | head.settings)),  # pyright: ignore[reportArgumentType]
        sources=head.sources,
        frames=len(arrays["labels"]),
        labels=tuple(labels),
        learnt_fps=head.learnt_fps,
        entropy_train=_or_nan(head.entropy_train),
        entropy_test=_or_nan(head.entropy_test),
    )
    root = _root(head, arrays)
    model = BehaviourModel(space, reduction, mixture, dynamics, automaton, prototypes, making, root)
    _check_shapes(model)
    return model


def _mixture(name: str, arrays: dict[str, NDArray[Any]]) -> GaussianMixture:
    return GaussianMixture(arrays[f"{name}_weights"], arrays[f"{name}_means"], arrays[f"{name}_covariances"])


def _check_shapes(model: BehaviourModel) -> None:
    """Raise ValueError unless all parts have the same clusters, states and dimensions."""
    clusters, states, half = model.clusters, model.states, model.space.dimensions
    reduced, width = model.reduction.loadings.shape[0], 2 * half
    whole = len(model.space.parameters)
    found = {
        (model.reduction.mean.shape, (width,)),
        (model.reduction.scale.shape, (width,)),
        (model.reduction.loadings.shape, (reduced, width)),
        (model.mixture.means.shape, (clusters, reduced)),
        (model.mixture.covariances.shape, (clusters, reduced, reduced)),
        (model.dynamics.means.shape, (clusters, width)),
        (model.dynamics.covariances.shape, (clusters, width, width)),
        (model.automaton.next_state.shape, (states, clusters)),
        (model.automaton.probabilities.shape, (states, clusters)),
        (model.automaton.kept.shape, (states,)),
        (model.automaton.start.shape, (states,)),
        (model.prototypes.poses.shape, (clusters, whole)),
        (model.prototypes.derivatives.shape, (clusters, half)),
        (model.space.rest.shape, (whole,)),
    }
    if model.root is not None:
        width = len(model.root.frame.columns)
        found |= {
            (model.root.changes.means.shape, (clusters, width)),
            (model.root.changes.covariances.shape, (clusters, width, width)),
            (model.root.frame.turning.shape, (width,)),
        }
    if any(shape != wanted for shape, wanted in found):
        raise ValueError("shapes")
    if model.automaton.next_state.min() < 0 or model.automaton.next_state.max() >= states:
        raise ValueError("states")


def _split(values: NDArray[Any], lengths: NDArray[Any]) -> list[NDArray[Any]]:
    return np.split(values, np.cumsum(lengths)[:-1])


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value
