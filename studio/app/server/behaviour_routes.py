"""Behaviour models of the workspace: what they learnt, movement made from them, their names, and the way to the trash.

Learning one is in `behaviour_learning_routes`.
"""

import math
from dataclasses import asdict, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from fastapi import APIRouter, Depends, Query
from numpy.typing import NDArray
from pydantic import Field

from studio.app.server.app_state import App, AppState
from studio.app.server.schemas import Answer, Request, RunName
from studio.app.server.session_routes import TrashEntry, trash_entry
from studio.body.catalogue import load_body
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, extremities
from studio.foundations.arrays import Array
from studio.foundations.errors import BehaviourError, BodyError
from studio.runs.behaviour_models import ModelSummary, summary_of
from studio.runs.learning.model_repository import (
    list_models,
    rename_model,
    stored_model,
    throw_away_model,
)
from studio.search.behaviour.generation import generate
from studio.search.behaviour.model import BehaviourModel, automaton_of
from studio.search.behaviour.model_file import read_model
from studio.sessions.session import BODIES_NAME

router = APIRouter(prefix="/api/behaviours", tags=["behaviours"])
MOST_FRAMES = 1800
KEPT_MODELS = 4
Limbs = list[list[list[float]]]


class ModelName(Request):
    """Another name for a model."""

    name: RunName


class BehaviourLine(Answer):
    """A model in a list. problem: why it cannot be read, "" if it can."""

    name: str
    body: str = ""
    fps: float = 0.0
    frames: int = 0
    clusters: int = 0
    states: int = 0
    memory: int = 0
    epsilon: float = 0.0
    entropy_train: float | None = Field(None, description="Nats a frame.")
    entropy_test: float | None = Field(
        None, description="Nats a frame; null where nothing was kept for a test."
    )
    sources: list[str] = Field(default_factory=list)
    problem: str = ""


class BehaviourList(Answer):
    """The workspace's models by name."""

    models: list[BehaviourLine]


class LimbShape(Answer):
    """A limb as a picture needs it: radii at its two ends, mm."""

    name: str
    side: str
    radius_start: float
    radius_end: float


class ClusterPicture(Answer):
    """An elementary movement. share: of the training frames. stays: frames in a row, in the mean. limbs: of its
    prototype. arrows: from where to where the extremities go in `BehaviourDetail.arrow_seconds`, at the mean of the
    cluster's derivatives. source: the recording of the prototype, frame: its frame in it.
    """

    cluster: int
    share: float
    stays: float
    limbs: Limbs
    arrows: Limbs
    source: str
    frame: int


class Transition(Answer):
    """How often a cluster follows another, of the times that the first is left."""

    source: int
    target: int
    probability: float


class BehaviourDetail(Answer):
    """A model. clusters: most frequent first. transitions: between different clusters, memory left aside.
    context_lengths: states of the automaton by the length of their history, 0 first; kept_lengths: those of them that
    passed the ε test. problem: why no poses can be shown, "" if they can.
    """

    model: BehaviourLine
    problem: str = ""
    limbs: list[LimbShape]
    arrow_seconds: float
    clusters: list[ClusterPicture]
    transitions: list[Transition]
    context_lengths: list[int]
    kept_lengths: list[int]


class EntropyLine(Answer):
    """Entropies over memory for one ε, nats a frame: of what the automaton was learnt from, and of the rest."""

    epsilon: float
    memory: list[int]
    states: list[int]
    train: list[float]
    test: list[float]


class Entropies(Answer):
    """The automaton learnt again from four of five recordings (where there are fewer than five: four fifths of each),
    tested on the rest.
    """

    lines: list[EntropyLine]


class GeneratedWalk(Answer):
    """A walk through the automaton. frames: limbs of every frame; clusters, histories: where it is in each."""

    seed: int
    fps: float
    frames: list[Limbs]
    clusters: list[int]
    histories: list[list[int]]


IntArray = NDArray[np.int64]
ARROW_SECONDS = 0.2
LEAST_TRANSITION = 0.02
"""Transitions that are rarer than this, of the times a cluster is left, would only blacken the picture."""
MEMORIES = (1, 2, 3, 5, 8, 10, 15, 20, 30)
EPSILON_FACTORS = (1.0, 10.0)
FIFTH = 5
FAR_END = 1


def model_path(behaviour: str, app: App) -> Path:
    """The file of the model that an address names, as a dependency. Raises NameRefused, NotFoundError."""
    return stored_model(app.workspace, behaviour)


Named = Annotated[Path, Depends(model_path)]


@router.get("")
def behaviours(app: App) -> BehaviourList:
    """The workspace's behaviour models."""
    return BehaviourList(models=[line_of(summary) for summary in list_models(app.workspace)])


@router.get("/{behaviour}")
def behaviour_detail(path: Named, app: App) -> BehaviourDetail:
    """Clusters as poses, which follows which, the automaton's states by the length of their history.

    Of a model whose body is gone or another one by now, `problem` says so; it has no poses to show then.
    """
    summary, model = summary_of(path), _model(path, path.stat().st_mtime_ns)
    try:
        return detail_of(summary, model, _body_of(model, app))
    except BehaviourError as problem:
        return bodiless_detail(summary, model, str(problem))


@router.patch("/{behaviour}")
def rename(behaviour: str, request: ModelName, app: App) -> ModelName:
    """Give it another name. Runs keep the copy that they were made with."""
    return ModelName(name=rename_model(app.workspace, behaviour, request.name).stem)


