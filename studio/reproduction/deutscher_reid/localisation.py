"""How the joints of the planar arms are localised over the layers of one search: Figs. 12, 13, 14, 17 and 18.

With adaptive diffusion (Eq. 18) a joint that is localised stays so, and the joints follow one another from the root
outwards: a soft partition of the search. With the planned noise of Eq. 13 every joint gets the same noise, and what
was gained for the first is lost again (Fig. 12c).

Figs. 13 and 14 show six layers and print neither particles nor survival rate. At the 0.5 of section 3.1 six layers
are too few for the last joint to fall at all; at 0.1 it falls in the sixth.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.comparison.findings import Chart, Findings, Number, Series, Table
from studio.comparison.footage_shelf import FootageShelf
from studio.comparison.statistics import number, overall
from studio.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.reproduction.deutscher_reid.arms import TemplateArm, localise, template_arm
from studio.reproduction.deutscher_reid.setting import EQ18_WORDS, SOURCE, share_number, times_in_words
from studio.reproduction.drawing import bar_chart, layer_table, line, line_chart, places, seeds_and_mean
from studio.reproduction.experiment import Experiment

Array = NDArray[np.float64]

CHAIN, BRANCHED = "planar_arm4", "branched_arms6"
CHAIN_JOINTS = ("x1", "x2", "x3", "x4")
BRANCHED_JOINTS = ("x1", "x2", "x3", "x4", "x5", "x6")
ARMS = ((0, 1, 2), (3, 4, 5))
FALLEN = 0.1
"""A parameter counts as localised when its variance is below this share of the first cloud's."""
SETTINGS: Mapping[str, Any] = {"layers": 6, "particles": 1000, "survival": 0.1, "crossover": 0.0}
NEVER = f"; {SETTINGS['layers'] + 1} stands for a joint that does not fall"
WITH, WITHOUT, WITH_LOUD = "adaptive (Eq. 18)", "planned (Eq. 13)", "planned with five times the noise"
CROSSING = "adaptive with crossover"
KINDS: Mapping[str, Mapping[str, Any]] = {
    WITH: {"adaptive_diffusion": True},
    WITHOUT: {"adaptive_diffusion": False},
    # Noise that outweighs selection in every joint.
    WITH_LOUD: {"adaptive_diffusion": False, "diffusion_scale": 5.0, "constraints": "ignore"},
    CROSSING: {"adaptive_diffusion": True, "crossover": 1.0, "crossover_by": "parameters"},
}


@dataclass(frozen=True, slots=True)
class Reduction:
    """How the variances fell, over some seeds.

    crossings : (S, D) the layer (from 0) whose cloud is the first with a variance below FALLEN of the first cloud's;
    the number of layers where none is. strictly_rising : (S,) whether every parameter falls, and later than the one
    before; even : (S,) whether all fall within one layer. shares : (S, M, D) variance over that of the first cloud.
    drawn, noisy : (S, D) the same of the first layer after drawing (Fig. 12 b, e) and after noise (c, f). errors :
    (S, D) of the reported pose, rad.
    """

    crossings: NDArray[np.int64]
    strictly_rising: NDArray[np.bool_]
    even: NDArray[np.bool_]
    shares: Array
    drawn: Array
    noisy: Array
    errors: Array

    @property
    def mean_layers(self) -> str:
        """The mean layer, counted from 1, in which each parameter falls, in words."""
        return listed(self.crossings.mean(axis=0) + 1.0)


def trials_of(body: str, *kinds: str) -> Callable[[Scale], tuple[Trial, ...]]:
    """One search a kind and seed."""

    def trials(scale: Scale) -> tuple[Trial, ...]:
        return tuple(
            Trial(
                f"{kind}, {body}, seed {seed}",
                {"body": body, "seed": seed, "knobs": {**SETTINGS, **KINDS[kind]}},
            )
            for kind in kinds
            for seed in scale.seeds
        )

    return trials


