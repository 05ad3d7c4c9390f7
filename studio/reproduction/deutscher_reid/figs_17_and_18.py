"""Figs. 17 and 18: the branched arms are localised from the hinge outwards, both arms side by side."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.comparison.findings import Chart, Findings, Series, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid import variance_reduction
from studio.reproduction.deutscher_reid.arms import localise
from studio.reproduction.deutscher_reid.setting import EQ18_WORDS, SOURCE, share_number, times_in_words
from studio.reproduction.deutscher_reid.variance_reduction import (
    FALLEN,
    SETTINGS,
    crossing_layers,
    crossing_table,
    listed,
    reduction_chart,
    reductions,
)
from studio.reproduction.experiment import Experiment

Array = NDArray[np.float64]

BRANCHED = "branched_arms6"
JOINTS = ("x1", "x2", "x3", "x4", "x5", "x6")
ARMS = ((0, 1, 2), (3, 4, 5))
KIND = "adaptive with crossover"
CROSSED: Mapping[str, Any] = {"adaptive_diffusion": True, "crossover": 1.0, "crossover_by": "parameters"}
LAYERS_18 = 8
# The particles' ends of a link lie together when they scatter by less than a fifth of its length.
GATHERED_MM = 50.0
# What Fig. 18 draws: the end of every link.
ENDS = (("RJoint1", "RJoint2", "RTip"), ("LJoint1", "LJoint2", "LTip"))
DRAWN_PARTICLES, DRAWN_SEED = 200, 0


def trials_fig_17(scale: Scale) -> tuple[Trial, ...]:
    """One search a seed."""
    return variance_reduction.trials(scale, {KIND: CROSSED}, BRANCHED)


def conclude_fig_17(outcomes: Sequence[Outcome]) -> Findings:
    """In each arm the joints fall in order, and the arms keep step."""
    found = reductions(outcomes)[KIND]
    in_order = [_rises(row) for row in found.crossings]
    steps = np.abs(found.crossings[:, ARMS[0]] - found.crossings[:, ARMS[1]])
    in_step = [bool(row.max() <= 1) for row in steps]
    numbers = (
        share_number("joints of both arms fall strictly from the hinge outwards", in_order),
        share_number("joints of equal rank fall within one layer", in_step),
        *(
            number(f"layer in which {name} falls", (found.crossings[:, column] + 1.0).tolist(), "")
            for column, name in enumerate(JOINTS)
        ),
        number("mean error of the reported pose", found.errors.mean(axis=1).tolist(), "rad"),
    )
    words = (
        f"In {times_in_words(in_order)} the variances of x1, x2, x3 and of x4, x5, x6 fall below "
        f"{FALLEN:.0%} one after "
        f"the other from the hinge outwards, and in {times_in_words(in_step)} joints of equal rank fall within one "
        f"layer (mean layers {listed(found.crossings.mean(axis=0) + 1.0)} of {SETTINGS['layers']}; "
        f"{SETTINGS['layers'] + 1} stands for a joint that does not fall). {EQ18_WORDS}"
    )
    charts = (reduction_chart("Variance reduction of the branched arms", found, JOINTS),)
    settings = {**SETTINGS, **CROSSED}
    verdict = overall(entry.verdict for entry in numbers)
    return Findings(verdict, words, numbers, (crossing_table({KIND: found}, JOINTS),), charts, settings)


def _rises(crossings: NDArray[np.int64]) -> bool:
    """Whether each arm's joints fall one after the other, the last ones within the search or never."""
    return all(bool(np.all(np.diff(crossings[list(arm)]) > 0)) for arm in ARMS)


