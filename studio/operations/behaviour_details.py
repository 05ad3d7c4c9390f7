"""What a behaviour model learnt: elementary movements as poses, their order, entropies, and walks made of them."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import FiniteFloat

from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, extremities
from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError, BodyError
from studio.runs.behaviour_models import ModelSummary, summary_of
from studio.search.behaviour.generation import generate
from studio.search.behaviour.model import BehaviourModel, automaton_of
from studio.search.behaviour.model_file import read_model
from studio.sessions.session import BODIES_NAME
from studio.sessions.workspace import Workspace

IntArray = NDArray[np.int64]
Limbs = list[list[list[FiniteFloat]]]
"""By limb its two ends, mm."""
KEPT_MODELS = 4
ARROW_SECONDS = 0.2
LEAST_TRANSITION = 0.02
"""Transitions that are rarer than this, of the times a cluster is left, would only blacken the picture."""
MEMORIES = (1, 2, 3, 5, 8, 10, 15, 20, 30)
EPSILON_FACTORS = (1.0, 10.0)
FIFTH = 5
FAR_END = 1


@dataclass(frozen=True, slots=True)
class LimbShape:
    """A limb as a picture needs it: radii at its two ends, mm."""

    name: str
    side: str
    radius_start: FiniteFloat
    radius_end: FiniteFloat


@dataclass(frozen=True, slots=True)
class ClusterPicture:
    """An elementary movement.

    share : of the training frames.
    stays : frames in a row, in the mean.
    limbs : of its prototype.
    arrows : where the extremities move from and to in `BehaviourDetail.arrow_seconds`, by the mean of the cluster's
        derivatives.
    source, frame : the recording of the prototype, and its frame in it.
    """

    cluster: int
    share: FiniteFloat
    stays: FiniteFloat
    limbs: Limbs
    arrows: Limbs
    source: str
    frame: int


@dataclass(frozen=True, slots=True)
class Transition:
    """How often a cluster follows another, as a share of the times that the first is left."""

    source: int
    target: int
    probability: FiniteFloat


@dataclass(frozen=True, slots=True)
class BehaviourDetail:
    """A behaviour model.

    clusters : most frequent first.
    transitions : between different clusters, memory left aside.
    context_lengths : states of the automaton by the length of their history, 0 first.
    kept_lengths : those of them that passed the ε test.
    problem : why no poses can be shown, "" if they can.
    """

    model: ModelSummary
    context_lengths: list[int]
    kept_lengths: list[int]
    problem: str = ""
    limbs: list[LimbShape] = field(default_factory=list[LimbShape])
    arrow_seconds: FiniteFloat = ARROW_SECONDS
    clusters: list[ClusterPicture] = field(default_factory=list[ClusterPicture])
    transitions: list[Transition] = field(default_factory=list[Transition])


@dataclass(frozen=True, slots=True)
class EntropyLine:
    """Entropies over memory for one ε, nats a frame: of the training material, and of the rest."""

    epsilon: FiniteFloat
    memory: list[int]
    states: list[int]
    train: list[FiniteFloat]
    test: list[FiniteFloat]


@dataclass(frozen=True, slots=True)
class Entropies:
    """The automaton learnt again from four of five recordings (or of fifths), tested on the rest."""

    lines: list[EntropyLine]


@dataclass(frozen=True, slots=True)
class GeneratedWalk:
    """A walk through the automaton.

    frames : limbs of every frame.
    clusters, histories : cluster and history of every frame.
    """

    seed: int
    fps: FiniteFloat
    frames: list[Limbs]
    clusters: list[int]
    histories: list[list[int]]


def _body_of(model: BehaviourModel, workspace: Workspace) -> BodyModel:
    """The model's body, shipped or of the workspace. Raises BehaviourError where it no longer exists."""
    name = model.space.body
    try:
        body = load_body(name, (workspace.root / BODIES_NAME,))
        model.space.check_body(body)
    except BodyError:
        raise BehaviourError(
            f"The model's body '{name}' no longer exists, so its movements cannot be drawn.",
            "Put the body back, or learn the model again on another one.",
        ) from None
    except BehaviourError as problem:
        raise BehaviourError(
            f"The body '{name}' has changed since the model was learnt: {problem.message}",
            "Put the old body back or learn the model again.",
        ) from None
    return body


@lru_cache(maxsize=KEPT_MODELS)
def _model(path: Path, _changed: int) -> BehaviourModel:
    return read_model(path)


def _read_model(path: Path) -> BehaviourModel:
    return _model(path, path.stat().st_mtime_ns)


def behaviour_detail(path: Path, workspace: Workspace) -> BehaviourDetail:
    """Clusters of a model as poses, their order, and states of its automaton by the length of their history.

    `problem` says so if the model's body no longer exists or has changed; there are no poses to show then.
    """
    model = _read_model(path)
    contexts = model.automaton.contexts
    lengths = np.array([len(context) for context in contexts])
    most = int(lengths.max()) + 1
    counts = (np.bincount(of, minlength=most).tolist() for of in (lengths, lengths[model.automaton.kept]))
    detail = BehaviourDetail(summary_of(path), *counts)
    try:
        body = _body_of(model, workspace)
    except BehaviourError as problem:
        return replace(detail, problem=str(problem))
    return replace(
        detail,
        limbs=[LimbShape(one.name, one.side, one.radius_start, one.radius_end) for one in body.drawn],
        clusters=_clusters(model, body),
        transitions=_transitions(model),
    )


