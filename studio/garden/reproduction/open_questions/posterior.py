"""Is a tracker's cloud a posterior? The truth's rank in it, layer by layer.

Were a weighted cloud a sample of what is known of the pose, the true value of a parameter would lie anywhere in it with
equal probability: its rank (the share of the weight below it, the probability integral transform) would be uniform over
frames. Their empirical distribution is drawn with a simultaneous 95 % band (Dvoretzky, Kiefer & Wolfowitz, with
Massart's constant; Säilynoja, Bürkner & Vehtari 2022 on reading such figures). A cloud that is too narrow has ranks
near 0 and 1. The root mean square of the truth's distance from the cloud's mean, in the cloud's standard deviations, is
1 of a posterior.

The annealed filter's last layer is weighed by w^β with a β that lets a chosen share survive, and is drawn again and
again on the way there; the same set weighed by w as it is (β = 1) is what importance sampling of the last layer would
give. Condensation's one layer is a posterior by design, if its likelihood is one. A swarm has no weights: its members
count alike.

Frames that follow each other are alike, so every fifth frame is used, and the band counts frames, not parameters.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.stats import chi2

from studio.foundations.arrays import Array
from studio.foundations.errors import TruthError
from studio.garden.reproduction.claims import share
from studio.garden.reproduction.deutscher_reid.weight_of_a_knee import true_poses
from studio.garden.reproduction.experiment import Part, each_seed, group_of, listed
from studio.garden.reproduction.tracking import Candidate
from studio.results.comparison.findings import Chart, Series, Table
from studio.results.comparison.footage_cache import FootageCache
from studio.results.comparison.statistics import number
from studio.results.comparison.tracked import TrackingTrial, track
from studio.results.comparison.trials import Outcome, Scale, Trial, kept_as
from studio.search.trackers.annealing import normalised
from studio.search.trackers.tracker import LayerRecord

CLIPS = ("walk", "choosing-turns", "choosing-kick")
WEIGHTING = "edge-region-silhouette"
EVALUATIONS = 2000
EVERY, FIRST = 5, 5
FRAMES, QUICK_FRAMES = 75, 30
LEVELS = tuple(float(value) for value in np.linspace(0.0, 1.0, 41))
CONFIDENCE = 0.05
CANDIDATES = (
    Candidate("annealed, improved", "annealed", WEIGHTING),
    Candidate("annealed, Eq. 13", "annealed", WEIGHTING, {"adaptive_diffusion": False, "crossover": 0.0}),
    Candidate("Condensation", "condensation", WEIGHTING),
    Candidate("swarm", "swarm", WEIGHTING),
)
AT_ONE = "last layer, β = 1"
LAST = "last layer"


def trials(scale: Scale) -> tuple[Trial, ...]:
    """Every tracker on every clip with every seed."""
    last = QUICK_FRAMES if scale.quick else FRAMES

    def arguments(one: Candidate, clip: str, seed: int) -> dict[str, Any]:
        return one.attempt(clip, seed, EVALUATIONS, last=last).plain()

    return tuple(
        trial
        for clip in CLIPS[: 1 if scale.quick else None]
        for one in CANDIDATES
        for trial in each_seed(f"{one.name} on {clip}", scale.seeds, partial(arguments, one, clip))
    )


def rank(values: Array, weights: Array, truth: float) -> float:
    """The share of the weight below the truth, that of equal values counted half. values, weights : (N,)."""
    below = float(weights[values < truth].sum() + 0.5 * weights[values == truth].sum())
    return below / float(weights.sum())


def weights_of(record: LayerRecord, beta: float) -> Array:
    """(N,) normalised weights w^β of a layer; equal ones where the tracker has none (β NaN)."""
    if not math.isfinite(beta):
        return np.full(len(record.poses), 1.0 / len(record.poses))
    return np.exp(normalised(record.log_weights, beta))


def band(count: int) -> float:
    """Half the height of the simultaneous 95 % band about the uniform distribution function of `count` ranks."""
    return math.sqrt(math.log(2.0 / CONFIDENCE) / (2.0 * count))


@kept_as("open_questions.posterior.measure")
def measure(arguments: Mapping[str, Any], cache: FootageCache) -> dict[str, Any]:
    """Of each layer, and of the last one at β = 1: ranks (K, D) and squared distances in variances (K, D) of the truth,
    of K frames and D parameters; effective particles.
    """
    attempt = TrackingTrial.of_plain(arguments)
    session = cache.session(attempt.footage)
    body = session.body()
    if session.truth_path is None:
        raise TruthError(f"Session '{session.name}' has no truth.", "Take one made by 'studio synthesize'.")
    frames = list(range(FIRST, int(attempt.last or session.manifest.frame_count), EVERY))
    truth = dict(zip(frames, true_poses(session, body, frames), strict=True))
    records: dict[int, list[LayerRecord]] = {frame: [] for frame in frames}
    track(attempt, cache, on_layer=lambda record: records.get(record.frame, []).append(record))
    samples: dict[str, dict[str, list[Any]]] = {}
    for frame, layers in records.items():
        clouds = {f"layer {record.layer + 1}": (record, record.beta) for record in layers}
        clouds[LAST] = clouds.pop(f"layer {layers[-1].layer + 1}")
        if math.isfinite(layers[-1].beta):
            clouds[AT_ONE] = (layers[-1], 1.0)
        for name, (record, beta) in clouds.items():
            weights = weights_of(record, beta)
            mean = weights @ record.poses
            variance = np.maximum(weights @ (record.poses - mean) ** 2, 1e-18)
            own = samples.setdefault(name, {"ranks": [], "squares": [], "particles": []})
            columns = range(record.poses.shape[1])
            own["ranks"].append([rank(record.poses[:, at], weights, truth[frame][at]) for at in columns])
            own["squares"].append(((truth[frame] - mean) ** 2 / variance).tolist())
            own["particles"].append(1.0 / float((weights**2).sum()))
    return {
        "parameters": [entry.label for entry in body.parameters],
        "layers": {
            name: {
                "ranks": np.round(own["ranks"], 4).tolist(),
                "squares": np.round(np.minimum(own["squares"], 1e6), 3).tolist(),
                "particles": float(np.mean(own["particles"])),
            }
            for name, own in samples.items()
        },
    }


def distribution(ranks: Array) -> Array:
    """(L,) share of the ranks at or below each of LEVELS."""
    return np.array([float((ranks <= level).mean()) for level in LEVELS])


def inside(ranks: Array) -> bool:
    """Whether the ranks (K, D) are uniform as far as the band of K frames shows: their distribution over all parameters
    stays within it.
    """
    return bool(np.all(np.abs(distribution(ranks) - np.array(LEVELS)) <= band(len(ranks))))


def factor(squares: Array) -> float:
    """What spreads must be multiplied by so that 95 % of the errors lie within 1.96 of them. squares : (K, D) squared
    errors in variances.
    """
    return math.sqrt(float(np.quantile(squares, 1.0 - CONFIDENCE)) / NORMAL_95)


NORMAL_95 = float(chi2.ppf(1.0 - CONFIDENCE, 1))


def _calibrated(name: str, clips: Mapping[str, Sequence[Mapping[str, Any]]]) -> Iterator[Part]:
    """Errors outside the 95 % of spreads that are calibrated on the other clips, for each clip."""
    squares = {
        clip: [np.array(one["layers"][LAST]["squares"]) for one in entries] for clip, entries in clips.items()
    }
    for clip, own in squares.items():
        others = [each for other, entries in squares.items() if other != clip for each in entries]
        if not others:
            return
        times = factor(np.concatenate(others))
        outside = [100.0 * float((each > times**2 * NORMAL_95).mean()) for each in own]
        title = f"{name}, calibrated by the other clips (× {times:.2g}): errors outside 95 %, {clip}"
        yield number(title, outside, "%")


def shown(outcomes: Sequence[Outcome]) -> Iterator[Part]:
    """Of each tracker's last layer: whether ranks are uniform, error in spreads; by layer, charts and a table."""
    by_tracker: dict[str, list[Mapping[str, Any]]] = {}
    by_clip: dict[str, dict[str, list[Mapping[str, Any]]]] = {}
    for outcome in outcomes:
        name, _, clip = group_of(outcome.trial).rpartition(" on ")
        by_tracker.setdefault(name, []).append(outcome.measured)
        by_clip.setdefault(name, {}).setdefault(clip, []).append(outcome.measured)
    rows: list[tuple[Any, ...]] = []
    for name, entries in by_tracker.items():
        layers = list(entries[0]["layers"])
        series: list[Series] = []
        for layer in layers:
            ranks = [np.array(one["layers"][layer]["ranks"]) for one in entries]
            squares = [np.array(one["layers"][layer]["squares"]) for one in entries]
            # The median over parameters: one parameter that a cloud has fixed would hide the rest.
            ratios = [float(np.sqrt(np.median(each.mean(axis=0)))) for each in squares]
            outer = [100.0 * float(((each < 0.025) | (each > 0.975)).mean()) for each in ranks]
            if layer in (LAST, AT_ONE, layers[0]):
                yield share(f"{name}, {layer}: ranks are uniform", map(inside, ranks), None)
                yield number(f"{name}, {layer}: error over spread", ratios, "×")
                yield number(f"{name}, {layer}: truth outside the middle 95 %", outer, "%")
                series.append(
                    Series(layer, LEVELS, tuple(distribution(np.concatenate(ranks)).tolist()), group=layer)
                )
            particles = float(np.mean([one["layers"][layer]["particles"] for one in entries]))
            rows.append(
                (
                    name,
                    layer,
                    *(round(float(np.mean(each)), 2) for each in (ratios, outer)),
                    round(particles, 1),
                )
            )
        yield from _calibrated(name, by_clip[name])
        frames = len(entries[0]["layers"][layers[0]]["ranks"])
        half = band(frames)
        for sign, word in ((-1.0, "lower"), (1.0, "upper")):
            edge = tuple(min(max(level + sign * half, 0.0), 1.0) for level in LEVELS)
            series.append(Series(f"95 % band, {word}", LEVELS, edge, group="band", dashed=True))
        yield Chart(f"Rank of the truth: {name}", "lines", "rank", "share of the ranks", tuple(series))
    yield (
        "Of a posterior the curves lie in the band, error over spread is 1 and the truth lies outside the middle 95 % "
        "in 5 % of the cases. Error over spread: root mean square over frames, the median over parameters. Calibrated: "
        "spreads multiplied by what makes them right in 95 % of the cases of the other clips; one that holds where "
        "it was not chosen would be an uncertainty to show."
    )
    heads = (
        "tracker",
        "layer",
        "error over spread",
        "truth outside the middle 95 % (%)",
        "effective particles",
    )
    yield Table("Every layer", heads, tuple(rows))
    yield {
        "weighting": WEIGHTING,
        "evaluations": EVALUATIONS,
        "every frames": EVERY,
        "clips": ", ".join(CLIPS),
    }


EXPERIMENTS = (listed("posterior", trials, measure, shown, footage=CLIPS),)
