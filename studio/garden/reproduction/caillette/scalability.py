"""Section 7.5: size of the model, and times of learning and predicting, as classes of motion are added.

The paper leaves it to further research and expects: fewer clusters than in proportion, a longer time to learn, and a
prediction whose time "would remain largely unaffected".
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from studio.garden.reproduction.caillette.setting import EXERCISE, EXERCISE_2
from studio.garden.reproduction.caillette.training_set import Training, lesson_of
from studio.garden.reproduction.claims import share
from studio.garden.reproduction.drawing import line_chart, places
from studio.garden.reproduction.experiment import Part, listed
from studio.results.comparison.findings import FIRM_SEEDS, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.search.behaviour.prediction import propagate, start_states

CLASSES = (EXERCISE, EXERCISE_2, "walk-with-turns", "run", "jumps", "handstand")
"""Recipes, whose motion is used without rendering."""
FRAMES, QUICK_FRAMES, QUICK_CLASSES = 150, 60, 3
PARTICLES, ROUNDS = 1000, 12
UNAFFECTED = 2.0
"""Greatest time of prediction with all classes, relative to one class."""


def trials(scale: Scale) -> tuple[Trial, ...]:
    """One, two, … classes, with every seed."""
    names = CLASSES[:QUICK_CLASSES] if scale.quick else CLASSES
    frames = QUICK_FRAMES if scale.quick else FRAMES
    return tuple(
        Trial(
            f"{count} classes, seed {seed}",
            {"training": Training(names[:count], frames=frames, seed=seed).plain(), "alone": True},
        )
        for seed in scale.seeds[:FIRM_SEEDS]
        for count in range(1, len(names) + 1)
    )


@kept_as("caillette.scalability.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Sizes of the model, seconds to learn clusters and automaton, milliseconds to predict 1000 particles."""
    training = Training.of_plain(arguments["training"])
    lesson = lesson_of(cache, training)
    model = lesson.model
    began = time.perf_counter()
    model.with_automaton(training.settings())
    automaton = time.perf_counter() - began
    rng = np.random.default_rng(training.seed)
    now = start_states(rng, model, PARTICLES)
    spent: list[float] = []
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


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Curves over the number of classes; the verdict is on the paper's expectations."""
    seeds: dict[int, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        seeds.setdefault(outcome.trial.arguments["training"]["seed"], []).append(outcome.measured)
    # (S, C) by what is measured, over the classes.
    values = {name: np.array([[one[name] for one in row] for row in seeds.values()]) for name in LABELS}
    growth = {name: rows[:, -1] / np.maximum(rows[:, 0], 1e-9) for name, rows in values.items()}
    yield share("clusters grow less than the training material", growth["clusters"] < growth["frames"])
    claim = f"prediction with all classes takes less than {UNAFFECTED:g} times that with one"
    yield share(claim, growth["prediction"] < UNAFFECTED)
    for name, label in LABELS.items():
        yield number(f"{label}, all classes over one", growth[name], "×")
    for name, label, unit in (
        ("clusters", "clusters", ""),
        ("states", "states", ""),
        ("learning", "time to learn", "s"),
        ("prediction", f"time to predict {PARTICLES} particles", "ms"),
    ):
        yield number(f"{label}, all classes", values[name][:, -1], unit)
    training = outcomes[-1].trial.arguments["training"]
    means = {name: rows.mean(axis=0).tolist() for name, rows in values.items()}
    heads = ("frames", "clusters", "states", "learning (s)", "automaton (s)", "prediction (ms)")
    rows = tuple(
        (place, source, *(round(value, 2) for value in column))
        for place, (source, *column) in enumerate(zip(training["sources"], *means.values(), strict=True), 1)
    )
    yield Table("Means over the seeds", ("classes", "the last one", *heads), rows)
    for title, axis, keys in (
        ("Clusters", "clusters", {"clusters": "clusters"}),
        ("States", "states", {"states": "states"}),
        ("Time to learn", "time (s)", {"learning": "all", "automaton": "automaton"}),
        (f"Time to predict {PARTICLES} particles", "time (ms)", {"prediction": "prediction"}),
    ):
        series = (
            Series(label, places(len(means[key]), first=1), tuple(means[key])) for key, label in keys.items()
        )
        yield line_chart(title, "classes of motion", axis, series)
    yield {"classes": ", ".join(training["sources"]), "memory": training["memory"]}


LABELS = {
    "frames": "frames learnt from",
    "clusters": "clusters",
    "states": "states",
    "learning": "time to learn",
    "automaton": "time to learn the automaton",
    "prediction": "time to predict",
}


EXPERIMENTS = (listed("caillette-scalability", trials, measure, shown, alone=True),)