@router.delete("/{behaviour}")
def delete(behaviour: str, app: App) -> TrashEntry:
    """Move it to the trash. Runs keep the copy that they were made with."""
    return trash_entry(throw_away_model(app.workspace, behaviour))


@router.get("/{behaviour}/entropies")
def behaviour_entropies(path: Named) -> Entropies:
    """Entropies over memory, for choosing memory and ε by; takes some seconds for large models."""
    return entropies_of(_model(path, path.stat().st_mtime_ns))


@router.get("/{behaviour}/walk")
def behaviour_walk(
    path: Named,
    app: App,
    frames: Annotated[int, Query(ge=2, le=MOST_FRAMES)] = 300,
    seed: Annotated[int, Query(ge=0, le=2**31 - 1)] = 0,
) -> GeneratedWalk:
    """A walk through the automaton, as movement."""
    model = _model(path, path.stat().st_mtime_ns)
    return walk_of(model, _body_of(model, app), frames, seed)


@lru_cache(maxsize=KEPT_MODELS)
def _model(path: Path, _changed: int) -> BehaviourModel:
    return read_model(path)


def _body_of(model: BehaviourModel, app: AppState) -> BodyModel:
    """A body of the model's kind, the studio's or the workspace's own. Raises BehaviourError where it is gone."""
    name = model.space.body
    try:
        body = load_body(name, (app.workspace.root / BODIES_NAME,))
        model.space.check_body(body)
    except BodyError:
        raise BehaviourError(
            f"The model's body '{name}' is not here any more, so its movements cannot be drawn.",
            "Put the body back, or learn the model anew on another one.",
        ) from None
    except BehaviourError as problem:
        raise BehaviourError(
            f"The body '{name}' has changed since the model was learnt: {problem.message}",
            "Put the old body back or learn the model anew.",
        ) from None
    return body


def line_of(summary: ModelSummary) -> BehaviourLine:
    """A model in a list."""
    entries = {name: value for name, value in asdict(summary).items() if name != "path"}
    for name in ("entropy_train", "entropy_test"):
        entries[name] = None if math.isnan(entries[name]) else entries[name]
    return BehaviourLine(**entries)


def detail_of(summary: ModelSummary, model: BehaviourModel, body: BodyModel) -> BehaviourDetail:
    """Everything about a model but its entropies and walks. body : of the model's parameters."""
    counts = _transition_counts(model)
    return bodiless_detail(summary, model).model_copy(
        update={
            "limbs": [
                LimbShape(
                    name=limb.name, side=limb.side, radius_start=limb.radius_start, radius_end=limb.radius_end
                )
                for limb in body.drawn
            ],
            "clusters": _clusters(model, body),
            "transitions": _transitions(counts),
        }
    )


def bodiless_detail(summary: ModelSummary, model: BehaviourModel, problem: str = "") -> BehaviourDetail:
    """What can be said of a model without its body. problem : why there is none."""
    lengths = np.array([len(context) for context in model.automaton.contexts])
    most = int(lengths.max()) + 1
    return BehaviourDetail(
        model=line_of(summary),
        problem=problem,
        limbs=[],
        arrow_seconds=ARROW_SECONDS,
        clusters=[],
        transitions=[],
        context_lengths=np.bincount(lengths, minlength=most).tolist(),
        kept_lengths=np.bincount(lengths[model.automaton.kept], minlength=most).tolist(),
    )


def entropies_of(model: BehaviourModel) -> Entropies:
    """Eq. 2 over memory, at the model's own ε and at a larger one."""
    train, test = _parted(model.making.labels)
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
    return Entropies(lines=lines)


def _parted(recordings: tuple[IntArray, ...]) -> tuple[list[IntArray], list[IntArray]]:
    """Labels to learn from and to test on: every fifth recording, or the last fifth of each where there are few."""
    if len(recordings) >= FIFTH:
        kept = [labels for place, labels in enumerate(recordings) if place % FIFTH != FIFTH - 1]
        return kept, list(recordings[FIFTH - 1 :: FIFTH])
    ends = [max(1, len(labels) - len(labels) // FIFTH) for labels in recordings]
    parts = list(zip(recordings, ends, strict=True))
    return [labels[:end] for labels, end in parts], [
        labels[end:] for labels, end in parts if len(labels) > end
    ]


def walk_of(model: BehaviourModel, body: BodyModel, frames: int, seed: int) -> GeneratedWalk:
    """A walk through the automaton and the movement it makes; the same for the same seed."""
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


def _transition_counts(model: BehaviourModel) -> Array:
    """(K, K) how often each cluster follows each in the training recordings."""
    counts = np.zeros((model.clusters, model.clusters))
    for labels in model.making.labels:
        np.add.at(counts, (labels[:-1], labels[1:]), 1.0)
    return counts


def _transitions(counts: Array) -> list[Transition]:
    leaving = counts - np.diag(np.diag(counts))
    shares = leaving / np.maximum(leaving.sum(axis=1, keepdims=True), 1.0)
    return [
        Transition(source=int(source), target=int(target), probability=float(shares[source, target]))
        for source, target in np.argwhere(shares >= LEAST_TRANSITION)
    ]


def _rounded(points: Array) -> list[Any]:
    """Millimetres; a tenth is finer than any screen."""
    return np.round(points, 1).tolist()
