"""What a page shows of a behaviour model: clusters as poses, which follow which, entropies, generated movement."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.arrays import Array
from studio.behaviour.generation import generate
from studio.behaviour.model import BehaviourModel, automaton_of
from studio.body.forward_kinematics import limb_ends
from studio.body.model import BodyModel, extremities
from studio.server.behaviour_schemas import (
    BehaviourDetail,
    BehaviourLine,
    ClusterPicture,
    Entropies,
    EntropyLine,
    GeneratedWalk,
    LimbShape,
    Transition,
)
from studio.training.model_repository import ModelSummary

IntArray = NDArray[np.int64]

ARROW_SECONDS = 0.2
LEAST_TRANSITION = 0.02
"""Transitions that are rarer than this, of the times a cluster is left, would only blacken the picture."""
MEMORIES = (1, 2, 3, 5, 8, 10, 15, 20, 30)
EPSILON_FACTORS = (1.0, 10.0)
FIFTH = 5
FAR_END = 1


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