def trials_fig_18(scale: Scale) -> tuple[Trial, ...]:
    """One search a seed, of eight layers."""
    knobs = {**SETTINGS, **CROSSED, "layers": LAYERS_18}
    return tuple(
        Trial(f"branched arms, seed {seed}", {"body": BRANCHED, "seed": seed, "knobs": knobs})
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.figs_17_and_18.measure_fig_18")
def measure_fig_18(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Per layer, how widely the ends of the links are scattered (mm), and of one seed where some of them lie."""
    del shelf
    seed, scene = int(arguments["seed"]), variance_reduction.scene(arguments["body"])
    _, records, truth = localise(scene, seed, **arguments["knobs"])
    names = [marker.name for marker in scene.body.markers]
    columns = [names.index(name) for arm in ENDS for name in arm]
    spreads, clouds = [], []
    for record in records:
        points = marker_points(scene.body, record.poses)[:, columns]
        spreads.append(np.sqrt(points.var(axis=0).sum(axis=1)).tolist())
        if seed == DRAWN_SEED:
            clouds.append(np.round(points[:DRAWN_PARTICLES, :, ::2], 1).tolist())
    true_ends = marker_points(scene.body, truth[None])[0, columns]
    return {"spreads": spreads, "clouds": clouds, "truth": true_ends[:, ::2].tolist()}


def conclude_fig_18(outcomes: Sequence[Outcome]) -> Findings:
    """Ends nearer the hinge gather in earlier layers."""
    spreads = np.array([outcome.measured["spreads"] for outcome in outcomes])
    names = [name for arm in ENDS for name in arm]
    crossings = crossing_layers(spreads, GATHERED_MM)
    in_order = [_rises(row) for row in crossings]
    numbers = (
        share_number("ends of both arms gather strictly from the hinge outwards", in_order),
        *(
            number(f"scatter of {name} after the last layer", spreads[:, -1, column].tolist(), "mm")
            for column, name in enumerate(names)
        ),
    )
    words = (
        f"In {times_in_words(in_order)} the particles' ends of the links gather (scatter below {GATHERED_MM:g} mm) one "
        f"after the other from the hinge outwards, in both arms (mean layers {listed(crossings.mean(axis=0) + 1.0)} of "
        f"{LAYERS_18}), as Fig. 18 shows. {EQ18_WORDS}"
    )
    layers = tuple(float(layer) for layer in range(1, LAYERS_18 + 1))
    fall = tuple(
        Series(name, layers, tuple(spreads[:, :, column].mean(axis=0)), group=name)
        for column, name in enumerate(names)
    )
    charts = (
        Chart(
            "Scatter of the links' ends over the layers", "lines", "layer", "scatter (mm)", fall, log_y=True
        ),
        *_cloud_charts(outcomes, names),
    )
    table = Table(
        "Mean scatter (mm) of the links' ends",
        ("layer", *names),
        tuple(
            (int(layer), *(round(float(value), 1) for value in row))
            for layer, row in zip(layers, spreads.mean(axis=0), strict=True)
        ),
    )
    settings = {**SETTINGS, **CROSSED, "layers": LAYERS_18}
    return Findings(numbers[0].verdict, words, numbers, (table,), charts, settings)


def _cloud_charts(outcomes: Sequence[Outcome], names: Sequence[str]) -> tuple[Chart, ...]:
    """The particles' ends in the plane of the arms, a chart for every other layer of the drawn seed."""
    drawn = next((outcome for outcome in outcomes if outcome.measured["clouds"]), None)
    if drawn is None:
        return ()
    truth = np.array(drawn.measured["truth"])
    charts = []
    for layer, cloud in enumerate(drawn.measured["clouds"]):
        if layer % 2 and layer != LAYERS_18 - 1:
            continue
        points = np.array(cloud)
        series = [
            Series(name, tuple(points[:, column, 0]), tuple(points[:, column, 1]), group=name)
            for column, name in enumerate(names)
        ]
        series.append(Series("truth", tuple(truth[:, 0]), tuple(truth[:, 1]), group="truth", dashed=True))
        title = f"Ends of the links, layer {layer + 1} of {LAYERS_18}, seed {drawn.trial.arguments['seed']}"
        charts.append(Chart(title, "points", "x (mm)", "z (mm)", tuple(series)))
    return tuple(charts)


EXPERIMENTS = (
    Experiment(
        name="deutscher-fig-17",
        title="Variance reduction of the branched arms",
        source=f"{SOURCE}, Fig. 17",
        claim="With crossover the parameters of both arms are localised in order of their dominance, from the fixed "
        "point outwards, in parallel.",
        trials=trials_fig_17,
        measure=variance_reduction.measure,
        conclude=conclude_fig_17,
    ),
    Experiment(
        name="deutscher-fig-18",
        title="Particles of the branched arms over eight layers",
        source=f"{SOURCE}, Fig. 18",
        claim="Each segment is localised from the hinge joint outwards.",
        trials=trials_fig_18,
        measure=measure_fig_18,
        conclude=conclude_fig_18,
    ),
)
