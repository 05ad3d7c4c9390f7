"""How wide a cluster must be at least: the floor of the mixture's covariances, beyond the paper.

Oversampling adds near-copies of every frame, so that clusters shrink onto the frames that were learnt: without a floor
nearly all training frames lie in some cluster's 99 % ellipsoid and few frames of another performance do, which are then
labelled by chance. Each floor (a share of the variance of every dimension in which clusters are found) is judged by
what it is for: the entropy of performances that were not learnt (Eq. 2), the frames of them inside some cluster, and
the tracking of both exercises by the printed tracker and by ours, with blobs fitted from the true pose.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from studio.body.catalogue import load_body
from studio.garden.reproduction.caillette.clusters_and_states import frames_inside
from studio.garden.reproduction.caillette.comparing import by_candidate, limb, position, ratio, summary_table
from studio.garden.reproduction.caillette.following import Followed, follow_trial
from studio.garden.reproduction.caillette.following import measure as measure_following
from studio.garden.reproduction.caillette.setting import (
    BLOBS,
    LEARNT_AS_PRINTED,
    TEST,
    TEST_2,
    guided,
    last_frame,
    printed,
    training_with,
    training_words,
)
from studio.garden.reproduction.caillette.training_set import Training, learnt, recorded
from studio.garden.reproduction.drawing import line_chart, seed_range
from studio.garden.reproduction.experiment import Part, each_seed, group_of, listed
from studio.results.comparison.findings import Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as

FLOORS = (0.0, 0.003, 0.01, 0.02, 0.03, 0.05, 0.1)
QUICK_FLOORS = (0.0, 0.02)
MEMORIES = (1, 10, 20, 30)
MEMORY, FRAMES = 20, 150
LEARNT_SEEDS = 2
"""Seeds of what is learnt (a minute each); runs have all seeds, and track with what the first has learnt."""
EXERCISES = {"first exercise": TEST, "second exercise": TEST_2}
PARTICLES = 200
PRINTED, OURS = "printed", "guided"
PAPER_CLUSTERS = 122


def _name(floor: float) -> str:
    return f"floor {floor:g}"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """What is learnt with each floor, and what is tracked with it."""
    planned: list[Trial] = []
    for floor in QUICK_FLOORS if scale.quick else FLOORS:
        knobs: Mapping[str, Any] = {"cluster_floor": floor}
        base = training_with(MEMORY, scale.quick, knobs)
        planned += each_seed(
            f"learnt, {_name(floor)}",
            scale.seeds[:LEARNT_SEEDS],
            # The last frame as of the tracked trials: no more is to be rendered.
            lambda seed, base=base: {
                "learnt": dataclasses.replace(base, seed=seed).plain(),
                "last": last_frame(TEST, scale.quick, FRAMES),
            },
        )
        pairs = (
            (PRINTED, printed(PARTICLES), {**LEARNT_AS_PRINTED, **knobs}),
            (OURS, guided(PARTICLES), knobs),
        )
        for clip, footage in EXERCISES.items():
            for kind, one, learning in pairs:
                planned += [
                    follow_trial(
                        one,
                        f"{kind}, {clip}, {_name(floor)}",
                        footage,
                        seed,
                        last_frame(footage, scale.quick, FRAMES),
                        from_truth=True,
                        training=training_with(MEMORY, scale.quick, learning),
                    )
                    for seed in scale.seeds
                ]
    return tuple(planned)


@kept_as("caillette.cluster_floor.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Track; or learn: clusters, states and entropies by memory, share of each exercise's frames inside a cluster."""
    if "learnt" not in arguments:
        return measure_following(arguments, cache)
    wanted = Training.of_plain(arguments["learnt"])
    model, body = learnt(cache, wanted).model, load_body(wanted.body)
    performances = {clip: recorded(cache, footage, body).poses for clip, footage in EXERCISES.items()}
    labels = {clip: [model.labels(poses)] for clip, poses in performances.items()}
    rows: list[dict[str, Any]] = []
    for memory in MEMORIES:
        other = model.with_automaton(dataclasses.replace(wanted, memory=memory).settings())
        entropies = {clip: other.automaton.entropy(own) for clip, own in labels.items()}
        rows.append(
            {"memory": memory, "states": other.states, "train": other.making.entropy_train, **entropies}
        )
    inside = {clip: frames_inside(model, [poses]) for clip, poses in performances.items()}
    return {"clusters": model.clusters, "inside": inside, "rows": rows}


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Entropies, frames inside and tracking, by floor."""
    learning: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        if "learnt" in outcome.trial.arguments:
            name = group_of(outcome.trial).removeprefix("learnt, ")
            learning.setdefault(name, []).append(outcome.measured)
    runs = by_candidate(outcome for outcome in outcomes if "learnt" not in outcome.trial.arguments)
    floors = [float(name.removeprefix("floor ")) for name in learning]

    def of(kind: str, clip: str, name: str) -> list[Followed]:
        return runs[f"{kind}, {clip}, {name}"]

    rows: list[tuple[Any, ...]] = []
    for name, of_name in learning.items():
        yield number(f"clusters, {name}", [one["clusters"] for one in of_name])
        for clip in EXERCISES:
            inside = [100.0 * one["inside"][clip] for one in of_name]
            yield number(f"frames of the {clip} inside a cluster, {name}", inside, "%")
        for place, memory in enumerate(MEMORIES):
            cells = [[one["rows"][place][key] for one in of_name] for key in ("states", "train", *EXERCISES)]
            rows.append((name, memory, *(round(float(np.mean(cell)), 3) for cell in cells)))
    for kind in (PRINTED, OURS):
        for clip in EXERCISES:
            for name in list(learning)[1:]:
                for words, measured in (("limb direction", limb), ("joint position", position)):
                    bare = _name(floors[0])
                    yield ratio(
                        f"{kind}, {clip}: {name} over {bare}, {words}",
                        of(kind, clip, name),
                        of(kind, clip, bare),
                        "",
                        measured,
                    )
    yield (
        f"Over both exercises and their test performances. The paper found {PAPER_CLUSTERS} clusters, and entropies "
        "that fall with memory. A floor's use shows in performances that were not learnt."
    )
    heads = ("floor", "memory", "states", "entropy, training", *(f"entropy, {clip}" for clip in EXERCISES))
    yield Table("States and entropies (nats a frame)", heads, tuple(rows))
    yield summary_table(f"{PARTICLES} guided particles", runs)
    axis = "floor (share of each dimension's variance)"
    places = tuple(floors)
    for clip in EXERCISES:
        series = [
            Series(
                f"memory {memory}",
                places,
                tuple(
                    float(np.mean([one["rows"][place][clip] for one in learnt]))
                    for learnt in learning.values()
                ),
            )
            for place, memory in enumerate(MEMORIES)
        ]
        yield line_chart(f"Entropy of the {clip}, not learnt", axis, "entropy (nats a frame)", series)
        tracked = [
            seed_range(
                kind,
                places,
                [[run.limb_rms for run in of(kind, clip, name)] for name in learning],
                group=kind,
            )
            for kind in (PRINTED, OURS)
        ]
        yield line_chart(f"Tracking of the {clip}", axis, "RMS limb direction error (°)", tracked)
    quick = any(
        len(outcome.trial.arguments["training"]["sources"]) == 1
        for outcome in outcomes
        if "learnt" not in outcome.trial.arguments
    )
    yield {"memory": MEMORY, "particles": PARTICLES, "weighting": BLOBS, "training": training_words(quick)}


EXPERIMENTS = (listed("caillette-cluster-floor", trials, measure, shown, footage=tuple(EXERCISES.values())),)
