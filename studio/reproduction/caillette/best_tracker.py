"""Which tracker a user should take for the dance, with and without a model of it: the paper's parts in all combinations
that make sense, tracking as a run does, at equal evaluations.

The paper compares dynamics with its own weighting alone. Here its blobs stand beside edges, region and silhouette, and
its prediction beside noise, in its own tracker and as the first layer of the annealed filter.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from studio.comparison.findings import Findings, Number
from studio.comparison.statistics import number
from studio.comparison.trials import Outcome, Scale, Trial
from studio.reproduction.caillette.comparing import (
    POSITION,
    Groups,
    Runs,
    by_contender,
    curves,
    mean_of,
    position,
    ratio,
    summary_table,
)
from studio.reproduction.caillette.following import Followed, follow_trial, measure
from studio.reproduction.caillette.setting import (
    BLOBS,
    GUIDED,
    MEMORY,
    SIGMA,
    TEST,
    UNSEEN,
    last_frame,
    training,
    training_words,
)
from studio.reproduction.experiment import Experiment
from studio.reproduction.tracking import Contender
from studio.tracking.evaluations import knobs_for_evaluations

EVALUATIONS = 1000
FRAMES = 100
MOST_SEEDS = 3
"""There are eight contenders on two clips, and a weight of edges costs twenty times that of blobs."""
EDGES = "edge-region-silhouette"
PREDICTION = {"prediction": "behaviour"}


def contender(name: str, tracker: str, weighting: str, **changes: str) -> Contender:
    """A tracker of so many evaluations."""
    return Contender(
        name,
        tracker,
        weighting,
        {**knobs_for_evaluations(tracker, EVALUATIONS), **SIGMA, **changes},
    )


CONTENDERS = (
    contender("annealed, edges", "annealed", EDGES),
    contender("annealed, edges, behaviour first", "annealed", EDGES, **PREDICTION),
    contender("guided, edges", GUIDED, EDGES),
    contender("swarm, edges", "swarm", EDGES),
    contender("annealed, blobs", "annealed", BLOBS),
    contender("annealed, blobs, behaviour first", "annealed", BLOBS, **PREDICTION),
    contender("guided, blobs", GUIDED, BLOBS),
    contender("Condensation, edges", "condensation", EDGES),
)
LEARNT, STRANGE = "learnt dance", "clip never learnt"
CLIPS = {LEARNT: TEST, STRANGE: UNSEEN}


def needs_model(one: Contender) -> bool:
    """Whether a contender is guided."""
    return one.tracker == GUIDED or "prediction" in one.changes


def group(one: Contender, clip: str) -> str:
    """The words for a contender on a clip."""
    return f"{one.name}, {clip}"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every contender on both clips with every seed."""
    taught = dataclasses.replace(training(scale.quick), memory=MEMORY)
    found = []
    for clip, footage in CLIPS.items():
        last = last_frame(footage, scale.quick, FRAMES)
        for one in CONTENDERS:
            model = taught if needs_model(one) else None
            for seed in scale.seeds[:MOST_SEEDS]:
                found.append(follow_trial(one, group(one, clip), footage, seed, last, training=model))
    return tuple(found)


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """The nearest on each clip, and what the model's prediction and the blobs do for it."""
    groups = by_contender(outcomes)

    def runs(name: str, clip: str) -> list[Followed]:
        return groups[f"{name}, {clip}"]

    ratios = tuple(
        ratio(f"{label}, {clip}", runs(ours, clip), runs(theirs, clip), "", position)
        for clip in CLIPS
        for label, ours, theirs in (
            ("behaviour first over noise, edges", "annealed, edges, behaviour first", "annealed, edges"),
            ("behaviour first over noise, blobs", "annealed, blobs, behaviour first", "annealed, blobs"),
            ("guided over annealed, edges", "guided, edges", "annealed, edges"),
            ("blobs over edges, annealed", "annealed, blobs", "annealed, edges"),
        )
    )
    errors = tuple(_error(name, own) for name, own in groups.items())
    tables = tuple(
        summary_table(
            f"{EVALUATIONS} evaluations a frame, {clip}",
            _on(clip, groups),
        )
        for clip in CLIPS
    )
    charts = tuple(curves(f"RMS joint position error, {clip}", _on(clip, groups), POSITION) for clip in CLIPS)
    quick = any(_learnt_one(outcome) for outcome in outcomes)
    settings = {
        "evaluations": EVALUATIONS,
        "edges": EDGES,
        "memory": MEMORY,
        "training": training_words(quick),
    }
    return Findings("answered", _words(groups), (*ratios, *errors), tables, charts, settings)


def _on(clip: str, groups: Groups) -> dict[str, Runs]:
    """The groups of one clip."""
    return {name: runs for name, runs in groups.items() if name.endswith(clip)}


def _learnt_one(outcome: Outcome) -> bool:
    taught = outcome.trial.arguments["training"]
    return bool(taught) and len(taught["sources"]) == 1


def _error(name: str, runs: Sequence[Followed]) -> Number:
    return number(f"mean marker error: {name}", [run.mean_mm for run in runs], "mm")


def _words(groups: Groups) -> str:
    told = []
    for clip in CLIPS:
        own = _on(clip, groups)
        means = {
            name.removesuffix(f", {clip}"): float(np.mean([run.mean_mm for run in runs]))
            for name, runs in own.items()
        }
        order = sorted(means, key=lambda name: means[name])
        best = own[f"{order[0]}, {clip}"]
        told.append(
            f"On the {clip} the nearest is {order[0]}: {means[order[0]]:.0f} mm mean marker error, "
            f"{mean_of(best):.1f}° RMS limb direction, {np.mean([run.milliseconds for run in best]):.0f} ms a frame on "
            f"one core; then {order[1]} ({means[order[1]]:.0f} mm) and {order[2]} ({means[order[2]]:.0f} mm); the "
            f"furthest {order[-1]} ({means[order[-1]]:.0f} mm)."
        )
    return " ".join(told) + " Times are the search alone, without carving hulls or making edge maps."


EXPERIMENT = Experiment(
    name="caillette-best-tracker",
    title="Which tracker for the dance",
    source="an open question",
    claim="Which tracker and weighting is best for a user, with a model of the motion and without, at equal "
    "evaluations?",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=(TEST, UNSEEN),
)
