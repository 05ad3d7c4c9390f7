"""Section 7.5: what happens to the model, and to the time of learning and predicting, as classes of motion are added.

The paper leaves it to further research and expects: fewer clusters than in proportion, a longer time to learn, and a
prediction whose time "would remain largely unaffected".
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from studio.behaviour.prediction import propagate, start_states
from studio.comparison.findings import Chart, Findings, Series, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.caillette.setting import EXERCISE, EXERCISE_2, SOURCE
from studio.reproduction.caillette.training_set import Training, lesson_of
from studio.reproduction.deutscher_reid.setting import share_number
from studio.reproduction.drawing import line_chart, places
from studio.reproduction.experiment import Experiment

CLASSES = (EXERCISE, EXERCISE_2, "walk-with-turns", "run", "jumps", "handstand")
"""Recipes, whose motion is taken without rendering it."""
FRAMES, QUICK_FRAMES, QUICK_CLASSES = 150, 60, 3
MOST_SEEDS = 2
PARTICLES, ROUNDS = 1000, 12
UNAFFECTED = 2.0
"""Prediction with all classes takes at most so many times what it does with one."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One, two, … classes, with every seed."""
    names = CLASSES[:QUICK_CLASSES] if scale.quick else CLASSES
    frames = QUICK_FRAMES if scale.quick else FRAMES
    found = []
    for seed in scale.seeds[:MOST_SEEDS]:
        for count in range(1, len(names) + 1):
            training = Training(names[:count], frames=frames, seed=seed)
            found.append(
                Trial(f"{count} classes, seed {seed}", {"training": training.plain(), "alone": True})
            )
    return tuple(found)


@kept_as("caillette.scalability.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Sizes of the model, seconds to learn clusters and automaton, milliseconds to predict 1000 particles."""
    training = Training.of_plain(arguments["training"])
    lesson = lesson_of(shelf, training)
    model = lesson.model
    began = time.perf_counter()
    model.with_automaton(training.settings())
    automaton = time.perf_counter() - began
    rng = np.random.default_rng(training.seed)
    now = start_states(rng, model, PARTICLES)
    spent = []
    for _ in range(ROUNDS + 1):
        began = time.perf_counter()
        now = propagate(rng, model, now.states, now.values, now.velocities, 0.3)
        spent.append(1000.0 * (time.perf_counter() - began))
    return {
        "frames": lesson.frames,
        "clusters": model.clusters,
        "states": model.states,
        "learning": lesson.seconds,
        "automaton": automaton,
        "prediction": float(np.median(spent[1:])),
    }


def conclude(outcomes: Sequence[Outcome]) -> Findings:
    """Curves over the number of classes; the verdict is on what the paper expects."""
    seeds = sorted({outcome.trial.arguments["training"]["seed"] for outcome in outcomes})
    rows = [
        [outcome for outcome in outcomes if outcome.trial.arguments["training"]["seed"] == seed]
        for seed in seeds
    ]
    runs = [[outcome.measured for outcome in row] for row in rows]
    names = outcomes[-1].trial.arguments["training"]["sources"]

    def growth(name: str) -> list[float]:
        return [row[-1][name] / max(row[0][name], 1e-9) for row in runs]

    more = growth("frames")
    slower = [ratio < frames for ratio, frames in zip(growth("clusters"), more, strict=True)]
    steady = [ratio < UNAFFECTED for ratio in growth("prediction")]
    claims = (
        share_number("clusters grow less than the training material", slower),
        share_number(
            f"prediction with all classes takes less than {UNAFFECTED:g} times that with one", steady
        ),
    )
    others = tuple(
        number(f"{label}, all classes over one", growth(name), "×") for name, label in LABELS.items()
    ) + tuple(number(f"{label}, all classes", [row[-1][name] for row in runs], unit) for name, label, unit in (
        ("clusters", "clusters", ""), ("states", "states", ""), ("learning", "time to learn", "s"),
        ("prediction", "time to predict 1000 particles", "ms"),
    ))  # fmt: skip
    means = {
        name: [float(np.mean([row[place][name] for row in runs])) for place in range(len(names))]
        for name in LABELS
    }
    words = (
        f"From {names[0]} alone to {len(names)} classes of motion ({_ends(means, 'frames')} frames) clusters go from "
        f"{_ends(means, 'clusters')}, states from {_ends(means, 'states')}, the time to learn from "
        f"{_ends(means, 'learning', 1)} s ({means['automaton'][-1]:.1f} s of it for the automaton) and the time to "
        f"predict {PARTICLES} particles from {_ends(means, 'prediction', 2)} ms."
    )
    return Findings(
        overall(entry.verdict for entry in claims),
        words,
        (*claims, *others),
        (_table(names, means),),
        _charts(means),
        {"classes": ", ".join(names), "memory": outcomes[0].trial.arguments["training"]["memory"]},
    )


LABELS = {
    "frames": "frames learnt from",
    "clusters": "clusters",
    "states": "states",
    "learning": "time to learn",
    "automaton": "time to learn the automaton",
    "prediction": "time to predict",
}


def _ends(means: Mapping[str, Sequence[float]], name: str, digits: int = 0) -> str:
    """With one class and with all."""
    return f"{means[name][0]:.{digits}f} to {means[name][-1]:.{digits}f}"


def _table(names: Sequence[str], means: Mapping[str, Sequence[float]]) -> Table:
    heads = ("frames", "clusters", "states", "learning (s)", "automaton (s)", "prediction (ms)")
    rows = tuple(
        (place + 1, name, *(round(means[key][place], 2) for key in LABELS))
        for place, name in enumerate(names)
    )
    return Table("Means over the seeds", ("classes", "the last one", *heads), rows)


def _charts(means: Mapping[str, Sequence[float]]) -> tuple[Chart, ...]:
    def chart(title: str, axis: str, keys: Mapping[str, str]) -> Chart:
        series = (
            Series(label, places(len(means[key]), first=1), tuple(means[key])) for key, label in keys.items()
        )
        return line_chart(title, "classes of motion", axis, series)

    return (
        chart("Clusters", "clusters", {"clusters": "clusters"}),
        chart("States", "states", {"states": "states"}),
        chart("Time to learn", "time (s)", {"learning": "all", "automaton": "automaton"}),
        chart(f"Time to predict {PARTICLES} particles", "time (ms)", {"prediction": "prediction"}),
    )


EXPERIMENT = Experiment(
    name="caillette-scalability",
    title="More classes of motion",
    source=f"{SOURCE}, section 7.5",
    claim="Clusters do not grow in proportion to the training data, learning takes longer, and the time to predict is "
    "largely unaffected.",
    trials=trials,
    measure=measure,
    conclude=conclude,
    alone=True,
)
