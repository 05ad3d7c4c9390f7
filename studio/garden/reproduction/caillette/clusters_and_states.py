"""Section 7.1: how many clusters the dance has and how many states the automaton, for several memories and ε.

The paper finds 122 clusters in both exercises (about 1400 frames performed three times), 5 in an "arms pointing"
sequence, and 948 and 2890 states with memories of 10 and 30. Its ε is not printed. Memory and ε are chosen by the
entropies (Eq. 2) of the training and of other performances (section 4.2).
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import chi2

from studio.body.catalogue import load_body
from studio.foundations.arrays import Array
from studio.garden.reproduction.caillette.setting import TEST, TEST_2, UNSEEN, training, training_words
from studio.garden.reproduction.caillette.training_set import POINTING, Training, learnt, recorded
from studio.garden.reproduction.claims import share
from studio.garden.reproduction.drawing import heat_chart, line_chart
from studio.garden.reproduction.experiment import Part, each_seed, listed
from studio.results.comparison.findings import FIRM_SEEDS, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.search.behaviour.model import BehaviourModel

PAPER_CLUSTERS, PAPER_POINTING = 122.0, 5.0
PAPER_STATES: Mapping[int, float] = {10: 948.0, 30: 2890.0}
MEMORIES = (0, 1, 2, 5, 10, 20, 30)
EPSILONS = (0.05, 0.5, 2.0)
SHOWN_EPSILON = EPSILONS[0]
DANCE, OVERSAMPLED = "dance", "pointing, oversampled"
FEW_SEEDS = 2
"""Settings of pointing oversampled as the dance, which is not in the paper."""
SETS = TRAIN, TEST_SET, NEVER = "training", "test performances", "clip never learnt"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Dance and pointing, learnt with every seed from other performances; tracking uses the first one's models."""
    one = Training((POINTING,), performances=1, smoothings=1)
    kinds = (
        (DANCE, FIRM_SEEDS, training(scale.quick)),
        (POINTING, FIRM_SEEDS, one),
        (OVERSAMPLED, FEW_SEEDS, Training((POINTING,))),
    )

    def arguments(kind: str, material: Training, seed: int) -> dict[str, Any]:
        return {"kind": kind, "training": dataclasses.replace(material, seed=seed).plain()}

    return tuple(
        trial
        for kind, seeds, material in kinds
        for trial in each_seed(kind, scale.seeds[:seeds], partial(arguments, kind, material))
    )