def entropies_of(path: Path) -> Entropies:
    """Entropies (Eq. 2) of a model over memory, at its own ε and at a larger one."""
    model = _read_model(path)
    train, test = _split(model.making.labels)
    settings = model.making.settings
    lines: list[EntropyLine] = []
    for epsilon in dict.fromkeys(max(settings.epsilon, 0.01) * factor for factor in EPSILON_FACTORS):
        made = [
            automaton_of(train, model.clusters, replace(settings, memory=memory, epsilon=epsilon))
            for memory in MEMORIES
        ]
        lines.append(
            EntropyLine(
                epsilon=epsilon,
                memory=list(MEMORIES),
                states=[automaton.size for automaton in made],
                train=[automaton.entropy(train) for automaton in made],
                test=[automaton.entropy(test) for automaton in made] if test else [],
            )
        )
    return Entropies(lines)


def _split(recordings: tuple[IntArray, ...]) -> tuple[list[IntArray], list[IntArray]]:
    """Labels to learn from and to test on: every fifth recording, or the last fifth of each if there are few."""
    if len(recordings) >= FIFTH:
        kept = [labels for place, labels in enumerate(recordings) if place % FIFTH != FIFTH - 1]
        return kept, list(recordings[FIFTH - 1 :: FIFTH])
    ends = [max(1, len(labels) - len(labels) // FIFTH) for labels in recordings]
    parts = list(zip(recordings, ends, strict=True))
    return [labels[:end] for labels, end in parts], [
        labels[end:] for labels, end in parts if len(labels) > end
    ]


def walk_of(path: Path, workspace: Workspace, frames: int, seed: int) -> GeneratedWalk:
    """A walk through a model's automaton and the movement it makes; the same for the same seed.

    Raises BehaviourError where the model's body no longer exists.
    """
    model = _read_model(path)
    body = _body_of(model, workspace)
    poses, states = generate(np.random.default_rng(seed), model, frames)
    contexts = model.automaton.contexts
    return GeneratedWalk(
        seed=seed,
        fps=model.fps,
        frames=_rounded(limb_ends(body, poses)),
        clusters=model.automaton.last_symbols[states].tolist(),
        histories=[list(contexts[int(state)]) for state in states],
    )


def _clusters(model: BehaviourModel, body: BodyModel) -> list[ClusterPicture]:
    """Prototypes with the root at rest and arrows at the extremities, most frequent first."""
    prototypes, space = model.prototypes, model.space
    labels = np.concatenate(model.making.labels)
    shares = np.bincount(labels, minlength=model.clusters) / len(labels)
    stays = np.bincount(labels, minlength=model.clusters) / np.maximum(_entries(model), 1.0)
    still = space.poses(space.angles(prototypes.poses))
    moved = still.copy()
    # A thousandth of the way, so that the arrow is the tangent and not the chord.
    moved[:, space.columns] += 0.001 * prototypes.derivatives
    ends, later = limb_ends(body, still), limb_ends(body, moved)
    tips = list(extremities(body))
    begins = ends[:, tips, FAR_END]
    ways = (later[:, tips, FAR_END] - begins) * 1000.0 * space.fps * ARROW_SECONDS
    arrows = np.stack([begins, begins + ways], axis=2)
    sources = model.making.sources
    return [
        ClusterPicture(
            cluster=int(cluster),
            share=float(shares[cluster]),
            stays=float(stays[cluster]),
            limbs=_rounded(ends[cluster]),
            arrows=_rounded(arrows[cluster]),
            source=sources[prototypes.recordings[cluster]] if sources else "",
            frame=int(prototypes.frames[cluster]),
        )
        for cluster in np.argsort(-shares, kind="stable")
    ]


def _entries(model: BehaviourModel) -> Array:
    """(K,) how often each cluster is entered in the training recordings, their first frames included."""
    entries = np.zeros(model.clusters)
    for labels in model.making.labels:
        first = np.concatenate([[True], labels[1:] != labels[:-1]])
        entries += np.bincount(labels[first], minlength=model.clusters)
    return entries


def _transitions(model: BehaviourModel) -> list[Transition]:
    """How often each cluster follows each other one in the training recordings."""
    leaving = np.zeros((model.clusters, model.clusters))
    for labels in model.making.labels:
        np.add.at(leaving, (labels[:-1], labels[1:]), 1.0)
    np.fill_diagonal(leaving, 0.0)
    shares = leaving / np.maximum(leaving.sum(axis=1, keepdims=True), 1.0)
    return [
        Transition(int(source), int(target), float(shares[source, target]))
        for source, target in np.argwhere(shares >= LEAST_TRANSITION)
    ]


def _rounded(points: Array) -> list[Any]:
    """Millimetres; a tenth is finer than any screen."""
    return np.round(points, 1).tolist()
