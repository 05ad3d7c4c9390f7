"""Fig. 13: how long the model should remember, 200 particles.

A memory of one frame (a first-order Markov model) wastes particles on the wrong clusters, says the paper; longer ones
are more accurate. Beside the tracker's error stands what the automaton itself tells of the test performance: its
entropy (Eq. 2), which is what a longer memory can better at all.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studio.body.catalogue import load_body
from studio.comparison.findings import Chart, Findings, Number, Series
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.caillette.comparing import (
    Groups,
    angle,
    by_contender,
    mean_of,
    position,
    ratio,
    summary_table,
)
from studio.reproduction.caillette.following import follow_trial
from studio.reproduction.caillette.following import measure as measure_following
from studio.reproduction.caillette.setting import (
    BLOBS,
    SOURCE,
    TEST,
    guided,
    last_frame,
    training,
    training_words,
)
from studio.reproduction.caillette.training_set import Training, learnt, recorded
from studio.reproduction.experiment import Experiment

MEMORIES = (1, 2, 5, 10, 20, 30)
FEW = guided(200)
FRAMES = 200
"""Before the pirouettes, in which every tracker is lost whatever its model remembers."""


def group(memory: int) -> str:
    """The words for a memory."""
    return f"memory {memory}"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every memory with every seed, and what each automaton says of the test performance."""
    last, taught = last_frame(TEST, scale.quick, FRAMES), training(scale.quick)
    found = []
    for memory in MEMORIES:
        model = dataclasses.replace(taught, memory=memory)
        found += [
            follow_trial(FEW, group(memory), TEST, seed, last, from_truth=True, training=model)
            for seed in scale.seeds
        ]
        found.append(Trial(f"entropy, {group(memory)}", {"entropy_of": TEST, "last": last, **model.plain()}))
    return tuple(found)


@kept_as("caillette.fig_13.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Track, or (where the arguments are a training set) ask the automaton."""
    if "entropy_of" not in arguments:
        return measure_following(arguments, shelf)
    wanted = {name: value for name, value in arguments.items() if name not in ("entropy_of", "last")}
    model = learnt(shelf, Training.of_plain(wanted)).model
    labels = model.labels(recorded(shelf, arguments["entropy_of"], load_body(model.space.body)).poses)
    return {
        "stays": float(np.mean(labels[1:] == labels[:-1])),
        "states": model.states,
        "train": model.making.entropy_train,
        "test": model.automaton.entropy([labels]),
    }


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Longer memory helps, or why not."""
    runs = [outcome for outcome in outcomes if "entropy_of" not in outcome.trial.arguments]
    asked = [outcome.measured for outcome in outcomes if "entropy_of" in outcome.trial.arguments]
    groups = by_contender(runs)
    first, last = groups[group(MEMORIES[0])], groups[group(MEMORIES[-1])]
    errors = [mean_of(groups[group(memory)]) for memory in MEMORIES]
    falling = [_falls(groups, seed) for seed in range(len(first))]
    claims = (
        ratio(f"memory {MEMORIES[-1]} over memory 1", last, first, "lower"),
        ratio("memory 10 over memory 1", groups[group(10)], first, "lower"),
    )
    others = (
        ratio(f"memory {MEMORIES[-1]} over memory 1, joint angle", last, first, "", angle),
        ratio(f"memory {MEMORIES[-1]} over memory 1, joint position", last, first, "", position),
        number("rank correlation of error and memory", falling, ""),
        *(
            number(f"limb direction, RMS: {name}", [run.limb_rms for run in runs_], "°")
            for name, runs_ in groups.items()
        ),
    )
    listed = ", ".join(f"{error:.1f}" for error in errors)
    words = (
        f"RMS error of limb directions with memory {', '.join(map(str, MEMORIES))}: {listed}°, states "
        f"{', '.join(str(entry['states']) for entry in asked)}. " + _reason(claims, asked)
    )
    return Findings(
        overall(entry.verdict for entry in claims),
        words,
        (*claims, *others),
        (summary_table("200 guided particles", groups),),
        (_chart(groups), _entropies(asked)),
        {"footage": TEST, "weighting": BLOBS, "particles": 200, "training": training_words(_quick(runs))},
    )


def _falls(groups: Groups, seed: int) -> float:
    errors = [groups[group(memory)][seed].limb_rms for memory in MEMORIES]
    ranks = np.argsort(np.argsort(errors))
    return float(np.corrcoef(np.arange(len(ranks)), ranks)[0, 1])


def _reason(claims: Sequence[Number], asked: Sequence[Mapping[str, Any]]) -> str:
    """What the automata say of the test, where a longer memory does not help."""
    tests = [entry["test"] for entry in asked]
    best = MEMORIES[int(np.argmin(tests))]
    said = (
        f"The automaton's entropy on the test performance is {', '.join(f'{value:.2f}' for value in tests)} nats a "
        f"frame (training {asked[0]['train']:.2f} to {asked[-1]['train']:.2f}), least with memory {best}"
    )
    if all(claim.verdict != "not reproduced" for claim in claims):
        return f"A longer memory helps. {said}."
    return (
        f"A longer memory does not help here. {said}: what long histories add is the training's own, which another "
        f"performance does not repeat. From frame to frame the test stays in its cluster {100 * asked[0]['stays']:.0f} "
        "% of the time, so a memory of some frames often is one cluster again and again."
    )


def _chart(groups: Groups) -> Chart:
    values = [[run.limb_rms for run in groups[group(memory)]] for memory in MEMORIES]
    series = Series(
        "200 guided particles (bars: lowest and highest seed)",
        tuple(float(memory) for memory in MEMORIES),
        tuple(float(np.mean(row)) for row in values),
        low=tuple(min(row) for row in values),
        high=tuple(max(row) for row in values),
    )
    return Chart("Error over memory", "lines", "memory (frames)", "RMS limb direction error (°)", (series,))


def _entropies(asked: Sequence[Mapping[str, Any]]) -> Chart:
    memories = tuple(float(memory) for memory in MEMORIES)
    series = tuple(
        Series(label, memories, tuple(float(entry[name]) for entry in asked))
        for name, label in (("train", "training"), ("test", "test performance"))
    )
    return Chart("Entropy over memory", "lines", "memory (frames)", "entropy (nats a frame)", series)


def _quick(runs: Sequence[Outcome]) -> bool:
    return len(runs[0].trial.arguments["training"]["sources"]) == 1


EXPERIMENT = Experiment(
    name="caillette-fig-13",
    title="Error over the model's memory",
    source=f"{SOURCE}, Fig. 13",
    claim="With 200 particles a memory of one frame wastes them on the wrong clusters; longer memories, up to 30 "
    "frames, are more accurate.",
    trials=trials,
    measure=measure,
    conclude=conclude,
    footage=(TEST,),
)
