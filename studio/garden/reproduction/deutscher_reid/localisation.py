"""How the joints of the planar arms are localised over the layers of one search: Figs. 12, 13, 14, 17 and 18; and what
crossover gains in the match: Fig. 16.

With adaptive diffusion (Eq. 18) a joint that is localised stays so, and the joints follow one another from the root
outwards: a soft partition of the search. With the planned noise of Eq. 13 every joint gets the same noise, and the
gain for the first is lost again (Fig. 12c).

Figs. 13 and 14 show six layers and give neither particles nor survival rate. At the 0.5 of section 3.1 six layers
are too few for the last joint to fall at all; at 0.1 it falls in the sixth.

Fig. 16: the match is the paper's SSD, the mean squared difference between the template of the reported pose and the
silhouette, which is minus the log of the template weighting. A search takes milliseconds, so a seed there stands for
PICTURES pictures with a pose each, and its SSD is their mean.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studio.body.forward_kinematics import marker_points
from studio.foundations.arrays import Array
from studio.garden.reproduction.claims import EQUAL, LOWER, ratio, share
from studio.garden.reproduction.deutscher_reid.arms import (
    TemplateArm,
    localise,
    localise_absolute,
    template_arm,
    true_pose,
)
from studio.garden.reproduction.deutscher_reid.setting import ARM_EQ18_WORDS, ARM_EQ_18
from studio.garden.reproduction.drawing import (
    bar_chart,
    floats,
    intervals,
    layer_table,
    line,
    line_chart,
    places,
    seeds_and_mean,
)
from studio.garden.reproduction.experiment import Part, each_seed, listed, measured
from studio.results.comparison.findings import Chart, Number, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as

CHAIN, BRANCHED = "planar_arm4", "branched_arms6"
CHAIN_JOINTS = ("x1", "x2", "x3", "x4")
BRANCHED_JOINTS = ("x1", "x2", "x3", "x4", "x5", "x6")
ARMS = ((0, 1, 2), (3, 4, 5))
FALLEN = 0.1
"""A parameter counts as localised when its variance is below this share of the first cloud's."""
SETTINGS: Mapping[str, Any] = {"layers": 6, "particles": 1000, "survival": 0.1, "crossover": 0.0}
NEVER = f"Layers are counted from 1; {SETTINGS['layers'] + 1} stands for a joint that does not fall."
WITH, WITHOUT, WITH_LOUD = "adaptive (Eq. 18)", "planned (Eq. 13)", "planned with five times the noise"
CROSSING, SHRINKING = "adaptive with crossover", "adaptive, shrunk (ours)"
MILDER = (0.3, 0.4, 0.5)
"""Survival rates beside 0.1, of Fig. 14: 0.5 is that of section 3.1."""
KINDS: Mapping[str, Mapping[str, Any]] = {
    WITH: ARM_EQ_18,
    WITHOUT: {"adaptive_diffusion": False},
    # Noise that outweighs selection in every joint.
    WITH_LOUD: {"adaptive_diffusion": False, "diffusion_scale": 5.0, "constraints": "ignore"},
    CROSSING: {**ARM_EQ_18, "crossover": 1.0, "crossover_by": "parameters"},
    SHRINKING: {"adaptive_diffusion": True, "diffusion_form": "shrink"},
    **{
        f"{kind}, α {survival:g}": {
            **(ARM_EQ_18 if kind == WITH else {"adaptive_diffusion": False}),
            "survival": survival,
        }
        for survival in MILDER
        for kind in (WITH, WITHOUT)
    },
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
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Variances per layer and parameter of one search, over those of the first cloud."""
    del cache
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
    by_kind: dict[str, list[Mapping[str, Any]]] = {}
    for outcome in outcomes:
        kind = outcome.trial.label.partition(f", {outcome.trial.arguments['body']}")[0]
        by_kind.setdefault(kind, []).append(outcome.measured)
    return {name: reduction(entries) for name, entries in by_kind.items()}


def reduction(searches: Sequence[Mapping[str, Any]]) -> Reduction:
    """The summary of some searches of equal length."""
    shares, drawn, noisy, errors = (
        np.array([entry[name] for entry in searches]) for name in ("shares", "drawn", "noisy", "errors")
    )
    crossings = crossing_layers(shares)
    fallen = crossings.max(axis=1) < shares.shape[1]
    rising = np.all(np.diff(crossings, axis=1) > 0, axis=1)
    even = np.ptp(crossings, axis=1) <= 1
    return Reduction(crossings, rising & fallen, fallen & even, shares, drawn, noisy, errors)


def crossing_layers(values: Array, limit: float = FALLEN) -> NDArray[np.int64]:
    """(S, D) first layer below the limit, of values (S, M, D); M where there is none."""
    below: NDArray[np.bool_] = values < limit
    first: NDArray[np.int64] = below.argmax(axis=1)
    return np.where(below.any(axis=1), first, int(values.shape[1]))


def _reduction_chart(title: str, reduction: Reduction, names: Sequence[str]) -> Chart:
    """Variance of each parameter over the layers."""
    layers = places(reduction.shares.shape[1], first=1)
    series = (
        entry
        for column, name in enumerate(names)
        for entry in seeds_and_mean(name, layers, reduction.shares[:, :, column])
    )
    return line_chart(title, "layer", "variance over the first cloud's", series, log_y=True)


def _crossing_table(groups: Mapping[str, Reduction], names: Sequence[str]) -> Table:
    rows = tuple(
        (name, *(round(float(value) + 1.0, 1) for value in reduced.crossings.mean(axis=0)))
        for name, reduced in groups.items()
    )
    return Table(f"Mean layer in which the variance falls below {FALLEN:.0%}", ("filter", *names), rows)


def _crossing_numbers(reduction: Reduction, names: Sequence[str]) -> Iterator[Number]:
    for name, layers in zip(names, reduction.crossings.T, strict=True):
        yield number(f"layer in which {name} falls", layers + 1.0)


def _error(name: str, reduction: Reduction) -> Number:
    return number(name, reduction.errors.mean(axis=1), "rad")


def fig_12(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """After drawing, before noise, x1 has lost most variance and the others little (b, e); planned noise undoes it (c).
    That adaptive noise does not (f) holds by construction. The paper has bars without figures, so the verdict is on its
    statements about them.
    """
    groups = reductions(outcomes)
    adaptive, planned = groups[WITH], groups[WITHOUT]
    first = adaptive.drawn[:, 0]
    yield share("x1 has the smallest variance after drawing", first < adaptive.drawn[:, 1:].min(axis=1))
    yield share(
        "planned noise makes that of x1 half as large again", planned.noisy[:, 0] > 1.5 * planned.drawn[:, 0]
    )
    # By construction 1 + c, but for chance: no claim.
    yield number("x1's variance after adaptive noise over that before", adaptive.noisy[:, 0] / first, "×")
    steps = {
        "after drawing": ("b, e: drawn", adaptive.drawn),
        "after planned noise": ("c: planned noise", planned.noisy),
        "after adaptive noise": ("f: adaptive noise", adaptive.noisy),
    }
    for step, (_, rows) in steps.items():
        for name, column in zip(CHAIN_JOINTS, rows.T, strict=True):
            yield number(f"variance of {name} {step}", 100.0 * column, "% of the first cloud's")
    panels = {"a, d: first cloud": np.ones(len(CHAIN_JOINTS))}
    panels |= {panel: rows.mean(axis=0) for panel, rows in steps.values()}
    series = [
        Series(name, places(len(panels)), floats(column))
        for name, column in zip(CHAIN_JOINTS, np.array(list(panels.values())).T, strict=True)
    ]
    axes = ("panel of Fig. 12", "variance over the first cloud's")
    yield bar_chart("Variances over one layer", *axes, series, panels)
    rows = tuple((panel, *(round(float(value), 3) for value in values)) for panel, values in panels.items())
    yield Table("Variance over the first cloud's, means over the seeds", ("step", *CHAIN_JOINTS), rows)
    yield (
        "What would refute this: another joint is localised first, or planned noise leaves the first one's variance as "
        f"it is. That adaptive noise nearly leaves it is no finding: it adds a set share. {ARM_EQ18_WORDS}"
    )
    yield {**SETTINGS, **ARM_EQ_18}


def fig_13(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """The joints fall one after the other, from the root outwards."""
    groups = reductions(outcomes)
    adaptive, ours = groups[WITH], groups[SHRINKING]
    yield share("joints fall strictly one after the other", adaptive.strictly_rising)
    yield from _crossing_numbers(adaptive, CHAIN_JOINTS)
    yield _error("mean error of the reported pose", adaptive)
    yield share("joints fall strictly one after the other, shrunk (ours)", ours.strictly_rising, None)
    yield _error("mean error of the reported pose, shrunk (ours)", ours)
    yield (
        f"{NEVER} {ARM_EQ18_WORDS} The paper prints no survival rate for the arm; with {SETTINGS['survival']} the last "
        "joint falls within its six layers, with 0.5 it does not."
    )
    yield _reduction_chart("Variance reduction with adaptive diffusion", adaptive, CHAIN_JOINTS)
    yield _crossing_table({WITH: adaptive, SHRINKING: ours}, CHAIN_JOINTS)
    yield {**SETTINGS, **ARM_EQ_18}


def slopes(shares: Array) -> Array:
    """(S, D) how fast each parameter's variance falls: the slope of its log10 over the layers (S, M, D) by least
    squares, powers of ten a layer.
    """
    logs = np.log10(np.maximum(shares, 1e-12))
    layers: Array = np.arange(shares.shape[1], dtype=np.float64) - (shares.shape[1] - 1) / 2.0
    return np.tensordot(logs, layers, axes=(1, 0)) / float((layers**2).sum())


def _slope_spread(reduction: Reduction) -> Array:
    """(S,) the steepest parameter's slope over the flattest's: 1 where all fall evenly."""
    fall = -slopes(reduction.shares)
    return fall.max(axis=1) / np.maximum(fall.min(axis=1), 1e-3)


KINDS_OF_FIG_14 = (
    *(WITH, WITHOUT, WITH_LOUD),
    *(f"{kind}, α {survival:g}" for survival in MILDER for kind in (WITH, WITHOUT)),
)


def fig_14(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """With planned noise all joints fall together, or the reason why not: even noise narrows the order without removing
    it, and noise that outweighs selection in every joint loses the arm.
    """
    groups = reductions(outcomes)
    adaptive, planned, loud = groups[WITH], groups[WITHOUT], groups[WITH_LOUD]
    claim = share("all joints fall within one layer", planned.even)
    yield claim
    for kind, reduced in (("planned", planned), ("adaptive", adaptive)):
        name = f"layers between the first and the last joint, {kind} noise"
        yield number(name, np.ptp(reduced.crossings, axis=1), "layers")
    for survival in (SETTINGS["survival"], *MILDER):
        words = "" if survival == SETTINGS["survival"] else f", α {survival:g}"
        steep = {kind: _slope_spread(groups[f"{kind}{words}"]) for kind in (WITHOUT, WITH)}
        for kind, values in steep.items():
            yield number(
                f"steepest over flattest fall, {kind}, α {survival:g}", np.minimum(values, 100.0), "×"
            )
        yield share(
            f"planned noise falls more evenly than adaptive, α {survival:g}",
            steep[WITHOUT] < steep[WITH],
            None,
        )
    yield from _crossing_numbers(planned, CHAIN_JOINTS)
    yield _error("mean error with planned noise", planned)
    yield _error("mean error with adaptive noise", adaptive)
    yield NEVER
    if claim.verdict != "reproduced":
        drawn = adaptive.drawn.mean(axis=0)
        first, last = (planned.crossings - adaptive.crossings).mean(axis=0)[[0, -1]]
        yield (
            f"The reason: a layer's selection sees little but the joints nearest the root (the first layer leaves "
            f"{drawn[0]:.0%} of the first joint's variance, {drawn[-1]:.0%} of the last one's); even noise moves the "
            f"fall of the first by {first:+.1f} layers, of the last by {last:+.1f}. Noise "
            f"{KINDS[WITH_LOUD]['diffusion_scale']:g} times as large, without limits, evens them out in "
            f"{loud.even.sum()} of {len(loud.even)} seeds and loses the arm: mean error {loud.errors.mean():.1f} rad."
        )
    yield _reduction_chart("Variance reduction with planned noise", planned, CHAIN_JOINTS)
    yield _reduction_chart("The same with five times the noise and no limits", loud, CHAIN_JOINTS)
    for kind in (WITHOUT, WITH):
        name = f"{kind}, α {MILDER[-1]:g}"
        yield _reduction_chart(f"Variance reduction, {name}", groups[name], CHAIN_JOINTS)
    yield _crossing_table(groups, CHAIN_JOINTS)
    yield SETTINGS


# Fig. 16. Eight layers as in Fig. 18.

SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)
SETTINGS_16: Mapping[str, Any] = {"layers": 8, "particles": 100, "survival": 0.3}
PICTURES, QUICK_PICTURES = 10, 4
# Eq. 19 cuts anywhere; the paper does not give the diffusion of Fig. 16 (Eq. 13 or 18).
CUTS: Mapping[str, Mapping[str, Any]] = {
    "cut by parameters, planned noise": {"crossover_by": "parameters", "adaptive_diffusion": False},
    "cut by parameters, adaptive noise": {"crossover_by": "parameters", **ARM_EQ_18},
    "cut by limbs, adaptive noise": {"crossover_by": "limbs", **ARM_EQ_18},
    "absolute angles, cut by parameters, adaptive noise": {"crossover_by": "parameters", **ARM_EQ_18},
}
ABSOLUTE = "absolute angles"
"""Of a cut: every link's angle is measured from the picture's axis, so that what is exchanged does not turn the links
beyond it; the paper does not say how its angles are measured.
"""
# On a chain, which is one limb, cutting by limbs exchanges nothing: not a trial.
PAIRS = tuple(
    (body, cut) for cut in CUTS for body in (CHAIN, BRANCHED) if (body, "limbs" in cut) != (CHAIN, True)
)


def trials_fig_16(scale: Scale) -> tuple[Trial, ...]:
    """One for every body, cut and seed: all shares on the same pictures."""
    count = QUICK_PICTURES if scale.quick else PICTURES

    def arguments(body: str, cut: str, seed: int) -> dict[str, Any]:
        knobs, pictures = {**SETTINGS_16, **CUTS[cut]}, [seed * count + index for index in range(count)]
        return {"body": body, "cut": cut, "knobs": knobs, "shares": list(SHARES), "pictures": pictures}

    return tuple(
        trial
        for body, cut in PAIRS
        for trial in each_seed(f"{body}, {cut}", scale.seeds, partial(arguments, body, cut))
    )


@kept_as("deutscher_reid.fig_16.measure")
def measure_fig_16(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """The mean SSD of the reported poses, per share."""
    del cache
    arm = scene(arguments["body"])
    ssd: list[float] = []
    for share_crossed in arguments["shares"]:
        differences: list[float] = []
        for picture in arguments["pictures"]:
            knobs = {**arguments["knobs"], "crossover": float(share_crossed)}
            if arguments["cut"].startswith(ABSOLUTE):
                pose = localise_absolute(arm, int(picture), **knobs)
            else:
                pose = localise(arm, int(picture), **knobs)[0].estimate.pose
            observed = arm.observed(true_pose(arm.space, int(picture)))
            differences.append(float(-observed.log_likelihood(pose[None])[0]))
        ssd.append(float(np.mean(differences)))
    return {"ssd": ssd}


def _ratio_name(body: str, cut: str) -> str:
    return f"SSD with over without crossover: {body}, {cut}"


def fig_16(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """SSD with crossover over that without, per body. On the chain the paper sees no difference: 1."""
    groups: dict[str, list[list[float]]] = {}
    for outcome in outcomes:
        name = f"{outcome.trial.arguments['body']}, {outcome.trial.arguments['cut']}"
        groups.setdefault(name, []).append(outcome.measured["ssd"])
    ssd = {pair: np.array(groups[", ".join(pair)]) for pair in PAIRS}
    for (body, cut), rows in ssd.items():
        claim = "" if "limbs" in cut or ABSOLUTE in cut else EQUAL if body == CHAIN else LOWER
        yield ratio(_ratio_name(body, cut), rows[:, -1].tolist(), rows[:, 0].tolist(), claim)
    yield (
        "The claims: neither gain nor harm on the chain and a gain on the branched arms, cut by parameters as Eq. 19 "
        "has it, with either diffusion (the paper does not say which). Absolute angles, where a cut does not turn the "
        f"links beyond it, stand beside them. {ARM_EQ18_WORDS}"
    )
    heads = tuple(f"{crossed:.0%} crossed" for crossed in SHARES)
    means = tuple((*pair, *(f"{value:.5f}" for value in rows.mean(axis=0))) for pair, rows in ssd.items())
    yield Table("Mean SSD after the last layer", ("body", "crossover", *heads), means)
    percent = tuple(100.0 * crossed for crossed in SHARES)
    for owner, panel in ((CHAIN, "a: no branches"), (BRANCHED, "b: branched")):
        series = [
            intervals(cut, percent, rows.T.tolist(), group=cut)
            for (body, cut), rows in ssd.items()
            if body == owner
        ]
        yield line_chart(f"Match over crossover ({panel})", "crossover (%)", "SSD", series)
    yield {**SETTINGS_16, "pictures a seed": len(outcomes[0].trial.arguments["pictures"])}


# Figs. 17 and 18.


def _rises(crossings: NDArray[np.int64]) -> list[bool]:
    """Whether each arm's joints fall one after the other, the last ones within the search or never: (S, D) to (S,)."""
    return [all(np.all(np.diff(row[list(arm)]) > 0) for arm in ARMS) for row in crossings]


def fig_17(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """In each arm the joints fall in order, and the arms keep step."""
    reduced = reductions(outcomes)[CROSSING]
    steps = np.abs(reduced.crossings[:, ARMS[0]] - reduced.crossings[:, ARMS[1]])
    yield share("joints of both arms fall strictly from the hinge outwards", _rises(reduced.crossings))
    yield share("joints of equal rank fall within one layer", steps.max(axis=1) <= 1)
    yield from _crossing_numbers(reduced, BRANCHED_JOINTS)
    yield _error("mean error of the reported pose", reduced)
    yield (
        f"{NEVER} A last joint that does not fall counts as one that falls after those before it. {ARM_EQ18_WORDS}"
    )
    yield _reduction_chart("Variance reduction of the branched arms", reduced, BRANCHED_JOINTS)
    yield _crossing_table({CROSSING: reduced}, BRANCHED_JOINTS)
    yield {**SETTINGS, **KINDS[CROSSING]}


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
        each_seed(
            "branched arms",
            scale.seeds,
            lambda seed: {"body": BRANCHED, "seed": seed, "knobs": dict(SETTINGS_18)},
        )
    )


@kept_as("deutscher_reid.figs_17_and_18.measure_fig_18")
def measure_fig_18(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Scatter of the links' ends per layer (mm), and for one seed the positions of some of them."""
    del cache
    seed, arms = int(arguments["seed"]), scene(arguments["body"])
    _, records, truth = localise(arms, seed, **arguments["knobs"])
    names = [marker.name for marker in arms.body.markers]
    columns = [names.index(name) for name in ENDS]
    spreads, clouds = list[list[float]](), list[list[list[list[float]]]]()
    for record in records:
        points = marker_points(arms.body, record.poses)[:, columns]
        spreads.append(np.sqrt(points.var(axis=0).sum(axis=1)).tolist())
        if seed == DRAWN_SEED:
            clouds.append(np.round(points[:DRAWN_PARTICLES, :, ::2], 1).tolist())
    true_ends = marker_points(arms.body, truth[None])[0, columns]
    return {"spreads": spreads, "clouds": clouds, "truth": true_ends[:, ::2].tolist()}


def fig_18(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Ends nearer the hinge keep less of their first scatter; the particles' ends in the plane of the arms, every other
    layer of the drawn seed.
    """
    spreads = measured(outcomes, "spreads")
    kept = (spreads / spreads[:, :1]).mean(axis=1)
    outwards = [all(np.all(np.diff(row[list(arm)]) > 0) for arm in ARMS) for row in kept]
    yield share("ends of both arms are localised from the hinge outwards", outwards)
    for column, name in enumerate(ENDS):
        yield number(f"share of its first scatter that {name} keeps", kept[:, column])
    # By construction: ends further out begin with a wider scatter, so that a cloud that shrinks evenly does so, too.
    rising = _rises(crossing_layers(spreads, GATHERED_MM))
    yield share(
        f"ends of both arms scatter by less than {GATHERED_MM:g} mm one after the other", rising, None
    )
    for column, name in enumerate(ENDS):
        yield number(f"scatter of {name} after the last layer", spreads[:, -1, column], "mm")
    yield (
        "What would refute this: an end further out loses as much of its scatter in the first cloud (averaged over the "
        f"layers) as one nearer the hinge. That the ends reach {GATHERED_MM:g} mm one after the other is no finding: "
        f"the further out they are, the wider a scatter they begin with. {ARM_EQ18_WORDS}"
    )
    mean = spreads.mean(axis=0)
    fall = (line(name, places(LAYERS_18, first=1), row) for name, row in zip(ENDS, mean.T, strict=True))
    yield line_chart("Scatter of the links' ends over the layers", "layer", "scatter (mm)", fall, log_y=True)
    drawn = next((outcome for outcome in outcomes if outcome.measured["clouds"]), None)
    for layer, cloud in enumerate(drawn.measured["clouds"] if drawn else ()):
        if drawn is None or (layer % 2 and layer != LAYERS_18 - 1):
            continue
        series = [
            line(name, *points.T)
            for name, points in zip(ENDS, np.array(cloud, dtype=np.float64).swapaxes(0, 1), strict=True)
        ]
        series.append(line("truth", *np.array(drawn.measured["truth"]).T, dashed=True))
        title = f"Ends of the links, layer {layer + 1} of {LAYERS_18}, seed {drawn.trial.arguments['seed']}"
        yield Chart(title, "points", "x (mm)", "z (mm)", tuple(series))
    yield layer_table("Mean scatter (mm) of the links' ends", ENDS, mean)
    yield SETTINGS_18


EXPERIMENTS = (
    listed("deutscher-fig-12", trials_of(CHAIN, WITH, WITHOUT), measure, fig_12),
    listed("deutscher-fig-13", trials_of(CHAIN, WITH, SHRINKING), measure, fig_13),
    listed("deutscher-fig-14", trials_of(CHAIN, *KINDS_OF_FIG_14), measure, fig_14),
    listed("deutscher-fig-16", trials_fig_16, measure_fig_16, fig_16),
    listed("deutscher-fig-17", trials_of(BRANCHED, CROSSING), measure, fig_17),
    listed("deutscher-fig-18", trials_fig_18, measure_fig_18, fig_18),
)