@kept_as("deutscher_reid.variance_reduction.measure")
def measure(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Variances per layer and parameter of one search, over those of the first cloud."""
    del shelf
    result, records, truth = localise(scene(arguments["body"]), int(arguments["seed"]), **arguments["knobs"])
    first = records[0].variance_weighed
    return {
        "shares": [(record.variance_weighed / first).tolist() for record in records],
        "drawn": (records[0].variance_resampled / first).tolist(),
        "noisy": (records[0].variance_diffused / first).tolist(),
        "errors": np.abs(result.estimate.pose - truth).tolist(),
    }


@cache
def scene(body: str) -> TemplateArm:
    """The body before its camera."""
    return template_arm(body)


def reductions(outcomes: Sequence[Outcome]) -> dict[str, Reduction]:
    """By kind, in the order of the trials."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        found.setdefault(outcome.trial.label.partition(", ")[0], []).append(outcome.measured)
    return {name: reduction(measured) for name, measured in found.items()}


def reduction(measured: Sequence[Mapping[str, Any]]) -> Reduction:
    """The summary of some searches of equal length."""
    shares, drawn, noisy, errors = (
        np.array([entry[name] for entry in measured]) for name in ("shares", "drawn", "noisy", "errors")
    )
    crossings, layers = crossing_layers(shares), shares.shape[1]
    fallen = crossings.max(axis=1) < layers
    return Reduction(
        crossings,
        np.asarray(np.all(np.diff(crossings, axis=1) > 0, axis=1) & fallen),
        np.asarray(fallen & (np.ptp(crossings, axis=1) <= 1)),
        shares,
        drawn,
        noisy,
        errors,
    )


def crossing_layers(values: Array, limit: float = FALLEN) -> NDArray[np.int64]:
    """(S, D) first layer below the limit, of values (S, M, D); M where there is none."""
    below = values < limit
    return np.where(below.any(axis=1), below.argmax(axis=1), values.shape[1])


def listed(values: Sequence[float] | Array, digits: int = 1) -> str:
    """ "2.0, 3.1, 4.2"."""
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _reduction_chart(title: str, found: Reduction, names: Sequence[str]) -> Chart:
    """Variance of each parameter over the layers."""
    layers = places(found.shares.shape[1], first=1)
    series = [
        entry
        for column, name in enumerate(names)
        for entry in seeds_and_mean(name, layers, found.shares[:, :, column])
    ]
    return line_chart(title, "layer", "variance over the first cloud's", series, log_y=True)


def _crossing_table(groups: Mapping[str, Reduction], names: Sequence[str]) -> Table:
    rows = tuple(
        (name, *(round(float(value) + 1.0, 1) for value in found.crossings.mean(axis=0)))
        for name, found in groups.items()
    )
    return Table(f"Mean layer in which the variance falls below {FALLEN:.0%}", ("filter", *names), rows)


def _crossing_numbers(found: Reduction, names: Sequence[str]) -> tuple[Number, ...]:
    return tuple(
        number(f"layer in which {name} falls", (found.crossings[:, column] + 1.0).tolist(), "")
        for column, name in enumerate(names)
    )


def _error(name: str, found: Reduction) -> Number:
    return number(name, found.errors.mean(axis=1).tolist(), "rad")


# Fig. 12.


def conclude_fig_12(outcomes: Sequence[Outcome]) -> Findings:
    """After drawing x1 has lost most variance and the others little (b, e); planned noise undoes it (c), adaptive
    noise does not (f).
    """
    groups = reductions(outcomes)
    adaptive, planned = groups[WITH], groups[WITHOUT]
    numbers = (
        share_number(
            "x1 has the smallest variance after drawing",
            (adaptive.drawn[:, 0] < adaptive.drawn[:, 1:].min(axis=1)).tolist(),
        ),
        share_number(
            "planned noise makes that of x1 half as large again",
            (planned.noisy[:, 0] > 1.5 * planned.drawn[:, 0]).tolist(),
        ),
        share_number(
            "adaptive noise leaves it as it is, within 10 %",
            (adaptive.noisy[:, 0] < 1.1 * adaptive.drawn[:, 0]).tolist(),
        ),
        *(
            number(f"variance of {name} {step}", (100.0 * rows[:, column]).tolist(), "% of the first cloud's")
            for step, rows in (
                ("after drawing", adaptive.drawn),
                ("after planned noise", planned.noisy),
                ("after adaptive noise", adaptive.noisy),
            )
            for column, name in enumerate(CHAIN_JOINTS)
        ),
    )
    drawn, noisy = adaptive.drawn.mean(axis=0), planned.noisy.mean(axis=0)
    words = (
        f"Drawing by weight leaves {drawn[0]:.0%} of the variance of x1 and "
        f"{listed(100.0 * drawn[1:], 0)} % of that of "
        f"x2 to x4 (Fig. 12b: x1 very small, the others a little). The planned noise brings x1 back to {noisy[0]:.0%} "
        f"(Fig. 12c: all but wiped out), adaptive noise leaves {adaptive.noisy[:, 0].mean():.0%} (Fig. 12f). "
        "The paper prints bars without figures, so the verdict is on what it says about them."
    )
    steps = ("a, d: first cloud", "b, e: drawn", "c: planned noise", "f: adaptive noise")
    values = np.array([np.ones(len(CHAIN_JOINTS)), drawn, noisy, adaptive.noisy.mean(axis=0)])
    series = [
        Series(name, places(len(steps)), tuple(column.tolist()))
        for name, column in zip(CHAIN_JOINTS, values.T, strict=True)
    ]
    chart = bar_chart(
        "Variances over one layer", "panel of Fig. 12", "variance over the first cloud's", series, steps
    )
    table = Table(
        "Variance over the first cloud's, means over the seeds",
        ("step", *CHAIN_JOINTS),
        tuple((step, *(round(float(v), 3) for v in row)) for step, row in zip(steps, values, strict=True)),
    )
    return Findings(
        overall(entry.verdict for entry in numbers), words, numbers, (table,), (chart,), dict(SETTINGS)
    )


# Figs. 13 and 14.


def conclude_fig_13(outcomes: Sequence[Outcome]) -> Findings:
    """The joints fall one after the other, from the root outwards."""
    found = reductions(outcomes)[WITH]
    ordered = found.strictly_rising.tolist()
    numbers = (
        share_number("joints fall strictly one after the other", ordered),
        *_crossing_numbers(found, CHAIN_JOINTS),
        _error("mean error of the reported pose", found),
    )
    words = (
        f"With adaptive diffusion the variances of x1 to x4 fall below {FALLEN:.0%} of the first cloud's one after the "
        f"other, from the root outwards, in {times_in_words(ordered)} (mean layers "
        f"{found.mean_layers} of {SETTINGS['layers']}{NEVER}). {EQ18_WORDS} The "
        "paper prints no "
        f"survival rate for the arm; with {SETTINGS['survival']} the last joint falls within its six layers, with 0.5 "
        "it does not."
    )
    charts = (_reduction_chart("Variance reduction with adaptive diffusion", found, CHAIN_JOINTS),)
    table = _crossing_table({WITH: found}, CHAIN_JOINTS)
    return Findings(numbers[0].verdict, words, numbers, (table,), charts, dict(SETTINGS))


def conclude_fig_14(outcomes: Sequence[Outcome]) -> Findings:
    """With planned noise all joints fall alike, or the reason why not."""
    groups = reductions(outcomes)
    adaptive, planned, loud = groups[WITH], groups[WITHOUT], groups[WITH_LOUD]
    even = planned.even.tolist()
    numbers = (
        share_number("all joints fall within one layer", even),
        *(
            number(
                f"layers between the first and the last joint, {kind} noise",
                np.ptp(found.crossings, axis=1).astype(float).tolist(),
                "layers",
            )
            for kind, found in (("planned", planned), ("adaptive", adaptive))
        ),
        *_crossing_numbers(planned, CHAIN_JOINTS),
        _error("mean error with planned noise", planned),
        _error("mean error with adaptive noise", adaptive),
    )
    words = (
        f"With the planned noise of Eq. 13 all joints fall below {FALLEN:.0%} within one layer of each other in "
        f"{times_in_words(even)} (mean layers {planned.mean_layers}; adaptive {adaptive.mean_layers}{NEVER})."
    )
    if numbers[0].verdict != "reproduced":
        words += _reason(adaptive, planned, loud)
    charts = (
        _reduction_chart("Variance reduction with planned noise", planned, CHAIN_JOINTS),
        _reduction_chart("The same with five times the noise and no limits", loud, CHAIN_JOINTS),
    )
    table = _crossing_table(groups, CHAIN_JOINTS)
    return Findings(numbers[0].verdict, words, numbers, (table,), charts, dict(SETTINGS))


def _reason(adaptive: Reduction, planned: Reduction, loud: Reduction) -> str:
    """Why the fall is not even, from what was measured."""
    drawn = adaptive.drawn.mean(axis=0)
    first, last = (planned.crossings - adaptive.crossings).mean(axis=0)[[0, -1]]
    return (
        " So the variances do not fall as evenly as Fig. 14 draws them. The reason: in both filters a "
        "layer's selection "
        f"sees little but the joints nearest the root (the first layer leaves {drawn[0]:.0%} of the first joint's "
        f"variance and {drawn[-1]:.0%} of the last one's). Noise that is the same for all joints moves the fall of the "
        f"first by {first:+.1f} layers and of the last by {last:+.1f}, so it narrows the order and does not undo it. "
        f"Even noise that outweighs selection in every joint ({KINDS[WITH_LOUD]['diffusion_scale']:g} times as much, "
        f"and no limits to hold it) evens them out in {times_in_words(loud.even.tolist())} (mean layers "
        f"{loud.mean_layers}), and the arm is then not found: mean error "
        f"{loud.errors.mean():.1f} rad instead of {planned.errors.mean():.2f}, and {adaptive.errors.mean():.3f} with "
        "Eq. 18."
    )


# Fig. 17.


def _rises(crossings: NDArray[np.int64]) -> bool:
    """Whether each arm's joints fall one after the other, the last ones within the search or never."""
    return all(bool(np.all(np.diff(crossings[list(arm)]) > 0)) for arm in ARMS)


def conclude_fig_17(outcomes: Sequence[Outcome]) -> Findings:
    """In each arm the joints fall in order, and the arms keep step."""
    found = reductions(outcomes)[CROSSING]
    in_order = [_rises(row) for row in found.crossings]
    steps = np.abs(found.crossings[:, ARMS[0]] - found.crossings[:, ARMS[1]])
    in_step = (steps.max(axis=1) <= 1).tolist()
    numbers = (
        share_number("joints of both arms fall strictly from the hinge outwards", in_order),
        share_number("joints of equal rank fall within one layer", in_step),
        *_crossing_numbers(found, BRANCHED_JOINTS),
        _error("mean error of the reported pose", found),
    )
    words = (
        f"In {times_in_words(in_order)} the variances of x1, x2, x3 and of x4, x5, x6 fall below "
        f"{FALLEN:.0%} one after "
        f"the other from the hinge outwards, and in {times_in_words(in_step)} joints of equal rank fall within one "
        f"layer (mean layers {found.mean_layers} of {SETTINGS['layers']}{NEVER}). {EQ18_WORDS}"
    )
    charts = (_reduction_chart("Variance reduction of the branched arms", found, BRANCHED_JOINTS),)
    table = _crossing_table({CROSSING: found}, BRANCHED_JOINTS)
    settings = {**SETTINGS, **KINDS[CROSSING]}
    return Findings(overall(entry.verdict for entry in numbers), words, numbers, (table,), charts, settings)


# Fig. 18 draws the particles' end of every link.

ENDS = ("RJoint1", "RJoint2", "RTip", "LJoint1", "LJoint2", "LTip")
SETTINGS_18: Mapping[str, Any] = {**SETTINGS, **KINDS[CROSSING], "layers": 8}
LAYERS_18 = SETTINGS_18["layers"]
# The particles' ends of a link lie together when they scatter by less than a fifth of its length.
GATHERED_MM = 50.0
DRAWN_PARTICLES, DRAWN_SEED = 200, 0


def trials_fig_18(scale: Scale) -> tuple[Trial, ...]:
    """One search a seed, of eight layers."""
    return tuple(
        Trial(f"branched arms, seed {seed}", {"body": BRANCHED, "seed": seed, "knobs": dict(SETTINGS_18)})
        for seed in scale.seeds
    )


@kept_as("deutscher_reid.figs_17_and_18.measure_fig_18")
def measure_fig_18(arguments: Mapping[str, Any], shelf: FootageShelf) -> dict[str, Any]:
    """Per layer, how widely the ends of the links are scattered (mm), and of one seed where some of them lie."""
    del shelf
    seed, arms = int(arguments["seed"]), scene(arguments["body"])
    _, records, truth = localise(arms, seed, **arguments["knobs"])
    names = [marker.name for marker in arms.body.markers]
    columns = [names.index(name) for name in ENDS]
    spreads, clouds = [], []
    for record in records:
        points = marker_points(arms.body, record.poses)[:, columns]
        spreads.append(np.sqrt(points.var(axis=0).sum(axis=1)).tolist())
        if seed == DRAWN_SEED:
            clouds.append(np.round(points[:DRAWN_PARTICLES, :, ::2], 1).tolist())
    true_ends = marker_points(arms.body, truth[None])[0, columns]
    return {"spreads": spreads, "clouds": clouds, "truth": true_ends[:, ::2].tolist()}


def conclude_fig_18(outcomes: Sequence[Outcome]) -> Findings:
    """Ends nearer the hinge gather in earlier layers."""
    spreads = np.array([outcome.measured["spreads"] for outcome in outcomes])
    crossings = crossing_layers(spreads, GATHERED_MM)
    in_order = [_rises(row) for row in crossings]
    numbers = (
        share_number("ends of both arms gather strictly from the hinge outwards", in_order),
        *(
            number(f"scatter of {name} after the last layer", spreads[:, -1, column].tolist(), "mm")
            for column, name in enumerate(ENDS)
        ),
    )
    words = (
        f"In {times_in_words(in_order)} the particles' ends of the links gather (scatter below {GATHERED_MM:g} mm) one "
        f"after the other from the hinge outwards, in both arms (mean layers {listed(crossings.mean(axis=0) + 1.0)} of "
        f"{LAYERS_18}), as Fig. 18 shows. {EQ18_WORDS}"
    )
    mean = spreads.mean(axis=0)
    fall = (line(name, places(LAYERS_18, first=1), mean[:, column]) for column, name in enumerate(ENDS))
    title = "Scatter of the links' ends over the layers"
    charts = (line_chart(title, "layer", "scatter (mm)", fall, log_y=True), *_cloud_charts(outcomes))
    table = layer_table("Mean scatter (mm) of the links' ends", ENDS, mean)
    return Findings(numbers[0].verdict, words, numbers, (table,), charts, SETTINGS_18)


def _cloud_charts(outcomes: Sequence[Outcome]) -> tuple[Chart, ...]:
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
        series = [line(name, *points[:, column].T) for column, name in enumerate(ENDS)]
        series.append(line("truth", *truth.T, dashed=True))
        title = f"Ends of the links, layer {layer + 1} of {LAYERS_18}, seed {drawn.trial.arguments['seed']}"
        charts.append(Chart(title, "points", "x (mm)", "z (mm)", tuple(series)))
    return tuple(charts)


EXPERIMENTS = (
    Experiment(
        name="deutscher-fig-12",
        title="Variances over one layer, planned and adaptive noise",
        source=f"{SOURCE}, Fig. 12",
        claim="Selection localises the first joint far and the others little; noise planned by Eq. 13 all but wipes "
        "that out, noise in proportion to the variance preserves it.",
        trials=trials_of(CHAIN, WITH, WITHOUT),
        measure=measure,
        conclude=conclude_fig_12,
    ),
    Experiment(
        name="deutscher-fig-13",
        title="Variance reduction with adaptive diffusion",
        source=f"{SOURCE}, Fig. 13",
        claim="The variances of the four joints fall in order, from the most dominant to the least, over six layers.",
        trials=trials_of(CHAIN, WITH),
        measure=measure,
        conclude=conclude_fig_13,
    ),
    Experiment(
        name="deutscher-fig-14",
        title="Variance reduction with planned noise",
        source=f"{SOURCE}, Fig. 14",
        claim="With the conventional filter all variances fall evenly over six layers; there is little evidence of "
        "hierarchical partitioning.",
        trials=trials_of(CHAIN, WITH, WITHOUT, WITH_LOUD),
        measure=measure,
        conclude=conclude_fig_14,
    ),
)
EXPERIMENTS_ON_BRANCHES = (
    Experiment(
        name="deutscher-fig-17",
        title="Variance reduction of the branched arms",
        source=f"{SOURCE}, Fig. 17",
        claim="With crossover the parameters of both arms are localised in order of their dominance, from the fixed "
        "point outwards, in parallel.",
        trials=trials_of(BRANCHED, CROSSING),
        measure=measure,
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