@kept_as("caillette.clusters_and_states.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Clusters; of the dance states and entropies (nats a frame) for every memory and ε."""
    trained_on = Training.of_plain(arguments["training"])
    lesson = learnt(cache, trained_on)
    model = lesson.model
    figures: dict[str, Any] = {
        "clusters": model.clusters,
        "frames": lesson.frames,
        "seconds": lesson.seconds,
        "kept": model.reduction.kept,
    }
    if arguments["kind"] != DANCE:
        return figures
    body = load_body(trained_on.body)
    tests = (TEST, TEST_2)[: len(trained_on.sources)]
    poses = {
        TRAIN: [recorded(cache, name, body).poses for name in trained_on.sources],
        TEST_SET: [recorded(cache, name, body).poses for name in tests],
        NEVER: [recorded(cache, UNSEEN, body).poses],
    }
    figures["inside"] = {name: frames_inside(model, own) for name, own in poses.items()}
    labels = {name: [model.labels(one) for one in poses[name]] for name in (TEST_SET, NEVER)}
    cells: list[dict[str, Any]] = []
    for epsilon in EPSILONS:
        for memory in MEMORIES:
            settings = dataclasses.replace(trained_on, memory=memory, epsilon=epsilon).settings()
            other = model.with_automaton(settings)
            entropies = {name: other.automaton.entropy(own) for name, own in labels.items()}
            entropies[TRAIN] = other.making.entropy_train
            cells.append({"memory": memory, "epsilon": epsilon, "states": other.states, **entropies})
    return {**figures, "cells": cells}


def frames_inside(model: BehaviourModel, recordings: Sequence[Array]) -> float:
    """Share of the frames that lie within the 99 % ellipsoid of some cluster, where clusters are found."""
    mixture = model.mixture
    points = np.concatenate([model.reduction.reduced(model.space.features(poses)) for poses in recordings])
    nearest = np.full(len(points), np.inf)
    for mean, whitener in zip(mixture.means, mixture.whiteners, strict=True):
        nearest = np.minimum(nearest, (((points - mean) @ whitener.T) ** 2).sum(axis=1))
    return float(np.mean(nearest <= chi2.ppf(0.99, points.shape[1])))


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Numbers beside the paper's; effect of memory and ε on the entropies."""
    dance, pointing, many = (
        [outcome.measured for outcome in outcomes if outcome.trial.arguments["kind"] == kind]
        for kind in (DANCE, POINTING, OVERSAMPLED)
    )

    def cells(name: str, memory: int, epsilon: float = SHOWN_EPSILON) -> list[float]:
        """A cell's value in every seed."""
        return [
            float(cell[name])
            for entry in dance
            for cell in entry["cells"]
            if cell["memory"] == memory and cell["epsilon"] == epsilon
        ]

    def mean(name: str, memory: int, epsilon: float = SHOWN_EPSILON) -> float:
        return float(np.mean(cells(name, memory, epsilon)))

    yield number("clusters of the dance", [entry["clusters"] for entry in dance], paper=PAPER_CLUSTERS)
    name = "clusters of pointing with an arm"
    yield number(name, [entry["clusters"] for entry in pointing], paper=PAPER_POINTING)
    for memory, paper in PAPER_STATES.items():
        yield number(f"states with memory {memory}", cells("states", memory), paper=paper)
    states = np.array([cells("states", memory) for memory in MEMORIES])
    yield share(
        "a longer memory has more states, up to 30 frames", np.all(np.diff(states, axis=0) > 0, axis=0)
    )
    yield number("clusters of pointing, oversampled as the dance", [entry["clusters"] for entry in many])
    for name in SETS:
        inside = [100.0 * entry["inside"][name] for entry in dance]
        yield number(f"frames inside a cluster, {name}", inside, "%")
    for memory in (1, 10, 30):
        for name in SETS:
            yield number(f"entropy, {name}, memory {memory}", cells(name, memory), "nats a frame")
    yield number("frames learnt from", [entry["frames"] for entry in dance])
    yield (
        "The numbers belong to the material: our exercises are other dances, and clusters are found in principal "
        f"components that keep {np.mean([entry['kept'] for entry in dance]):.0%} of the variance. Pointing is learnt "
        "from one recording as it is; oversampled, copies that differ little count as so many independent frames when "
        "the number of clusters is chosen."
    )
    columns = ("states", *SETS)
    rows = tuple(
        (memory, epsilon, *(round(mean(name, memory, epsilon), 3) for name in columns))
        for epsilon in EPSILONS
        for memory in MEMORIES
    )
    yield Table("States and entropies (nats a frame)", ("memory", "ε", *columns), rows)
    memories, axis = tuple(map(float, MEMORIES)), "memory (frames)"

    def over_memory(name: str, label: str = "") -> Series:
        return Series(label or name, memories, tuple(mean(name, memory) for memory in MEMORIES))

    title = f"Entropy over memory, ε = {SHOWN_EPSILON:g}"
    yield line_chart(title, axis, "entropy (nats a frame)", map(over_memory, SETS))
    printed = Series("paper", tuple(map(float, PAPER_STATES)), tuple(PAPER_STATES.values()), dashed=True)
    yield line_chart("States over memory", axis, "states", (over_memory("states", "ours"), printed))
    for name in (TRAIN, TEST_SET):
        heat = {
            f"ε {epsilon:g}": [mean(name, memory, epsilon) for memory in MEMORIES] for epsilon in EPSILONS
        }
        title = f"Entropy, {name} (nats a frame)"
        yield heat_chart(title, axis, "ε", map(str, MEMORIES), heat, digits=3)
    trained_on = Training.of_plain(outcomes[0].trial.arguments["training"])
    yield {
        "training": training_words(len(trained_on.sources) == 1),
        "ε": SHOWN_EPSILON,
        "dimensions the clusters are found in": trained_on.settings().reduced_dimensions,
    }


EXPERIMENTS = (listed("caillette-clusters", trials, measure, shown),)
